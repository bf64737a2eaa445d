"""MaxPressure: green for the phase that relieves most.

Source: Varaiya, Max pressure control of a network of signalized intersections, 2013.
"""

import numpy as np
from numpy.typing import NDArray

from dojo_env.controllers.base import Controller
from dojo_env.instant import Instant
from dojo_env.signals.plan import SignalPlan


class MaxPressure(Controller):
    """The phase with the greatest sum, over its links with priority, of vehicles before and behind them.

    Links count with multiplicity, permissive ones (`g`) do not; ties go to the lowest phase.
    """

    def __init__(self) -> None:
        """Begin with no signal known."""
        super().__init__()
        self._known: dict[str, tuple[SignalPlan, tuple[str, ...], NDArray[np.float64]]] = {}

    def choose(self, signal: str, instant: Instant) -> int:
        """Weigh the vehicles on each phase's lanes."""
        plan = instant.signals[signal].plan
        if signal not in self._known or self._known[signal][0] is not plan:
            self._known[signal] = (plan, *_weights(plan))
        _, lanes, weights = self._known[signal]
        return int(np.argmax(weights @ instant.count_vehicles(lanes)))


def _weights(plan: SignalPlan) -> tuple[tuple[str, ...], NDArray[np.float64]]:
    """Count, per phase and lane, the links that bring vehicles off it (+) and onto it (-)."""
    lanes = tuple(dict.fromkeys([*plan.lanes, *plan.out_lanes]))
    column = {lane: number for number, lane in enumerate(lanes)}
    weights = np.zeros((len(plan.phases), len(lanes)))
    for row, state in enumerate(plan.phases):
        for index, source, target in plan.links:
            if state[index] == "G":
                weights[row, column[source]] += 1
                weights[row, column[target]] -= 1
    return lanes, weights
