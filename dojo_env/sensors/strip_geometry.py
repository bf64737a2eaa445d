"""Where the lanes of a signal lie in its cameras' pictures: each lane as a strip, as if seen from above.

Row 0 of a strip is at the junction, whether traffic drives up to it there or away from it; rows lead
outwards, columns from left to right as one looks along them. So every lane looks alike, whichever camera
shows it.

    picture      . - ' |        strip   row 63, 96 m out
            . '  . ' / |   -->           |  |
         '   . '   /   |                 |  |
       ' . '     /     |                row 0, the stop line
"""

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from dojo_env.camera import BEV, Camera
from dojo_env.rendering.scene import Scene
from dojo_env.sensors.placement import find_feeders, find_seen
from dojo_env.signals.plan import SignalPlan
from dojo_maps.description import Lane
from dojo_maps.index import MapIndex

Floats = NDArray[np.float64]
Picture = NDArray[np.uint8]

ROWS, COLUMNS, CELLS = 64, 12, 16
"""Of a strip; a cell is four rows over its whole width, in which at most one vehicle has its front."""
REACH = 96.0
"""Metres of a lane that a strip shows."""
CELL = REACH / CELLS
"""Metres of a cell."""
GEOMETRY = ("in_view", "scale", "steepness", "side", "is_outgoing", "distance")
"""What is told of every place of a strip beside its colours, see `Strip`."""
_WIDTHS = 2.0
"""How many lanes wide a strip is: the lane, and half of each neighbour."""
_FINE = 2
"""Samples of a pixel, along and across."""
_NEAREST_EDGE = 1.5
"""Pixels from a picture's edge."""
_LEAST_SCALE = 2.0
"""Pixels of a metre below which no vehicle can be told."""
_LEAST_SEEN = 0.75
"""The share of a cell's part of the lane that must be in view for it to be seen."""
_MOST_HIDDEN = 0.5
"""The share of that which may stand behind something."""
_BONNET = 1.0
"""Metres above the ground that must not be hidden."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Strip:
    """A lane, and where it lies in the picture that shows most of it.

    Attributes:
        lane: its id.
        is_outgoing: traffic drives away from the junction on it.
        line: (n, 3) the middle of the lane and of what leads straight into it, from the junction outwards,
            metres, map frame.
        sources: ids of the lanes that it is made of.
        camera: the camera; None where none shows it.
        pixels: (rows * fine, columns * fine, 2) where it is in that picture.
        geometry: (rows, columns, 6): whether it is seen there; pixels of a metre there, by 20; the sine
            of the angle at which the camera looks down; the sine of the angle between its view and the lane;
            whether traffic leads away; the distance as a share.
        shares: (cells,) what a vehicle in each cell counts for this lane: a part where lanes divide later on,
            0 where none would be seen.
    """

    lane: str
    is_outgoing: bool
    line: Floats
    sources: tuple[str, ...]
    camera: Camera | None
    pixels: NDArray[np.float32]
    geometry: NDArray[np.float32]
    shares: Floats


def build_strips(scene: Scene, plan: SignalPlan, cameras: Sequence[Camera]) -> tuple[Strip, ...]:
    """Find the strips of the lanes that lead to a signal, and of those that lead away from it.

    Args:
        scene: the static world, which may stand before a lane.
        plan: of the signal.
        cameras: that look at it; a bird's eye view is left out, as it shows every lane small.

    Returns:
        One for each lane of the plan, then one for each other lane away from it.
    """
    lanes, feeders = MapIndex(scene.road_map).lanes, find_feeders(scene.road_map)
    looking = [camera for camera in cameras if camera.name != BEV]
    upstream = {lane: feeders[lane] for lane in feeders if feeders[lane] in plan.upstream}
    paths = [_trace_back(lanes[lane], lanes, upstream) for lane in plan.lanes]
    users = Counter(source for path in paths for source in path.sources)
    away = [lane for lane in plan.out_lanes if lane not in plan.lanes]
    paths += [_Path(line=lanes[lane].shape, sources=(lane,), ends=(np.inf,)) for lane in away]
    watched = [lanes[lane] for lane in (*plan.lanes, *away)]
    samples = [_sample(path.line, lane.width) for lane, path in zip(watched, paths, strict=True)]
    probes = np.stack([points[:, COLUMNS] for points, _ in samples])
    probes[..., 2] += _BONNET
    clear = {
        camera: find_seen(scene, camera, probes.reshape(-1, 3)).reshape(probes.shape[:2])
        for camera in looking
    }
    return tuple(
        _lay_strip(
            lane,
            path,
            *sample,
            {camera: rows[number] for camera, rows in clear.items()},
            users,
            is_outgoing=number >= len(plan.lanes),
        )
        for number, (lane, path, sample) in enumerate(zip(watched, paths, samples, strict=True))
    )


def cut_strips(strips: Sequence[Strip], pictures: Mapping[Camera, Picture]) -> NDArray[np.uint8]:
    """Cut the strips out of pictures.

    Args:
        strips: n of them.
        pictures: (h, w, 3) of each of their cameras.

    Returns:
        (n, rows, columns, 3), black where nothing is in view.
    """
    import cv2  # noqa: PLC0415 - OpenCV is large; few need it

    found = np.zeros((len(strips), ROWS, COLUMNS, 3), np.uint8)
    for camera, picture in pictures.items():
        rows = [row for row, strip in enumerate(strips) if strip.camera is camera]
        if not rows:
            continue
        places = np.concatenate([strips[row].pixels for row in rows])
        across, along = np.ascontiguousarray(places[..., 0]), np.ascontiguousarray(places[..., 1])
        seen = cv2.remap(picture, across, along, cv2.INTER_LINEAR, borderMode=cv2.BORDER_CONSTANT)
        found[rows] = cv2.resize(seen, (COLUMNS, ROWS * len(rows)), interpolation=cv2.INTER_AREA).reshape(
            len(rows), ROWS, COLUMNS, 3
        )
    return found


def measure_along(line: Floats, points: Floats) -> tuple[Floats, Floats]:
    """Find how far along a line points are, and how far from it.

    Args:
        line: (n, 2 or 3) metres, n >= 2; heights do not count.
        points: (m, 2 or 3) metres.

    Returns:
        (m,) metres from the line's begin, and (m,) metres aside.
    """
    line, points = line[:, :2], points[:, :2]
    steps = np.diff(line, axis=0)
    lengths = np.hypot(*steps.T)
    away = points[:, None] - line[None, :-1]
    share = np.clip((away * steps).sum(axis=2) / np.maximum(lengths**2, 1e-12), 0.0, 1.0)
    aside = np.linalg.norm(away - share[..., None] * steps, axis=2)
    best = aside.argmin(axis=1)
    rows = np.arange(len(points))
    before = np.concatenate([[0.0], np.cumsum(lengths)])
    return before[best] + share[rows, best] * lengths[best], aside[rows, best]


def measure_length(line: Floats) -> float:
    """Measure a line.

    Args:
        line: (n, 2 or 3) metres; heights do not count.

    Returns:
        Metres.
    """
    return float(np.hypot(*np.diff(line[:, :2], axis=0).T).sum())


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Path:
    """A strip's line, the lanes that it is made of, and how far out each of them reaches."""

    line: Floats
    sources: tuple[str, ...]
    ends: tuple[float, ...]


