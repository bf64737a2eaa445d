"""Sidewalks for networks that have none: along the roads of a town and around their corners."""

from collections.abc import Iterator, Sequence

import numpy as np
import shapely

from dojo_maps.description import Lane, LaneKind, Origin, Road, RoadMap, Sidewalk, points
from dojo_maps.geometry.polylines import drop_repeats, lift, offset_lines
from dojo_maps.index import MapIndex

_WIDTH = 2.0
_UNDERLAP = 0.1
"""How far generated pavement reaches under the carriageway, metres, so that no slit is left."""
_FASTEST = 22.3
"""Roads above 80 km/h have no sidewalks, m/s."""
_CLEAR = 15.0
"""A side with another carriageway closer than this, metres, is a median and gets no sidewalk."""
_VEHICLE_KINDS = (LaneKind.DRIVING, LaneKind.BUS, LaneKind.BICYCLE, LaneKind.SHOULDER, LaneKind.OTHER)


def generate_sidewalks(road_map: RoadMap) -> tuple[Sidewalk, ...]:
    """Lay pavement where people would walk and the network has none.

    Without sidewalk lanes it runs along the outer side of every road of a town, and along both sides where
    one runs alone; without walking areas it goes around the corners between roads that have a sidewalk.

    Args:
        road_map: as a source describes it.

    Returns:
        The sidewalks along roads, then those around corners. They reach a little under the carriageway.
    """
    walked = {lane.road for lane in road_map.lanes if lane.kind is LaneKind.SIDEWALK}
    along: tuple[Sidewalk, ...] = ()
    if not walked:
        along = _beside_roads(road_map)
        walked = {sidewalk.road for sidewalk in along if sidewalk.road}
    corners = () if road_map.walking_areas else tuple(_around_corners(road_map, walked))
    return along + corners


def _beside_roads(road_map: RoadMap) -> tuple[Sidewalk, ...]:
    lane_of = MapIndex(road_map).lanes
    roads = [road for road in road_map.roads if has_sidewalk(road, lane_of)]
    outer = 1.0 if road_map.left_hand else -1.0
    free = _inner_side_is_free(road_map, roads, lane_of, -outer)
    along = [*_along(roads, lane_of, 0, outer, "outer")]
    along += _along(
        [road for road, is_free in zip(roads, free, strict=True) if is_free], lane_of, -1, -outer, "inner"
    )
    return tuple(along)


def has_sidewalk(road: Road, lane_of: dict[str, Lane]) -> bool:
    """Tell whether people walk along a road: cars use it, and it is no motorway.

    Args:
        road: any of the map.
        lane_of: the map's lanes by id.

    Returns:
        False also for trunk roads, and where a lane's limit is above 80 km/h.
    """
    lanes = [lane_of[lane] for lane in road.lanes]
    drivable = any(lane.kind is LaneKind.DRIVING for lane in lanes)
    fast = "motorway" in road.kind or "trunk" in road.kind or max(lane.speed for lane in lanes) > _FASTEST
    return drivable and not fast


def _along(
    roads: Sequence[Road], lane_of: dict[str, Lane], index: int, side: float, name: str
) -> Iterator[Sidewalk]:
    lanes = [lane_of[road.lanes[index]] for road in roads]
    lanes = [lane for lane in lanes if len(drop_repeats(lane.shape)) > 1]
    lines = np.array([shapely.linestrings(drop_repeats(lane.shape)[:, :2]) for lane in lanes], dtype=object)
    widths = np.array([lane.width for lane in lanes])
    middle = offset_lines(lines, side * (widths / 2 + (_WIDTH - _UNDERLAP) / 2))
    strips = shapely.buffer(
        middle, (_WIDTH + _UNDERLAP) / 2, cap_style="flat", join_style="mitre", mitre_limit=2.0
    )
    for lane, strip in zip(lanes, strips, strict=True):
        for k, part in enumerate(shapely.get_parts(strip)):
            ring = np.round(shapely.get_coordinates(part.exterior)[:-1], 4)
            yield Sidewalk(
                id=f"generated:{lane.road}:{name}{f':{k}' if k else ''}",
                origin=Origin.GENERATED,
                road=lane.road,
                polygon=lift(ring, lane.shape),
            )


def _around_corners(road_map: RoadMap, walked: set[str]) -> Iterator[Sidewalk]:
    ends = {road.id: {road.from_junction, road.to_junction} for road in road_map.roads}
    for junction in road_map.junctions:
        roads = [road for road in (*junction.incoming, *junction.outgoing) if road in walked]
        if len(set().union(*(ends[road] for road in roads))) < 3 or len(junction.polygon) < 3:
            continue
        shape = np.vstack([junction.polygon, junction.polygon[:1]])
        corner = shapely.make_valid(shapely.Polygon(shape[:, :2])).union(shapely.LineString(shape[:, :2]))
        around = shapely.buffer(corner, _WIDTH, quad_segs=6)
        ring = np.round(shapely.get_coordinates(around.exterior)[:-1], 4)
        yield Sidewalk(
            id=f"generated:{junction.id}",
            origin=Origin.GENERATED,
            road=None,
            polygon=lift(ring, points(shape)),
        )


def _inner_side_is_free(
    road_map: RoadMap, roads: Sequence[Road], lane_of: dict[str, Lane], side: float
) -> list[bool]:
    """Tell for each road whether no other carriageway runs beside its innermost lane."""
    others = [
        lane for lane in road_map.lanes if lane.kind in _VEHICLE_KINDS and len(drop_repeats(lane.shape)) > 1
    ]
    tree = shapely.STRtree([shapely.linestrings(drop_repeats(lane.shape)[:, :2]) for lane in others])
    free = []
    for road in roads:
        lane = lane_of[road.lanes[-1]]
        reach = side * (lane.width / 2 + _CLEAR)
        hits = [
            any(others[k].road != road.id for k in tree.query(probe, predicate="intersects"))
            for probe in _probes(lane, reach)
        ]
        free.append(sum(hits) * 2 < len(hits))
    return free


def _probes(lane: Lane, reach: float) -> list[shapely.LineString]:
    """Lines across a lane's side at a quarter, half and three quarters of its way."""
    line = shapely.LineString(lane.shape[:, :2])
    if line.length == 0:
        return []
    probes = []
    for share in (0.25, 0.5, 0.75):
        here = line.interpolate(share, normalized=True)
        ahead = line.interpolate(min(share * line.length + 0.1, line.length))
        direction = np.array([ahead.x - here.x, ahead.y - here.y])
        normal = np.array([-direction[1], direction[0]]) / max(float(np.hypot(*direction)), 1e-9)
        start = np.array([here.x, here.y])
        probes.append(shapely.LineString([start, start + normal * reach]))
    return probes
