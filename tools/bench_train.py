"""How fast policies learn from pictures beside features: the same algorithm and processes, taking turns.

Steps per second of wall time, simulation, pictures and updates together; ratios are medians over the rounds.
Both meet the same traffic: signals go round, whatever the policies say. Who learns faster jams less, and SUMO
and pictures take less time for fewer vehicles.
"""

import argparse
import statistics
import sys
import time
from contextlib import closing
from typing import Any

import numpy as np
from stable_baselines3.common.base_class import BaseAlgorithm
from stable_baselines3.common.vec_env import VecEnvWrapper

from dojo_env.learning.algorithms import build_model
from dojo_env.learning.environments import open_environments
from dojo_env.learning.process_setup import prepare_process
from dojo_env.learning.settings import ALGORITHMS, Training

GOAL = 0.6
"""Of features' steps per second, with pictures."""
_GREEN = 3
"""Decisions that each phase is green."""


class GoingRound(VecEnvWrapper):
    """Environments whose signals go from phase to phase, whatever is asked of them."""

    def reset(self) -> Any:
        """Begin the next episode everywhere."""
        self._decisions = 0
        return self.venv.reset()

    def step_async(self, actions: np.ndarray) -> None:
        """Go on to the next phase when it is time."""
        phase = self._decisions // _GREEN % self.action_space.n
        self._decisions += 1
        self.venv.step_async(np.full_like(actions, phase))

    def step_wait(self) -> Any:
        """Collect what came of it."""
        return self.venv.step_wait()


def time_learning(model: BaseAlgorithm, steps: int) -> float:
    """Give steps per second."""
    start = time.perf_counter()
    model.learn(steps, log_interval=None, reset_num_timesteps=False)
    return steps / (time.perf_counter() - start)


def measure(settings: dict[str, object], rounds: int, warm_up: int) -> dict[str, list[float]]:
    """Let both learn in turns, each in environments of its own."""
    runs = {name: Training(observation=name, **settings) for name in ("features", "bev")}
    with (
        closing(open_environments(runs["features"])) as first,
        closing(open_environments(runs["bev"])) as second,
    ):
        models = {
            name: build_model(run, GoingRound(environments))
            for (name, run), environments in zip(runs.items(), (first, second), strict=True)
        }
        for model in models.values():
            model.learn(warm_up, log_interval=None)
        pace: dict[str, list[float]] = {name: [] for name in models}
        for _ in range(rounds):
            for name, model in models.items():
                pace[name].append(time_learning(model, runs[name].round_steps))
        return pace


def main() -> int:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--scenario", default="cologne1")
    parser.add_argument("--algorithms", nargs="+", default=list(ALGORITHMS), choices=list(ALGORITHMS))
    parser.add_argument("--processes", type=int, default=Training().processes)
    parser.add_argument("--rounds", type=int, default=3, help="of an episode in each environment")
    parser.add_argument("--warm-up", type=int, default=6_000, help="steps before anything is measured")
    options = parser.parse_args()
    prepare_process()
    for algorithm in options.algorithms:
        settings = {"scenario": options.scenario, "processes": options.processes, "algorithm": algorithm}
        pace = measure(settings, options.rounds, options.warm_up)
        features, bev = (statistics.median(pace[name]) for name in ("features", "bev"))
        verdict = "holds" if bev >= GOAL * features else "MISSED"
        print(f"{algorithm}: features {features:.0f} steps/s, bev {bev:.0f}, ratio {bev / features:.2f} "
              f"(goal {GOAL}: {verdict})")  # fmt: skip
    return 0


if __name__ == "__main__":
    sys.exit(main())
