"""Whoever looks on: shown every simulated second, live."""

from collections.abc import Callable

from dojo_env.managers.base import Manager, Turn
from dojo_env.simulation import Simulation
from dojo_env.snapshot import Snapshot


class WatchManager(Manager):
    """Hands a snapshot of every second to a function, which may take its time."""

    def __init__(self, simulation: Simulation, on_second: Callable[[Snapshot], None]) -> None:
        """Take the function."""
        self._simulation, self._on_second = simulation, on_second

    def reset(self, turn: Turn) -> None:
        """Show the first instant."""
        self._on_second(self._simulation.read_snapshot())

    def step(self, turn: Turn) -> None:
        """Show a second."""
        if self._simulation.is_new_second:
            self._on_second(self._simulation.read_snapshot())
