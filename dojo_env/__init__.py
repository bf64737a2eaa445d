"""The environment: SUMO's traffic on a converted map, seen through cameras, measured and controlled.

Importing it registers `dojo_env/TrafficSignal-v0` with Gymnasium.
"""

from dojo_maps import interruption

interruption.begin_command("dojo-env", "dojo-env: interrupted")  # Before anything that takes longer to load.

import importlib  # noqa: E402
from typing import TYPE_CHECKING, Any  # noqa: E402

import gymnasium  # noqa: E402

if TYPE_CHECKING:
    from dojo_env.config import EnvConfig, EpisodeConfig, SignalConfig, TrafficConfig
    from dojo_env.env import TrafficSignalEnv
    from dojo_env.errors import ConfigError, EpisodeOverError, SimulationError
    from dojo_env.parallel import TrafficSignalsEnv, parallel_env
    from dojo_env.recording import Recording
    from dojo_env.replaying import replay
    from dojo_env.scenario import Scenario
    from dojo_env.snapshot import Snapshot

__all__ = [
    "ConfigError",
    "EnvConfig",
    "EpisodeConfig",
    "EpisodeOverError",
    "Recording",
    "Scenario",
    "SignalConfig",
    "SimulationError",
    "Snapshot",
    "TrafficConfig",
    "TrafficSignalEnv",
    "TrafficSignalsEnv",
    "parallel_env",
    "replay",
]

_HOMES = {
    "ConfigError": "errors",
    "EnvConfig": "config",
    "EpisodeConfig": "config",
    "EpisodeOverError": "errors",
    "Recording": "recording",
    "Scenario": "scenario",
    "SignalConfig": "config",
    "SimulationError": "errors",
    "Snapshot": "snapshot",
    "TrafficConfig": "config",
    "TrafficSignalEnv": "env",
    "TrafficSignalsEnv": "parallel",
    "parallel_env": "parallel",
    "replay": "replaying",
}

gymnasium.register("dojo_env/TrafficSignal-v0", entry_point="dojo_env.env:TrafficSignalEnv")


def __getattr__(name: str) -> Any:
    """Load a public name when it is first used, so that commands and renderers start at once."""
    if name not in _HOMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    value = getattr(importlib.import_module(f"{__name__}.{_HOMES[name]}"), name)
    globals()[name] = value
    return value
