"""Ray RLlib: PPO from features at one junction, on all cores of this machine.

pip install "traffic-dojo[distributed]"
python rllib_ppo.py --scenario cologne1 --rounds 10
"""

import argparse

import gymnasium
import ray
from ray.rllib.algorithms.ppo import PPOConfig
from ray.tune.registry import register_env


def make_env(settings: dict) -> gymnasium.Env:
    """Make an environment, as each runner does for itself."""
    import dojo_env  # noqa: F401, PLC0415 - it registers the name, in the runner's process

    return gymnasium.make("dojo_env/TrafficSignal-v0", **settings)


def main() -> None:
    """Train, and tell what episodes earn."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--scenario", default="cologne1")
    parser.add_argument("--rounds", type=int, default=10, help="of 1,440 decisions, and an update each")
    parser.add_argument("--runners", type=int, default=2, help="processes that simulate")
    parser.add_argument("--seconds", type=int, default=3600, help="of an episode")
    options = parser.parse_args()
    ray.init(num_cpus=options.runners + 1, include_dashboard=False, log_to_driver=False)
    register_env("junction", make_env)
    settings = {"scenario": options.scenario, "num_seconds": options.seconds}
    config = (
        PPOConfig()
        .environment("junction", env_config=settings)
        .env_runners(num_env_runners=options.runners)
        .training(train_batch_size=1_440, minibatch_size=144, num_epochs=3, gamma=0.97, lr=5e-4)
        .debugging(seed=0)
    )
    algorithm = config.build_algo()
    for number in range(options.rounds):
        earned = algorithm.train()["env_runners"].get("episode_return_mean", float("nan"))
        print(f"round {number}: episodes earn {earned:.1f}", flush=True)
    algorithm.stop()
    ray.shutdown()


if __name__ == "__main__":
    main()
