"""A plain cycle: every phase in turn, for the same time, whatever the traffic."""

from dojo_env.controllers.base import Controller
from dojo_env.instant import Instant


class Cycle(Controller):
    """Each phase is green for `green` seconds."""

    def __init__(self, green: float = 30.0) -> None:
        """Choose the green time, seconds."""
        super().__init__()
        self._green = green

    def choose(self, signal: str, instant: Instant) -> int:
        """Go on when the time is over."""
        view = instant.signals[signal]
        return (view.phase + (view.green_time >= self._green)) % len(view.plan.phases)
