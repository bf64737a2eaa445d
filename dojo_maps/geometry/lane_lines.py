"""Lines along lanes: dividers, centre and edge lines, and rails, solid or dashed by what may be crossed."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from enum import Enum
from itertools import pairwise

import numpy as np
import shapely

from dojo_maps.description import Lane, LaneKind, Road, RoadMap
from dojo_maps.geometry.paint import KERB_GAP, Canvas, Paint, PaintLayer
from dojo_maps.geometry.polylines import Flags, Ints, Shapes, drop_repeats, offset_lines
from dojo_maps.geometry.through_lines import trace_through_lines
from dojo_maps.index import MapIndex

_WIDTH = 0.12
_EDGE_INSET = 0.15
_DASH = 3.0
_DASH_AND_GAP = 9.0
"""Lane lines in towns: 3 m of paint, 6 m of gap. Source: RMS-1, the German guideline on markings."""
_SLOW = 8.4
"""Streets up to 30 km/h have no edge lines, m/s."""
_TOUCHING = 0.5
"""Carriageways closer than this share one centre line, metres."""
_SHORTEST = 1.0
_CROSSING_CLEARANCE = 0.3
_GAUGE = 1.435
_RAIL_WIDTH = 0.08
_UNMARKED = (LaneKind.SIDEWALK, LaneKind.RAIL, LaneKind.WATERWAY)


class _Style(Enum):
    SOLID = "solid"
    DASHED = "dashed"


@dataclass(slots=True)
class _Line:
    """A line to paint beside a lane's centre, `offset` metres to the left, on the ground of some lanes."""

    lane: Lane
    offset: float
    style: _Style
    ground: tuple[str, ...]
    near: str = ""
    """Only where this lane's inner border runs alongside; with `away`, only where it does not."""
    away: bool = False


def line_markings(road_map: RoadMap, canvas: Canvas) -> Paint:
    """Paint the lines of every road up to the crossings, and those that run on through junctions.

    Args:
        road_map: with crossings and islands, which the lines keep off.
        canvas: its ground, for cutting lines to the carriageway.

    Returns:
        Strokes, each with the id of the lane beside it, inside junctions of the nearer lane before or behind.
    """
    lane_of = MapIndex(road_map).lanes
    inward = -1.0 if road_map.left_hand else 1.0
    lines = [line for road in road_map.roads for line in _dividers(road, lane_of, inward)]
    lines += _borders(road_map, lane_of, inward)
    lines = [line for line in lines if len(drop_repeats(line.lane.shape)) > 1]
    shapes = _trace(lines, lane_of, inward, road_map)
    grounds = [(line.ground, bool(line.near) and not line.away) for line in lines]
    distinct = list(dict.fromkeys(grounds))
    areas = np.array([canvas.area_of(lanes) for lanes, _ in distinct], dtype=object)
    areas = _paintable(areas, np.array([shared for _, shared in distinct], dtype=bool))
    number = {ground: k for k, ground in enumerate(distinct)}
    shapes = shapely.intersection(shapes, areas[[number[ground] for ground in grounds]])
    shapes = _clear_obstacles(shapes, road_map)
    strokes, index = _strokes(shapes, np.array([line.style is _Style.DASHED for line in lines], dtype=bool))
    through, owners = _through_strokes(road_map)
    cut, part = canvas.cut(_widen(through, _WIDTH))
    return Paint(
        layer=PaintLayer.MARKING,
        polygons=np.concatenate([_widen(strokes, _WIDTH), cut]),
        ids=(*(lines[i].lane.id for i in index), *(owners[i] for i in part)),
    )


def _through_strokes(road_map: RoadMap) -> tuple[Shapes, list[str]]:
    """Dash the lines through junctions; each stroke belongs to the lane before or behind, as it is nearer."""
    lines, beside = trace_through_lines(road_map)
    strokes, index = _strokes(_clear_obstacles(lines.copy(), road_map), np.ones(len(lines), dtype=bool))
    places = shapely.line_locate_point(lines[index], shapely.centroid(strokes), normalized=True)
    ends = zip(index, places, strict=True)
    return strokes, [beside[k].from_lane if place < 0.5 else beside[k].to_lane for k, place in ends]


