"""Checks of what leads where: dead ends, entries, pieces of the network, references."""

from collections import defaultdict
from collections.abc import Iterator

import numpy as np

from dojo_maps.description import CARRIAGEWAY, Lane, Road
from dojo_maps.geometry.polylines import Floats
from dojo_maps.validation.check import ERROR, WARNING, Check, Finding, Need, check, element
from dojo_maps.validation.facts import Facts
from dojo_maps.validation.profiles import Limits
from dojo_maps.wording import counted

_NAMED = 20
"""How many roads of a cut-off part are named."""


@check(
    id="topology.lane_dead_end",
    code="TOP001",
    title="Lanes lead on",
    severity=ERROR,
    limit="one way on per drivable lane whose road goes on",
    source="SUMO: vehicles stop for good on a lane without a connection",
    hint="add the missing connection, or end the lane before the junction",
)
def check_lane_dead_end(facts: Facts, _limits: Limits) -> Iterator[Finding]:
    """Find drivable lanes that end at a junction though their road goes on there from other lanes.

    A lane that its users can leave only by changing lanes is a trap at a junction, a warning where the road
    only loses a lane, as at the end of a ramp. Where the road has no way on at all, that is another check's
    finding; where nothing goes on for its vehicles, the map ends.

    Args:
        facts: of the map.
        _limits: there is none to this check.

    Yields:
        A finding for each such lane, at its end.
    """
    for lane in facts.drivable:
        road = facts.roads[lane.road]
        if facts.leaving.get(lane.id) or not _road_goes_on(facts, road):
            continue
        onward = [way for way in _onward(facts, road) if set(lane.allow) & facts.classes(way.id)]
        if not onward:
            continue
        yield Finding(
            elements=(*element("lane", lane.id), *element("road", road.id)),
            at=lane.shape[-1],
            message=f"the lane {lane.id} ends at the junction {road.to_junction} without a way on",
            severity=WARNING if _loses_a_lane(facts, onward) else ERROR,
        )


def _loses_a_lane(facts: Facts, onward: list[Road]) -> bool:
    """Tell whether there is one road to go on in and every lane of it is entered."""
    return len(onward) == 1 and all(facts.entering.get(lane.id) for lane in _drivable_lanes(facts, onward[0]))


@check(
    id="topology.lane_no_entry",
    code="TOP002",
    title="Lanes are entered",
    severity=WARNING,
    limit="one way in per drivable lane",
    source="netconvert: Lane is not connected from any incoming edge",
    hint="add a connection into it, unless it is a turn lane that opens here",
)
def check_lane_no_entry(facts: Facts, _limits: Limits) -> Iterator[Finding]:
    """Find drivable lanes that no way leads into though other roads come to where their road begins.

    Where one road only comes, and all of its lanes lead on, the lane opens there, as turn lanes do.

    Args:
        facts: of the map.
        _limits: there is none to this check.

    Yields:
        A finding for each such lane, at its start.
    """
    for lane in facts.drivable:
        road = facts.roads[lane.road]
        if facts.entering.get(lane.id):
            continue
        coming = _coming_from_elsewhere(facts, road, set(lane.allow))
        if not coming or (len(coming) == 1 and _leads_on_whole(facts, coming[0])):
            continue
        yield Finding(
            elements=(*element("lane", lane.id), *element("road", road.id)),
            at=lane.shape[0],
            message=f"the lane {lane.id} is not entered from the junction {road.from_junction}",
        )


@check(
    id="topology.edge_not_connected",
    code="TOP003",
    title="Roads lead on",
    severity=ERROR,
    limit="one way on per road",
    source="netconvert: Edge is not connected to outgoing edges",
    hint="add connections at the road's end",
)
def check_edge_not_connected(facts: Facts, _limits: Limits) -> Iterator[Finding]:
    """Find roads without a way on at a junction that other roads leave.

    Args:
        facts: of the map; roads without a lane for cars or buses do not count.
        _limits: there is none to this check.

    Yields:
        A finding for each such road, at its end.
    """
    for road in facts.map.roads:
        lanes = _drivable_lanes(facts, road)
        if lanes and not _road_goes_on(facts, road) and _onward(facts, road):
            yield Finding(
                elements=element("road", road.id),
                at=lanes[0].shape[-1],
                message=f"the road {road.id} ends at the junction {road.to_junction} without a way on",
            )


