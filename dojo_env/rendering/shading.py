"""How the static world looks: sun, sky and lamps on textured surfaces, sample by sample."""

from math import exp, floor, sqrt
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from dojo_env.rendering import textures
from dojo_env.rendering.compiling import inner, kernel
from dojo_env.rendering.lighting import SRGB

Floats = NDArray[np.float64]

LAMP_HEIGHT = 8.0
"""Metres; a street lamp this high lights the ground under it with 1."""
_SHADOW_BIAS = 0.12
_NEAR_GROUND = 0.35
"""Height of the surroundings above a place that closes it in fully, metres."""
_CLOSED_IN = 0.35
"""Share of the sky that such a place loses."""
_BARE = (0.14, 0.21, 0.076)
"""Linear colour of the ground beyond the map's edge."""
_KNEE = 0.55
"""Linear light from which brighter places are held back."""
_LAMP_COLOUR = (1.0, 0.72, 0.42)
_BEAM = (1.0, 0.95, 0.82)
_WINDOW = (1.0, 0.78, 0.45)
_GRASS, _ASPHALT, _PAVING, _PAINT, _BALLAST, _FACADE, _FOLIAGE, _WATER = 1, 2, 3, 4, 5, 6, 7, 8
_SUN, _SUN_COLOUR, _SKY_COLOUR, _GROUND_COLOUR, _ZENITH, _HORIZON, _WEATHER = range(7)
"""Rows of the packed light; the last holds head lamps, wetness and fog."""


class HeightMap(NamedTuple):
    """The scene as parallel light along an axis sees it.

    Attributes:
        heights: (n, n) float32, along the last axis of `frame`; -inf where there is nothing.
        place: (3,) pixels per metre, and the middle's first two coordinates in `frame`.
        frame: (3, 3) rows are the axes, scene frame.
    """

    heights: NDArray[np.float32]
    place: Floats
    frame: Floats


class Surroundings(NamedTuple):
    """All that decides how a static face looks.

    Attributes:
        normals: (m, 3) of the scene's faces.
        surfaces: (m,) `Surface`.
        colours: (m, 3) linear.
        light: (7, 3) rows as `pack_light` makes them.
        sun: the scene as the sun sees it.
        around: the smoothed heights of the scene seen from above.
        lamps: (k, 3) street lamps, metres, scene frame.
        ground: height of the ground beyond the map's edge, metres.
    """

    normals: Floats
    surfaces: NDArray[np.uint8]
    colours: NDArray[np.float32]
    light: Floats
    sun: HeightMap
    around: HeightMap
    lamps: Floats
    ground: float


@inner
def expose(light):
    """Bring linear light into 0 to 1: as it is in the dark, and ever less as it nears white, as film does."""
    if light <= _KNEE:
        return light
    return 1.0 - (1.0 - _KNEE) * exp((_KNEE - light) / (1.0 - _KNEE))


@kernel
def shade(depths, tags, view, world, samples, pictures):
    """Turn a visibility buffer into pictures.

    Args:
        depths: (h * samples, w * samples) float32 inverse depths.
        tags: the same shape, int32, the face at each sample, -1 for none.
        view: the `View` of these samples.
        world: the `Surroundings`.
        samples: along each side of a pixel.
        pictures: (3, h, w, 3) uint8 to fill: lit, shaded by something that moves, in the light of head lamps.
    """
    weight = 1.0 / (samples * samples)
    sums, shown, scratch = np.empty((3, 3)), np.empty((3, 3)), np.empty((3, 3))
    for row in range(pictures.shape[1]):
        for column in range(pictures.shape[2]):
            sums[:] = 0.0
            for sample in range(samples * samples):
                v, u = row * samples + sample // samples, column * samples + sample % samples
                _shade_sample(tags[v, u], depths[v, u], u, v, view, world, scratch, shown)
                for picture in range(3):
                    for c in range(3):
                        sums[picture, c] += weight * expose(shown[picture, c])
            for picture in range(3):
                for c in range(3):
                    pictures[picture, row, column, c] = SRGB[int(sums[picture, c] * 4095.0 + 0.5)]


