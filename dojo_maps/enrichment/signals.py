"""Where traffic stops and what it looks at: stop lines, signal heads and the poles that carry them."""

from collections import defaultdict
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
import shapely

from dojo_maps.description import (
    Crossing,
    Lane,
    LaneKind,
    Link,
    LinkKind,
    Points,
    Prop,
    RoadMap,
    Signal,
    SignalHead,
    StopLine,
    points,
)  # fmt: skip
from dojo_maps.enrichment.pole_sites import PoleSites
from dojo_maps.geometry.polylines import Floats, drop_repeats, place_on
from dojo_maps.index import MapIndex

_STOPPING_STATES = "sw"
"""Connections of these states belong to a stop sign or an all-way stop."""
_STOP_BACK = 0.15
"""Metres from a lane's end back to the middle of its stop line, which SUMO's vehicles stop before."""
_STOP_GAP = 0.75
"""Metres from a crossing on the lane, or right past its end, back to the middle of the stop line."""
_CROSSING_REACH = 15.0
HEAD_HEIGHT = 5.2
POLE_HEIGHT = 6.0
WALK_HEAD_HEIGHT = 2.3
WALK_POLE_HEIGHT = 2.7
_HEAD_SPACING = 0.55
_POLE_OFFSETS = (0.6, 1.2, 2.0, 3.0, 4.5, 6.0)
"""How far beside an approach's lanes its pole may stand in line with the heads, metres."""
_POLE_REACH = 30.0
"""How far from there it may stand where nothing of that is free, metres."""
_NARROWEST_JUNCTION, _WIDEST_JUNCTION = 8.0, 45.0
"""Lengths of ways across that have heads on the far side, metres."""
_BEYOND_JUNCTION = 1.0
"""From the end of the junction's floor to the heads on its far side, metres."""
_WALK_POLE_BACK = (0.4, 1.0, 2.0)
"""How far behind a crossing's end its pole may stand, metres."""
_WALK_POLE_ASIDE = 0.3
_WALK_POLE_REACH = 8.0
_NO_STOP_LINE = (LaneKind.RAIL, LaneKind.WATERWAY, LaneKind.SIDEWALK)


def place_stop_lines(road_map: RoadMap) -> tuple[StopLine, ...]:
    """Put a stop line before the end of every lane that ends at a signal or a stop sign.

    SUMO's vehicles stop up to a metre before the end of their lane, and there the line lies. Where a crossing
    lies on the lane, the line lies before the crossing.

    Args:
        road_map: with crossings, generated ones too.

    Returns:
        A line for each lane that has to stop, from the right of the lane to its left. Sidewalks, tracks and
        waterways have none.
    """
    stopping = {
        c.from_lane
        for c in road_map.connections
        if c.signal is not None or (c.state and c.state in _STOPPING_STATES)
    }
    lanes = [
        lane
        for lane in road_map.lanes
        if lane.id in stopping and lane.kind not in _NO_STOP_LINE and len(drop_repeats(lane.shape)) > 1
    ]
    areas = [shapely.polygons(crossing.polygon[:, :2]) for crossing in road_map.crossings]
    tree = shapely.STRtree(areas)
    return tuple(StopLine(lane=lane.id, shape=_across(lane, _stop_distance(lane, tree))) for lane in lanes)


def _stop_distance(lane: Lane, crossings: shapely.STRtree) -> float:
    """Measure how far before a lane's end its stop line lies, metres."""
    shape = drop_repeats(lane.shape)[:, :2]
    step = shape[-1] - shape[-2]
    line = shapely.LineString([*shape, shape[-1] + step / np.hypot(*step)])
    distance = _STOP_BACK
    for k in crossings.query(line, predicate="intersects"):
        met = shapely.get_coordinates(line.intersection(crossings.geometries[k]))
        before_end = line.length - 1.0 - float(shapely.line_locate_point(line, shapely.points(met)).min())
        # Farther ones belong to no stop line, and those in a short lane's first half to the road before it.
        if before_end < min(_CROSSING_REACH, line.length / 2):
            distance = max(distance, before_end + _STOP_GAP)
    return distance


