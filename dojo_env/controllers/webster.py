"""Webster's plan: a cycle and its green splits from measured flows, made anew as the demand changes.

Source: Webster, Traffic signal settings, Road Research Technical Paper 39, 1958.
"""

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from dojo_env.controllers.base import Controller
from dojo_env.instant import Instant, SignalView

_SATURATION = 1800.0 / 3600.0
"""Vehicles per second of one lane of steady green. Source: Highway Capacity Manual, about the usual value."""
_LOST = 4.0
"""Seconds lost at each change: yellow and starting up."""
_CYCLES = (30.0, 120.0)
"""Bounds of the cycle, seconds."""
_FULLEST = 0.9
"""The sum of the flow ratios is taken to be at most this; above it the formula has no answer."""


@dataclass(slots=True)
class _Counts:
    """Who was on each lane at the last decision, how many have come since the plan was made, and the plan."""

    since: float
    present: list[frozenset[str]]
    came: NDArray[np.float64]
    greens: NDArray[np.float64] = field(default_factory=lambda: np.empty(0))


class Webster(Controller):
    """Counts arrivals on each lane and makes a new plan every `interval` seconds."""

    def __init__(self, interval: float = 300.0) -> None:
        """Choose how often to plan, seconds."""
        super().__init__()
        self._interval = interval
        self._counts: dict[str, _Counts] = {}

    def reset(self, seed: int) -> None:
        """Forget all counts."""
        self._counts = {}

    def choose(self, signal: str, instant: Instant) -> int:
        """Go on when the phase's share of the cycle is over."""
        view = instant.signals[signal]
        counts = self._count(signal, view, instant)
        return (view.phase + bool(view.green_time >= counts.greens[view.phase])) % len(view.plan.phases)

    def _count(self, signal: str, view: SignalView, instant: Instant) -> _Counts:
        present = [frozenset(instant.list_vehicles(lane)) for lane in view.plan.lanes]
        counts = self._counts.get(signal)
        if counts is None:
            lanes = len(present)
            equal = np.full(len(view.plan.phases), 2 * _CYCLES[0] / len(view.plan.phases) - _LOST)
            counts = self._counts[signal] = _Counts(instant.time, present, np.zeros(lanes), equal)
        counts.came += [len(now - before) for now, before in zip(present, counts.present, strict=True)]
        counts.present = present
        if instant.time - counts.since >= self._interval:
            counts.greens = compute_greens(view, counts.came / (instant.time - counts.since))
            counts.since, counts.came = instant.time, np.zeros(len(present))
        return counts


def compute_greens(view: SignalView, flows: NDArray[np.float64]) -> NDArray[np.float64]:
    """Split Webster's cycle among the phases by their critical lanes.

    Args:
        view: the signal.
        flows: (lanes,) vehicles per second.

    Returns:
        (phases,) seconds of green.
    """
    column = {lane: number for number, lane in enumerate(view.plan.lanes)}
    ratios = np.zeros(len(view.plan.phases))
    for row, state in enumerate(view.plan.phases):
        used = {column[source] for index, source, _ in view.plan.links if state[index] == "G"}
        ratios[row] = max((flows[lane] / _SATURATION for lane in used), default=0.0)
    total = min(float(ratios.sum()), _FULLEST)
    lost = _LOST * len(ratios)
    cycle = float(np.clip((1.5 * lost + 5) / (1 - total), *_CYCLES))
    shares = ratios / ratios.sum() if ratios.sum() else np.full(len(ratios), 1 / len(ratios))
    greens: NDArray[np.float64] = shares * max(cycle - lost, 1.0)
    return greens
