"""Stable-Baselines3: PPO from features at one junction, four environments at once.

pip install "traffic-dojo[learn]"
python sb3_ppo.py --scenario cologne1 --steps 20000
"""

import argparse

import gymnasium
from stable_baselines3 import PPO
from stable_baselines3.common.vec_env import SubprocVecEnv

from dojo_env.runs import run_controller

NAME = "dojo_env/TrafficSignal-v0"


def make_env(scenario: str, seconds: int):
    """Make an environment, as each process does for itself."""
    return gymnasium.make(NAME, scenario=scenario, num_seconds=seconds)


def main() -> None:
    """Train, and compare with max-pressure."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--scenario", default="cologne1")
    parser.add_argument("--steps", type=int, default=20_000, help="decisions of all environments together")
    parser.add_argument("--seconds", type=int, default=3600, help="of an episode")
    options = parser.parse_args()
    count = 4
    environments = SubprocVecEnv([lambda: make_env(options.scenario, options.seconds)] * count)
    model = PPO("MlpPolicy", environments, n_steps=options.seconds // 5, batch_size=72, gamma=0.97, seed=0)
    model.learn(options.steps)
    environments.close()

    env = make_env(options.scenario, options.seconds)
    (seen, _), over = env.reset(seed=0), False
    while not over:
        action, _ = model.predict(seen, deterministic=True)
        seen, _, terminated, truncated, _ = env.step(int(action))
        over = terminated or truncated
    learned = env.unwrapped.metrics()
    env.close()
    (rule,) = run_controller("max-pressure", 1, scenario=options.scenario, num_seconds=options.seconds)
    for name, figures in (("PPO", learned), ("max-pressure", rule)):
        print(
            f"{name:14}{figures['travel_time_all']:8.1f} s{figures['accumulated_waiting']:10.0f} s of waiting"
        )


if __name__ == "__main__":
    main()
