"""What lies around a map's signals, where cameras look: the ground that is taken, and what must be seen."""

from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import shapely

from dojo_maps.description import Lane, LaneKind, LinkKind, Points, RoadMap, points
from dojo_maps.geometry.pieces import flat_polygons, lane_strips
from dojo_maps.geometry.polylines import Floats, Shapes, along, drop_repeats, lift_to_nearest

FORECOURT = 3.5
"""Metres between the street's edge and houses."""
_RADII = (150.0, 120.0, 100.0, 80.0, 65.0, 50.0, 40.0)
"""How far around signals things may stand, metres; the first with few enough roads there, or the last."""
_MOST_ROADS = 7_500.0
"""Metres of roads within that distance of signals."""
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

_TURNAROUNDS = ("t", "T")


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Vicinity:
    """The part of a map near its signals; shapes are in the map's own frame, metres.

    Attributes:
        road_map: with the lanes, roads and junctions that lie in `reach`, and no others.
        focus: where things may stand.
        reach: what is known of here, which is more.
        driven: (n,) what vehicles use: lanes and the floors of junctions, overlaps and all.
        walked: (m,) pavement.
        cleared: all ground that is taken, with the forecourts around it.
        sights: (k,) what stays open between cameras and traffic, and where roads go on past the map.
    """

    road_map: RoadMap
    focus: shapely.Geometry
    reach: shapely.Geometry
    driven: Shapes
    walked: Shapes
    cleared: shapely.Geometry
    sights: Shapes

    def lift(self, places: Floats) -> Points:
        """Give places the heights of the nearest lanes.

        Args:
            places: (n, 2), metres, map frame.

        Returns:
            (n, 3), metres, in the same order; x and y are rounded to the millimetre.
        """
        return lift_to_nearest(np.round(places, 3), [lane.shape for lane in self.road_map.lanes])

    def lift_outlines(self, polygons: Shapes) -> list[Points]:
        """Give the corners of polygons the heights of the nearest lanes.

        Args:
            polygons: (k,), metres, map frame; their holes are left out.

        Returns:
            One ring (n, 3) for each polygon, metres, that closes implicitly.
        """
        corners, polygon = shapely.get_coordinates(shapely.get_exterior_ring(polygons), return_index=True)
        ends = np.cumsum(np.bincount(polygon, minlength=len(polygons)))
        return [points(ring[:-1]) for ring in np.split(self.lift(corners), ends[:-1])] if len(ends) else []


def look_around(road_map: RoadMap) -> Vicinity | None:
    """Find the vicinity of a map's signals.

    Args:
        road_map: furnished, but for the town around it.

    Returns:
        The vicinity; None where no junction has a signal.
    """
    signalled = {junction for signal in road_map.signals for junction in signal.junctions}
    places = [junction.position[:2] for junction in road_map.junctions if junction.id in signalled]
    if not places:
        return None
    lines = _lines(road_map.lanes)
    is_outer = np.array([lane.index == 0 for lane in road_map.lanes])
    focus = _focus(shapely.points(places), lines[is_outer])
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
    taken = np.concatenate([driven, walked, islands[shapely.intersects(reach, islands)]])
    # Buffering all ground at once joins it, much faster than a union does.
    ground = shapely.multipolygons(flat_polygons(taken)[0])
    return Vicinity(
        road_map=replace(road_map, lanes=lanes, roads=roads, junctions=junctions),
        focus=focus,
        reach=reach,
        driven=driven,
        walked=walked,
        cleared=shapely.make_valid(shapely.buffer(ground, FORECOURT, join_style="mitre", mitre_limit=2.0)),
        sights=np.concatenate([_sights(road_map), _open_ends(road_map, lanes)]),
    )


def areas(rings: Sequence[Points]) -> Shapes:
    """Make valid areas of rings, however twisted.

    Args:
        rings: (n, 3) each, metres.

    Returns:
        (k,) areas in the same frame and order, without heights. Rings of fewer than three points have none.
    """
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
        if shapely.length(shapely.intersection(near, focus)).sum() < _MOST_ROADS:
            break
    return focus


def _sights(road_map: RoadMap) -> Shapes:
    """Outline what lies between the lanes that a signal stops and cameras over the junction."""
    lane_of = {lane.id: lane for lane in road_map.lanes}
    links = [link for signal in road_map.signals for link in signal.links if link.kind is LinkKind.VEHICLE]
    seen: dict[str, list[Floats]] = defaultdict(list)
    for lane in (lane_of[name] for name in dict.fromkeys(link.from_id for link in links)):
        shape = drop_repeats(lane.shape)[:, :2]
        if len(shape) > 1:
            seen[lane.road].append(_seen_from_ahead(shape, lane.width))
    corners = [np.concatenate(parts) for parts in seen.values()]
    hulls: Shapes = shapely.convex_hull(
        np.array([shapely.multipoints(part) for part in corners], dtype=object)
    )
    return hulls


def _seen_from_ahead(shape: Floats, width: float) -> Floats:
    """List points along both edges of a lane's last metres, and where a camera hangs that looks at them."""
    length = along(shape)
    start = max(0.0, float(length[-1]) - _SIGHT)
    first = [np.interp(start, length, axis) for axis in shape.T]
    line = np.vstack([first, shape[length > start]])
    ahead = np.diff(shape, axis=0)[-1] / np.hypot(*np.diff(shape, axis=0)[-1])
    aside = np.array([-ahead[1], ahead[0]]) * width / 2
    return np.vstack([line + aside, line - aside, line[-1] + _CAMERA_AHEAD * ahead])


def _open_ends(road_map: RoadMap, lanes: Sequence[Lane]) -> Shapes:
    """Carry each lane on past the map's edge, where none follows or leads to it but to turn around."""
    passed = [c for c in road_map.connections if c.direction not in _TURNAROUNDS]
    followed, entered = {c.from_lane for c in passed}, {c.to_lane for c in passed}
    lines, widths = [np.empty((0, 2, 2))], [np.empty(0)]
    for lane in lanes:
        shape = drop_repeats(lane.shape)[:, :2]
        if lane.kind is LaneKind.SIDEWALK or len(shape) < 2:
            continue
        for is_open, end, inner in (
            (lane.id not in followed, shape[-1], shape[-2]),
            (lane.id not in entered, *shape[:2]),
        ):
            if is_open:
                step = (end - inner) / np.hypot(*(end - inner))
                lines.append(np.array([[end, end + step * _PAST_END]]))
                widths.append(np.array([lane.width / 2 + _PAST_END_HALF]))
    return shapely.buffer(
        shapely.linestrings(np.concatenate(lines)), np.concatenate(widths), cap_style="flat"
    )
