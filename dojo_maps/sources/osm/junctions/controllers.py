"""Which junction each signal is for, and which junctions share a controller."""

import itertools
import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace

from dojo_maps.sources.osm.graph.road_graph import RoadGraph, Section
from dojo_maps.sources.osm.graph.sign_direction import sign_direction
from dojo_maps.sources.osm.junctions.grouping import Groups, Junctions, joins_carriageways
from dojo_maps.sources.osm.junctions.mapped_crossings import MappedCrossing


def assign_signals(graph: RoadGraph) -> tuple[dict[int, list[int]], list[int]]:
    """Find the vertex that each signal node is for.

    Args:
        graph: the roads.

    Returns:
        The signal nodes of each vertex; and those with no vertex near, which are stray.
    """
    ends = graph.ends()
    strong: dict[int, list[int]] = {}
    stray = []
    for node, places in sorted(graph.positions().items()):
        if graph.tags.get(node, {}).get("highway") != "traffic_signals":
            continue
        if len(ends.get(node, ())) > 2:
            strong.setdefault(node, []).append(node)
            continue
        found = [
            hit
            for name, index in places
            for hit in _downstream(
                graph, ends, graph.sections[name], index, sign_direction(graph, graph.sections[name], node)
            )
        ]
        if found:
            strong.setdefault(min(found)[1], []).append(node)
        else:
            stray.append(node)
    return strong, stray


def signals_of_junctions(
    graph: RoadGraph,
    of: Mapping[int, int],
    assigned: Mapping[int, Sequence[int]],
    crossings: Iterable[MappedCrossing],
) -> dict[int, list[int]]:
    """List the signal nodes of each junction; two signalised crossings are enough to give it signals.

    Args:
        graph: the roads.
        of: the junction of each vertex.
        assigned: the signal nodes of each vertex.
        crossings: where people cross.

    Returns:
        OSM nodes by junction; without junctions that have no signals.
    """
    ends = graph.ends()
    signals: dict[int, list[int]] = {}
    for vertex, nodes in sorted(assigned.items()):
        signals.setdefault(of[vertex], []).extend(nodes)
    near: dict[int, list[int]] = {}
    for crossing in crossings:
        if not crossing.signalised:
            continue
        section = graph.sections[crossing.section]
        rest = graph.length(section) - crossing.along
        distance, vertex = min((crossing.along, section.start), (rest, section.end))
        if distance <= graph.rules.signals.crossing_at_junction and len(ends[vertex]) > 2:
            near.setdefault(of[vertex], []).append(crossing.node)
    for junction, nodes in sorted(near.items()):
        if len(nodes) > 1:
            signals.setdefault(junction, nodes)
    return signals


def share_controllers(graph: RoadGraph, junctions: Junctions) -> Junctions:
    """Give one controller to signalised junctions with little room between them.

    Args:
        graph: the roads.
        junctions: with their signals.

    Returns:
        The junctions with a controller for each that has signals, named by the lowest of those that share it.
    """
    rules = graph.rules.signals
    groups = Groups(
        {junction: graph.places[junction] for junction in junctions.signals}, rules.widest_controller
    )
    ends, members = graph.ends(), junctions.members()
    pairs = [
        (
            graph.length(section),
            junctions.of[section.start],
            junctions.of[section.end],
            rules.one_place
            if joins_carriageways(graph, ends, section) or _is_dog_leg(graph, junctions, members, section)
            else rules.one_controller,
        )
        for section in graph.sections.values()
        if {junctions.of[section.start], junctions.of[section.end]} <= junctions.signals.keys()
        and graph.length(section) <= rules.one_place
    ]
    vertices = [vertex for vertex, junction in junctions.of.items() if junction in junctions.signals]
    pairs += [
        (
            math.dist(graph.places[one], graph.places[other]),
            junctions.of[one],
            junctions.of[other],
            rules.side_by_side,
        )
        for one, other in itertools.combinations(vertices, 2)
    ]
    for length, one, other, farthest in sorted(pairs):
        if length <= farthest and one in junctions.signals and other in junctions.signals:
            groups.join(one, other)
    controllers = {junction: groups.find(junction) for junction in sorted(junctions.signals)}
    return replace(junctions, controllers=controllers)


def _is_dog_leg(
    graph: RoadGraph, junctions: Junctions, members: dict[int, list[int]], section: Section
) -> bool:
    """Tell whether a street goes on along a section: it leaves to one side at each end, not to the same."""
    ends = graph.ends()
    sides = [
        {
            side
            for member in members[junctions.of[vertex]]
            for name in ends[member]
            if (side := _side(graph, junctions, section, graph.sections[name], member)) is not None
        }
        for vertex in (section.start, section.end)
    ]
    return all(len(side) == 1 for side in sides) and sides[0] != sides[1]


def _side(
    graph: RoadGraph, junctions: Junctions, along: Section, section: Section, vertex: int
) -> bool | None:
    """Tell to which side of a section's line another leaves a vertex, left or not; None for neither."""
    if junctions.of[section.start] == junctions.of[section.end]:
        return None
    (x, y), (a, b) = (graph.places[node] for node in (along.start, along.end))
    line = graph.line(section)
    ahead, aside = line[1] - line[0] if section.start == vertex else line[-2] - line[-1]
    size = math.hypot(a - x, b - y) * math.hypot(ahead, aside)
    turn = ((a - x) * aside - (b - y) * ahead) / max(size, 1e-9)
    return turn > 0 if abs(turn) > graph.rules.signals.leaves_aside else None


def _downstream(
    graph: RoadGraph, ends: dict[int, list[str]], section: Section, index: int, heading: int
) -> list[tuple[float, int]]:
    """Find the next vertices where roads meet, with the metres to them, in the given direction or both."""
    found, farthest = [], graph.rules.signals.before_junction
    for way in (1, -1):
        if heading not in (0, way):
            continue
        here, at, walked, seen = section, index, 0.0, {section.id}
        forward = way > 0
        while walked <= farthest:
            for one, other in itertools.pairwise(here.nodes[at:] if forward else here.nodes[at::-1]):
                walked += math.dist(graph.places[one], graph.places[other])
                if walked > farthest:
                    break
            vertex = here.end if forward else here.start
            if walked > farthest:
                break
            if len(ends[vertex]) > 2:
                found.append((walked, vertex))
                break
            onward = [name for name in ends[vertex] if name not in seen]
            if not onward:
                break
            here = graph.sections[onward[0]]
            seen.add(here.id)
            forward = here.start == vertex
            at = 0 if forward else len(here.nodes) - 1
    return found
