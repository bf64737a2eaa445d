"""The traffic of the episode: SUMO, started, stepped and ended, and what is measured of it."""

from pathlib import Path

from dojo_env.config import EnvConfig
from dojo_env.managers.base import Manager, Turn
from dojo_env.simulation import Simulation


class TrafficManager(Manager):
    """Owns the simulation.

    Attributes:
        simulation: runs between `reset` and `close`; the other managers look at it.
    """

    def __init__(self, network: Path, config: EnvConfig) -> None:
        """Note what is to be run, and check its files; nothing starts yet.

        Args:
            network: the map's SUMO network.
            config: of the environment.

        Raises:
            ScenarioError: a file is cut short, no XML, or unsafe to read.
        """
        self.simulation = Simulation(network, config)

    def before_reset(self, turn: Turn) -> None:
        """End the last episode's simulation."""
        self.simulation.close()

    def reset(self, turn: Turn) -> None:
        """Start a simulation."""
        self.simulation.start(turn.seed)

    def step(self, turn: Turn) -> None:
        """Simulate a step."""
        self.simulation.step()

    def close(self) -> None:
        """End the simulation."""
        self.simulation.close()
