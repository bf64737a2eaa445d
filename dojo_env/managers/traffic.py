"""The traffic of the episode: SUMO, started, stepped and ended, and what is measured of it."""

from collections.abc import Callable
from functools import partial

from dojo_env.config import EnvConfig
from dojo_env.errors import ConfigError
from dojo_env.managers.base import Manager, Turn
from dojo_env.simulation import Simulation
from dojo_maps.bundle import Bundle
from dojo_maps.errors import DojoError


class TrafficManager(Manager):
    """Owns the simulation.

    Attributes:
        simulation: runs between `reset` and `close`; the other managers look at it.
    """

    def __init__(self, bundle: Bundle, config: EnvConfig) -> None:
        """Note what is to be run, and check its files; nothing starts yet.

        Args:
            bundle: the map.
            config: of the environment.

        Raises:
            ConfigError: the scenario's pattern cannot draw traffic on this map.
            ScenarioError: a file is cut short, no XML, or unsafe to read.
        """
        self.simulation = Simulation(bundle.network, config)
        self._draw_routes = _build_traffic(bundle, config)

    def before_reset(self, turn: Turn) -> None:
        """End the last episode's simulation."""
        self.simulation.close()

    def reset(self, turn: Turn) -> None:
        """Start a simulation, with traffic of its own where a pattern draws it."""
        self.simulation.start(turn.seed, routes=self._draw_routes(turn.seed))

    def step(self, turn: Turn) -> None:
        """Simulate a step."""
        self.simulation.step()

    def close(self) -> None:
        """End the simulation."""
        self.simulation.close()


def _build_traffic(bundle: Bundle, config: EnvConfig) -> Callable[[int], str | None]:
    """Find out how an episode's traffic is drawn: its seed in, SUMO's routes out; None without a pattern.

    Raises:
        ConfigError: the scenario's pattern cannot draw traffic on this map.
    """
    pattern = config.scenario.pattern
    if pattern is None:
        return lambda _seed: None
    from dojo_maps.demand.changing import ChangingTraffic  # noqa: PLC0415 - it loads what few need

    try:
        traffic = ChangingTraffic(bundle.road_map, bundle.network, pattern)
    except DojoError as error:
        raise ConfigError(str(error)) from error
    return partial(traffic.format, begin=config.sumo.begin, end=config.sumo.end)
