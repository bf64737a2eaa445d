"""SOTL: the green stays while a platoon passes, and goes on when enough vehicles wait elsewhere.

Source: Cools, Gershenson, D'Hooghe, Self-organizing traffic lights: a realistic simulation, 2013.
"""

from dojo_env.controllers.base import Controller
from dojo_env.instant import Instant


class Sotl(Controller):
    """With g vehicles on the lanes with priority and r on the others: next if g is few and r many."""

    def __init__(self, few: int = 3, many: int = 6) -> None:
        """Choose the thresholds: g at most `few` and r above `many`, or g none and r any."""
        super().__init__()
        self._few, self._many = few, many

    def choose(self, signal: str, instant: Instant) -> int:
        """Compare who moves with who waits."""
        view = instant.signals[signal]
        moving = {
            source for index, source, _ in view.plan.links if view.plan.phases[view.phase][index] == "G"
        }
        counts = dict(zip(view.plan.lanes, view.lanes.vehicles.tolist(), strict=True))
        green = sum(count for lane, count in counts.items() if lane in moving)
        red = sum(count for lane, count in counts.items() if lane not in moving)
        go_on = (green <= self._few and red > self._many) or (green == 0 and red > 0)
        return (view.phase + go_on) % len(view.plan.phases)
