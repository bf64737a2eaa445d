"""MaxPressure: green for the phase that relieves most.

Source: Varaiya, Max pressure control of a network of signalized intersections, 2013.
"""

from collections import Counter

import numpy as np
from numpy.typing import NDArray

from dojo_env.controllers.base import Controller
from dojo_env.controllers.ranking import choose_best
from dojo_env.instant import Instant
from dojo_env.reading import Approach
from dojo_env.signals.plan import SignalPlan
from dojo_maps.signals.programs import green_links


class MaxPressure(Controller):
    """The phase with the greatest sum, over its movements, of vehicles that want to go minus those beyond.

    As the source has it, a vehicle counts for its own movement alone, also where a lane serves several. Here
    it counts within 150 m. A link that yields counts as far as it can discharge beside those that it yields
    to, one behind which there is no room counts nothing, and none counts less than nothing.
    """

    def choose(self, signal: str, instant: Instant) -> int:
        """Weigh each phase's movements."""
        view = instant.signals[signal]
        approach = instant.approach(signal)
        waiting = Counter(approach.links)
        if not waiting:
            return view.phase
        return choose_best(
            [_relief(view.plan, state, approach, waiting) for state in view.plan.phases], view.phase
        )


def _relief(plan: SignalPlan, state: str, approach: Approach, waiting: Counter[int]) -> float:
    total = 0.0
    for link, count in waiting.items():
        if link in green_links(state) and link not in approach.blocked:
            pressure = max(count - approach.beyond.get(link, 0.0), 0.0)
            total += pressure * share_of_green(plan, state, link, waiting)
    return total


def share_of_green(plan: SignalPlan, state: str, link: int, waiting: Counter[int]) -> float:
    """Estimate which share of a green a link can use: all, or, where it yields, what the others leave.

    Args:
        plan: of the signal.
        state: the phase's letters.
        link: by its place in the state.
        waiting: vehicles by the link that they will take.

    Returns:
        Above 0 and at most 1.
    """
    if state[link] == "G":
        return 1.0
    first = plan.conflicts.yields[link]
    opposing = sum(n for other, n in waiting.items() if other in green_links(state) and first[other])
    return 1.0 / (1.0 + opposing)


class MaxPressureOfThePaper(Controller):
    """The phase with the greatest sum, over its links with priority, of vehicles before and behind them.

    So TrafficDojo's table has it: links count with multiplicity, permissive ones (`g`) do not, a lane's
    vehicles count for each of its links; ties go to the lowest phase.
    """

    def __init__(self) -> None:
        """Begin with no signal known."""
        super().__init__({"max_red": None})
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
