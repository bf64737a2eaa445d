"""The traffic of the episode: SUMO, started, stepped and ended."""

from dojo_env.managers.base import Manager, Turn
from dojo_env.simulation import Simulation


class TrafficManager(Manager):
    """Runs the simulation."""

    def __init__(self, simulation: Simulation) -> None:
        """Take the simulation to run."""
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
