"""Light, weather, and what they and time do to cameras; how to sample it for domain randomisation.

How a camera works by itself, from its shutter to its compression, is `imaging`.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from dojo_env.errors import ConfigError
from dojo_env.ranges import Ranges, check_limits, draw_values, read_values
from dojo_maps.short_repr import short_repr

LOOKS = ("street", "plain")
"""How what moves is drawn: as well as we can, or in fewer faces that mirror nothing, for speed."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Conditions:
    """One state of the world outside and of cameras in it; the default is clear noon, and clean, still ones.

    Attributes:
        hour: solar time, 0 to 24; the sun stands as over Cologne in May, and under the horizon it is night.
        overcast: 0 clear sky to 1 closed clouds.
        rain: 0 dry to 1 heavy rain; streets are wet.
        fog: extinction per metre; 0.01 leaves 37 % of the contrast after 100 m.
        exposure: stops above or below the automatic exposure.
        noise: standard deviation of the cameras' noise, in levels of 255.
        blur: standard deviation of the blur, pixels.
        dirt: 0 clean lens to 1 very dirty.
        drops: rain drops on the lens, 0 none to 1 as many as hold.
        shake_m: standard deviation of each camera's offset from its place, metres; one draw per episode.
        shake_deg: standard deviation of each camera's turn from its direction, degrees; one draw per episode.
        sway_deg: standard deviation of each camera's turn from there, degrees; one draw per picture.
        dropped: probability that a camera delivers its last frame again.
        seed: of everything drawn at random here.
    """

    hour: float = 12.0
    overcast: float = 0.0
    rain: float = 0.0
    fog: float = 0.0
    exposure: float = 0.0
    noise: float = 0.0
    blur: float = 0.0
    dirt: float = 0.0
    drops: float = 0.0
    shake_m: float = 0.0
    shake_deg: float = 0.0
    sway_deg: float = 0.0
    dropped: float = 0.0
    seed: int = 0

    __repr__ = short_repr

    def __post_init__(self) -> None:
        """Refuse values out of range.

        Raises:
            ConfigError: a value is not finite or out of its range.
        """
        check_limits(self, LIMITS, "conditions")

    @property
    def outside(self) -> tuple[float, ...]:
        """What of it changes the light and the weather, rather than the cameras."""
        return (self.hour, self.overcast, self.rain, self.fog, self.exposure)

    @property
    def spoils_pictures(self) -> bool:
        """Whether cameras deliver anything but perfect pictures of this world."""
        return max(self.rain, self.dirt, self.drops, self.blur, self.noise, self.dropped) > 0


LIMITS: Mapping[str, tuple[float, float]] = {
    "hour": (0.0, 24.0),
    "overcast": (0.0, 1.0),
    "rain": (0.0, 1.0),
    "fog": (0.0, 1.0),
    "exposure": (-5.0, 5.0),
    "noise": (0.0, 100.0),
    "blur": (0.0, 20.0),
    "dirt": (0.0, 1.0),
    "drops": (0.0, 1.0),
    "shake_m": (0.0, 5.0),
    "shake_deg": (0.0, 45.0),
    "sway_deg": (0.0, 5.0),
    "dropped": (0.0, 1.0),
    "seed": (0, 2**63 - 1),
}
_NAMES = tuple(name for name in LIMITS if name != "seed")


PRESETS: Mapping[str, Conditions] = {
    "day": Conditions(),
    "dusk": Conditions(hour=20.0),
    "night": Conditions(hour=23.0),
    "rain": Conditions(overcast=1.0, rain=0.6),
    "fog": Conditions(overcast=0.8, fog=0.02),
}
"""Conditions by name."""


def sample_conditions(ranges: Ranges, seed: int) -> Conditions:
    """Draw one state from ranges, each value uniform and on its own.

    Args:
        ranges: (low, high), or a number, by the name of a field of `Conditions`; others keep their defaults.
        seed: the same seed and ranges give the same conditions.

    Returns:
        The conditions, with the seed.

    Raises:
        ConfigError: a name is unknown or a range is empty or out of its limits.
    """
    drawn: dict[str, Any] = draw_values(ranges, _NAMES, np.random.default_rng(seed), "conditions")
    return Conditions(**drawn, seed=seed)


def read_conditions(text: str) -> Conditions:
    """Read a name of `PRESETS`, or values such as `hour=20,rain=0.4`.

    Args:
        text: the name, or values with commas between.

    Returns:
        The conditions.

    Raises:
        ConfigError: it is neither, or a value is out of range.
    """
    if text in PRESETS:
        return PRESETS[text]
    values: dict[str, Any] = read_values(text, _NAMES, PRESETS, "conditions")
    return Conditions(**values)


def settle_conditions(wanted: "Conditions | Ranges | str", seed: int) -> Conditions:
    """Take conditions, find them by their name, or draw them for an episode.

    Args:
        wanted: conditions, what `read_conditions` reads, or ranges by the name of a field.
        seed: of what is drawn.

    Returns:
        The conditions.

    Raises:
        ConfigError: it is none of these, or out of its limits.
    """
    if isinstance(wanted, Conditions):
        return wanted
    if isinstance(wanted, str):
        return read_conditions(wanted)
    if isinstance(wanted, Mapping):
        return sample_conditions(wanted, seed)
    raise ConfigError(f"conditions={wanted!r}: expected Conditions, a name such as night, or ranges by name")