@inner
def _shade_sample(face, depth, u, v, view, world, scratch, shown):
    """Colour what one sample sees, three times."""
    ray, normal, place = scratch[0], scratch[1], scratch[2]
    length = _cast(u, v, view, ray)
    distance = length / depth if face >= 0 else np.inf
    if face < 0 and ray[2] < -1e-4 and view.eye[2] > world.ground:
        distance = (view.eye[2] - world.ground) / -ray[2]
    if distance > 1e8:
        for c in range(3):
            shown[0, c] = shown[1, c] = shown[2, c] = _sky(ray, world.light, c)
        return
    for axis in range(3):
        place[axis] = view.eye[axis] + distance * ray[axis]
        normal[axis] = world.normals[face, axis] if face >= 0 else (1.0 if axis == 2 else 0.0)
    if normal[0] * ray[0] + normal[1] * ray[1] + normal[2] * ray[2] > 0.0:
        for axis in range(3):
            normal[axis] = -normal[axis]
    surface = world.surfaces[face] if face >= 0 else _GRASS
    _light_surface(face, surface, place, normal, distance / view.lens[0], world, shown)
    mirror = _mirrored(surface, place, normal, ray, distance / view.lens[0], world.light[_WEATHER, 1])
    fog = 1.0 - exp(-world.light[_WEATHER, 2] * distance)
    veil = max(fog, 1.0 - exp(-max(0.0, distance - 300.0) / 1500.0))
    for picture in range(3):
        for c in range(3):
            horizon = world.light[_HORIZON, c]
            value = shown[picture, c] * (1.0 - mirror) + mirror * horizon
            shown[picture, c] = value * (1.0 - veil) + veil * horizon


@inner
def _cast(u, v, view, ray):
    """Compute the unit vector through a sample; returns how far one metre along the axis is along it."""
    a, b = (u + 0.5 - view.lens[1]) / view.lens[0], (v + 0.5 - view.lens[2]) / view.lens[0]
    length = sqrt(a * a + b * b + 1.0)
    for axis in range(3):
        ray[axis] = (view.axes[0, axis] * a + view.axes[1, axis] * b + view.axes[2, axis]) / length
    return length


@inner
def _sky(ray, light, c):
    """Colour of the sky along a ray: from the horizon's to the zenith's, brighter towards the sun."""
    share = 1.0 - exp(-5.0 * max(0.0, ray[2]))
    towards = ray[0] * light[_SUN, 0] + ray[1] * light[_SUN, 1] + ray[2] * light[_SUN, 2]
    glow = 0.25 * max(0.0, towards) ** 24 * light[_SUN_COLOUR, c]
    return light[_HORIZON, c] * (1.0 - share) + light[_ZENITH, c] * share + glow


@inner
def _light_surface(face, surface, place, normal, pixel, world, shown):
    """Light a place: in the open, in the shadow of something that moves, and in front of head lamps."""
    light = world.light
    headlights = light[_WEATHER, 0]
    tone, window = _tone(surface, place, normal, pixel, light[_WEATHER, 1])
    if window >= 0.0:
        for c in range(3):
            seen = 0.35 * light[_HORIZON, c] + 0.04 * light[_SKY_COLOUR, c]
            seen += headlights * 0.55 * _WINDOW[c] * (window > 0.55)
            shown[0, c] = shown[1, c] = shown[2, c] = seen
        return
    facing = normal[0] * light[_SUN, 0] + normal[1] * light[_SUN, 1] + normal[2] * light[_SUN, 2]
    reached = facing * _sunlit(place, normal, world.sun) if facing > 0.0 else 0.0
    over = _lookup(world.around, place[0], place[1]) - place[2]
    open_sky = 1.0 - _CLOSED_IN * min(1.0, max(0.0, over / _NEAR_GROUND))
    up = 0.5 + 0.5 * normal[2]
    lamps = headlights * _lamp_light(place, normal, world.lamps) if headlights > 0.0 else 0.0
    for c in range(3):
        albedo = tone * (world.colours[face, c] if face >= 0 else _BARE[c])
        soft = open_sky * (up * light[_SKY_COLOUR, c] + (1.0 - up) * light[_GROUND_COLOUR, c])
        soft += lamps * _LAMP_COLOUR[c]
        shown[0, c] = albedo * (soft + reached * light[_SUN_COLOUR, c])
        shown[1, c] = albedo * soft * (0.62 if reached == 0.0 else 0.8)
        shown[2, c] = shown[0, c] + albedo * headlights * 1.6 * _BEAM[c]