def _widen(strokes: Shapes, width: float) -> Shapes:
    return shapely.buffer(strokes, width / 2, cap_style="flat", join_style="mitre", mitre_limit=2.0)


def rail_markings(road_map: RoadMap) -> Paint:
    """Lay rails along tracks, and along lanes that share their road with a tramway.

    Args:
        road_map: a track that is used in both directions, two lanes of one shape, has one pair of rails.

    Returns:
        Two rails for each track, with the id of its lane.
    """
    kind = {road.id: road.kind for road in road_map.roads}
    tracks: dict[frozenset[bytes], Lane] = {}
    for lane in road_map.lanes:
        tram = "tram" in lane.allow and "tram" in kind[lane.road]
        if len(drop_repeats(lane.shape)) > 1 and (tram or lane.kind is LaneKind.RAIL):
            # Tracks used in both directions are two lanes of one shape.
            tracks.setdefault(frozenset((lane.shape.tobytes(), lane.shape[::-1].tobytes())), lane)
    lanes = tracks.values()
    both = [lane for lane in lanes for _ in range(2)]
    lines = _centre_lines(both, road_map)
    rails = offset_lines(lines, np.resize([_GAUGE / 2, -_GAUGE / 2], len(both)))
    return Paint(
        layer=PaintLayer.TRACK,
        polygons=_widen(rails, _RAIL_WIDTH),
        ids=tuple(lane.id for lane in both),
    )


def _dividers(road: Road, lane_of: dict[str, Lane], inward: float) -> Iterator[_Line]:
    """Lines between neighbouring lanes; two where only one side may cross, the broken one on that side."""
    lanes = [lane_of[lane] for lane in road.lanes]
    for outer, inner in pairwise(lanes):
        if outer.kind in _UNMARKED or inner.kind in _UNMARKED:
            continue
        border = inward * outer.width / 2
        ways = (outer.change_inward, inner.change_outward)
        if outer.kind is not inner.kind or not any(ways):
            yield _Line(outer, border, _Style.SOLID, road.lanes)
        elif all(ways):
            yield _Line(outer, border, _Style.DASHED, road.lanes)
        else:
            for may_cross, side in zip(ways, (-_WIDTH, _WIDTH), strict=True):
                style = _Style.DASHED if may_cross else _Style.SOLID
                yield _Line(outer, border + inward * side, style, road.lanes)


def _borders(road_map: RoadMap, lane_of: dict[str, Lane], inward: float) -> Iterator[_Line]:
    """Edge lines, and centre lines where the opposite carriageway touches."""
    by_ends = {(road.from_junction, road.to_junction): road for road in road_map.roads}
    order = {road.id: k for k, road in enumerate(road_map.roads)}
    for road in road_map.roads:
        lanes = _marked(road, lane_of)
        if not lanes or not any(lane.kind is LaneKind.DRIVING for lane in lanes):
            continue
        fast = max(lane.speed for lane in lanes) > _SLOW
        if fast:
            yield _Line(lanes[0], -inward * (lanes[0].width / 2 - _EDGE_INSET), _Style.SOLID, road.lanes)
        inner = lanes[-1]
        opposite = by_ends.get((road.to_junction, road.from_junction))
        facing = _marked(opposite, lane_of) if opposite and opposite.id != road.id else []
        if fast:
            inset = inward * (inner.width / 2 - _EDGE_INSET)
            near = facing[-1].id if facing else ""
            yield _Line(inner, inset, _Style.SOLID, road.lanes, near, away=True)
        if opposite and facing and order[road.id] < order[opposite.id]:
            ground = (*road.lanes, *opposite.lanes)
            for offset, style in _centre_styles(lanes, facing):
                yield _Line(inner, inward * inner.width / 2 + offset, style, ground, facing[-1].id)


def _centre_styles(lanes: Sequence[Lane], facing: Sequence[Lane]) -> list[tuple[float, _Style]]:
    """Choose the centre line: double on wide roads, broken where a lane may be used to overtake."""
    if len(lanes) + len(facing) >= 4:
        return [(-_WIDTH, _Style.SOLID), (_WIDTH, _Style.SOLID)]
    crossable = lanes[-1].opposite is not None or facing[-1].opposite is not None
    return [(0.0, _Style.DASHED if crossable else _Style.SOLID)]


