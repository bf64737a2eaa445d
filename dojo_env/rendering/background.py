"""The static world as one camera sees it: drawn once, with textures, shadows and smooth edges."""

import mmap
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.lib.stride_tricks import as_strided
from numpy.typing import NDArray

from dojo_env.rendering.classes import Semantic
from dojo_env.rendering.lanes import draw_lane_map
from dojo_env.rendering.lighting import Light
from dojo_env.rendering.raster import draw_from_above, draw_mesh
from dojo_env.rendering.scene import Scene
from dojo_env.rendering.shading import LAMP_HEIGHT, HeightMap, Surroundings, shade
from dojo_env.rendering.view import View
from dojo_maps.description import hung_lamp

Floats = NDArray[np.float64]
Picture = NDArray[np.uint8]
Depths = NDArray[np.float32]

SAMPLES = 3
"""Samples along each side of a pixel; odd, so that the middle one is the pixel's own."""
OWN = (slice(SAMPLES // 2, None, SAMPLES),) * 2
"""Rows and columns of the samples in the pixels' middles."""
_SHADOW_MAP = 2048
_HEIGHT_MAP = 768
_LANE_MAP = 1024
_SHADOW_REACH = 150.0
"""Farthest from the middle of the view that shadows are kept, metres."""
_SURROUNDINGS = 1.2
"""Side of the square over which heights are smoothed to tell what closes a place in, metres."""
_LINES = 64
"""Lines of the map of heights that are smoothed at once: few, so that little memory is taken."""
_LAMP_SPACING = 30.0
_LAMPS_APART = 8.0
_LAMP_POSTS = ("pole", "street_lamp")


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Background:
    """What a camera sees of the static world.

    Attributes:
        lit: (h, w, 3) sRGB.
        shaded: the same where something that moves keeps the sun away.
        headlit: the same in the full light of head lamps; by day the same array as `lit`.
        semantics: (h, w) `Semantic`.
        instances: (h, w) int32, the number of the parked car that is seen, 0 where there is none.
    """

    lit: Picture
    shaded: Picture
    headlit: Picture
    semantics: Picture
    instances: NDArray[np.int32]


def draw_background(scene: Scene, view: View, light: Light) -> tuple[Background, Depths]:
    """Draw the static world.

    Args:
        scene: the static world.
        view: the camera.
        light: what shines on it.

    Returns:
        What the camera sees, and the inverse depth of each sample: (h * SAMPLES, w * SAMPLES), 1 / metres
        along the axis, 0 for the sky; `OWN` are those of the pixels' middles.
    """
    fine = view.scaled(SAMPLES)
    depths = _scratch((fine.height, fine.width), np.float32)
    tags = _scratch((fine.height, fine.width), np.int32)
    tags.fill(-1)
    draw_mesh(scene.vertices, scene.faces, fine.axes, fine.eye, fine.lens, depths, tags)
    world = _surroundings(scene, light, *_extent(fine, depths))
    pictures = _scratch((3, view.height, view.width, 3), np.uint8)
    shade(depths, tags, fine, world, SAMPLES, pictures)
    lit, shaded, headlit = pictures if light.headlights > 0 else (*pictures[:2], pictures[0])
    background = Background(
        lit=lit.copy(),
        shaded=shaded.copy(),
        headlit=headlit.copy() if light.headlights > 0 else lit,
        semantics=np.append(scene.semantics, np.uint8(Semantic.SKY))[tags[OWN]],
        instances=np.zeros((view.height, view.width), np.int32),
    )
    return background, depths


def _scratch(shape: tuple[int, ...], dtype: type[np.generic]) -> NDArray[Any]:
    """Make an array of zeros whose memory goes back to the system with it.

    What is kept of a background is small beside what drawing it takes; from the common heap, one would pin
    the other.
    """
    size = int(np.prod(shape)) * np.dtype(dtype).itemsize
    return np.frombuffer(mmap.mmap(-1, max(1, size)), dtype, int(np.prod(shape))).reshape(shape)


def _surroundings(scene: Scene, light: Light, centre: Floats, reach: float) -> Surroundings:
    solid = scene.semantics != Semantic.SIGNAL  # Masts and their arms are too slim to close anything in.
    above = _look_down(scene, np.eye(3), centre, reach, _HEIGHT_MAP, solid)
    level = np.where(np.isfinite(above.heights), above.heights, scene.ground).astype(np.float32)
    side = 2 * int(_SURROUNDINGS * above.place[0] / 2) + 1
    # The sun's map is the largest, and comes when the others have given back what they needed on the way.
    around = above._replace(heights=_smoothed(level, side))
    lanes = draw_lane_map(scene.lanes, centre, reach, _LANE_MAP)
    return Surroundings(
        normals=scene.normals,
        surfaces=scene.surfaces,
        colours=scene.colours,
        things=scene.things,
        light=light.packed,
        sun=_look_down(scene, _towards(light.sun), centre, reach, _SHADOW_MAP),
        around=around,
        lanes=lanes,
        lamps=street_lamps(scene, centre, reach) if light.headlights > 0 else np.empty((0, 3)),
        ground=scene.ground,
    )


def _smoothed(heights: NDArray[np.float32], side: int) -> NDArray[np.float32]:
    """Average over squares of an odd side; the edge goes on outside."""
    for axis in range(2):
        smooth = _scratch(heights.shape, np.float32)
        lines, found = np.moveaxis(heights, axis, 1), np.moveaxis(smooth, axis, 1)
        for first in range(0, len(lines), _LINES):
            some = slice(first, first + _LINES)
            padded = np.pad(lines[some], ((0, 0), (side // 2 + 1, side // 2)), mode="edge")
            total = np.cumsum(padded, axis=1, dtype=np.float64)
            found[some] = (total[:, side:] - total[:, :-side]).astype(np.float32) / np.float32(side)
        heights = smooth
    return heights


def street_lamps(scene: Scene, centre: Floats, reach: float) -> Floats:
    """List the street lamps near a place.

    On a map without any, one hangs over every pole and every 30 m of road.

    Args:
        scene: the static world.
        centre: (2,) or (3,) the place, metres, scene frame; its height does not count.
        reach: metres; lamps up to 30 m beyond are listed, too, as their light still arrives.

    Returns:
        (n, 3) where they shine, metres, scene frame.
    """
    hung = [hung_lamp(prop) for prop in scene.road_map.props if prop.kind == "lamp" and prop.position]
    if hung:
        lamps = np.array(hung) - scene.origin
        return lamps[np.hypot(*(lamps[:, :2] - centre[:2]).T) < reach + _LAMP_SPACING]
    spots = [np.empty((0, 3))]
    spots += [
        np.array([prop.position])
        for prop in scene.road_map.props
        if prop.kind in _LAMP_POSTS and prop.position is not None
    ]
    outermost = {road.lanes[0] for road in scene.road_map.roads if road.lanes}
    for lane in scene.road_map.lanes:
        if lane.id in outermost and len(lane.shape) > 1:
            along = np.append(0.0, np.cumsum(np.hypot(*np.diff(lane.shape[:, :2], axis=0).T)))
            places = np.arange(_LAMP_SPACING / 2, along[-1], _LAMP_SPACING)
            spots.append(np.column_stack([np.interp(places, along, values) for values in lane.shape.T]))
    lamps = np.concatenate(spots) - scene.origin
    lamps = lamps[np.hypot(*(lamps[:, :2] - centre[:2]).T) < reach + _LAMP_SPACING]
    _, first = np.unique(np.round(lamps[:, :2] / _LAMPS_APART), axis=0, return_index=True)
    spread: Floats = lamps[np.sort(first)] + np.array([0.0, 0.0, LAMP_HEIGHT])
    return spread


def _extent(view: View, depths: NDArray[np.float32]) -> tuple[Floats, float]:
    """Middle and radius of the ground in view."""
    rows, columns = (np.linspace(0, n - 1, 24).astype(int) for n in depths.shape)
    y, x = (grid.ravel() for grid in np.meshgrid(rows, columns, indexing="ij"))
    far = 1.0 / np.maximum(depths[y, x], 1.0 / 120.0)
    focal, middle_x, middle_y = view.lens[:3]
    rays = np.column_stack([(x - middle_x) / focal, (y - middle_y) / focal, np.ones(len(x))])
    places = view.eye + (rays * far[:, None]) @ view.axes
    low, high = places.min(axis=0), places.max(axis=0)
    return (low + high) / 2, float(min(_SHADOW_REACH, max(10.0, np.hypot(*(high - low)[:2]) / 2)))


def _towards(direction: Floats) -> Floats:
    """(3, 3): rows of a frame whose last axis points along a direction."""
    helper = np.array([0.0, 1.0, 0.0]) if abs(direction[1]) < 0.9 else np.array([1.0, 0.0, 0.0])
    right = np.cross(helper, direction)
    right /= np.linalg.norm(right)
    return np.array([right, np.cross(direction, right), direction])


def _look_down(
    scene: Scene,
    frame: Floats,
    centre: Floats,
    reach: float,
    size: int,
    drawn: NDArray[np.bool_] | slice = slice(None),
) -> HeightMap:
    """Draw the scene, or some of its faces, along the last axis of a frame."""
    heights = _scratch((size, size), np.float32)
    heights.fill(-np.inf)
    tags = as_strided(np.zeros(1, np.uint8), (size, size), (0, 0))  # Nobody asks which face it is.
    middle = frame @ centre
    place = np.array([size / 2 / (reach * 1.05), middle[0], middle[1]])
    draw_from_above(scene.vertices @ frame.T, scene.faces[drawn], place, heights, tags)
    return HeightMap(heights=heights, place=place, frame=frame)
