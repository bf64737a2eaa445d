"""What a policy for any junction learns from: episodes whose junctions, demand and constraints are drawn."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

YELLOWS: tuple[float | str, ...] = (2, 3, "speed")
ALL_REDS = (0.0, 1.0, 2.0)
LEAST_GREENS = (5.0, 8.0, 10.0)
"""Seconds that constraints are drawn from: those of published benchmarks, and of streets."""
MOST_SIGNALS = 4
"""Signals that the policy controls in one episode; the others run their own programs."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Case:
    """An episode to learn from.

    Attributes:
        scenario: name or path.
        signals: ids of those that the policy controls.
        seed: of SUMO, and of what is tried.
        seconds: simulated.
        scale: of the demand.
        min_green: seconds.
        yellow_time: seconds, or `speed`.
        all_red: seconds.
    """

    scenario: str
    signals: tuple[str, ...]
    seed: int
    seconds: int
    scale: float = 1.0
    min_green: float = 10.0
    yellow_time: float | str = 2
    all_red: float = 0.0

    @property
    def environment(self) -> dict[str, Any]:
        """Keywords of the environment."""
        return {
            "scenario": self.scenario,
            "ts_ids": self.signals,
            "num_seconds": self.seconds,
            "min_green": self.min_green,
            "yellow_time": self.yellow_time,
            "all_red": self.all_red,
            "additional_sumo_cmd": f"--scale {self.scale:g}",
        }


def draw_case(
    junctions: Sequence[tuple[str, Sequence[str]]],
    draw: np.random.Generator,
    *,
    seed: int,
    seconds: tuple[int, int],
    scales: tuple[float, float],
) -> Case:
    """Draw an episode.

    Args:
        junctions: scenarios, and the ids of each one's signals; one with four times as many signals comes
            twice as often.
        draw: numbers.
        seed: of the episode.
        seconds: the shortest and the longest episode.
        scales: of the demand, the least and the most.

    Returns:
        The episode; it lasts whole minutes.
    """
    weights = np.sqrt([len(signals) for _, signals in junctions])
    scenario, signals = junctions[int(draw.choice(len(junctions), p=weights / weights.sum()))]
    count = int(draw.integers(1, min(MOST_SIGNALS, len(signals)) + 1))
    chosen = sorted(draw.choice(len(signals), count, replace=False))
    return Case(
        scenario=scenario,
        signals=tuple(signals[place] for place in chosen),
        seed=seed,
        seconds=int(draw.integers(seconds[0], seconds[1] + 1)) // 60 * 60,
        scale=round(float(draw.uniform(*scales)), 2),
        min_green=float(draw.choice(LEAST_GREENS)),
        yellow_time=YELLOWS[int(draw.integers(len(YELLOWS)))],
        all_red=float(draw.choice(ALL_REDS)),
    )
