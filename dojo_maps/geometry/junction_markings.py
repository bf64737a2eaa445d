"""Shapes painted at junctions: stop lines, turn arrows and the zebra stripes of crossings."""

from collections import defaultdict
from functools import cache

import numpy as np
import shapely
from shapely import affinity

from dojo_maps.description import CARRIAGEWAY, Crossing, Lane, Points, RoadMap
from dojo_maps.geometry.paint import Canvas, Paint, PaintLayer
from dojo_maps.geometry.polylines import Floats, Shapes, along, drop_repeats, place_on, places_on
from dojo_maps.index import MapIndex

_STOP_LINE_WIDTH = 0.5
_STRIPE = 0.5
_ARROW_LENGTH = 5.0
_ARROW_PLACES = (4.0, 24.0)
"""Metres from a lane's stop line, or its end, back to the tips of its arrows."""
_SHORTEST_LANE = 14.0
_TURNS = {"s": "s", "l": "l", "L": "l", "r": "r", "R": "r"}
"""SUMO's connection directions as arrows; partly left or right is drawn as left or right."""


_Line = tuple[tuple[float, float], ...]


def stop_line_paint(road_map: RoadMap, canvas: Canvas) -> Paint:
    """Paint each stop line across its lane.

    Args:
        road_map: with stop lines.
        canvas: its ground, for cutting paint to the carriageway.

    Returns:
        Bars, each with the id of its lane.
    """
    shift = np.array(road_map.origin)
    lines = [shapely.linestrings(line.shape[:, :2] - shift) for line in road_map.stop_lines]
    bars = shapely.buffer(np.array(lines, dtype=object), _STOP_LINE_WIDTH / 2, cap_style="flat")
    cut, index = canvas.cut(bars)
    ids = tuple(road_map.stop_lines[int(k)].lane for k in index)
    return Paint(layer=PaintLayer.STOP_LINE, polygons=cut, ids=ids)


def crossing_paint(road_map: RoadMap, canvas: Canvas) -> Paint:
    """Paint the stripes of each crossing where it lies on the carriageway.

    Args:
        road_map: with crossings.
        canvas: its ground, for cutting paint to the carriageway.

    Returns:
        Stripes, each with the id of its crossing.
    """
    shift = np.array(road_map.origin)
    stripes, owner = [], []
    for k, crossing in enumerate(road_map.crossings):
        found = _stripes(crossing, shift)
        stripes += [*found]
        owner += [k] * len(found)
    cut, index = canvas.cut(np.array(stripes, dtype=object))
    owners = np.array(owner, dtype=int)[index]
    return Paint(
        layer=PaintLayer.CROSSING,
        polygons=cut,
        ids=tuple(road_map.crossings[k].id for k in owners),
    )


def arrow_paint(road_map: RoadMap, canvas: Canvas) -> Paint:
    """Paint arrows on lanes that end where roads branch, by where each lane's connections lead.

    Args:
        road_map: with stop lines, before which the arrows lie.
        canvas: its ground, for cutting each arrow to its lane's.

    Returns:
        Arrows, each with the id of its lane.
    """
    shift = np.array([*road_map.origin, 0.0])
    stop_of = {line.lane: line.shape.mean(axis=0)[:2] for line in road_map.stop_lines}
    polygons, ids = [], []
    for lane, turns in _arrow_lanes(road_map):
        shape = drop_repeats(lane.shape)
        if lane.id in stop_of:
            shape = _until(shape, stop_of[lane.id])
        length = along(shape)[-1]
        ground = canvas.area_of([lane.id])
        for tip in _ARROW_PLACES:
            if len(shape) < 2 or length < tip + _ARROW_LENGTH + 5.0:
                continue
            position, heading = place_on(shape - shift, -(tip + _ARROW_LENGTH / 2))
            glyph = affinity.rotate(_arrow(turns), heading, origin=(0, 0), use_radians=True)
            glyph = affinity.translate(glyph, *position[:2])
            polygons.append(glyph.intersection(ground))
            ids.append(lane.id)
    return Paint(
        layer=PaintLayer.ARROW,
        polygons=canvas.keep_off_border(np.array(polygons, dtype=object)),
        ids=tuple(ids),
    )


