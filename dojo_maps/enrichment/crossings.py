"""Crossings for networks that have none: one over each arm of a signalised junction, to be looked at."""

from collections import defaultdict
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from itertools import combinations

import numpy as np
import shapely

from dojo_maps.description import Crossing, Junction, Lane, LaneKind, Origin, Road, RoadMap, points
from dojo_maps.enrichment.sidewalks import has_sidewalk
from dojo_maps.geometry.pieces import lane_strips
from dojo_maps.geometry.polylines import Floats, drop_repeats, place_on, strip_outline
from dojo_maps.index import MapIndex

_WIDTHS = (3.0, 2.5, 2.0)
"""Tried in this order at each junction, metres."""
_PAST_LANE_END = 0.6
"""From where vehicles wait to the crossing, metres."""
_BEFORE_LANE_START = 0.3
_SLANTS = (0.0, 1.0)
"""A crossing is square to its arm or else as oblique as the line that the lanes' ends make."""
_SHORTEST_ROAD = 8.0
_SAME_ARM = np.radians(50.0)
_REACH = 4.0
"""How far a crossing may run past the outermost lanes to reach the kerb, metres."""
_MOST_LOST = 2.0
"""How much of the outermost lane a crossing may leave out, where a kerb or a neighbour's end is, metres."""
_TIE = 0.05
_LEAST_SHARED = 0.01
"""Square metres."""
_SLIT = 0.1
"""Slits between the ends of lanes and the junction's floor are no kerb, metres."""


@dataclass(frozen=True, slots=True)
class _Arm:
    """The roads that leave a junction to one side, as seen from its lanes' ends."""

    roads: tuple[str, ...]
    into: Floats
    """(2,) unit vector from the arm into the junction."""
    ends: Floats
    """(n, 2) corners of the lanes' ends at the junction, metres."""
    waiting: Floats
    """(m, 2) those of them where vehicles wait."""
    arriving: shapely.Geometry
    leaving: shapely.Geometry
    """The ground of the lanes that lead to the junction, and of those that lead away."""
    height: float


def generate_crossings(road_map: RoadMap) -> tuple[Crossing, ...]:
    """Lay a crossing over each arm of every signalised junction with three arms or more.

    SUMO's vehicles wait at the ends of their lanes, so a crossing lies past them, on the junction's floor.
    At a tight junction the crossings are narrower, and each gives way a little where two meet at a corner.
    An arm without room has none; one that no vehicle arrives on has its crossing on its lanes.

    Args:
        road_map: without crossings of its own; roads along which nobody walks count for no arm.

    Returns:
        The crossings, in the order of the map's junctions; no signal controls them.
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
    kept_free = shapely.union_all([arm.arriving for arm in arms]).buffer(_PAST_LANE_END, join_style="mitre")
    floor = shapely.make_valid(shapely.Polygon(junction.polygon[:, :2])).difference(kept_free)
    chosen, chosen_width = dict[int, Floats](), _WIDTHS[0]
    for width in _WIDTHS:
        lines = _lay_out(arms, floor, width)
        if len(lines) > len(chosen):
            chosen, chosen_width = lines, width
    for k, line in chosen.items():
        arm = arms[k]
        shape = points(np.column_stack([np.round(line, 4), np.full(2, arm.height)]))
        yield Crossing(
            id=f"generated:{junction.id}:{arm.roads[0]}",
            origin=Origin.GENERATED,
            junction=junction.id,
            roads=arm.roads,
            width=chosen_width,
            shape=shape,
            polygon=strip_outline(shape, chosen_width),
            signal=None,
            link_index=None,
        )


def _lay_out(arms: list[_Arm], floor: shapely.Geometry, width: float) -> dict[int, Floats]:
    """Find the centre line of each arm's crossing, by the arm's place, so that none lies on another.

    Where two meet, the one that loses less gives way; an arm whose crossing loses too much has none.
    """
    found = {k: _line_over(arm, floor, width) for k, arm in enumerate(arms)}
    kept = {k: line for k, line in found.items() if line is not None}
    while True:
        lines = dict(kept)
        for first, second in combinations(_main_road_first(arms, kept), 2):
            cut = {k: _trim(lines[k], lines[first + second - k], width) for k in (first, second)}
            lost = {k: _lost(arms[k], line) for k, line in cut.items()}
            gives_way = first if lost[first] < lost[second] - _TIE else second
            lines[gives_way] = cut[gives_way]
        lost = {k: _lost(arms[k], line) for k, line in lines.items()}
        if max(lost.values(), default=0.0) <= _MOST_LOST:
            return lines
        del kept[max(lost, key=lost.__getitem__)]


def _main_road_first(arms: list[_Arm], wanted: Iterable[int]) -> list[int]:
    """Sort arms: first the widest and those in line with it, so that opposite crossings come out alike."""
    places = sorted(wanted)
    widths = {k: float(np.ptp(arms[k].ends @ [-arms[k].into[1], arms[k].into[0]])) for k in places}
    main = arms[max(widths, key=widths.__getitem__, default=0)].into
    return sorted(places, key=lambda k: -abs(float(arms[k].into @ main)))


def _line_over(arm: _Arm, floor: shapely.Geometry, width: float) -> Floats | None:
    """Find a crossing's centre line from kerb to kerb, without regard to its neighbours; (2, 2) metres."""
    side = np.array([-arm.into[1], arm.into[0]])
    reach, ahead = arm.ends @ side, arm.ends @ arm.into
    first, last = int(reach.argmin()), int(reach.argmax())
    slope = (ahead[last] - ahead[first]) / max(reach[last] - reach[first], 1e-6)
    if not len(arm.waiting):
        back = float(ahead.min()) - _BEFORE_LANE_START - width / 2
        line: Floats = np.array([reach[[first, last]]]).T * side + back * arm.into
        return line
    ground = shapely.union_all([floor, arm.leaving]).buffer(_SLIT, join_style="mitre")
    ground = ground.buffer(-_SLIT, join_style="mitre")
    for slant in _SLANTS:
        across = side + slant * slope * arm.into
        across /= np.hypot(*across)
        normal = np.array([across[1], -across[0]])
        distance = float((arm.waiting @ normal).max()) + _PAST_LANE_END + width / 2
        line = _between_kerbs(arm, across, distance * normal, ground)
        if _lost(arm, line) <= _MOST_LOST:
            return line
    return None