@check(
    id="topology.uturn_only",
    code="TOP005",
    title="Roads lead on otherwise than back",
    severity=WARNING,
    limit="one way on that is no turning back",
    source="SUMO tracker 12978",
    hint="add the missing connections at the road's end",
)
def check_uturn_only(facts: Facts, _limits: Limits) -> Iterator[Finding]:
    """Find roads that can only be turned back on though other roads leave their end.

    Args:
        facts: of the map; only lanes for cars or buses count.
        _limits: there is none to this check.

    Yields:
        A finding for each such road, at its end.
    """
    for road in facts.map.roads:
        lanes = _drivable_lanes(facts, road)
        ways = [c for lane in lanes for c in facts.leaving.get(lane.id, ())]
        if ways and all(c.direction in ("t", "T") for c in ways) and _onward(facts, road):
            yield Finding(
                elements=element("road", road.id),
                at=lanes[0].shape[-1],
                message=f"from the road {road.id} one can only turn back at the junction {road.to_junction}",
            )


def _drivable_lanes(facts: Facts, road: Road) -> list[Lane]:
    return [lane for lane in facts.lanes_of(road.id) if lane.kind in CARRIAGEWAY]


def _road_goes_on(facts: Facts, road: Road) -> bool:
    return any(facts.leaving.get(lane) for lane in road.lanes)


def _onward(facts: Facts, road: Road) -> list[Road]:
    """List the drivable roads that a road could lead into."""
    if facts.kind(road.to_junction) == "dead_end":
        return []
    ways = facts.ways_on(road, facts.junctions.get(road.to_junction))
    return [way for way in ways if _drivable_lanes(facts, way)]


def _leads_on_whole(facts: Facts, road: Road) -> bool:
    return all(facts.leaving.get(lane.id) for lane in _drivable_lanes(facts, road))


def _coming_from_elsewhere(facts: Facts, road: Road, classes: set[str]) -> list[Road]:
    """List the roads that could lead into a road; at the map's edge those that end there do not."""
    junction = facts.junctions.get(road.from_junction)
    if junction is None or junction.kind == "dead_end":
        return []
    roads = [facts.roads[id_] for id_ in junction.incoming]
    return [
        other
        for other in roads
        if other.from_junction != road.to_junction
        and classes & facts.classes(other.id)
        and _drivable_lanes(facts, other)
    ]


@check(
    id="topology.components",
    code="TOP006",
    title="The road network is one",
    severity=WARNING,
    limit="1 part for cars",
    source="SUMO netcheck.py",
    hint="join the part, or drop it with netconvert --keep-edges.components 1",
)
def check_components(facts: Facts, _limits: Limits) -> Iterator[Finding]:
    """Find parts of the road network for cars that no way joins with the largest part.

    Args:
        facts: of the map.
        _limits: there is none to this check.

    Yields:
        A finding for each part but the largest, with the number of its roads; it names up to 20 of them.
    """
    groups = _groups(facts)
    for group in groups[1:]:
        first = facts.roads[group[0]]
        yield Finding(
            elements=element("road", *group[:_NAMED]),
            at=facts.lanes_of(first.id)[0].shape[0],
            message=f"not joined with the other {len(groups[0])}: {counted(len(group), 'road')}, "
            f"{first.id} among them",
            measured=float(len(group)),
            limit=0.0,
        )


def _groups(facts: Facts) -> list[list[str]]:
    """Divide the roads for cars into parts joined by ways, the largest first."""
    cars = [road.id for road in facts.map.roads if "passenger" in facts.classes(road.id)]
    joined: dict[str, list[str]] = defaultdict(list)
    for (one, other), connections in facts.road_links.items():
        if any(_lets_cars(facts, c.from_lane) and _lets_cars(facts, c.to_lane) for c in connections):
            joined[one].append(other)
            joined[other].append(one)
    groups, seen = [], set[str]()
    for start in cars:
        group, rest = [], [] if start in seen else [start]
        seen.add(start)
        while rest:
            road = rest.pop()
            group.append(road)
            fresh = [other for other in joined[road] if other not in seen]
            seen.update(fresh)
            rest.extend(dict.fromkeys(fresh))
        if group:
            groups.append(group)
    return sorted(groups, key=len, reverse=True)


def _lets_cars(facts: Facts, lane: str) -> bool:
    return "passenger" in facts.lanes[lane].allow


@check(
    id="topology.unreachable_edge_in_tls",
    code="TOP007",
    title="Roads inside a signal can be reached",
    severity=WARNING,
    limit="one way in",
    source="netconvert: Unreachable edge within tlLogic",
    hint="connect the road, or remove it from the signal",
)
def check_unreachable_edge_in_tls(facts: Facts, _limits: Limits) -> Iterator[Finding]:
    """Find roads between two junctions of one signal that no way leads into.

    Args:
        facts: of the map.
        _limits: there is none to this check.

    Yields:
        A finding for each signal and road, at the road's start.
    """
    for signal in facts.signals:
        inside = set(signal.junctions)
        for road in dict.fromkeys(
            facts.lanes[link.from_id].road for link in signal.links if link.from_id in facts.lanes
        ):
            found = facts.roads[road]
            entered = any(facts.entering.get(lane) for lane in found.lanes)
            if found.from_junction in inside and found.to_junction in inside and not entered:
                yield Finding(
                    elements=(*element("road", road), *element("signal", signal.id)),
                    at=facts.lanes_of(road)[0].shape[0],
                    message=f"the road {road} inside the signal {signal.id} cannot be reached",
                )


