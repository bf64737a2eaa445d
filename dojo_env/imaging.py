"""How a camera makes a picture: shutter, exposure control, lens, sensor and compression.

Light and weather, and what they do to a camera, are `conditions`; where it hangs is `camera`.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any
from zlib import crc32

import numpy as np

from dojo_env.errors import ConfigError
from dojo_env.ranges import Ranges, check_limits, draw_values, read_values
from dojo_maps.short_repr import short_repr


@dataclass(frozen=True, slots=True, kw_only=True)
class Imaging:
    """What the bodies of all cameras do to their pictures; the default is nothing at all.

    Attributes:
        shutter_s: exposure time of each row, seconds; what moves meanwhile is blurred.
        readout_s: from the first row's exposure to the last one's, seconds (rolling shutter); 0 takes all
            rows at once.
        auto_exposure: 0 off to 1, share of the way, in stops, to a mean of 18 % of white.
        adaptation_s: time constant of the automatic exposure, seconds.
        vignetting: share of the light that is missing in the corners.
        glare: 0 none to 1 strong stray light of a sun that shines on the lens.
        shot_noise: standard deviation where the picture is white by day, in levels of 255 of linear light;
            it grows with the root of the light.
        read_noise: standard deviation in the dark by day, in levels of 255 of linear light.
        night_gain: the sensor's gain at night, as a multiple of that by day. Shot noise grows with its root,
            read noise with itself.
        jpeg_quality: 1 to 100; below 1 pictures are not compressed as JPEG.
        h264_kbps: bit rate of the camera's stream, kbit/s; below 1 pictures are not compressed as H.264,
            which needs the extra `h264`. Each picture is a key frame of its own, see `sensors.h264.Stream`.
    """

    shutter_s: float = 0.0
    readout_s: float = 0.0
    auto_exposure: float = 0.0
    adaptation_s: float = 1.0
    vignetting: float = 0.0
    glare: float = 0.0
    shot_noise: float = 0.0
    read_noise: float = 0.0
    night_gain: float = 4.0
    jpeg_quality: float = 0.0
    h264_kbps: float = 0.0

    __repr__ = short_repr

    def __post_init__(self) -> None:
        """Refuse values out of range.

        Raises:
            ConfigError: a value is not finite or out of its range, or pictures are compressed twice.
        """
        check_limits(self, IMAGING_LIMITS, "imaging")
        if min(self.jpeg_quality, self.h264_kbps) >= 1:
            raise ConfigError(
                f"imaging: jpeg_quality={self.jpeg_quality:g} and h264_kbps={self.h264_kbps:g}; give one"
            )

    @property
    def takes_time(self) -> bool:
        """Whether a picture is more than one instant."""
        return self.shutter_s > 0 or self.readout_s > 0

    @property
    def changes_light(self) -> bool:
        """Whether less, more or other light is seen than falls on the lens."""
        strongest = max(self.auto_exposure, self.vignetting, self.glare, self.shot_noise, self.read_noise)
        return strongest > 0

    @property
    def spoils_pictures(self) -> bool:
        """Whether a picture of one instant is changed."""
        return self.changes_light or max(self.jpeg_quality, self.h264_kbps) >= 1


IMAGING_LIMITS: Mapping[str, tuple[float, float]] = {
    "shutter_s": (0.0, 1.0),
    "readout_s": (0.0, 1.0),
    "auto_exposure": (0.0, 1.0),
    "adaptation_s": (0.0, 600.0),
    "vignetting": (0.0, 1.0),
    "glare": (0.0, 1.0),
    "shot_noise": (0.0, 100.0),
    "read_noise": (0.0, 100.0),
    "night_gain": (1.0, 1000.0),
    "jpeg_quality": (0.0, 100.0),
    "h264_kbps": (0.0, 100_000.0),
}

IMAGING_PRESETS: Mapping[str, Imaging] = {
    "ideal": Imaging(),
    "traffic_camera": Imaging(
        shutter_s=0.01,
        readout_s=0.016,
        auto_exposure=0.6,
        vignetting=0.25,
        glare=0.3,
        shot_noise=2.0,
        read_noise=0.3,
        jpeg_quality=75,
    ),
    "webcam": Imaging(
        shutter_s=0.025,
        readout_s=0.033,
        auto_exposure=0.8,
        adaptation_s=2.0,
        vignetting=0.4,
        glare=0.6,
        shot_noise=4.0,
        read_noise=0.8,
        jpeg_quality=40,
    ),
}
"""Camera bodies by name."""


def sample_imaging(ranges: Ranges, seed: int) -> Imaging:
    """Draw a camera body from ranges, each value uniform and on its own.

    Args:
        ranges: (low, high), or a number, by the name of a field of `Imaging`; the others keep their defaults.
        seed: the same seed and ranges give the same body.

    Returns:
        The camera body.

    Raises:
        ConfigError: a name is unknown or a range is empty or out of its limits.
    """
    random = np.random.default_rng([seed, crc32(b"imaging")])
    drawn: dict[str, Any] = draw_values(ranges, IMAGING_LIMITS, random, "imaging")
    return Imaging(**drawn)


def read_imaging(text: str) -> Imaging:
    """Read a name of `IMAGING_PRESETS`, or values such as `shutter_s=0.02,jpeg_quality=50`.

    Args:
        text: the name, or values with commas between.

    Returns:
        The camera body.

    Raises:
        ConfigError: it is neither, or a value is out of range.
    """
    if text in IMAGING_PRESETS:
        return IMAGING_PRESETS[text]
    values: dict[str, Any] = read_values(text, IMAGING_LIMITS, IMAGING_PRESETS, "imaging")
    return Imaging(**values)


def settle_imaging(wanted: "Imaging | Ranges | str", seed: int) -> Imaging:
    """Take a camera body, find it by its name, or draw it for an episode.

    Args:
        wanted: a camera body, its name, or ranges by the name of a field.
        seed: of what is drawn.

    Returns:
        The camera body.

    Raises:
        ConfigError: it is none of these, or out of its limits.
    """
    if isinstance(wanted, Imaging):
        return wanted
    if isinstance(wanted, str):
        return read_imaging(wanted)
    if isinstance(wanted, Mapping):
        return sample_imaging(wanted, seed)
    raise ConfigError(
        f"imaging={wanted!r}: expected Imaging, a name such as traffic_camera, or ranges by name"
    )
