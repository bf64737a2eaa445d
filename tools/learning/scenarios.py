"""Whether a scenario can be learned, seen before anything heavy is loaded."""

from dojo_env.config import SignalConfig
from dojo_env.errors import ConfigError
from dojo_env.managers.map import MapManager
from dojo_env.scenario import find_scenario, open_map

from .settings import Training


def check_scenario(training: Training) -> None:
    """Open the map, converted on first use, and count its signals.

    Raises:
        ConfigError: there is no such scenario, or it has several signals and the settings have one agent.
    """
    signals = MapManager(open_map(find_scenario(training.scenario)), SignalConfig()).plans
    if training.agents == "single" and len(signals) > 1:
        raise ConfigError(
            f"agents='single': {training.scenario} has {len(signals)} signals; choose shared or independent"
        )
