"""The environment's errors; each says what is wrong, where, and what to do about it."""

import inspect
from collections.abc import Callable
from typing import Any

from dojo_maps.errors import DojoError, SourceError


class ConfigError(DojoError, ValueError):
    """A setting has a value that cannot work."""

    exit_status = 2


class ScenarioError(SourceError, ConfigError):
    """A scenario's file is missing, unreadable, not what it claims to be, or unsafe to run."""


class CameraError(SourceError, ConfigError):
    """A file of cameras is missing, unreadable, or holds what no camera can be."""


class EncoderError(SourceError, ConfigError):
    """An encoder's file is missing, unreadable, or no network that encodes pictures."""


class PlanError(SourceError, ConfigError):
    """A signal timing plan's file is missing, unreadable, or does not fit its signals."""


class PolicyError(SourceError, ConfigError):
    """A policy's file is missing, damaged, or no weights of this version."""


class DatasetError(SourceError, ConfigError):
    """A file of a data set is missing, unreadable, or not what it should be."""


class DetectorError(SourceError, ConfigError):
    """A detector's file is missing, unreadable, or no network that finds road users."""


class PhotographError(SourceError, ConfigError):
    """A photograph is missing, unreadable, or too large."""


class ModelError(SourceError, ConfigError):
    """A 3D model is missing, unreadable, or too large."""


class FilmError(SourceError, ConfigError):
    """A film, a folder of pictures or a stream cannot be read."""


class RegionError(SourceError, ConfigError):
    """A file of regions cannot be read, or holds what no region can be."""


class CalibrationError(SourceError, ConfigError):
    """Control points cannot be read, or no camera can be found from them."""


class SnapshotError(DojoError, ValueError):
    """A snapshot holds values that no simulated instant can have."""


class SimulationError(DojoError):
    """SUMO refused or stopped; the message names the simulated time."""


class SimulationBusyError(SimulationError):
    """This process runs another simulation already, and libsumo holds one."""


class SimulationDiedError(SimulationError):
    """The process that ran SUMO has died, with its episode; `reset` begins another."""


class StaleInstantError(DojoError):
    """A decision was asked for what nobody had measured before SUMO moved on."""


class EpisodeOverError(DojoError):
    """`step` was called after the episode's end, or before its first `reset`."""


class RecordingError(SourceError):
    """A recording cannot be read, or does not hold what its format promises."""


def refuse_other_arguments(setting: str, function: Callable[..., Any], names: tuple[str, ...]) -> None:
    """Refuse a user's function that cannot be called with these arguments.

    Args:
        setting: the keyword that the function was given as, for the message.
        function: the user's.
        names: of the arguments that it will be called with.

    Raises:
        ConfigError: it takes others.
    """
    try:
        inspect.signature(function).bind(*names)
    except ValueError:
        return  # Functions of C do not tell what they take.
    except TypeError:
        name = getattr(function, "__name__", function)
        raise ConfigError(
            f"{setting}: {name} must take ({', '.join(names)}); functions of SUMO-RL's TrafficSignal run in "
            "dojo_env.compat.sumo_rl"
        ) from None