def _trace_back(lane: Lane, lanes: Mapping[str, Lane], feeders: Mapping[str, str]) -> _Path:
    """Follow a lane, and what leads straight into it, from its end backwards."""
    line, sources = lane.shape[::-1], [lane.id]
    ends = [measure_length(line)]
    while ends[-1] < REACH and (before := feeders.get(sources[-1], "")) in lanes and before not in sources:
        line = np.vstack([line, lanes[before].shape[::-1]])
        sources.append(before)
        ends.append(measure_length(line))
    return _Path(line=line, sources=tuple(sources), ends=(*ends[:-1], np.inf))


def _lay_strip(
    lane: Lane,
    path: _Path,
    points: Floats,
    exists: NDArray[np.bool_],
    cameras: Mapping[Camera, NDArray[np.bool_]],
    users: Mapping[str, int],
    *,
    is_outgoing: bool,
) -> Strip:
    """Lay a strip's places over the picture that shows most; it is told which rows stand free."""
    best, camera, pixels = -1.0, None, np.zeros((*points.shape[:2], 2))
    in_view = np.zeros(points.shape[:2], bool)
    scale = np.zeros(points.shape[:2])
    for each, clear in cameras.items():
        places, depth = each.project(points.reshape(-1, 3))
        places, depth = places.reshape(*points.shape[:2], 2), depth.reshape(points.shape[:2])
        with np.errstate(invalid="ignore"):
            low, high = _NEAREST_EDGE, np.array([each.width, each.height]) - _NEAREST_EDGE
            seen = exists[:, None] & (depth > each.near) & ((places > low) & (places < high)).all(axis=2)
        inside = seen[:, COLUMNS].reshape(CELLS, -1)
        hidden = inside & ~clear.reshape(CELLS, -1)
        is_clear = hidden.sum(axis=1) <= _MOST_HIDDEN * inside.sum(axis=1)
        size = each.focal_length / np.maximum(depth, each.near)
        seen &= (size >= _LEAST_SCALE) & np.repeat(is_clear, inside.shape[1])[:, None]
        size = np.where(seen, size, 0.0)
        if (found := float(size.sum())) > max(best, 0.0):
            best, camera, pixels, in_view, scale = found, each, places, seen, size
    geometry = np.zeros((*points.shape[:2], len(GEOMETRY)))
    geometry[..., 0], geometry[..., 1] = in_view, scale / 20.0
    if camera is not None:
        geometry[..., 2], geometry[..., 3] = _angles(camera, points)
    geometry[..., 4] = is_outgoing
    geometry[..., 5] = np.linspace(0.0, 1.0, len(points))[:, None]
    coarse = geometry.reshape(ROWS, _FINE, COLUMNS, _FINE, -1).mean(axis=(1, 3))
    lane_only = coarse[:, COLUMNS // 4 : -COLUMNS // 4, 0].reshape(CELLS, -1).mean(axis=1)
    held = np.searchsorted(path.ends, (np.arange(CELLS) + 0.5) * CELL)
    sharing = np.array([1 if is_outgoing else users[path.sources[place]] for place in held])
    return Strip(
        lane=lane.id,
        is_outgoing=is_outgoing,
        line=path.line,
        sources=path.sources,
        camera=camera,
        # A remapped pixel's centre is a whole number; a camera's lies at a half.
        pixels=np.where(in_view[..., None], pixels - 0.5, -9.0).astype(np.float32),
        geometry=coarse.astype(np.float32),
        shares=(lane_only > _LEAST_SEEN) / sharing,
    )


def _sample(line: Floats, width: float) -> tuple[Floats, NDArray[np.bool_]]:
    """Lay places over a lane: (rows * fine, columns * fine, 3), and which rows the line reaches."""
    along = np.append(0.0, np.cumsum(np.hypot(*np.diff(line[:, :2], axis=0).T)))
    at = (np.arange(ROWS * _FINE) + 0.5) * REACH / (ROWS * _FINE)
    middle = np.stack([np.interp(at, along, line[:, axis]) for axis in range(3)], axis=1)
    ends = np.stack([np.interp(at + d, along, line[:, axis]) for d in (-2.0, 2.0) for axis in (0, 1)], axis=1)
    ahead = ends[:, 2:] - ends[:, :2]
    ahead /= np.maximum(np.hypot(*ahead.T), 1e-9)[:, None]
    right = np.stack([ahead[:, 1], -ahead[:, 0], np.zeros(len(at))], axis=1)
    across = ((np.arange(COLUMNS * _FINE) + 0.5) / (COLUMNS * _FINE) - 0.5) * _WIDTHS * width
    return middle[:, None] + across[None, :, None] * right[:, None], at <= along[-1]


def _angles(camera: Camera, points: Floats) -> tuple[Floats, Floats]:
    """Compute the sines of the angles at which a camera looks down on places, and along a strip there."""
    view = points - np.asarray(camera.position)
    level = np.hypot(view[..., 0], view[..., 1])
    down = -view[..., 2] / np.maximum(np.hypot(level, view[..., 2]), 1e-9)
    ahead = np.gradient(points[:, points.shape[1] // 2, :2], axis=0)[:, None]
    turned = ahead[..., 0] * view[..., 1] - ahead[..., 1] * view[..., 0]
    return down, turned / np.maximum(level * np.hypot(ahead[..., 0], ahead[..., 1]), 1e-9)
