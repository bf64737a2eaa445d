"""Controllers by name, under the same constraints as agents: rules, SUMO's logics, one that has learned."""

from collections.abc import Callable, Mapping
from pathlib import Path

from dojo_env.camera_presets import LONG_VIEW
from dojo_env.controllers.base import Controller
from dojo_env.controllers.fixed_time import Cycle
from dojo_env.controllers.max_pressure import MaxPressure, MaxPressureOfThePaper
from dojo_env.controllers.phase_competition import PhaseCompetition
from dojo_env.controllers.queue_pressure import QueuePressure
from dojo_env.controllers.random_choice import RandomChoice
from dojo_env.controllers.sotl import Sotl, SotlOfThePaper
from dojo_env.controllers.webster import Webster
from dojo_env.errors import ConfigError
from dojo_maps.wording import did_you_mean


def _make_rolling_horizon() -> Controller:
    # numba takes a third of a second to load, which only those two need wait for.
    from dojo_env.controllers.rolling_horizon import RollingHorizon  # noqa: PLC0415

    return RollingHorizon()


def make_seeing(network: Path | None = None) -> Controller:
    """Make the controller that acts on what a network sees of the lanes in pictures, `learned-vision`.

    Args:
        network: its weights, as `dojo-env train --vision` keeps them; None takes those of the package.

    Returns:
        The controller.
    """
    from dojo_env.sensors.lane_network import PACKAGED  # noqa: PLC0415

    sensor = "lane-strips" if network is None else f"lane-strips:{network}"
    controller = PhaseCompetition(settings={"observation": sensor})
    controller.weights = (*controller.weights, network or PACKAGED)
    controller.preferred = {"cameras": LONG_VIEW}
    return controller


_MAKERS: Mapping[str, Callable[[], Controller]] = {
    "fixed-time": lambda: Controller(settings={"fixed_ts": True}),
    "pretimed": lambda: Controller(settings={"fixed_ts": True, "program": "fixed"}),
    "cycle": Cycle,
    "webster": Webster,
    "actuated": lambda: Controller(settings={"fixed_ts": True, "program": "actuated"}),
    "delay-based": lambda: Controller(settings={"fixed_ts": True, "program": "delay_based"}),
    "sotl": Sotl,
    "sotl-paper": SotlOfThePaper,
    "max-pressure": MaxPressure,
    "max-pressure-paper": MaxPressureOfThePaper,
    "queue-pressure": QueuePressure,
    "rolling-horizon": _make_rolling_horizon,
    "random": RandomChoice,
    "learned": PhaseCompetition,
    "learned-vision": make_seeing,
}
CONTROLLERS = tuple(_MAKERS)
"""The controllers' names."""


def make_controller(name: str) -> Controller:
    """Make a controller by its name.

    Args:
        name: one of `CONTROLLERS`.

    Returns:
        The controller, which serves any number of episodes.

    Raises:
        ConfigError: there is none of that name.
    """
    if name not in _MAKERS:
        meant = did_you_mean(str(name), CONTROLLERS)
        raise ConfigError(f"controller {name!r}: expected one of {', '.join(CONTROLLERS)}{meant}")
    controller = _MAKERS[name]()
    controller.name = name
    return controller


__all__ = ["CONTROLLERS", "Controller", "make_controller", "make_seeing"]
