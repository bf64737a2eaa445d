"""SOTL: the green stays while a platoon passes, and goes on when enough vehicles wait elsewhere.

Source: Cools, Gershenson, D'Hooghe, Self-organizing traffic lights: a realistic simulation, 2013.
"""

from dojo_env.controllers.base import Controller
from dojo_env.instant import Instant, SignalView
from dojo_maps.signals.programs import green_links


class Sotl(Controller):
    """With g vehicles that may go and r that may not, within 150 m: on if g is few and r many.

    Each vehicle counts for its own movement. The green goes to the next phase that somebody waits for.
    """

    def __init__(self, few: int = 3, many: int = 6) -> None:
        """Choose the thresholds: g at most `few` and r above `many`, or g none and r any."""
        super().__init__()
        self._few, self._many = few, many

    def choose(self, signal: str, instant: Instant) -> int:
        """Compare who moves with who waits."""
        view, approach = instant.signals[signal], instant.approach(signal)
        phases = view.plan.phases
        served = [sum(link in green_links(state) for link in approach.links) for state in phases]
        green = served[view.phase]
        if not _goes_on(green, len(approach.links) - green, self._few, self._many):
            return view.phase
        others = [(view.phase + k) % len(phases) for k in range(1, len(phases))]
        return next((phase for phase in others if served[phase]), view.phase)


class SotlOfThePaper(Controller):
    """With g vehicles on the lanes with priority and r on the others: next if g is few and r many.

    So TrafficDojo's table has it.
    """

    def __init__(self, few: int = 3, many: int = 6) -> None:
        """Choose the thresholds, as for `Sotl`."""
        super().__init__({"max_red": None})
        self._few, self._many = few, many

    def choose(self, signal: str, instant: Instant) -> int:
        """Compare who moves with who waits."""
        view = instant.signals[signal]
        green, red = _count_by_lane(view)
        return (view.phase + _goes_on(green, red, self._few, self._many)) % len(view.plan.phases)


def _count_by_lane(view: SignalView) -> tuple[int, int]:
    moving = {source for index, source, _ in view.plan.links if view.plan.phases[view.phase][index] == "G"}
    counts = dict(zip(view.plan.lanes, view.lanes.vehicles.tolist(), strict=True))
    green = sum(count for lane, count in counts.items() if lane in moving)
    return green, sum(counts.values()) - green


def _goes_on(green: int, red: int, few: int, many: int) -> bool:
    return (green <= few and red > many) or (green == 0 and red > 0)
