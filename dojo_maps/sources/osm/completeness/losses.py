"""What of an extract a built network lacks, each loss with the OSM element and a link to it.

Things beside roads, such as trees and bus stops, tell their own losses: `surroundings.props`.
"""

import math
from collections import defaultdict
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import shapely

from dojo_maps.index import MapIndex
from dojo_maps.issue import Element, Issue, Severity
from dojo_maps.sources.osm.graph.edge_id import EdgeId
from dojo_maps.sources.osm.network.osm_network import OsmNetwork
from dojo_maps.sources.osm.plain.lane_connections import arrow_targets
from dojo_maps.sources.osm.plain.movements import Movement
from dojo_maps.sources.osm.read.conditions import UnreadCondition
from dojo_maps.sources.osm.read.data import OsmData, link_to
from dojo_maps.sources.osm.read.restrictions import Restriction
from dojo_maps.wording import counted

Share = tuple[int, int]
"""How many are kept, of how many."""


@dataclass(slots=True)
class Left:
    """What of one kind was not built: its metres, and the way that most of them are of."""

    metres: float = 0.0
    ways: int = 0
    longest: float = 0.0
    way: int = 0
    place: tuple[float, float] = field(default=(0.0, 0.0))

    def add(self, way: int, lost: shapely.Geometry) -> None:
        """Count what of a way was not built.

        Args:
            way: its id.
            lost: the part of its line that was not built, metres.
        """
        self.metres += lost.length
        self.ways += 1
        if lost.length > self.longest:
            point = lost.interpolate(0.5, normalized=True) if lost.geom_type == "LineString" else None
            point = point or lost.representative_point()
            self.longest, self.way, self.place = lost.length, way, (point.x, point.y)


def share_of(share: Share) -> dict[str, Any]:
    """Give a share as the report has it.

    Args:
        share: how many are kept, of how many.

    Returns:
        `kept`, `of` and `share`, which is None where there was nothing to keep.
    """
    kept, total = share
    return {"kept": kept, "of": total, "share": round(kept / total, 4) if total else None}


def loss(  # noqa: PLR0913
    check: str,
    what: str,
    osm: tuple[str, int],
    place: tuple[float, float],
    hint: str,
    *,
    near: Element | None = None,
    severity: Severity = Severity.WARNING,
    measured: float | None = None,
    limit: float | None = None,
) -> Issue:
    """Report something of the extract that the network lacks.

    Args:
        check: dotted id of the check.
        what: is lacking, in words; the message goes on with a link to the element.
        osm: the element that it is mapped by: node, way or relation, and its id.
        place: x and y, metres, map frame.
        hint: what to do about it.
        near: the network's own element there, named first; None for none.
        severity: how much it matters.
        measured: the value found; None for none.
        limit: the value expected; None for none.

    Returns:
        The issue, on the ground.
    """
    kind, element = osm
    elements = [near] if near else []
    return Issue(
        check=check,
        severity=severity,
        elements=(*elements, Element(kind=f"osm_{kind}", id=str(element))),
        position=(place[0], place[1], 0.0),
        message=f"{what}: {link_to(kind, element)}",
        hint=hint,
        measured=measured,
        limit=limit,
    )


def check_crossings(network: OsmNetwork) -> tuple[Share, list[Issue]]:
    """Look for a built crossing within 10 m of each mapped one.

    Args:
        network: as it was built.

    Returns:
        How many have one, of how many; and a warning for each that has none.
    """
    built = [shapely.LineString(c.shape[:, :2]) for c in network.road_map.crossings]
    tree, within = shapely.STRtree(built), network.layout.rules.completeness.crossing_found
    why = {id(crossing): reason for crossing, reason in network.layout.lost}
    issues = []
    for crossing in network.layout.crossings:
        place = shapely.Point(crossing.place)
        nearest = tree.nearest(place) if built else None
        distance = built[nearest].distance(place) if nearest is not None else np.inf
        if distance > within:
            reason = why.get(id(crossing), f"the nearest is {distance:.0f} m away")
            issues.append(
                loss(
                    "osm.missing_crossing", f"a mapped crossing was not built ({reason})",
                    (crossing.kind, crossing.element), crossing.place,
                    "add the crossing in netedit, or map the sidewalks that it joins",
                    measured=float(round(distance, 2)) if np.isfinite(distance) else None,
                    limit=within,
                )
            )  # fmt: skip
    total = len(network.layout.crossings)
    return (total - len(issues), total), issues


