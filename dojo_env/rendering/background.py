"""The static world as one camera sees it: drawn once, with textures, shadows and smooth edges."""

from dataclasses import dataclass
from math import exp, floor, sqrt

import cv2
import numpy as np
from numpy.typing import NDArray

from dojo_env.rendering import textures
from dojo_env.rendering.classes import Semantic
from dojo_env.rendering.lighting import Light, srgb_table
from dojo_env.rendering.raster import draw_from_above, draw_mesh, kernel
from dojo_env.rendering.scene import Scene

Floats = NDArray[np.float64]
Picture = NDArray[np.uint8]

SAMPLES = 3
"""Samples along each side of a pixel; odd, so that the middle one is the pixel's own."""
_SHADOW_MAP = 2048
_HEIGHT_MAP = 1024
_SHADOW_REACH = 150.0
"""Farthest from the middle of the view that shadows are kept, metres."""
_SHADOW_BIAS = 0.12
_NEAR_GROUND = 0.35
"""Height difference to the surroundings that darkens a place fully, metres."""
_CLOSED_IN = 0.35
"""Share of the sky that a corner loses."""
_LAMP_HEIGHT = 8.0
_BARE = (0.14, 0.21, 0.076)
"""Linear colour of the ground beyond the map's edge."""
_LAMP_COLOUR = (1.0, 0.72, 0.42)
_BEAM = (1.0, 0.95, 0.82)
_WINDOW = (1.0, 0.78, 0.45)
_GRASS, _ASPHALT, _PAVING, _PAINT, _BALLAST, _FACADE, _FOLIAGE, _WATER = 1, 2, 3, 4, 5, 6, 7, 8


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class View:
    """A camera in the scene's frame, as kernels take it.

    Attributes:
        eye: (3,) metres.
        axes: (3, 3) rows right, down, forward.
        lens: (5,) focal length (pixels), middle (x, y), near, far.
        height: pixels.
        width: pixels.
    """

    eye: Floats
    axes: Floats
    lens: Floats
    height: int
    width: int

    def scaled(self, factor: int) -> "View":
        """The same view with more pixels."""
        lens = self.lens * np.array([factor, factor, factor, 1.0, 1.0])
        return View(
            eye=self.eye, axes=self.axes, lens=lens, height=self.height * factor, width=self.width * factor
        )


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Background:
    """What a camera sees of the static world.

    Attributes:
        lit: (h, w, 3) sRGB.
        shaded: the same where something that moves keeps the sun away.
        headlit: the same in the full light of head lamps; by day the same array as `lit`.
        depths: (h, w) float32, 1 / metres along the axis, 0 for the sky.
        semantics: (h, w) `Semantic`.
    """

    lit: Picture
    shaded: Picture
    headlit: Picture
    depths: NDArray[np.float32]
    semantics: Picture


def draw_background(scene: Scene, view: View, light: Light) -> Background:
    """Draw the static world, nine samples a pixel."""
    fine = view.scaled(SAMPLES)
    depths = np.zeros((fine.height, fine.width), dtype=np.float32)
    tags = np.full((fine.height, fine.width), -1, dtype=np.int32)
    draw_mesh(scene.vertices, scene.faces, fine.axes, fine.eye, fine.lens, depths, tags)
    middle = SAMPLES // 2
    own = tags[middle::SAMPLES, middle::SAMPLES]
    semantics = np.append(scene.semantics, np.uint8(Semantic.SKY))[own]
    centre, reach = _extent(view, depths)
    sun_map = _look_down(scene, _towards(light.sun), centre, reach, _SHADOW_MAP)
    height_map = _look_down(scene, np.eye(3), centre, reach, _HEIGHT_MAP)
    heights, height_frame = height_map
    floor_level = np.where(np.isfinite(heights), heights, scene.ground).astype(np.float32)
    around = cv2.blur(floor_level, (_odd(1.2 * height_frame[0]),) * 2)
    lamps = street_lamps(scene, centre, reach) if light.headlights > 0 else np.empty((0, 3))
    pictures = np.zeros((3, view.height, view.width, 3), dtype=np.uint8)
    _shade(
        depths, tags, fine.eye, fine.axes, fine.lens, scene.normals, scene.surfaces, scene.colours,
        _light_rows(light), sun_map[0], sun_map[1], _towards(light.sun), around, height_frame,
        lamps, scene.ground, srgb_table(), pictures,
    )  # fmt: skip
    lit, shaded, headlit = pictures
    return Background(
        lit=lit,
        shaded=shaded,
        headlit=headlit if light.headlights > 0 else lit,
        depths=np.ascontiguousarray(depths[middle::SAMPLES, middle::SAMPLES]),
        semantics=semantics,
    )