def place_signal_heads(road_map: RoadMap, *, far_side: bool = False) -> RoadMap:
    """Hang a head over each signalled lane for each group of links that always show alike.

    Heads hang at the stop line on an arm that a pole beside the approach carries; walkers' heads stand at
    both ends of a signalised crossing, each facing the other end. No pole stands where vehicles drive: where
    nothing else is in reach there is none, and the heads hang over the traffic as if from a wire.

    Args:
        road_map: with stop lines and crossings.
        far_side: whether to hang each of traffic's heads a second time, where its way leaves the junction.

    Returns:
        The map, with heads in its signals and poles after its other props.
    """
    index = MapIndex(road_map)
    lane_of = index.lanes
    crossing_of = {crossing.id: crossing for crossing in road_map.crossings}
    sites = PoleSites(road_map)
    signals, poles = [], list[Prop]()
    for signal in road_map.signals:
        heads: list[SignalHead] = []
        for road, lanes in _approaches(signal, lane_of).items():
            near = [head for lane in lanes for head in _lane_heads(signal, lane)]
            heads += near
            poles += _approach_pole(signal, road, lanes, sites, left_hand=road_map.left_hand)
            way = _way_across(index, road, lanes) if far_side else None
            if way is not None:
                heads += [_moved(head, way) for head in near]
                poles += _approach_pole(signal, road, lanes, sites, left_hand=road_map.left_hand, way=way)
        for link in signal.links:
            if link.kind is LinkKind.PEDESTRIAN and link.to_id in crossing_of:
                for k, end in enumerate(_crossing_ends(crossing_of[link.to_id])):
                    place = sites.choose(end.spots, end.area)
                    heads.append(_walk_head(link, end, place))
                    if place is not None:
                        poles.append(_walk_pole(signal, link, k, place, end.height))
        signals.append(replace(signal, heads=tuple(heads)))
    return replace(road_map, signals=tuple(signals), props=road_map.props + tuple(poles))


def _across(lane: Lane, distance: float) -> Points:
    position, heading = _near_end(lane, distance)
    normal = np.array([-np.sin(heading), np.cos(heading), 0.0]) * lane.width / 2
    return points(np.round([position - normal, position + normal], 4))


def _near_end(lane: Lane, distance: float = _STOP_BACK) -> tuple[Floats, float]:
    """Find the place some metres before a lane's end, but not before its middle, and the heading there."""
    return place_on(lane.shape, max(-distance, -lane.length / 2))


def _approaches(signal: Signal, lane_of: dict[str, Lane]) -> dict[str, list[Lane]]:
    """Group the lanes a signal stops by their road, in index order."""
    approaches: dict[str, dict[str, Lane]] = defaultdict(dict)
    for link in signal.links:
        if link.kind is LinkKind.VEHICLE and len(drop_repeats(lane_of[link.from_id].shape)) > 1:
            lane = lane_of[link.from_id]
            approaches[lane.road][lane.id] = lane
    return {road: sorted(lanes.values(), key=lambda e: e.index) for road, lanes in approaches.items()}


def _lane_heads(signal: Signal, lane: Lane) -> Iterator[SignalHead]:
    groups: dict[tuple[str, ...], list[int]] = defaultdict(list)
    for link in signal.links:
        if link.from_id == lane.id and link.kind is LinkKind.VEHICLE:
            shown = tuple(_letter(p.state, link) for program in signal.programs for p in program.phases)
            groups[shown].append(link.index)
    position, heading = _near_end(lane)
    normal = np.array([-np.sin(heading), np.cos(heading)])
    spacing = min(_HEAD_SPACING, lane.width / max(len(groups), 1))
    for k, indices in enumerate(groups.values()):
        x, y = position[:2] - normal * spacing * (k - (len(groups) - 1) / 2)
        yield SignalHead(
            link_indices=tuple(sorted(set(indices))),
            position=_rounded(x, y, position[2] + HEAD_HEIGHT),
            heading=round(float((heading + 2 * np.pi) % (2 * np.pi) - np.pi), 6),
        )


def _way_across(index: MapIndex, road: str, lanes: Sequence[Lane]) -> Floats | None:
    """Measure the way from an approach's stop lines to where straight traffic leaves the junction.

    Returns:
        (3,) metres; None where the junction is too small or too large for heads on its far side.
    """
    junction = index.junctions[index.roads[road].to_junction]
    if len(junction.polygon) < 3:
        return None
    ends = [place_on(lane.shape, -1e-6) for lane in lanes]
    start = np.mean([position for position, _ in ends], axis=0)
    ahead = np.mean([(np.cos(heading), np.sin(heading)) for _, heading in ends], axis=0)
    ahead /= np.hypot(*ahead)
    floor = shapely.make_valid(shapely.Polygon(junction.polygon[:, :2]))
    met = floor.intersection(shapely.LineString([start[:2], start[:2] + _WIDEST_JUNCTION * ahead]))
    length = float((shapely.get_coordinates(met) @ ahead).max(initial=-np.inf) - start[:2] @ ahead)
    if not _NARROWEST_JUNCTION < length < _WIDEST_JUNCTION - 0.1:
        return None
    target = start[:2] + (length + _BEYOND_JUNCTION) * ahead
    starts = [index.lanes[lane].shape[0] for out in junction.outgoing for lane in index.roads[out].lanes]
    nearest = min(starts, key=lambda place: float(np.hypot(*(place[:2] - target))), default=start)
    return np.array([*(target - start[:2]), nearest[2] - start[2]])