def _until(line: Points, place: Floats) -> Points:
    """Take the part of a line that leads up to the place nearest to a point."""
    length = float(shapely.line_locate_point(shapely.LineString(line[:, :2]), shapely.Point(place)))
    lengths = along(line)
    return np.vstack([line[lengths < length - 1e-3], place_on(line, length)[0]])


def _stripes(crossing: Crossing, shift: Floats) -> Shapes:
    """Bars along the traffic, across the crossing's whole width, half a metre apart."""
    shape = drop_repeats(crossing.shape) - [*shift, 0.0]
    if len(shape) < 2:
        return np.empty(0, dtype=object)
    length = along(shape)[-1]
    count = max(1, int((length + _STRIPE) // (2 * _STRIPE)))
    margin = (length - (2 * count - 1) * _STRIPE) / 2
    area = shapely.make_valid(shapely.Polygon(crossing.polygon[:, :2] - shift))
    middles, headings = places_on(shape, margin + (2 * np.arange(count) + 0.5) * _STRIPE)
    ahead = np.column_stack([np.cos(headings), np.sin(headings)]) * (_STRIPE / 2)
    left = np.column_stack([-np.sin(headings), np.cos(headings)]) * (crossing.width / 2)
    corners = [middles[:, :2] + a * ahead + b * left for a, b in ((1, -1), (1, 1), (-1, 1), (-1, -1))]
    return shapely.intersection(shapely.polygons(np.stack(corners, axis=1)), area)


def _arrow_lanes(road_map: RoadMap) -> list[tuple[Lane, str]]:
    """List the lanes that get arrows, each with its turns."""
    turns: dict[str, set[str]] = defaultdict(set)
    targets: dict[str, set[str]] = defaultdict(set)
    signalled: set[str] = set()
    lane_of = MapIndex(road_map).lanes
    for connection in road_map.connections:
        start = lane_of[connection.from_lane].road
        if connection.direction in _TURNS:
            turns[connection.from_lane].add(_TURNS[connection.direction])
            targets[start].add(lane_of[connection.to_lane].road)
        if connection.signal is not None:
            signalled.add(start)
    chosen = []
    for road in road_map.roads:
        lanes = [lane_of[i] for i in road.lanes if lane_of[i].kind in CARRIAGEWAY]
        branches = len(targets[road.id]) > 1
        if branches and (len(lanes) > 1 or road.id in signalled):
            chosen += [
                (lane, "".join(sorted(turns[lane.id])))
                for lane in lanes
                if turns[lane.id] and lane.length > _SHORTEST_LANE
            ]
    return chosen


@cache
def _arrow(turns: str) -> shapely.Polygon:
    """Draw an arrow for a set of turns, driving direction along +x, its middle at the origin."""
    stems: dict[str, tuple[_Line, _Line]] = {
        "s": (((0.0, 0.0), (3.6, 0.0)), ((3.6, 0.42), (5.0, 0.0), (3.6, -0.42))),
        "l": (((0.0, 0.0), (1.3, 0.0), (2.3, 0.6)), ((1.95, 0.8), (2.8, 1.45), (2.65, 0.4))),
    }
    stems["r"] = (_mirrored(stems["l"][0]), _mirrored(stems["l"][1]))
    parts = []
    for turn in turns:
        stem, head = stems[turn]
        parts += [shapely.LineString(stem).buffer(0.08, cap_style="flat"), shapely.Polygon(head)]
    return affinity.translate(shapely.union_all(parts), -_ARROW_LENGTH / 2, 0.0)


def _mirrored(places: _Line) -> _Line:
    return tuple((x, -y) for x, y in places)