def tell_guesses(network: OsmNetwork) -> list[Issue]:
    """Name the junctions whose crossings nobody has mapped.

    Args:
        network: as it was built.

    Returns:
        A note for each junction, with the number of crossings guessed.
    """
    graph = network.layout.graph
    return [
        loss(
            "osm.guessed_crossing",
            f"{counted(count, 'crossing')} at this signal guessed, for none is mapped",
            ("node", junction), graph.places[junction],
            "map the crossings, or remove them in netedit", severity=Severity.NOTE, measured=count,
        )
        for junction, count in sorted(network.plain.guessed.items())
    ]  # fmt: skip


def tell_unread_conditions(
    data: OsmData, network: OsmNetwork, unread: Sequence[UnreadCondition]
) -> tuple[Issue, ...]:
    """Name the conditions of tags that are not understood, each with the first element that has it.

    Args:
        data: the extract, with or without its conditions.
        network: as it was built from it.
        unread: the conditions, as `apply_conditions` found them.

    Returns:
        A note for each; none for a condition whose first element is nowhere on the map.
    """
    places = network.layout.graph.places
    issues = []
    for condition in unread:
        first = condition.elements[0]
        if condition.kind == "way":
            nodes = list(data.ways[first].nodes)
        else:
            nodes = [member.ref for member in data.relations[first].members if member.kind == "node"]
        place = next((places[node] for node in nodes if node in places), None)
        tag = f"{condition.key}={condition.value[:100]}"
        if place is not None:
            issues.append(
                loss(
                    "osm.condition_unread",
                    f"{len(condition.elements)} {condition.kind}s have {tag}, "
                    "which is not understood and left out; the first is",
                    (condition.kind, first), place,
                    "set what holds at your hours in netedit, or without the condition in the data",
                    severity=Severity.NOTE, measured=len(condition.elements),
                )
            )  # fmt: skip
    return tuple(issues)


def check_signals(network: OsmNetwork) -> tuple[Share, list[Issue]]:
    """Look for exactly one controller at each signalised junction, and one near each other signal.

    Args:
        network: as it was built.

    Returns:
        How many signals are as they should be, of how many, junctions that share a controller counted once;
        and a warning for each other.
    """
    junctions, graph = network.layout.junctions, network.layout.graph
    control = {junction: signal.id for signal in network.road_map.signals for junction in signal.junctions}
    groups: dict[int, list[int]] = defaultdict(list)
    for junction, controller in junctions.controllers.items():
        groups[controller].append(junction)
    issues = []
    for members in groups.values():
        found = {control.get(network.plain.nodes.get(junction, "")) for junction in members}
        if len(found) == 1 and None not in found:
            continue
        node = junctions.signals[members[0]][0]
        check = "osm.split_signal" if len(found - {None}) > 1 else "osm.missing_signal"
        what = "a signalised junction has several controllers" if len(found) > 1 else "a signal was not built"
        issues.append(
            loss(check, what, ("node", node), graph.places[members[0]], "set the junction's type in netedit")
        )
    signalised = [graph.places[vertex] for vertex, of in junctions.of.items() if of in junctions.signals]
    farthest = graph.rules.signals.before_junction
    alone = [
        node
        for node in junctions.stray
        if all(math.dist(graph.places[node], place) > farthest for place in signalised)
    ]
    issues += [
        loss(
            "osm.missing_signal", "a signal was not built: no junction or crossing is near that it is for",
            ("node", node), graph.places[node], "choose a larger area, or map the crossing or road there",
        )
        for node in alone
    ]  # fmt: skip
    total = len(groups) + len(alone)
    return (total - len(issues), total), issues