@check(
    id="topology.unequal_lengths",
    code="TOP014",
    title="Lanes of both directions on one strip are equally long",
    severity=WARNING,
    limit="0.1 m",
    source="sumo: Unequal lengths of bidi lane; of neigh lane",
    hint="give both lanes one length, or rebuild the network with netconvert",
)
def check_unequal_lengths(facts: Facts, limits: Limits) -> Iterator[Finding]:
    """Find lanes whose length differs from that of the opposite lane on their ground or beside them.

    Args:
        facts: of the map.
        limits: `pair_length`, metres by which they may differ.

    Yields:
        A finding for each pair of lanes, with the metres by which they differ.
    """
    pairs = [(lane.id, lane.opposite) for lane in facts.map.lanes if lane.opposite in facts.lanes]
    for road in facts.map.roads:
        other = facts.roads.get(road.bidi or "")
        if other is not None and len(road.lanes) == len(other.lanes) == 1:
            pairs.append((road.lanes[0], other.lanes[0]))
    for pair in sorted({tuple(sorted(pair)) for pair in pairs if pair[1]}):
        one, two = (facts.lanes[lane] for lane in pair)
        apart = abs(one.length - two.length)
        if apart > limits.pair_length:
            yield Finding(
                elements=element("lane", one.id, two.id),
                at=one.shape[0],
                message=f"the lanes {one.id} and {two.id}, one for each direction, "
                f"are {one.length:.2f} and {two.length:.2f} m long",
                measured=apart,
                limit=limits.pair_length,
            )


@check(
    id="topology.dangling_reference",
    code="TOP012",
    title="What is named exists",
    severity=ERROR,
    limit="none",
    source="SUMO net format",
    hint="correct the name or remove what names it, then rebuild the network with netconvert",
)
def check_dangling_reference(facts: Facts, _limits: Limits) -> Iterator[Finding]:
    """Find roads that name junctions, and crossings that name roads, which are not there.

    Args:
        facts: of the map; generated crossings do not count.
        _limits: there is none to this check.

    Yields:
        A finding for each name of what is not there.
    """
    for road in facts.map.roads:
        for junction, at in ((road.from_junction, 0), (road.to_junction, -1)):
            if junction not in facts.junctions:
                shape = facts.lanes_of(road.id)[0].shape
                yield _dangling("road", road.id, "junction", junction, shape[at])
    for crossing in facts.crossings.values():
        for name in crossing.roads:
            if name not in facts.roads:
                yield _dangling("crossing", crossing.id, "road", name, crossing.shape[0])


def _dangling(kind: str, id_: str, named: str, name: str, at: Floats) -> Finding:
    return Finding(
        elements=(*element(kind, id_), *element(named, name)),
        at=np.array(at),
        message=f"the {kind} {id_} names the {named} {name}, which the network does not have",
    )


TURN_LANE_MISMATCH = Check(
    id="topology.turn_lane_mismatch",
    code="TOP011",
    title="Turn lanes are as many as lanes",
    severity=WARNING,
    limit="turn:lanes names each driving lane",
    source="netconvert: Ignoring turn sign information",
    hint="correct the tags in OpenStreetMap",
    needs=Need.OSM,
)
DUPLICATE_ID = Check(
    id="topology.duplicate_id",
    code="TOP013",
    title="Ids are unique",
    severity=ERROR,
    limit="none",
    source="SUMO net format",
    hint="give each its own id",
)
REQUEST_MISMATCH = Check(
    id="topology.request_mismatch",
    code="TOP013",
    title="Junctions have a rule for each of their links",
    severity=ERROR,
    limit="one request per link",
    source="SUMO net format",
    hint="rebuild the network with netconvert",
)
UNKNOWN_CLASS = Check(
    id="topology.unknown_class",
    code="TOP015",
    title="Permissions name vehicle classes that there are",
    severity=WARNING,
    limit="SUMO's classes",
    source="sumo: Unknown vehicle class ignored",
    hint="correct the lane's permissions",
)
STOP_OFFSET_REPEATED = Check(
    id="topology.stop_offset_repeated",
    code="TOP016",
    title="Lanes have one stop offset",
    severity=WARNING,
    limit="one",
    source="sumo: Duplicate stopOffset definition",
    hint="leave one of them",
)