def street_lamps(scene: Scene, centre: Floats, reach: float) -> Floats:
    """Hang a street lamp at every signal pole and every 30 m along roads: (n, 3), scene frame."""
    spots = [np.empty((0, 3))]
    for prop in scene.road_map.props:
        if prop.kind in ("pole", "street_lamp") and prop.position is not None:
            spots.append(np.array([prop.position]) - scene.origin)
    outermost = {road.lanes[0] for road in scene.road_map.roads if road.lanes}
    for lane in scene.road_map.lanes:
        if lane.id in outermost and len(lane.shape) > 1:
            steps = np.hypot(*np.diff(lane.shape[:, :2], axis=0).T)
            along = np.append(0.0, np.cumsum(steps))
            places = np.arange(15.0, along[-1], 30.0)
            line = lane.shape - scene.origin
            spots.append(np.column_stack([np.interp(places, along, line[:, axis]) for axis in range(3)]))
    lamps = np.concatenate(spots)
    near = np.hypot(*(lamps[:, :2] - centre[:2]).T) < reach + 40.0
    _, first = np.unique(np.round(lamps[near][:, :2] / 8.0), axis=0, return_index=True)
    return lamps[near][np.sort(first)] + [0.0, 0.0, _LAMP_HEIGHT]


def _extent(view: View, depths: NDArray[np.float32]) -> tuple[Floats, float]:
    """Middle and radius of the ground in view."""
    rows, columns = (np.linspace(0, n - 1, 24).astype(int) for n in depths.shape)
    y, x = np.meshgrid(rows, columns, indexing="ij")
    held = depths[y, x].ravel()
    far = 1.0 / np.maximum(held, 1.0 / 120.0)
    focal, middle_x, middle_y = view.lens[:3] * SAMPLES
    rays = np.column_stack([(x.ravel() - middle_x) / focal, (y.ravel() - middle_y) / focal, np.ones(x.size)])
    places = view.eye + (rays * far[:, None]) @ view.axes
    low, high = places.min(axis=0), places.max(axis=0)
    centre = (low + high) / 2
    return centre, float(min(_SHADOW_REACH, max(10.0, np.hypot(*(high - low)[:2]) / 2)))


def _towards(direction: Floats) -> Floats:
    """(3, 3): rows of a frame whose last axis points along a direction."""
    helper = np.array([0.0, 1.0, 0.0]) if abs(direction[1]) < 0.9 else np.array([1.0, 0.0, 0.0])
    right = np.cross(helper, direction)
    right /= np.linalg.norm(right)
    return np.array([right, np.cross(direction, right), direction])


def _look_down(
    scene: Scene, frame: Floats, centre: Floats, reach: float, size: int
) -> tuple[NDArray[np.float32], Floats]:
    """Draw the scene along the last axis of a frame: (size, size) heights, and (scale, x, y)."""
    heights = np.full((size, size), -np.inf, dtype=np.float32)
    tags = np.full((size, size), -1, dtype=np.int32)
    middle = frame @ centre
    place = np.array([size / 2 / (reach * 1.05), middle[0], middle[1]])
    draw_from_above(scene.vertices @ frame.T, scene.faces, place, heights, tags)
    return heights, place


def _odd(pixels: float) -> int:
    return 2 * int(pixels / 2) + 1


