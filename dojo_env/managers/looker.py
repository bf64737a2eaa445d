"""Sensors that look between decisions, too."""

from typing import Protocol, runtime_checkable

from dojo_env.managers.base import Manager, Turn
from dojo_env.simulation import Simulation
from dojo_env.snapshot import Snapshot


@runtime_checkable
class Looker(Protocol):
    """An observer that can look between decisions."""

    def is_due(self, time: float) -> bool:
        """Tell whether it wants to look now.

        Args:
            time: the present one, simulated seconds.

        Returns:
            Whether `look` is to be called at this time.
        """
        ...

    def look(self, snapshot: Snapshot) -> None:
        """Look.

        Args:
            snapshot: the present instant, before SUMO's next step.
        """
        ...


class LookManager(Manager):
    """Shows an observer what it wants to see before each of SUMO's steps, so it comes first of all managers.

    It need not look after the last step: there a decision follows, at which it observes.
    """

    def __init__(self, simulation: Simulation, looker: Looker) -> None:
        """Take the observer."""
        self._simulation, self._looker = simulation, looker

    def step(self, turn: Turn) -> None:
        """Look, where it is time."""
        if self._looker.is_due(self._simulation.time):
            self._looker.look(self._simulation.read_snapshot())
