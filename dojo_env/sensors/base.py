"""What a sensor is, and the kinds of sensors by name.

A user's settings (a frozen record with `mount`) say what to put up; mounted at a signal they become a
`Sensor`, which looks, and keeps what it must remember between two looks. Whoever asks sensors keeps their
intervals and delays.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from math import isfinite
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, Protocol, runtime_checkable

import numpy as np
from gymnasium import spaces

from dojo_env.camera import Camera
from dojo_env.errors import ConfigError
from dojo_env.instant import SignalView
from dojo_env.sensors.eyes import Eyes
from dojo_env.signals.plan import SignalPlan
from dojo_env.snapshot import Snapshot
from dojo_maps.short_repr import short_repr

if TYPE_CHECKING:
    from dojo_env.detectors.measuring import LaneMeasurements
    from dojo_env.rendering.outputs import Picture


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Site:
    """Where a sensor is mounted.

    Attributes:
        name: the sensor's name in the observation.
        signal: id of the signal.
        plan: the signal's phases and lanes.
        eyes: draws; holds the scene and the episode's conditions.
        decision_interval: seconds from decision to decision.
    """

    name: str
    signal: str
    plan: SignalPlan
    eyes: Eyes
    decision_interval: float

    __repr__ = short_repr

    def find_camera(self, wanted: Camera | str) -> Camera:
        """Take a camera as it is, or find one of the signal's by its name.

        Args:
            wanted: a camera, or a name such as `bev` or `approach_0`.

        Returns:
            The camera.

        Raises:
            ConfigError: the signal has no such camera.
        """
        if isinstance(wanted, Camera):
            return wanted
        known = {camera.name: camera for camera in self.eyes.cameras(self.signal)}
        if wanted not in known:
            raise ConfigError(
                f"sensor {self.name!r}, signal {self.signal!r}: no camera {wanted!r}; it has "
                f"{', '.join(known)}, and other kinds of sensors are {', '.join(SENSORS)}"
            )
        return known[wanted]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Look:
    """What a sensor is given when it looks.

    Attributes:
        snapshot: everyone on the road, and the signals.
        pictures: of the cameras in the sensor's `views`, with at least the outputs it asks for.
    """

    snapshot: Snapshot
    pictures: "Mapping[Camera, Picture]"

    __repr__ = short_repr


@runtime_checkable
class Sensor(Protocol):
    """A sensor at work at one signal. Inherit from it, and give what is not as here.

    Attributes:
        space: of what the agent gets.
        interval: seconds from look to look; 0 looks once at each decision. Looks fall on SUMO's steps.
        delay: seconds from a look until the agent gets it.
        idle: seconds after a decision in which it does not look, as it has no use for what it would see.
        views: the outputs it needs of each camera; see `rendering.outputs`. All sensors' are drawn together.
    """

    space: spaces.Space[Any]
    interval: float = 0.0
    delay: float = 0.0
    idle: float = 0.0
    views: Mapping[Camera, Sequence[str]] = MappingProxyType({})

    def reset(self, random: np.random.Generator) -> None:
        """Begin an episode: nothing has been seen yet.

        Args:
            random: follows from the episode's seed and the sensor's name; all noise is drawn from it.
        """
        return

    def observe(self, look: Look) -> Any:
        """Look, noise included. Called in the order of time; what it returns is not changed later.

        Args:
            look: what there is to see.

        Returns:
            A value for `deliver`; by default one of `space`.
        """
        ...

    def deliver(self, looks: Sequence[Any], view: SignalView) -> Any:
        """Make the agent's observation of a decision.

        Args:
            looks: what `observe` returned, of the looks that have arrived since the last decision, oldest
                first; those of that decision again where none has, and the first look before any has.
            view: what the signal knows of itself without a sensor, such as its phase.

        Returns:
            A value of `space`: by default the newest look.
        """
        return looks[-1]

    def perceive(self) -> "LaneMeasurements | None":
        """Measure lanes for controllers, from what `deliver` was last given.

        Returns:
            The lanes as this sensor tells them; None if it tells none.
        """
        return None


@runtime_checkable
class SensorSettings(Protocol):
    """What a user writes down of a sensor: a value that can be kept, compared, and mounted at any signal."""

    def mount(self, site: Site) -> Sensor:
        """Put the sensor up.

        Args:
            site: the signal, and where the sensor hangs.

        Returns:
            The sensor at work.

        Raises:
            ConfigError: it cannot work there.
        """
        ...


SensorKind = Callable[[str, Site], Sensor]
"""Mounts a sensor by its name: takes the text after the kind's name and a colon, and the site."""

SENSORS: dict[str, SensorKind] = {}
"""The kinds of sensors by name. Each kind's module adds its own; so may a user's."""

CAMERA_KIND = "camera"
"""The kind of names that begin with no kind: `bev:depth` is `camera:bev:depth`."""


def mount_sensor(wanted: Any, site: Site) -> Sensor:
    """Mount what a user asks for: settings, or a name such as `bev`, `approach_0:depth` or `events:bev`.

    Args:
        wanted: the sensor.
        site: where.

    Returns:
        The sensor at work, its interval and delay 0 or more.

    Raises:
        ConfigError: it is neither, or cannot work there.
    """
    if isinstance(wanted, str):
        kind, _, text = wanted.partition(":")
        sensor = SENSORS[kind](text, site) if kind in SENSORS else SENSORS[CAMERA_KIND](wanted, site)
    elif isinstance(wanted, SensorSettings) and not isinstance(wanted, type):
        sensor = wanted.mount(site)
    else:
        raise ConfigError(
            f"sensor {site.name!r}: expected a Camera, a name, or settings with mount(site), such as "
            f"CameraSensor, Lidar, Detector or EventCamera; got {wanted!r}"
        )
    if not isinstance(sensor, Sensor):
        raise ConfigError(
            f"sensor {site.name!r}: {wanted!r} mounts {sensor!r}, expected a dojo_env.sensors.base.Sensor "
            "with space, interval, delay, views, reset, observe and deliver"
        )
    for what in ("interval", "delay"):
        seconds = getattr(sensor, what)
        if not isinstance(seconds, int | float) or not (isfinite(seconds) and seconds >= 0):
            raise ConfigError(f"sensor {site.name!r}: {what}={seconds!r}, expected seconds, 0 or more")
    return sensor