def _moved(head: SignalHead, way: Floats) -> SignalHead:
    return replace(head, position=_rounded(*(np.array(head.position) + way)), far_side=True)


def _letter(state: str, link: Link) -> str:
    """Read what a link shows; protected and permissive green look the same."""
    return state[link.index].replace("g", "G") if link.index < len(state) else ""


def _approach_pole(
    signal: Signal,
    road: str,
    lanes: Sequence[Lane],
    sites: PoleSites,
    *,
    left_hand: bool,
    way: Floats | None = None,
) -> Iterator[Prop]:
    """Find a place for an approach's pole: outside of its lanes if free, on the inner side, or near.

    On the far side, `way` metres from the stop lines, the same in line with its lanes.
    """
    outer = 1.0 if left_hand else -1.0
    spots = []
    for lane, side in ((lanes[0], outer), (lanes[-1], -outer)):
        position, heading = _near_end(lane)
        position = position if way is None else position + way
        normal = np.array([-np.sin(heading), np.cos(heading)]) * side
        spots += [position[:2] + normal * (lane.width / 2 + offset) for offset in _POLE_OFFSETS]
    place = sites.choose(spots, shapely.Point(spots[0]).buffer(_POLE_REACH))
    if place is not None:
        x, y = place
        yield Prop(
            id=f"pole:{signal.id}:{road}{'' if way is None else ':far'}",
            kind="pole",
            height=POLE_HEIGHT,
            position=_rounded(x, y, position[2]),
            tags=(("signal", signal.id), ("road", road)) + (() if way is None else (("side", "far"),)),
        )


@dataclass(frozen=True, slots=True)
class _CrossingEnd:
    """Where a walker's head may stand at one end of a crossing, best first, and where it faces.

    `area` is where else: in reach, and nearer to this end than to the other.
    """

    spots: list[Floats]
    area: shapely.Geometry
    height: float
    heading: float


def _crossing_ends(crossing: Crossing) -> Iterator[_CrossingEnd]:
    """Describe both ends: behind each, on either side of the crossing, the head looks along it."""
    middle = (crossing.shape[0, :2] + crossing.shape[-1, :2]) / 2
    for distance in (0.0, -1e-6):
        position, heading = place_on(crossing.shape, distance)
        # The head at the start looks along the line at people coming from the end, and the other way round.
        toward = heading if distance == 0.0 else heading + np.pi
        ahead = np.array([np.cos(toward), np.sin(toward)])
        aside = (crossing.width / 2 + _WALK_POLE_ASIDE) * np.array([-np.sin(heading), np.cos(heading)])
        spots = [position[:2] - back * ahead + side for back in _WALK_POLE_BACK for side in (aside, -aside)]
        facing = round(float((toward + np.pi) % (2 * np.pi) - np.pi), 6)
        beside = 2 * _WALK_POLE_REACH * np.array([-ahead[1], ahead[0]])
        behind = middle - 2 * (_WALK_POLE_REACH + float(np.hypot(*(position[:2] - middle)))) * ahead
        half = shapely.Polygon([middle + beside, middle - beside, behind - beside, behind + beside])
        area = half.intersection(shapely.Point(spots[0]).buffer(_WALK_POLE_REACH))
        yield _CrossingEnd(spots, area, float(position[2]), facing)


def _walk_head(link: Link, end: _CrossingEnd, place: Floats | None) -> SignalHead:
    x, y = end.spots[0] if place is None else place
    height = HEAD_HEIGHT if place is None else WALK_HEAD_HEIGHT
    return SignalHead(
        link_indices=(link.index,), position=_rounded(x, y, end.height + height), heading=end.heading
    )


def _walk_pole(signal: Signal, link: Link, number: int, place: Floats, height: float) -> Prop:
    x, y = place
    return Prop(
        id=f"pole:{signal.id}:{link.to_id}:{link.index}:{number}",
        kind="pole",
        height=WALK_POLE_HEIGHT,
        position=_rounded(x, y, height),
        tags=(("signal", signal.id), ("crossing", link.to_id)),
    )


def _rounded(x: float, y: float, z: float) -> tuple[float, float, float]:
    return round(float(x), 4), round(float(y), 4), round(float(z), 4)