def _light_rows(light: Light) -> Floats:
    """Pack a light for the kernel."""
    return np.array(
        [
            light.sun, light.sun_colour, light.sky_colour, light.ground_colour, light.zenith, light.horizon,
            [light.headlights, light.wet, light.fog],
        ]
    )  # fmt: skip


@kernel
def _lookup(table, frame, x, y):
    """Read a map drawn from above at a place, nearest pixel; -inf outside."""
    size_y, size_x = table.shape
    column = int(floor(size_x / 2 + (x - frame[1]) * frame[0]))
    row = int(floor(size_y / 2 - (y - frame[2]) * frame[0]))
    if column < 0 or row < 0 or column >= size_x or row >= size_y:
        return -np.inf
    return table[row, column]


@kernel
def _sunlit(place, normal, sun_map, sun_place, sun_frame):
    """Share of a place that the sun reaches, over a small square of the shadow map."""
    step = 0.7 / sun_place[0]
    x = y = z = 0.0
    for axis in range(3):
        p = place[axis] + 0.04 * normal[axis]
        x += sun_frame[0, axis] * p
        y += sun_frame[1, axis] * p
        z += sun_frame[2, axis] * p
    reached = 0.0
    for i in range(-1, 2):
        for j in range(-1, 2):
            reached += _lookup(sun_map, sun_place, x + i * step, y + j * step) < z + _SHADOW_BIAS
    return reached / 9.0


@kernel
def _tone(surface, place, normal, pixel, wet):
    """Texture of a surface: brightness, and a number from 0 to 1 where there is a window, else -1."""
    x, y, z = place[0], place[1], place[2]
    window = -1.0
    tone = 1.0
    if surface == _GRASS:
        tone = textures.grass(x, y, pixel)
    elif surface == _ASPHALT:
        tone = textures.asphalt(x, y, pixel)
    elif surface == _PAVING:
        tone = textures.paving(x, y, pixel) if normal[2] > 0.5 else 0.8
    elif surface == _PAINT:
        tone = textures.paint(x, y, pixel)
    elif surface == _BALLAST:
        tone = textures.ballast(x, y, pixel)
    elif surface == _FOLIAGE:
        tone = textures.foliage(x, y, z, pixel)
    elif surface == _FACADE and abs(normal[2]) < 0.3:
        tone, window = textures.facade(x * -normal[1] + y * normal[0], z, pixel)
    elif surface == _FACADE:
        tone = 0.75
    if wet > 0.0 and normal[2] > 0.5 and surface != _PAINT:
        tone *= 1.0 - 0.42 * wet
    return max(0.05, tone), window


@kernel
def _lamp_light(place, normal, lamps):
    """Light of street lamps, around 1 right under one."""
    total = 0.0
    for k in range(len(lamps)):
        x, y, z = lamps[k, 0] - place[0], lamps[k, 1] - place[1], lamps[k, 2] - place[2]
        square = x * x + y * y + z * z
        if 0.25 < square < 2500.0 and z > 0.0:
            facing = max(0.1, (x * normal[0] + y * normal[1] + z * normal[2]) / sqrt(square))
            total += facing * _LAMP_HEIGHT * _LAMP_HEIGHT / (square + 4.0) * (z / sqrt(square))
    return min(total, 1.6)


@kernel
def _sky(ray, light, out):
    """Colour of the sky along a ray: from the horizon's to the zenith's, brighter towards the sun."""
    share = 1.0 - exp(-5.0 * max(0.0, ray[2]))
    towards = max(0.0, ray[0] * light[0, 0] + ray[1] * light[0, 1] + ray[2] * light[0, 2])
    for c in range(3):
        out[c] = light[5, c] * (1.0 - share) + light[4, c] * share + 0.25 * towards**24 * light[1, c]