def check_turn_lanes(network: OsmNetwork) -> tuple[Share, list[Issue]]:
    """Compare the arrows painted on approaches with where their lanes lead, for turns that exist.

    Args:
        network: as it was built.

    Returns:
        How many approaches lead as painted, of those with arrows and a choice; and a note for each other.
    """
    index = MapIndex(network.road_map)
    roads, leaving = index.roads, index.leaving
    lane_road = {lane.id: lane.road for lane in network.road_map.lanes}
    movements: dict[EdgeId, list[Movement]] = defaultdict(list)
    for movement in network.plain.movements:
        movements[movement.source.incoming].append(movement)
    left_hand = network.road_map.left_hand
    total, issues = 0, []
    for edge, section in sorted(network.plain.sections.items(), key=lambda entry: str(entry[0])):
        road = roads.get(str(edge))
        lanes = section.road.forward
        angles = [movement.angle for movement in movements[edge]]
        if road is None or len(angles) < 2 or not any(lane.turns for lane in lanes):
            continue
        total += 1
        names = road.lanes[len(road.lanes) - len(lanes) :]
        missing = [
            turn
            for lane, name in zip(lanes, names, strict=True)
            for turn in lane.turns
            if (number := arrow_targets(turn, angles, left_hand=left_hand)) is not None
            and str(movements[edge][number].target.outgoing)
            not in {lane_road[connection.to_lane] for connection in leaving.get(name, ())}
        ]
        if missing:
            way = section.ways[-1]
            issues.append(
                loss(
                    "osm.turn_lane_lost", f"lanes of {edge} do not lead as their arrows say ({missing[0]})",
                    ("way", way), network.layout.graph.places[section.end],
                    "correct turn:lanes, or connect the lanes in netedit",
                    near=Element(kind="road", id=str(edge)), severity=Severity.NOTE,
                )
            )  # fmt: skip
    return (total - len(issues), total), issues


def check_restrictions(network: OsmNetwork) -> tuple[Share, list[Issue]]:
    """Look for connections that a turn restriction forbids.

    Args:
        network: as it was built.

    Returns:
        How many restrictions are kept, of those between two ways that are built, without a way between; and a
        warning for each other.
    """
    sections = network.plain.sections
    by_first, by_last = defaultdict(set), defaultdict(set)
    for edge, section in sections.items():
        if section.road.forward:
            by_first[section.ways[0]].add(edge)
            by_last[section.ways[-1]].add(edge)
    lane_road = {lane.id: EdgeId.read(lane.road) for lane in network.road_map.lanes}
    pairs = {(lane_road[c.from_lane], lane_road[c.to_lane]) for c in network.road_map.connections}
    total, issues = 0, []
    for restriction in network.restrictions:
        if restriction.via_ways or not (by_last[restriction.source] and by_first[restriction.target]):
            continue
        total += 1
        if _is_broken(restriction, network, by_first, by_last, pairs):
            place = network.layout.graph.places.get(restriction.via[0], (0.0, 0.0))
            issues.append(
                loss(
                    "osm.restriction_lost", "a forbidden turn is connected",
                    ("relation", restriction.relation), place, "remove the connection in netedit",
                )
            )  # fmt: skip
    return (total - len(issues), total), issues


def _is_broken(
    restriction: Restriction,
    network: OsmNetwork,
    by_first: dict[int, set[EdgeId]],
    by_last: dict[int, set[EdgeId]],
    pairs: Iterable[tuple[EdgeId, EdgeId]],
) -> bool:
    of = network.layout.junctions.of
    here = {of.get(node) for node in restriction.via} - {None}
    sections = network.plain.sections
    ending = {e for e in by_last[restriction.source] if of[sections[e].end] in here}
    starting = {e for e in by_first[restriction.target] if of[sections[e].start] in here}
    taken = [(a, b) for a, b in pairs if a in ending and b in sections and of[sections[b].start] in here]
    if restriction.only:
        return bool(starting) and any(b not in starting and b.section != a.section for a, b in taken)
    return any(b in starting for _, b in taken)
