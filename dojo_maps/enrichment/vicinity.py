"""What lies around a map's signals, where cameras look: the ground that is taken, and what must be seen."""

from collections import defaultdict
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
import shapely
import shapely.ops

from dojo_maps.description import Lane, LaneKind, LinkKind, Points, RoadMap
from dojo_maps.geometry.pieces import lane_strips
from dojo_maps.geometry.polylines import Floats, Shapes, drop_repeats

_RADII = (150.0, 120.0, 90.0, 60.0, 40.0)
"""How far around signals things may stand, metres; the first that leaves few enough lanes, or the last."""
_MOST_LANES = 40_000.0
"""Metres of lanes within that distance of signals."""
_BEYOND = 40.0
"""How far around that the streets are looked at, metres."""
_SIGHT = 80.0
"""How far before its stop line traffic must be seen, metres."""
_CAMERA_AHEAD = 9.0
"""How far past the stop line, over the junction, cameras hang, metres."""
_PAST_END = 45.0
"""How far a road is taken to go on where the map ends, metres."""
_PAST_END_HALF = 4.0
"""Half the width of what is kept open there for each lane, metres."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Vicinity:
    """The part of a map near its signals; shapes are in the map's own frame, metres.

    Attributes:
        road_map: with the lanes, roads and junctions that lie in `reach`, and no others.
        focus: where things may stand.
        reach: what is known of here, which is more.
        driven: (n,) what vehicles use: lanes and the floors of junctions, overlaps and all.
        walked: (m,) pavement.
        taken: (k,) all ground that is claimed.
        sights: (j,) what stays open between cameras and traffic, and where roads go on past the map.
    """

    road_map: RoadMap
    focus: shapely.Geometry
    reach: shapely.Geometry
    driven: Shapes
    walked: Shapes
    taken: Shapes
    sights: Shapes


def look_around(road_map: RoadMap) -> Vicinity | None:
    """Find the vicinity of a map's signals; None where it has none."""
    signalled = {junction for signal in road_map.signals for junction in signal.junctions}
    places = [junction.position[:2] for junction in road_map.junctions if junction.id in signalled]
    if not places:
        return None
    lines = _lines(road_map.lanes)
    focus = _focus(shapely.points(places), lines)
    reach = focus.buffer(_BEYOND, quad_segs=4)
    shapely.prepare(reach)
    is_near = shapely.intersects(reach, lines)
    lanes = tuple(lane for lane, near in zip(road_map.lanes, is_near, strict=True) if near)
    ids = {lane.road for lane in lanes}
    roads = tuple(road for road in road_map.roads if road.id in ids)
    ends = {junction for road in roads for junction in (road.from_junction, road.to_junction)}
    junctions = tuple(junction for junction in road_map.junctions if junction.id in ends)
    walks = [thing for thing in road_map.sidewalks if thing.road is None or thing.road in ids]
    walked = areas([*(w.polygon for w in walks), *(a.polygon for a in road_map.walking_areas)])
    walked = walked[shapely.intersects(reach, walked)]
    islands = areas([p.polygon for p in road_map.props if p.kind == "island" and p.polygon is not None])
    strips = lane_strips([lane for lane in lanes if lane.kind is not LaneKind.SIDEWALK])
    driven = np.concatenate([strips, areas([junction.polygon for junction in junctions])])
    return Vicinity(
        road_map=replace(road_map, lanes=lanes, roads=roads, junctions=junctions),
        focus=focus,
        reach=reach,
        driven=driven,
        walked=walked,
        taken=np.concatenate([driven, walked, islands[shapely.intersects(reach, islands)]]),
        sights=np.array([*_sights(road_map), *_open_ends(road_map, lanes)], dtype=object),
    )


def areas(rings: Sequence[Points]) -> Shapes:
    """Make valid areas of rings (n, 3), however twisted; those of fewer than three points have none."""
    polygons = [shapely.Polygon(ring[:, :2]) for ring in rings if len(ring) > 2]
    shapes: Shapes = shapely.make_valid(np.array(polygons, dtype=object))
    return shapes


def _lines(lanes: Sequence[Lane]) -> Shapes:
    shapes = [drop_repeats(lane.shape)[:, :2] for lane in lanes]
    lines = [shapely.linestrings(shape) if len(shape) > 1 else shapely.LineString() for shape in shapes]
    return np.array(lines, dtype=object)


def _focus(places: Shapes, lines: Shapes) -> shapely.Geometry:
    for radius in _RADII:
        focus = shapely.union_all(shapely.buffer(places, radius, quad_segs=4))
        shapely.prepare(focus)
        near = lines[shapely.intersects(focus, lines)]
        if shapely.length(shapely.intersection(near, focus)).sum() < _MOST_LANES:
            break
    return focus


def _sights(road_map: RoadMap) -> Iterator[shapely.Geometry]:
    """Outline what lies between the lanes that a signal stops and a camera over the junction."""
    lane_of = {lane.id: lane for lane in road_map.lanes}
    stopped: dict[str, dict[str, Lane]] = defaultdict(dict)
    for signal in road_map.signals:
        for link in signal.links:
            if link.kind is LinkKind.VEHICLE and len(drop_repeats(lane_of[link.from_id].shape)) > 1:
                lane = lane_of[link.from_id]
                stopped[lane.road][lane.id] = lane
    for lanes in stopped.values():
        tails = [_tail(lane) for lane in lanes.values()]
        ends = np.array([tail[-1] for tail in tails])
        ways = np.array([tail[-1] - tail[-2] for tail in tails])
        ahead = ways.sum(axis=0) / max(float(np.hypot(*ways.sum(axis=0))), 1e-9)
        camera = ends.mean(axis=0) + _CAMERA_AHEAD * ahead
        strips = [
            shapely.LineString(tail).buffer(lane.width / 2, cap_style="flat")
            for tail, lane in zip(tails, lanes.values(), strict=True)
        ]
        yield shapely.union_all([*strips, shapely.Point(camera)]).convex_hull


def _tail(lane: Lane) -> Floats:
    """Take a lane's last metres (n, 2), n >= 2."""
    line = shapely.LineString(drop_repeats(lane.shape)[:, :2])
    tail = shapely.ops.substring(line, max(0.0, line.length - _SIGHT), line.length)
    return shapely.get_coordinates(tail)


def _open_ends(road_map: RoadMap, lanes: Sequence[Lane]) -> Iterator[shapely.Geometry]:
    """Carry each lane on past the map's edge, where none follows or leads to it."""
    followed = {c.from_lane for c in road_map.connections}
    entered = {c.to_lane for c in road_map.connections}
    for lane in lanes:
        shape = drop_repeats(lane.shape)[:, :2]
        if lane.kind is LaneKind.SIDEWALK or len(shape) < 2:
            continue
        ends = [(shape[-1], shape[-2])] if lane.id not in followed else []
        ends += [(shape[0], shape[1])] if lane.id not in entered else []
        for end, inner in ends:
            step = (end - inner) / np.hypot(*(end - inner))
            line = shapely.LineString([end, end + step * _PAST_END])
            yield line.buffer(lane.width / 2 + _PAST_END_HALF, cap_style="flat")
