"""Crossings for networks that have none: one over each arm of a signalised junction, to be looked at."""

from collections import defaultdict
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import combinations

import numpy as np
import shapely

from dojo_maps.description import Crossing, Junction, Lane, LaneKind, Origin, Road, RoadMap, points
from dojo_maps.enrichment.sidewalks import has_sidewalk
from dojo_maps.geometry.polylines import Floats, drop_repeats, place_on, strip_outline
from dojo_maps.index import MapIndex

_WIDTH = 3.0
_PAST_LANE_END = 0.6
_BEFORE_LANE_END = 0.3
_SHORTEST_ROAD = 8.0
_SAME_ARM = np.radians(50.0)
_REACH = 4.0
"""How far a crossing may run past the outermost lanes to reach the kerb, metres."""


@dataclass(frozen=True, slots=True)
class _Arm:
    """The roads that leave a junction to one side, as seen from its lanes' ends."""

    roads: tuple[str, ...]
    into: Floats
    """(2,) unit vector from the arm into the junction."""
    ends: Floats
    """(n, 2) corners of the lanes' ends at the junction, metres."""
    height: float


def generate_crossings(road_map: RoadMap) -> tuple[Crossing, ...]:
    """Lay a crossing over each arm of every signalised junction with three arms or more.

    Where there is room they lie on the junction's floor, just past the ends of the lanes; at a tight junction
    all of them lie on the arms, just before the ends of the lanes.
    """
    index = MapIndex(road_map)
    found: list[Crossing] = []
    for junction in road_map.junctions:
        if not junction.kind.startswith("traffic_light") or len(junction.polygon) < 3:
            continue
        arms = _arms(junction, index.roads, index.lanes)
        if len(arms) > 2:
            found += _cross(junction, arms)
    return tuple(found)


def _cross(junction: Junction, arms: list[_Arm]) -> Iterator[Crossing]:
    floor = shapely.make_valid(shapely.Polygon(junction.polygon[:, :2]))
    inside = [_across_floor(arm, floor) for arm in arms]
    lines = [line for line in inside if line is not None]
    if len(lines) < len(arms) or _overlap(lines):
        lines = [_across_lanes(arm) for arm in arms]
    for arm, line in zip(arms, lines, strict=True):
        shape = points(np.column_stack([np.round(line, 4), np.full(2, arm.height)]))
        yield Crossing(
            id=f"generated:{junction.id}:{arm.roads[0]}",
            origin=Origin.GENERATED,
            junction=junction.id,
            roads=arm.roads,
            width=_WIDTH,
            shape=shape,
            polygon=strip_outline(shape, _WIDTH),
            signal=None,
            link_index=None,
        )


def _overlap(lines: list[Floats]) -> bool:
    strips = [shapely.LineString(line).buffer(_WIDTH / 2, cap_style="flat") for line in lines]
    return any(a.intersection(b).area > 0.5 for a, b in combinations(strips, 2))


def _across_lanes(arm: _Arm) -> Floats:
    """Find a crossing's centre line just before the ends of an arm's lanes; (2, 2) metres.

    Where the lanes of an arm end at different places, the line runs as obliquely as they do.
    """
    side = np.array([-arm.into[1], arm.into[0]])
    reach, ahead = arm.ends @ side, arm.ends @ arm.into
    borders = [int(reach.argmin()), int(reach.argmax())]
    level = np.interp(reach, reach[borders], ahead[borders])
    back = float((level - ahead).max()) + _BEFORE_LANE_END + _WIDTH / 2
    line: Floats = arm.ends[borders] - back * arm.into
    return line


def _across_floor(arm: _Arm, floor: shapely.Geometry) -> Floats | None:
    """Find a crossing's centre line past the ends of an arm's lanes, from kerb to kerb; (2, 2) metres."""
    side = np.array([-arm.into[1], arm.into[0]])
    ahead = float((arm.ends @ arm.into).max()) + _PAST_LANE_END + _WIDTH / 2
    low, high = float((arm.ends @ side).min()), float((arm.ends @ side).max())
    start, end = ((t * side + ahead * arm.into) for t in (low - _REACH, high + _REACH))
    on_floor = shapely.LineString([start, end]).intersection(floor)
    middle = shapely.Point((low + high) / 2 * side + ahead * arm.into)
    parts = [part for part in shapely.get_parts(on_floor) if part.distance(middle) < 0.1]
    if not parts or parts[0].length < 0.8 * (high - low):
        return None
    line: Floats = shapely.get_coordinates(parts[0])[[0, -1]]
    return line


def _arms(junction: Junction, road_of: dict[str, Road], lane_of: dict[str, Lane]) -> list[_Arm]:
    """Group the roads at a junction into arms: those that run side by side or to the same junction."""
    ends: list[tuple[Road, float, list[Lane], bool]] = []
    for road_id in (*junction.incoming, *junction.outgoing):
        road, arrives = road_of[road_id], road_id in junction.incoming
        lanes = [lane_of[i] for i in road.lanes if lane_of[i].kind is not LaneKind.SIDEWALK]
        lanes = [lane for lane in lanes if len(drop_repeats(lane.shape)) > 1]
        if not lanes or not has_sidewalk(road, lane_of) or lanes[0].length < _SHORTEST_ROAD:
            continue
        heading = place_on(lanes[0].shape, -0.01 if arrives else 0.0)[1]
        ends.append((road, heading if arrives else heading + np.pi, lanes, arrives))
    groups: dict[int, list[int]] = defaultdict(list)
    for k, (road, heading, _, _) in enumerate(ends):
        match = (g for g, members in groups.items() if _same_arm(road, heading, *ends[members[0]][:2]))
        groups[next(match, k)].append(k)
    return [_arm([ends[k] for k in members]) for members in groups.values()]


def _same_arm(road: Road, heading: float, other: Road, other_heading: float) -> bool:
    turn = abs((heading - other_heading + np.pi) % (2 * np.pi) - np.pi)
    far = {road.from_junction, road.to_junction} == {other.from_junction, other.to_junction}
    return bool(turn < (_SAME_ARM if far else _SAME_ARM / 2))


def _arm(ends: list[tuple[Road, float, list[Lane], bool]]) -> _Arm:
    headings = np.array([heading for _, heading, _, _ in ends])
    into = np.array([np.cos(headings).sum(), np.sin(headings).sum()])
    into /= np.hypot(*into)
    corners = [
        corner for _, _, lanes, arrives in ends for lane in lanes for corner in _end_corners(lane, arrives)
    ]
    _, _, lanes, arrives = ends[0]
    return _Arm(
        roads=tuple(road.id for road, *_ in ends),
        into=into,
        ends=np.array(corners),
        height=float(lanes[0].shape[-1 if arrives else 0, 2]),
    )


def _end_corners(lane: Lane, arrives: bool) -> Iterator[Floats]:
    position, heading = place_on(lane.shape, -1e-6 if arrives else 0.0)
    normal = np.array([-np.sin(heading), np.cos(heading)])
    for side in (-0.5, 0.5):
        yield position[:2] + side * lane.width * normal