@kernel
def _shade(
    depths, tags, eye, axes, lens, normals, surfaces, colours, light, sun_map, sun_place, sun_frame,
    around, around_place, lamps, ground, table, pictures,
):  # fmt: skip
    """Turn the visibility buffer into the lit, shaded and headlit pictures."""
    height, width = pictures.shape[1], pictures.shape[2]
    headlights, wet, fog = light[6, 0], light[6, 1], light[6, 2]
    sums = np.empty((3, 3))
    ray, place, normal, sky = np.empty(3), np.empty(3), np.empty(3), np.empty(3)
    weight = 1.0 / (SAMPLES * SAMPLES)
    for row in range(height):
        for column in range(width):
            sums[:] = 0.0
            for sample in range(SAMPLES * SAMPLES):
                v, u = row * SAMPLES + sample // SAMPLES, column * SAMPLES + sample % SAMPLES
                a, b = (u + 0.5 - lens[1]) / lens[0], (v + 0.5 - lens[2]) / lens[0]
                length = sqrt(a * a + b * b + 1.0)
                for axis in range(3):
                    ray[axis] = (axes[0, axis] * a + axes[1, axis] * b + axes[2, axis]) / length
                _sky(ray, light, sky)
                face = tags[v, u]
                distance = length / depths[v, u] if face >= 0 else 1e9
                surface = _GRASS
                normal[0], normal[1], normal[2] = 0.0, 0.0, 1.0
                if face >= 0:
                    surface = surfaces[face]
                    for axis in range(3):
                        normal[axis] = normals[face, axis]
                    if normal[0] * ray[0] + normal[1] * ray[1] + normal[2] * ray[2] > 0.0:
                        for axis in range(3):
                            normal[axis] = -normal[axis]
                elif ray[2] < -1e-4 and eye[2] > ground:
                    distance = (eye[2] - ground) / -ray[2]
                if distance > 1e8:
                    for picture in range(3):
                        for c in range(3):
                            sums[picture, c] += weight * min(1.0, sky[c])
                    continue
                for axis in range(3):
                    place[axis] = eye[axis] + distance * ray[axis]
                pixel = distance / lens[0]
                tone, window = _tone(surface, place, normal, pixel, wet)
                facing = max(0.0, normal[0] * light[0, 0] + normal[1] * light[0, 1] + normal[2] * light[0, 2])
                reached = 0.0
                if facing > 0.0:
                    reached = facing * _sunlit(place, normal, sun_map, sun_place, sun_frame)
                over = _lookup(around, around_place, place[0], place[1]) - place[2]
                open_sky = 1.0 - _CLOSED_IN * min(1.0, max(0.0, over / _NEAR_GROUND))
                up = 0.5 + 0.5 * normal[2]
                lamp = headlights * _lamp_light(place, normal, lamps) if headlights > 0.0 else 0.0
                mirror = 0.0
                if wet > 0.0 and normal[2] > 0.5:
                    mirror = wet * (0.05 + 0.6 * (1.0 - min(1.0, abs(ray[2]) * 1.6)) ** 3)
                if surface == _WATER:
                    mirror = 0.15 + 0.7 * (1.0 - min(1.0, abs(ray[2]))) ** 3
                veil = 1.0 - exp(-fog * distance)
                haze = max(veil, 1.0 - exp(-max(0.0, distance - 120.0) / 900.0))
                for c in range(3):
                    albedo = tone * (colours[face, c] if face >= 0 else _BARE[c])
                    soft = open_sky * (up * light[2, c] + (1.0 - up) * light[3, c])
                    soft += lamp * _LAMP_COLOUR[c]
                    value = albedo * (soft + reached * light[1, c])
                    dark = albedo * soft * (0.62 if reached == 0.0 else 0.8)
                    beam = value + albedo * headlights * 1.6 * _BEAM[c]
                    if window >= 0.0:
                        seen = 0.35 * light[5, c] + 0.04 * light[2, c]
                        seen += headlights * 0.55 * _WINDOW[c] * (window > 0.55)
                        value = dark = beam = seen
                    for picture in range(3):
                        shown = value if picture == 0 else (dark if picture == 1 else beam)
                        shown = shown * (1.0 - mirror) + mirror * light[5, c]
                        sums[picture, c] += weight * min(1.0, shown * (1.0 - haze) + haze * light[5, c])
            for picture in range(3):
                for c in range(3):
                    pictures[picture, row, column, c] = table[int(sums[picture, c] * 4095.0 + 0.5)]