def _between_kerbs(arm: _Arm, across: Floats, foot: Floats, ground: shapely.Geometry) -> Floats:
    """Cut a line to the ground; it ends at the outermost lanes where no kerb is in reach; (2, 2) metres."""
    reach = arm.ends @ across
    low, high = float(reach.min()), float(reach.max())
    whole = shapely.LineString([foot + t * across for t in (low - _REACH, high + _REACH)])
    longest = max(shapely.get_parts(whole.intersection(ground)), key=shapely.length, default=whole)
    start, end = sorted(shapely.get_coordinates(longest)[[0, -1]] @ across)
    start = low if start < low - _REACH + 0.01 else start
    end = high if end > high + _REACH - 0.01 else end
    line: Floats = foot + np.array([[start], [end]]) * across
    return line


def _trim(line: Floats, other: Floats, width: float) -> Floats:
    """Cut a crossing's line back to where its strip is clear of another's; (2, 2) metres."""
    strips = [shapely.LineString(each).buffer(width / 2, cap_style="flat") for each in (line, other)]
    shared = strips[0].intersection(strips[1])
    if shared.area < _LEAST_SHARED:
        return line
    across = (line[1] - line[0]) / np.hypot(*(line[1] - line[0]))
    start, end = line @ across
    covered = shapely.get_coordinates(shared) @ across
    if covered.mean() < (start + end) / 2:
        start = min(covered.max(), end)
    else:
        end = max(covered.min(), start)
    trimmed: Floats = line[0] + (np.array([[start], [end]]) - line[0] @ across) * across
    return trimmed


def _lost(arm: _Arm, line: Floats) -> float:
    """Measure how much of the outermost lanes a crossing leaves out, at the worse end, metres."""
    across = np.array([-arm.into[1], arm.into[0]])
    lanes, reached = arm.ends @ across, line @ across
    return float(max(reached.min() - lanes.min(), lanes.max() - reached.max()))


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
    arriving, leaving = (
        [lane for *_, lanes, arrives in ends if arrives == comes for lane in lanes] for comes in (True, False)
    )
    waiting = [corner for lane in arriving for corner in _end_corners(lane, arrives=True)]
    others = [corner for lane in leaving for corner in _end_corners(lane, arrives=False)]
    return _Arm(
        roads=tuple(road.id for road, *_ in ends),
        into=into,
        ends=np.array(waiting + others),
        waiting=np.array(waiting).reshape(-1, 2),
        arriving=shapely.union_all(lane_strips(arriving)),
        leaving=shapely.union_all(lane_strips(leaving)),
        height=float(arriving[0].shape[-1, 2] if arriving else leaving[0].shape[0, 2]),
    )


def _end_corners(lane: Lane, *, arrives: bool) -> Iterator[Floats]:
    position, heading = place_on(lane.shape, -1e-6 if arrives else 0.0)
    normal = np.array([-np.sin(heading), np.cos(heading)])
    for side in (-0.5, 0.5):
        yield position[:2] + side * lane.width * normal
