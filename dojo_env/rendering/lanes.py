"""Where lanes run: what the wear of asphalt and paint follows, place by place."""

from collections.abc import Iterator
from typing import NamedTuple
from zlib import crc32

import numpy as np
from numpy.typing import NDArray

from dojo_env.rendering.compiling import inner
from dojo_env.rendering.raster import draw_from_above
from dojo_maps.description import CARRIAGEWAY, RoadMap

Floats = NDArray[np.float64]

_WAY_WIDTH = 3.2
"""Width that ways across junctions are taken to have, metres."""
_BEND = 0.4
"""Metres that pieces overlap where a lane bends."""
_FACES = 4
"""Triangles of a piece: two on each side, like a roof, so that where lanes meet the nearer middle wins."""


class LaneMap(NamedTuple):
    """Which piece of a lane runs over each place.

    Attributes:
        pieces: (n, 10) straight pieces of lanes: x and y of its start, the unit vector along it, metres from
            the lane's start, the lane's length, half its width, a number of its own from 0 to 1, 1 for a way
            across a junction or else 0, and the piece's length; metres, scene frame.
        faces: (h, w) int32, `_FACES` for each piece, -1 where there is none.
        place: (3,) pixels per metre, and the middle, x and y.
    """

    pieces: Floats
    faces: NDArray[np.int32]
    place: Floats


def lane_pieces(road_map: RoadMap) -> Floats:
    """Cut the lanes that wheels wear, and the ways across junctions, into straight pieces.

    Args:
        road_map: the map; its lanes of carriageways count, and connections between two of them.

    Returns:
        (n, 10) as `LaneMap.pieces` has them.
    """
    rows = [row for line in _lines(road_map) for row in _pieces(*line)]
    pieces = np.array(rows).reshape(-1, 10)
    pieces[:, :2] -= road_map.origin[:2]
    return pieces


def _lines(road_map: RoadMap) -> Iterator[tuple[str, Floats, float, bool]]:
    for lane in road_map.lanes:
        if lane.kind in CARRIAGEWAY:
            yield lane.id, lane.shape, lane.width, False
    worn = {lane.id for lane in road_map.lanes if lane.kind in CARRIAGEWAY}
    for way in road_map.connections:
        if way.from_lane in worn and way.to_lane in worn:
            yield way.id, way.shape, _WAY_WIDTH, True


def _pieces(name: str, line: Floats, width: float, is_way: bool) -> Iterator[tuple[float, ...]]:
    steps = np.diff(line[:, :2], axis=0)
    lengths = np.hypot(*steps.T)
    total, along = float(lengths.sum()), 0.0
    number = (crc32(name.encode()) & 0xFFFF) / 0xFFFF
    for (x, y), step, length in zip(line[:-1, :2], steps, lengths, strict=True):
        if length > 1e-3:
            yield x, y, *(step / length), along, total, width / 2, number, float(is_way), length
        along += float(length)


def draw_lane_map(pieces: Floats, centre: Floats, reach: float, size: int) -> LaneMap:
    """Draw a map of the lanes around a place.

    Args:
        pieces: (n, 10) of `lane_pieces`.
        centre: (2,) or (3,) the place, metres, scene frame; its height does not count.
        reach: metres from there to each edge of the map, which holds a little more.
        size: its width and height, pixels.

    Returns:
        The map, with those pieces that may lie on it.
    """
    near = pieces[np.hypot(*(pieces[:, :2] - centre[:2]).T) < 2.0 * reach + 200.0]
    start, way, half = near[:, :2], near[:, 2:4], near[:, 6]
    side = np.column_stack([-way[:, 1], way[:, 0]]) * half[:, None]
    ends = (start - _BEND * way, start + (near[:, 9:] + _BEND) * way)
    ridge = 1.0 - near[:, 8]
    corners = np.empty((len(near), 6, 3))
    for k, (end, across) in enumerate((e, a) for e in ends for a in (-1.0, 0.0, 1.0)):
        corners[:, k, :2] = end + across * side
        corners[:, k, 2] = ridge - 0.9 * abs(across)
    roof = np.array([(0, 3, 4), (0, 4, 1), (1, 4, 5), (1, 5, 2)])
    faces = (roof + 6 * np.arange(len(near))[:, None, None]).reshape(-1, 3)
    heights = np.full((size, size), -np.inf, dtype=np.float32)
    tags = np.full((size, size), -1, dtype=np.int32)
    place = np.array([size / 2 / (reach * 1.05), centre[0], centre[1]])
    draw_from_above(corners.reshape(-1, 3), faces, place, heights, tags)
    return LaneMap(pieces=near, faces=tags, place=place)


@inner
def find_lane(x, y, lanes, found):
    """Find the lane at a place.

    Args:
        x: metres, scene frame.
        y: the same.
        lanes: the `LaneMap`.
        found: (5,) to fill: metres along the lane, to the left of its middle, and to its end; half its width,
            negative on a way across a junction, 0 where there is no lane; its own number.
    """
    size_y, size_x = lanes.faces.shape
    column = int((x - lanes.place[1]) * lanes.place[0] + size_x / 2)
    row = int(size_y / 2 - (y - lanes.place[2]) * lanes.place[0])
    found[0], found[1], found[2], found[3], found[4] = x, y, 100.0, 0.0, 0.0
    if column < 0 or row < 0 or column >= size_x or row >= size_y or lanes.faces[row, column] < 0:
        return
    piece = lanes.pieces[lanes.faces[row, column] // _FACES]
    x, y = x - piece[0], y - piece[1]
    found[0] = piece[4] + x * piece[2] + y * piece[3]
    found[1] = y * piece[2] - x * piece[3]
    found[2] = max(0.0, piece[5] - found[0]) if piece[8] == 0.0 else 100.0
    found[3], found[4] = piece[6] * (1.0 - 2.0 * piece[8]), piece[7]