@inner
def _tone(surface, place, normal, pixel, wet):
    """Texture of a surface: brightness, and a number from 0 to 1 where there is a window, else -1."""
    x, y, z = place[0], place[1], place[2]
    level = normal[2] > 0.5
    tone, window = 1.0, -1.0
    if surface == _GRASS:
        tone = textures.grass(x, y, pixel)
    elif surface == _ASPHALT:
        tone = textures.asphalt(x, y, pixel)
    elif surface == _PAVING:
        tone = textures.paving(x, y, pixel) if level else 0.8
    elif surface == _PAINT:
        tone = textures.paint(x, y, pixel)
    elif surface == _BALLAST:
        tone = textures.ballast(x, y, pixel)
    elif surface == _FOLIAGE:
        tone = textures.foliage(x, y, z, pixel)
    elif surface == _FACADE:
        tone, window = textures.facade(x * -normal[1] + y * normal[0], z, level, pixel)
    if level and surface != _PAINT:
        tone *= 1.0 - 0.42 * wet
    return max(0.05, tone), window


@inner
def _mirrored(surface, place, normal, ray, pixel, wet):
    """Share of the sky's light that a wet street or water sends on."""
    flat = 1.0 - min(1.0, abs(ray[2]) * 1.3)
    if surface == _WATER:
        return 0.15 + 0.7 * flat**3
    if wet > 0.0 and normal[2] > 0.5 and _ASPHALT <= surface <= _PAINT:
        return wet * (0.03 + 0.55 * flat * flat) * textures.puddles(place[0], place[1], pixel)
    return 0.0


@inner
def _lookup(seen, x, y):
    """Read a height map at a place of its frame, nearest pixel; -inf outside."""
    size_y, size_x = seen.heights.shape
    column = floor(size_x / 2 + (x - seen.place[1]) * seen.place[0])
    row = floor(size_y / 2 - (y - seen.place[2]) * seen.place[0])
    if column < 0 or row < 0 or column >= size_x or row >= size_y:
        return -np.inf
    return seen.heights[row, column]


@inner
def _sunlit(place, normal, sun):
    """Share of a place that the sun reaches, over a small square of the shadow map."""
    step = 0.7 / sun.place[0]
    x = y = z = 0.0
    for axis in range(3):
        p = place[axis] + 0.04 * normal[axis]
        x += sun.frame[0, axis] * p
        y += sun.frame[1, axis] * p
        z += sun.frame[2, axis] * p
    reached = 0.0
    for i in range(-1, 2):
        for j in range(-1, 2):
            reached += _lookup(sun, x + i * step, y + j * step) < z + _SHADOW_BIAS
    return reached / 9.0


@inner
def _lamp_light(place, normal, lamps):
    """Light of street lamps, around 1 right under one."""
    total = 0.0
    for k in range(len(lamps)):
        x, y, z = lamps[k, 0] - place[0], lamps[k, 1] - place[1], lamps[k, 2] - place[2]
        square = x * x + y * y + z * z
        if 0.25 < square < 2500.0 and z > 0.0:
            facing = max(0.1, (x * normal[0] + y * normal[1] + z * normal[2]) / sqrt(square))
            total += facing * LAMP_HEIGHT * LAMP_HEIGHT / (square + 4.0) * (z / sqrt(square))
    return min(total, 1.6)
