"""How the static world looks: sun, sky and lamps on textured surfaces, sample by sample."""

from math import exp, floor, sqrt
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from dojo_env.rendering import textures
from dojo_env.rendering.compiling import inner, kernel
from dojo_env.rendering.lanes import LaneMap, find_lane
from dojo_env.rendering.lighting import SRGB

Floats = NDArray[np.float64]

LAMP_HEIGHT = 8.0
"""Metres; a street lamp this high lights the ground under it with 1."""
_SHADOW_BIAS = 0.1
_NEAR_GROUND = 0.35
"""Height of the surroundings above a place that closes it in fully, metres."""
_BEFORE = 0.9
"""How far before a wall its surroundings are looked at, so that it is not among them, metres."""
_CLOSED_IN = 0.35
"""Share of the sky that such a place loses."""
_BARE = (0.14, 0.21, 0.076)
"""Linear colour of the ground beyond the map's edge."""
_WOODS, _CLEAR_WOODS, _WOODS_AWAY = (0.10, 0.16, 0.08), 0.55, 800.0
"""Linear colour of woods at the horizon, the share of it that clear air lets through, and metres to them."""
_KNEE = 0.55
"""Linear light from which brighter places are held back."""
_LAMP_COLOUR = (1.0, 0.82, 0.58)
_BEAM = (1.0, 0.95, 0.82)
_WINDOW = (1.0, 0.78, 0.45)
_LIT_WINDOWS = 0.55
"""Share of the panes that are dark at night."""
_LEVEL = 0.95
"""Upward part of the normal of level roofs."""
_INDOORS = 0.6
"""Share of the sky's light that reaches what hangs or stands behind a pane."""
_STREET = 0.16
"""What panes mirror where they do not show the sky, as a share of its light."""
_GRASS, _ASPHALT, _PAVING, _PAINT, _BALLAST, _FACADE, _FOLIAGE, _WATER, _GLASS = 1, 2, 3, 4, 5, 6, 7, 8, 10
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
        things: (m, 6) of the thing that each face belongs to, as `Scene.things`.
        light: (7, 3) rows as `Light.packed` has them.
        sun: the scene as the sun sees it.
        around: the smoothed heights of the scene seen from above.
        lanes: where lanes run.
        lamps: (k, 3) street lamps, metres, scene frame.
        ground: height of the ground beyond the map's edge, metres.
    """

    normals: Floats
    surfaces: NDArray[np.uint8]
    colours: NDArray[np.float32]
    things: NDArray[np.float32]
    light: Floats
    sun: HeightMap
    around: HeightMap
    lanes: LaneMap
    lamps: Floats
    ground: float


@inner
def expose(light):
    """Bring linear light into 0 to 1: as it is in the dark, and ever less as it nears white, as film does.

    Args:
        light: of one channel, 0 or more; 1 is white without this.

    Returns:
        0 to 1, linear.
    """
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
        pictures: (3, h, w, 3) uint8 to fill: lit, shaded by something that moves, in the light of head lamps;
            the last one stays as it is by day.
    """
    sums, shown, scratch, lane = np.empty((3, 3)), np.empty((3, 3)), np.empty((4, 3)), np.empty(5)
    count = 3 if world.light[_WEATHER, 0] > 0.0 else 2
    for row in range(pictures.shape[1]):
        for column in range(pictures.shape[2]):
            sums[:] = 0.0
            step = _sample_step(tags, row * samples, column * samples, samples)
            taken = 0
            for sample in range(step // 2, samples * samples, step):
                taken += 1
                v, u = row * samples + sample // samples, column * samples + sample % samples
                _shade_sample(tags[v, u], depths[v, u], u, v, view, world, scratch, lane, shown)
                for picture in range(count):
                    for c in range(3):
                        sums[picture, c] += expose(shown[picture, c])
            for picture in range(count):
                for c in range(3):
                    pictures[picture, row, column, c] = SRGB[int(sums[picture, c] / taken * 4095.0 + 0.5)]


@inner
def _sample_step(tags, top, left, samples):
    """Tell which samples of a pixel to shade: all where faces meet, else every second one or so."""
    face = tags[top, left]
    for v in range(top, top + samples):
        for u in range(left, left + samples):
            if tags[v, u] != face:
                return 1
    return max(1, samples - 1)


@inner
def _shade_sample(face, depth, u, v, view, world, scratch, lane, shown):
    """Colour what one sample sees, three times."""
    ray, normal, place, sky = scratch[0], scratch[1], scratch[2], scratch[3]
    length = _cast(u, v, view, ray)
    distance = length / depth if face >= 0 else np.inf
    if face < 0 and ray[2] < -1e-4 and view.eye[2] > world.ground:
        distance = (view.eye[2] - world.ground) / -ray[2]
    if distance > 1e8:
        _far_away(ray[0], ray[1], ray[2], world.light, sky)
        for c in range(3):
            shown[0, c] = shown[1, c] = shown[2, c] = sky[c]
        return
    for axis in range(3):
        place[axis] = view.eye[axis] + distance * ray[axis]
        normal[axis] = world.normals[face, axis] if face >= 0 else (1.0 if axis == 2 else 0.0)
    if normal[0] * ray[0] + normal[1] * ray[1] + normal[2] * ray[2] > 0.0:
        for axis in range(3):
            normal[axis] = -normal[axis]
    surface = world.surfaces[face] if face >= 0 else _GRASS
    pixel = distance / view.lens[0]
    if surface == _FOLIAGE:
        textures.ruffle(place[0], place[1], place[2], pixel, normal)
    tone, pane = _tone(surface, face, place, normal, pixel, world, lane)
    if pane >= 0.0:
        _show_pane(pane, tone, normal, ray, world.light, sky, shown)
    else:
        _light_surface(face, tone, place, normal, world, shown)
    _mirror(surface, place, normal, ray, pixel, world, sky, shown)
    fog = 1.0 - exp(-world.light[_WEATHER, 2] * distance)
    veil = max(fog, 1.0 - exp(-max(0.0, distance - 200.0) / 1500.0))
    for picture in range(3):
        for c in range(3):
            shown[picture, c] += veil * (world.light[_HORIZON, c] - shown[picture, c])


@inner
def _cast(u, v, view, ray):
    """Compute the unit vector through a sample; returns how far one metre along the axis is along it."""
    a, b = (u + 0.5 - view.lens[1]) / view.lens[0], (v + 0.5 - view.lens[2]) / view.lens[0]
    length = sqrt(a * a + b * b + 1.0)
    for axis in range(3):
        ray[axis] = (view.axes[0, axis] * a + view.axes[1, axis] * b + view.axes[2, axis]) / length
    return length


@inner
def _sky(x, y, z, light, found):
    """Find the sky's colour along a ray: from the horizon's to the zenith's, brighter towards the sun."""
    share = 1.0 - exp(-5.0 * max(0.0, z))
    towards = x * light[_SUN, 0] + y * light[_SUN, 1] + z * light[_SUN, 2]
    glow = 0.25 * max(0.0, towards) ** 24
    hidden = 0.0
    if z >= 0.03:
        hidden = textures.clouds(1.1 * x / (z + 0.12), 1.1 * y / (z + 0.12)) * min(1.0, 4.0 * (z - 0.03))
    for c in range(3):
        clear = light[_HORIZON, c] * (1.0 - share) + light[_ZENITH, c] * share + glow * light[_SUN_COLOUR, c]
        white = light[_HORIZON, c] + 0.15 * light[_SUN_COLOUR, c]
        found[c] = clear + hidden * (white - clear)


@inner
def _far_away(x, y, z, light, found):
    """Find the colour of what is farther than the map: woods and hills in the haze, over them the sky."""
    level = sqrt(x * x + y * y)
    if level == 0.0 or z > level * textures.woods(x / level, y / level):
        _sky(x, y, z, light, found)
        return
    clear = _CLEAR_WOODS * exp(-_WOODS_AWAY * light[_WEATHER, 2])
    for c in range(3):
        found[c] = light[_HORIZON, c] + clear * (_WOODS[c] * light[_SKY_COLOUR, c] - light[_HORIZON, c])


@inner
def _show_pane(pane, tone, normal, ray, light, sky, shown):
    """Show a window: what it mirrors over what is behind it, or at night somebody's lamp."""
    along = normal[0] * ray[0] + normal[1] * ray[1] + normal[2] * ray[2]
    x, y, z = (
        ray[0] - 2.0 * along * normal[0],
        ray[1] - 2.0 * along * normal[1],
        ray[2] - 2.0 * along * normal[2],
    )
    mirrored = 0.1 + 0.9 * (1.0 - min(1.0, abs(along))) ** 5
    opens = min(1.0, max(0.0, 4.0 * z + 0.3))
    _sky(x, y, z, light, sky)
    for c in range(3):
        behind = (0.03 + 0.12 * (pane < 0.3) + _INDOORS * tone) * light[_SKY_COLOUR, c]
        behind += light[_WEATHER, 0] * 0.6 * _WINDOW[c] * (pane > _LIT_WINDOWS)
        street = _STREET * light[_SKY_COLOUR, c]
        seen = street + opens * (sky[c] - street)
        value = behind + (mirrored + 0.25 * mirrored * pane) * (seen - behind)
        shown[0, c] = shown[1, c] = shown[2, c] = value


@inner
def _light_surface(face, tone, place, normal, world, shown):
    """Light a place: in the open, in the shadow of something that moves, and in front of head lamps."""
    light = world.light
    headlights = light[_WEATHER, 0]
    facing = normal[0] * light[_SUN, 0] + normal[1] * light[_SUN, 1] + normal[2] * light[_SUN, 2]
    reached = facing * _sunlit(place, normal, facing, world.sun) if facing > 0.02 else 0.0
    over = _lookup(world.around, place[0] + _BEFORE * normal[0], place[1] + _BEFORE * normal[1]) - place[2]
    open_sky = 1.0 - _CLOSED_IN * min(1.0, max(0.0, over / _NEAR_GROUND))
    up = 0.5 + 0.5 * normal[2]
    lamps = headlights * _lamp_light(place, normal, world.lamps) if headlights > 0.0 else 0.0
    for c in range(3):
        albedo = tone * (world.colours[face, c] if face >= 0 else _BARE[c])
        soft = open_sky * (up * light[_SKY_COLOUR, c] + (1.0 - up) * light[_GROUND_COLOUR, c])
        soft += lamps * _LAMP_COLOUR[c]
        shown[0, c] = albedo * (soft + reached * light[_SUN_COLOUR, c])
        shown[1, c] = albedo * soft
        shown[2, c] = shown[0, c] + albedo * headlights * 2.4 * _BEAM[c]


@inner
def _tone(surface, face, place, normal, pixel, world, lane):
    """Texture of a surface: brightness, and a number from 0 to 1 where there is a pane of glass, else -1."""
    x, y, z = place[0], place[1], place[2]
    level, along = normal[2] > 0.5, place[1] * normal[0] - place[0] * normal[1]
    tone, pane = 1.0, -1.0
    if surface == _GRASS:
        tone = textures.grass(x, y, pixel)
    elif surface == _ASPHALT or surface == _PAINT:  # noqa: PLR1714, SIM109 - numba makes a search of `in`
        find_lane(x, y, world.lanes, lane)
        tone = (
            textures.asphalt(x, y, lane, pixel) if surface == _ASPHALT else textures.paint(x, y, lane, pixel)
        )
    elif surface == _PAVING:
        tone = textures.paving(x, y, pixel) if level else textures.kerb(along, pixel)
    elif surface == _BALLAST:
        tone = textures.ballast(x, y, pixel)
    elif surface == _FOLIAGE:
        high = (z - world.things[face, 0]) / max(1.0, world.things[face, 1] - world.things[face, 0])
        tone = textures.foliage(x, y, z, pixel) * (0.62 + 0.43 * high)
    elif surface == _FACADE and normal[2] > 0.2:
        across = sqrt(max(1e-6, 1.0 - normal[2] ** 2))
        tone = (
            textures.tiles(along / across, z, pixel) if normal[2] < _LEVEL else textures.gravel(x, y, pixel)
        )
    elif surface == _FACADE:
        foot, top, number = world.things[face, 0], world.things[face, 1], world.things[face, 2]
        by_x, by_y = world.things[face, 4], world.things[face, 5]
        left = world.things[face, 3] + by_x * x + by_y * y - z
        slope = by_y * normal[0] - by_x * normal[1]
        tone, pane = textures.facade(along, z - foot, left, slope, top - foot, number, pixel)
    elif surface == _GLASS:
        pane = 0.2
    if level:
        tone *= 1.0 - (0.2 if surface == _PAINT else 0.45) * world.light[_WEATHER, 1]
    return max(0.05, tone), pane


@inner
def _mirror(surface, place, normal, ray, pixel, world, sky, shown):
    """Add what water and wet ground send on: the sky, and long streaks under lamps."""
    wet = world.light[_WEATHER, 1]
    if normal[2] <= 0.9 or (surface != _WATER and (wet == 0.0 or surface == _GRASS)):
        return
    facing = min(1.0, max(0.0, -ray[2]))
    share = 0.04 + 0.96 * (1.0 - facing) ** 5
    if surface != _WATER:
        share *= 0.75 * wet * textures.puddles(place[0], place[1], pixel)
    lamps = world.light[_WEATHER, 0]
    streak = 6.0 * lamps * _streaks(place, ray, world.lamps) if lamps > 0.0 else 0.0
    _sky(ray[0], ray[1], -ray[2], world.light, sky)
    for c in range(3):
        for picture in range(3):
            shown[picture, c] += share * (sky[c] + streak * _LAMP_COLOUR[c] - shown[picture, c])


@inner
def _streaks(place, ray, lamps):
    """How brightly rough wet ground mirrors street lamps: along the line of sight they are drawn out."""
    total = 0.0
    for k in range(len(lamps)):
        x, y, z = lamps[k, 0] - place[0], lamps[k, 1] - place[1], lamps[k, 2] - place[2]
        square = x * x + y * y + z * z
        if 1.0 < square < 6400.0:
            far = 1.0 / sqrt(square)
            x, y, z = x * far - ray[0], y * far - ray[1], z * far - ray[2]
            total += (z * z / (x * x + y * y + z * z)) ** 60
    return min(2.0, total)


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
def _sunlit(place, normal, facing, sun):
    """Share of a place that the sun reaches, over three by three pixels of the shadow map, weighted smoothly.

    The map's heights are compared with the plane of the surface, so that it does not shade itself.
    """
    x = y = z = across = along = 0.0
    for axis in range(3):
        p = place[axis] + 0.04 * normal[axis]
        x += sun.frame[0, axis] * p
        y += sun.frame[1, axis] * p
        z += sun.frame[2, axis] * p
        across -= sun.frame[0, axis] * normal[axis]
        along -= sun.frame[1, axis] * normal[axis]
    size_y, size_x = sun.heights.shape
    u, v = (
        size_x / 2 + (x - sun.place[1]) * sun.place[0] - 0.5,
        size_y / 2 - (y - sun.place[2]) * sun.place[0] - 0.5,
    )
    left, top = floor(u), floor(v)
    if left < 1 or top < 1 or left + 2 >= size_x or top + 2 >= size_y:
        return 1.0
    u, v = u - left, v - top
    across, along = across / facing / sun.place[0], along / facing / sun.place[0]
    reached = 0.0
    for i in range(-1, 3):
        wide = 1.0 - u if i < 0 else (u if i == 2 else 1.0)
        for j in range(-1, 3):
            high = 1.0 - v if j < 0 else (v if j == 2 else 1.0)
            plane = z + across * (i - u) - along * (j - v)
            reached += wide * high * (sun.heights[top + j, left + i] < plane + _SHADOW_BIAS)
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
