"""Checks of single ways across junctions: turns that miss, lead the wrong way, or run over other roads."""

from collections.abc import Iterator

import numpy as np
import shapely

from dojo_maps.description import CARRIAGEWAY, Connection, Lane, Road
from dojo_maps.geometry.polylines import Floats, place_on
from dojo_maps.signals.waiting import find_meetings
from dojo_maps.validation.check import ERROR, WARNING, Finding, check, element
from dojo_maps.validation.facts import Facts, direction, turn_deg
from dojo_maps.validation.profiles import Limits

_NEAR = 5.0
"""Metres from a lane's other end within which a way meets it there."""


@check(
    id="topology.missing_turn",
    code="TOP004",
    title="Roads that go straight on are connected",
    severity=WARNING,
    limit="one connection within 30° of straight on",
    source="SUMO tracker 14478",
    hint="add the connection, or exclude the finding where the movement is forbidden",
)
def check_missing_turn(facts: Facts, limits: Limits) -> Iterator[Finding]:
    """Find roads that go straight on across a junction for cars without a connection that does.

    Only the straight way is expected: turns are forbidden at many junctions, and a network does not say so. A
    straight way that another road takes, of the two that lie closest, is not missing either.

    Args:
        facts: of the map.
        limits: `straight_deg`, degrees of turn up to which a road goes straight on.

    Yields:
        A finding for each such road, with the degrees of turn to the road that it should lead to.
    """
    for junction in facts.map.junctions:
        if junction.kind == "dead_end" or junction.kind.startswith("rail"):
            continue
        roads, ways = (
            [facts.roads[id_] for id_ in ids if "passenger" in facts.classes(id_)]
            for ids in (junction.incoming, junction.outgoing)
        )
        for road in roads:
            onward = [other for other in ways if other.to_junction != road.from_junction]
            if onward and any(facts.leaving.get(lane) for lane in road.lanes):
                yield from _missing_straight(facts, limits, road, onward)


def _missing_straight(facts: Facts, limits: Limits, road: Road, onward: list[Road]) -> Iterator[Finding]:
    arriving = facts.heading(road, at_end=True)
    turns = [turn_deg(arriving, facts.heading(other, at_end=False)) for other in onward]
    best = int(np.argmin([abs(turn) for turn in turns]))
    if abs(turns[best]) > limits.straight_deg:
        return
    linked = [k for k, other in enumerate(onward) if (road.id, other.id) in facts.road_links]
    if best in linked or any(abs(turns[k]) < limits.straight_deg for k in linked):
        return
    lane = facts.lanes_of(road.id)[-1]
    yield Finding(
        elements=element("road", road.id, onward[best].id),
        at=lane.shape[-1],
        message=f"no way leads straight on from the road {road.id} to {onward[best].id}",
        measured=abs(turns[best]),
        limit=limits.straight_deg,
    )


@check(
    id="topology.wrong_way",
    code="TOP008",
    title="Ways enter lanes in their direction",
    severity=ERROR,
    limit="150° of turn unless it is a turning back",
    source="geometry",
    hint="reverse the lane's shape, or correct the connection's lanes",
)
def check_wrong_way(facts: Facts, limits: Limits) -> Iterator[Finding]:
    """Find ways that meet a lane at its other end, and straight ways that turn back.

    A hairpin is no wrong way: its path bends round and meets the lane where it begins.

    Args:
        facts: of the map.
        limits: `turn_back_deg`, degrees of turn beyond which a straight way turns back, and `gap_error`,
            metres up to which a way meets its lane.

    Yields:
        A finding for each such way; of its lanes the one at fault is named first.
    """
    for connection in facts.map.connections:
        one, other = facts.lanes[connection.from_lane], facts.lanes[connection.to_lane]
        problem, lanes = "", (other, one)
        if facts.roads[one.road].to_junction != facts.roads[other.road].from_junction:
            problem = "does not begin where the way ends"
        elif (
            connection.direction == "s"
            and not connection.via
            and _turn_between(one, other) > limits.turn_back_deg
        ):
            problem = "runs against the way, which is said to go straight on"
        elif max((across for across, _ in connection.joints), default=0.0) < limits.gap_error:
            continue
        elif _is_nearer(connection.shape[1], one.shape[0], one.shape[-1], limits):
            problem, lanes = "is met at its other end", (one, other)
        elif _is_nearer(connection.shape[-2], other.shape[-1], other.shape[0], limits):
            problem = "is met at its other end"
        if problem:
            yield Finding(
                elements=(*element("connection", connection.id), *element("lane", *(x.id for x in lanes))),
                at=one.shape[-1] if lanes[0] is one else other.shape[0],
                message=f"the connection {connection.id}: the lane {lanes[0].id} {problem}",
            )


def _turn_between(one: Lane, other: Lane) -> float:
    return abs(turn_deg(-direction(one.shape[::-1]), direction(other.shape)))


def _is_nearer(place: Floats, wrong: Floats, right: Floats, limits: Limits) -> bool:
    """Tell whether a path's end lies off the end of a lane that it should meet, and nearer to the other."""
    gaps = [float(np.hypot(*(end - place)[:2])) for end in (wrong, right)]
    return gaps[0] + limits.gap_error < gaps[1] and gaps[0] < _NEAR


