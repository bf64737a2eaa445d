"""An event camera (dynamic vision sensor): each pixel tells when its brightness has changed.

Sources: Gallego et al. 2022, Event-based Vision: A Survey, equations 1 and 2; the threshold mismatch and the
background activity as in Hu, Liu and Delbruck 2021, v2e.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from math import isfinite
from typing import Any

import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from dojo_env.camera import BEV, Camera
from dojo_env.errors import ConfigError
from dojo_env.sensors.base import SENSORS, Look, Sensor, Site
from dojo_maps.short_repr import short_repr

Floats = NDArray[np.float32]

ON, OFF = 0, 1
"""Channels of the observation: brighter, darker."""

_MOST = 255
_WHITE = 65535
"""Linear intensity of white; whole numbers, so that the same picture gives the same bytes everywhere."""
_DARK = 0.01
"""Intensity that a pixel sees in the dark, a share of white: below it, changes drown."""
_LEAST_THRESHOLD = 0.01
_REC_709 = (0.2126, 0.7152, 0.0722)
"""How bright red, green and blue light are. Source: ITU-R BT.709."""


def _linear_light() -> tuple[NDArray[np.int32], ...]:
    """(256,) each: what a value of the red, green or blue channel adds. Source: IEC 61966-2-1 (sRGB)."""
    value = np.arange(256) / 255
    linear = np.where(value <= 0.04045, value / 12.92, ((value + 0.055) / 1.055) ** 2.4)
    return tuple(np.floor(_WHITE * share * linear).astype(np.int32) for share in _REC_709)


_RED, _GREEN, _BLUE = _linear_light()
_LOG: Floats = np.log(np.arange(_WHITE + 1) / _WHITE + _DARK).astype(np.float32)


@dataclass(frozen=True, slots=True, kw_only=True)
class EventCamera:
    """Counts the ON and OFF events of each pixel: (height, width, 2) uint8, at most 255.

    A pixel fires each time its log intensity has moved by a threshold from the level of its last event. The
    first look of an episode only sets the levels. Nothing is seen between two looks, so give it an interval
    below the time between decisions; the agent gets the events of all looks since its last decision.

    Attributes:
        camera: what it watches through: a camera, or the name of one that is placed from the map.
        threshold: contrast threshold, change of the natural logarithm of the intensity.
        mismatch: standard deviation of the thresholds from pixel to pixel, as `threshold`; drawn per episode.
        background_rate: events per pixel and second that nothing causes, half of them ON.
        interval: seconds from look to look; 0 looks at each decision.
        delay: seconds from a look until the agent gets it.
    """

    camera: Camera | str = BEV
    threshold: float = 0.2
    mismatch: float = 0.0
    background_rate: float = 0.0
    interval: float = 0.0
    delay: float = 0.0

    __repr__ = short_repr

    def __post_init__(self) -> None:
        """Refuse what cannot be.

        Raises:
            ConfigError: a number is not finite or out of its range.
        """
        for name, least in (("threshold", _LEAST_THRESHOLD), ("mismatch", 0.0), ("background_rate", 0.0)):
            value = getattr(self, name)
            if not (isfinite(value) and least <= value <= 1e4):
                raise ConfigError(f"event camera: {name}={value!r}, expected {least:g} to 10,000")

    def mount(self, site: Site) -> Sensor:
        """Hang it.

        Raises:
            ConfigError: there is no such camera.
        """
        return _MountedEventCamera(self, site)


class _MountedEventCamera(Sensor):
    def __init__(self, settings: EventCamera, site: Site) -> None:
        self._settings = settings
        self._camera = site.find_camera(settings.camera)
        shape = (self._camera.height, self._camera.width, 2)
        self.space = spaces.Box(0, _MOST, shape, np.uint8)
        self.interval, self.delay = settings.interval, settings.delay
        self.views = {self._camera: ("rgb",)}
        self._random = np.random.default_rng(0)
        self._thresholds: Floats = np.empty(0, np.float32)
        self._levels: Floats | None = None
        self._time = 0.0

    def reset(self, random: np.random.Generator) -> None:
        settings, self._random, self._levels = self._settings, random, None
        thresholds = np.full((2, *self._picture_shape), settings.threshold, dtype=np.float32)
        if settings.mismatch > 0:
            thresholds += random.normal(0.0, settings.mismatch, thresholds.shape).astype(np.float32)
        self._thresholds = np.maximum(thresholds, np.float32(_LEAST_THRESHOLD))

    @property
    def _picture_shape(self) -> tuple[int, int]:
        return (self._camera.height, self._camera.width)

    def observe(self, look: Look) -> NDArray[np.uint8]:
        rgb = look.pictures[self._camera].rgb
        seen = _LOG[_RED[rgb[..., 0]] + _GREEN[rgb[..., 1]] + _BLUE[rgb[..., 2]]]
        since, self._time = look.snapshot.time - self._time, look.snapshot.time
        if self._levels is None:
            self._levels = seen
            return np.zeros((*self._picture_shape, 2), dtype=np.uint8)
        change = seen - self._levels
        on = np.floor(np.maximum(change, 0) / self._thresholds[ON])
        off = np.floor(np.maximum(-change, 0) / self._thresholds[OFF])
        self._levels = self._levels + (on * self._thresholds[ON] - off * self._thresholds[OFF])
        events = np.stack([on, off], axis=2)
        if self._settings.background_rate > 0:
            events += self._random.poisson(self._settings.background_rate / 2 * since, events.shape)
        return np.minimum(events, _MOST).astype(np.uint8)

    def deliver(self, looks: Sequence[Any], view: Any) -> NDArray[np.uint8]:
        """Count the events of all looks together."""
        if len(looks) == 1:
            alone: NDArray[np.uint8] = looks[0]
            return alone
        return np.minimum(np.sum(looks, axis=0, dtype=np.int64), _MOST).astype(np.uint8)


def _mount(text: str, site: Site) -> Sensor:
    return EventCamera(camera=text or BEV).mount(site)


SENSORS["events"] = _mount
