"""Sun, sky and lamps: the light that conditions make, in linear sRGB."""

from dataclasses import dataclass
from math import acos, asin, cos, pi, radians, sin

import numpy as np
from numpy.typing import NDArray

from dojo_env.conditions import Conditions

Floats = NDArray[np.float64]

_LATITUDE = radians(50.9)
_DECLINATION = radians(17.0)
_LUT_SIZE = 4096


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Light:
    """What shines on the scene.

    Attributes:
        sun: (3,) unit vector towards the sun, or the moon at night; map frame.
        sun_colour: (3,) what reaches a surface that faces the sun.
        sky_colour: (3,) what the open sky sends to a level surface.
        ground_colour: (3,) what the ground sends up.
        zenith: (3,) colour of the sky overhead.
        horizon: (3,) colour of the sky at the horizon, and of the fog.
        headlights: 0 off to 1, as the brightness of vehicles' and street lamps.
        wet: 0 dry to 1 wet ground.
        fog: extinction per metre.
    """

    sun: Floats
    sun_colour: Floats
    sky_colour: Floats
    ground_colour: Floats
    zenith: Floats
    horizon: Floats
    headlights: float
    wet: float
    fog: float

    @property
    def packed(self) -> Floats:
        """(7, 3): the colours in the order above, and one row of head lamps, wetness and fog."""
        return np.array(
            [
                self.sun, self.sun_colour, self.sky_colour, self.ground_colour, self.zenith, self.horizon,
                [self.headlights, self.wet, self.fog],
            ]
        )  # fmt: skip


def compute_light(conditions: Conditions) -> Light:
    """Find the light of an hour and a weather. Source: the usual solar position, no refraction.

    Args:
        conditions: of these the hour, clouds, rain, fog and exposure count.

    Returns:
        What shines on the scene; at night the moon takes the sun's place.
    """
    elevation, azimuth = _sun_position(conditions.hour)
    day = _ramp(elevation, radians(-8.0), radians(12.0))
    low = (1.0 - _ramp(elevation, radians(0.0), radians(28.0))) * _ramp(elevation, radians(-9.0), 0.0)
    clouds = max(conditions.overcast, 0.85 * conditions.rain)
    warm = np.array([1.0, 0.92, 0.78]) * (1 - low) + np.array([1.0, 0.55, 0.25]) * low
    direct = 1.35 * _ramp(elevation, radians(-1.0), radians(18.0)) * (1 - clouds) ** 1.5
    moon = 0.02 * (1 - day)
    gain = 2.0**conditions.exposure
    blue, grey = np.array([0.39, 0.47, 0.62]), np.array([0.5, 0.53, 0.57])
    dusk, night = np.array([0.66, 0.48, 0.44]), np.array([0.016, 0.02, 0.036])
    bright = (blue * (1 - clouds) + 1.25 * grey * clouds) * (1 - 0.45 * conditions.rain)
    sky = (bright * (1 - low) + dusk * low) * day + night * (1 - day)
    glow = np.array([0.80, 0.42, 0.20]) * low * (1 - clouds)
    horizon = (np.array([0.68, 0.76, 0.84]) * (1 - clouds) + 0.9 * grey * clouds) * (1 - low) * day
    lamps = 1.0 - _ramp(elevation, radians(-4.0), radians(4.0))
    # Low sun would throw shadows without end; at night the moon takes its place.
    elevation = max(elevation, radians(4.0)) if elevation > radians(-1.0) else radians(50.0)
    return Light(
        sun=np.array([cos(elevation) * cos(azimuth), cos(elevation) * sin(azimuth), sin(elevation)]),
        sun_colour=gain * (warm * direct + moon),
        sky_colour=gain * sky,
        ground_colour=gain * sky * np.array([0.32, 0.30, 0.26]),
        zenith=gain * sky * (0.7 * (1 - clouds) + 1.1 * clouds),
        horizon=gain * (horizon + glow + sky * low + 1.2 * night),
        headlights=gain * lamps,
        wet=min(1.0, 2.0 * conditions.rain),
        fog=conditions.fog + 0.004 * conditions.rain,
    )


def _sun_position(hour: float) -> tuple[float, float]:
    """Elevation and azimuth (counter-clockwise from east), radians."""
    turn = (hour - 12.0) / 12.0 * pi
    height = sin(_LATITUDE) * sin(_DECLINATION) + cos(_LATITUDE) * cos(_DECLINATION) * cos(turn)
    elevation = asin(height)
    side = (sin(_DECLINATION) - height * sin(_LATITUDE)) / max(1e-9, cos(elevation) * cos(_LATITUDE))
    from_north = acos(min(1.0, max(-1.0, side)))
    return elevation, pi / 2 - (from_north if turn < 0 else 2 * pi - from_north)


def _ramp(value: float, low: float, high: float) -> float:
    share = min(1.0, max(0.0, (value - low) / (high - low)))
    return share * share * (3 - 2 * share)


def _srgb_table() -> NDArray[np.uint8]:
    linear = np.arange(_LUT_SIZE) / (_LUT_SIZE - 1)
    encoded = np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * linear ** (1 / 2.4) - 0.055)
    return np.round(encoded * 255).astype(np.uint8)


def to_linear(colours: NDArray[np.uint8] | Floats) -> Floats:
    """Turn sRGB bytes into linear light. Source: IEC 61966-2-1.

    Args:
        colours: of any shape, 0 to 255.

    Returns:
        The same shape, 0 to 1.
    """
    encoded = np.asarray(colours, dtype=np.float64) / 255
    return np.where(encoded <= 0.04045, encoded / 12.92, ((encoded + 0.055) / 1.055) ** 2.4)


SRGB = _srgb_table()
"""Linear light from 0 to 1 in 4,096 steps as sRGB bytes. Source: IEC 61966-2-1."""