def _marked(road: Road, lane_of: dict[str, Lane]) -> list[Lane]:
    return [lane_of[lane] for lane in road.lanes if lane_of[lane].kind not in _UNMARKED]


def _centre_lines(lanes: Sequence[Lane], road_map: RoadMap) -> Shapes:
    shift = np.array(road_map.origin)
    return np.array(
        [shapely.linestrings(drop_repeats(lane.shape)[:, :2] - shift) for lane in lanes], dtype=object
    )


def _trace(lines: Sequence[_Line], lane_of: dict[str, Lane], inward: float, road_map: RoadMap) -> Shapes:
    """Draw each line beside its lane, as far as the border it depends on runs alongside or not."""
    shapes = offset_lines(
        _centre_lines([line.lane for line in lines], road_map), np.array([e.offset for e in lines])
    )
    bound = [k for k, line in enumerate(lines) if line.near]
    others = [lane_of[lines[k].near] for k in bound]
    usable = [k for k, lane in enumerate(others) if len(drop_repeats(lane.shape)) > 1]
    bound, others = [bound[k] for k in usable], [others[k] for k in usable]
    borders = offset_lines(
        _centre_lines(others, road_map), np.array([inward * lane.width / 2 for lane in others])
    )
    beside = shapely.buffer(borders, _TOUCHING + _EDGE_INSET, cap_style="flat")
    away = np.array([lines[k].away for k in bound], dtype=bool)
    shapes[bound] = np.where(
        away, shapely.difference(shapes[bound], beside), shapely.intersection(shapes[bound], beside)
    )
    return shapes


def _paintable(areas: Shapes, shared: Flags) -> Shapes:
    """Keep lines off the borders of their ground by half a line; a slit between two roads is no border."""
    slit = _TOUCHING / 2
    areas[shared] = shapely.buffer(areas[shared], slit, join_style="mitre", mitre_limit=2.0)
    inset = np.where(shared, slit, 0.0) + _WIDTH / 2 + KERB_GAP
    return shapely.buffer(areas, -inset, join_style="mitre", mitre_limit=2.0)


def _clear_obstacles(lines: Shapes, road_map: RoadMap) -> Shapes:
    """Cut lines out of crossings and off islands with a kerb."""
    origin = np.array(road_map.origin)
    rings = [(crossing.polygon, _CROSSING_CLEARANCE) for crossing in road_map.crossings]
    rings += [
        (prop.polygon, _WIDTH)
        for prop in road_map.props
        if prop.kind == "island" and prop.polygon is not None and prop.height > 0
    ]
    areas = [shapely.polygons(ring[:, :2] - origin).buffer(distance) for ring, distance in rings]
    obstacles = np.array(areas, dtype=object)
    line, obstacle = shapely.STRtree(obstacles).query(lines, predicate="intersects")
    for k in np.unique(line):
        lines[k] = shapely.difference(lines[k], shapely.union_all(obstacles[obstacle[line == k]]))
    return lines


def _strokes(shapes: Shapes, dashed: Flags) -> tuple[Shapes, Ints]:
    """Cut dashed lines into their dashes.

    Returns:
        Lines, and for each the index of the shape it is part of.
    """
    parts, index = shapely.get_parts(shapely.line_merge(shapes), return_index=True)
    long_enough = (shapely.get_type_id(parts) == 1) & (shapely.length(parts) > _SHORTEST)
    parts, index = parts[long_enough], index[long_enough]
    whole = ~dashed[index]
    broken = np.flatnonzero(~whole)
    count = np.floor((shapely.length(parts[broken]) - _DASH) / _DASH_AND_GAP).astype(int) + 1
    line = np.repeat(broken, np.maximum(count, 0))
    start = (np.arange(len(line)) - np.searchsorted(line, line)) * _DASH_AND_GAP + _DASH_AND_GAP / 6
    places = [shapely.line_interpolate_point(parts[line], start + _DASH * share) for share in (0.0, 0.5, 1.0)]
    ends = np.stack([shapely.get_coordinates(place) for place in places], axis=1)
    dashes = shapely.linestrings(ends) if len(ends) else np.empty(0, dtype=object)
    return np.concatenate([parts[whole], dashes]), np.concatenate([index[whole], index[line]])