@check(
    id="topology.lane_type_mix",
    code="TOP009",
    title="Ways join lanes for the same vehicles",
    severity=ERROR,
    limit="one vehicle class in common",
    source="SUMO tracker 8538, 13087",
    hint="correct the permissions of the lanes, or connect the lane beside",
)
def check_lane_type_mix(facts: Facts, _limits: Limits) -> Iterator[Finding]:
    """Find ways that no vehicle may use at both ends, and roads for cars joined for others only.

    Args:
        facts: of the map.
        _limits: there is none to this check.

    Yields:
        An error for each such way, and a warning for each such pair of roads.
    """
    for connection in facts.map.connections:
        one, other = facts.lanes[connection.from_lane], facts.lanes[connection.to_lane]
        if one.allow and other.allow and not set(one.allow) & set(other.allow):
            yield Finding(
                elements=(*element("connection", connection.id), *element("lane", one.id, other.id)),
                at=one.shape[-1],
                message=f"no vehicle may use both ends of the connection {connection.id}",
            )
    for (one_road, other_road), connections in facts.road_links.items():
        if _excludes_cars(facts, one_road, other_road, connections):
            first = connections[0]
            yield Finding(
                elements=(
                    *element("connection", first.id),
                    *element("lane", first.from_lane, first.to_lane),
                    *element("road", one_road, other_road),
                ),
                at=facts.lanes[first.from_lane].shape[-1],
                message=f"from the road {one_road} to {other_road} cars may not use any connection",
                severity=WARNING,
            )


def _excludes_cars(facts: Facts, one: str, other: str, connections: list[Connection]) -> bool:
    if not all("passenger" in facts.classes(road) for road in (one, other)):
        return False
    driven = [c for c in connections if facts.lanes[c.from_lane].kind in CARRIAGEWAY]
    return bool(driven) and not any(
        "passenger" in facts.lanes[c.from_lane].allow and "passenger" in facts.lanes[c.to_lane].allow
        for c in connections
    )


@check(
    id="topology.median_cross",
    code="TOP010",
    title="Ways across junctions stay off other roads",
    severity=WARNING,
    limit="3 m over a third road",
    source="osm2streets",
    hint="correct the connection, or the shape of the road it runs over",
)
def check_median_cross(facts: Facts, limits: Limits) -> Iterator[Finding]:
    """Find ways across junctions that run over a road they do not join; who turns back has to.

    Args:
        facts: of the map.
        limits: `path_on_road`, metres of a way on one lane, and `level_height`, metres below which both lie
            on one level.

    Yields:
        A finding for each way and road, with the metres on the first of the road's lanes that is found.
    """
    ways = [
        c
        for c in facts.map.connections
        if len(c.shape) > 1 and facts.lanes[c.from_lane].kind in CARRIAGEWAY and c.direction not in ("t", "T")
    ]
    if not ways or not facts.drivable:
        return
    paths = np.array([shapely.linestrings(c.shape[:, :2] - facts.origin[:2]) for c in ways], dtype=object)
    which, strip = facts.road_tree.query(paths, predicate="intersects")
    kept = np.array(
        [_is_third(facts, ways[w], facts.drivable[s]) for w, s in zip(which, strip, strict=True)], dtype=bool
    )
    which, strip = which[kept], strip[kept]
    over = shapely.intersection(paths[which], facts.road_strips[strip])
    seen: set[tuple[int, str]] = set()
    for k in np.flatnonzero(shapely.length(over) > limits.path_on_road):
        way, lane = ways[which[k]], facts.drivable[strip[k]]
        at = shapely.get_coordinates(over[k])[0] + facts.origin[:2]
        if (int(which[k]), lane.road) in seen or not facts.near_level(
            way.shape, lane.shape, at, limits.level_height
        ):
            continue
        seen.add((int(which[k]), lane.road))
        yield Finding(
            elements=(
                *element("connection", way.id),
                *element("lane", way.from_lane, way.to_lane, lane.id),
                *element("road", lane.road),
            ),
            at=at,
            message=f"the connection {way.id} runs over the lane {lane.id}",
            measured=float(shapely.length(over[k])),
            limit=limits.path_on_road,
        )


def _is_third(facts: Facts, way: Connection, lane: Lane) -> bool:
    return lane.road not in (facts.lanes[way.from_lane].road, facts.lanes[way.to_lane].road)


@check(
    id="topology.waits_in_path",
    code="TOP017",
    title="Who waits inside a junction stands in nobody's way",
    severity=WARNING,
    limit="a car of 1.8 m, 1 m into the way of those that it lets go first",
    source="SUMO contPos",
    hint="let it wait earlier: set the connection's contPos in netedit, or give the two greens of their own",
)
def check_waits_in_path(facts: Facts, limits: Limits) -> Iterator[Finding]:
    """Find turns whose vehicles wait inside the junction for other vehicles, in the way of those.

    Such as who turns across the opposite traffic. Who is parted by a signal meets nobody.

    Args:
        facts: of the map.
        limits: `car`, the width of a car, and `in_path`, how far it may stand in the way of others; metres.

    Yields:
        A finding for each such way, with the metres by which its vehicles stand in the way.
    """
    states = {
        signal.id: [phase.state for program in signal.programs for phase in program.phases]
        for signal in facts.map.signals
    }
    meetings = find_meetings(facts.map, states, widest=limits.car, nearest=limits.in_path, walkers=False)
    for meeting in meetings:
        connection = meeting.connection
        depth = (connection.waits or 0.0) - meeting.place
        if meeting.other and depth > limits.in_path:
            yield Finding(
                elements=(
                    *element("connection", connection.id, meeting.other),
                    *element("lane", connection.from_lane, connection.to_lane),
                ),
                at=place_on(connection.shape, connection.waits or 0.0)[0],
                message=f"who waits on {connection.id} stands {depth:.1f} m in the way of {meeting.other}",
                measured=depth,
                limit=limits.in_path,
            )
