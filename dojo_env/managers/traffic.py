"""The traffic of the episode: SUMO, started, stepped and ended."""

from collections.abc import Iterable
from pathlib import Path

from dojo_env.elements import read_elements
from dojo_env.managers.base import Manager, Turn
from dojo_env.simulation import Simulation


class TrafficManager(Manager):
    """Runs the simulation."""

    def __init__(self, simulation: Simulation, routes: Iterable[Path]) -> None:
        """Take the simulation to run.

        SUMO reads its route files piece by piece; what is wrong at their end would end an episode late.

        Raises:
            ConfigError: a route file is cut short, no XML, or unsafe to read.
        """
        for path in routes:
            read_elements(path)
        self._simulation = simulation

    def before_reset(self, turn: Turn) -> None:
        """End the last episode's simulation."""
        self._simulation.close()

    def reset(self, turn: Turn) -> None:
        """Start a simulation."""
        self._simulation.start(turn.seed)

    def step(self, turn: Turn) -> None:
        """Simulate a second."""
        self._simulation.step()

    def close(self) -> None:
        """End the simulation."""
        self._simulation.close()
