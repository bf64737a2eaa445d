"""Train a small policy on a bundle's signal and set it beside plans that do not learn.

    python train_on.py liisankatu.dojo --rounds 10

A linear policy over the environment's features, found by the cross-entropy method: draw policies around a
mean, drive each through an episode, keep the best, move the mean to them. It needs nothing but numpy and a
minute or two. For pictures and deep policies hand the same environment to Stable-Baselines3.
"""

import argparse
from pathlib import Path

import gymnasium
import numpy as np

import dojo_env  # noqa: F401 - makes the environment known to gymnasium
from dojo_env.runs import run_controller
from dojo_maps.whole_file import replaced

CANDIDATES, KEPT = 16, 4
UNSEEN_SEED = 1000
"""The comparison drives an episode that no round of the training has seen."""


def drive(env: gymnasium.Env, policy: np.ndarray, seed: int) -> float:
    """Drive an episode; the mean waiting time of all vehicles before the signal, added up, seconds."""
    features, _ = env.reset(seed=seed)
    over = False
    while not over:
        action = int(np.argmax(policy @ np.append(features, 1.0)))
        features, _, _, over, _ = env.step(action)
    return float(env.unwrapped.metrics()["accumulated_waiting"])


def train(env: gymnasium.Env, rounds: int, seed: int = 0) -> np.ndarray:
    """Search for the weights (actions, features + 1) that let vehicles wait least."""
    chance = np.random.default_rng(seed)
    shape = (env.action_space.n, env.observation_space.shape[0] + 1)
    mean, spread = np.zeros(shape), np.ones(shape)
    for number in range(rounds):
        policies = mean + spread * chance.standard_normal((CANDIDATES, *shape))
        waits = np.array([drive(env, policy, seed=number) for policy in policies])
        best = policies[np.argsort(waits)[:KEPT]]
        mean, spread = best.mean(axis=0), best.std(axis=0) + 0.3 / (1 + number)
        best_wait, usual_wait = waits.min(), np.median(waits)
        print(f"round {number + 1:2}: waiting {best_wait:8.1f} s at best, {usual_wait:8.1f} s in the middle")
    return mean


def main() -> None:
    """Train, compare, and keep the weights beside the bundle."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("bundle", type=Path)
    parser.add_argument("--signal", help="which one, where the map has several")
    parser.add_argument("--rounds", type=int, default=10)
    parser.add_argument("--seconds", type=int, default=3600, help="of an episode")
    options = parser.parse_args()
    keywords = {"scenario": str(options.bundle), "num_seconds": options.seconds}
    if options.signal:
        keywords["ts_ids"] = [options.signal]
    env = gymnasium.make("dojo_env/TrafficSignal-v0", observation="features", **keywords)
    policy = train(env, options.rounds)
    rows = {"trained": drive(env, policy, UNSEEN_SEED)}
    env.close()
    for name in ("fixed-time", "max-pressure"):
        rows[name] = run_controller(name, [UNSEEN_SEED], **keywords)[0]["accumulated_waiting"]
    for name, waiting in rows.items():
        print(f"{name:14} accumulated waiting {waiting:8.1f} s")
    with replaced(options.bundle.with_suffix(".npy")) as fresh:
        np.save(fresh, policy)


if __name__ == "__main__":
    main()
