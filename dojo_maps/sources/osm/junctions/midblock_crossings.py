"""Crossings that lie between junctions: they get a vertex of their own, on both carriageways."""

import itertools
import math
from collections import defaultdict

from dojo_maps.sources.osm.graph.road_graph import RoadGraph, Section
from dojo_maps.sources.osm.junctions.grouping import Junctions
from dojo_maps.sources.osm.junctions.mapped_crossings import MappedCrossing


def over_both_carriageways(graph: RoadGraph, crossings: list[MappedCrossing]) -> list[tuple[int, int]]:
    """Pair the crossings between junctions that lead over both carriageways of a divided road.

    Args:
        graph: the roads.
        crossings: of it; those count that lie at a vertex where one one-way road goes on as another.

    Returns:
        The two vertices of each pair.
    """
    ends, rules = graph.ends(), graph.rules.junctions
    alone = []
    for crossing in crossings:
        at = ends.get(crossing.node, [])
        if len(at) == 2 and all(graph.sections[name].road.oneway for name in at):
            line = graph.line(graph.sections[at[0]])
            alone.append((crossing, math.atan2(line[-1][1] - line[0][1], line[-1][0] - line[0][0])))
    return [
        (one.node, other.node)
        for (one, way), (other, back) in itertools.combinations(alone, 2)
        if math.dist(one.place, other.place) < rules.carriageways_apart
        and math.cos(way - back) < -rules.opposite
    ]


def split_between(graph: RoadGraph, junctions: Junctions, crossings: list[MappedCrossing]) -> RoadGraph:
    """Split sections at crossings too far from both ends.

    Args:
        graph: the roads.
        junctions: which of its vertices are one.
        crossings: of the graph.

    Returns:
        The graph with a vertex at each of these crossings.
    """
    by_section: dict[str, list[MappedCrossing]] = defaultdict(list)
    for crossing in crossings:
        by_section[crossing.section].append(crossing)
    degree = {vertex: len(at) for vertex, at in graph.ends().items()}
    # Where a track crosses, it is a junction as where a road does.
    on_tracks = {node for section in graph.tracks.values() for node in section.nodes}
    degree |= {node: 3 for node in on_tracks if degree.get(node) == 2}
    cuts: dict[str, list[int]] = {}
    for name, found in sorted(by_section.items()):
        section = graph.sections[name]
        if junctions.of[section.start] == junctions.of[section.end]:
            continue
        inner = section.nodes[1:-1]
        at = {
            inner.index(node) + 1
            for node in _between(graph, junctions, degree, section, found)
            if node in inner
        }
        if at:
            cuts[name] = sorted(at)
    return graph.split(cuts)


def _between(
    graph: RoadGraph,
    junctions: Junctions,
    degree: dict[int, int],
    section: Section,
    found: list[MappedCrossing],
) -> list[int]:
    rules, length = graph.rules.crossings, graph.length(section)
    taken: list[float] = []

    def border(vertex: int) -> float:
        if degree[vertex] <= 2 and junctions.of[vertex] == vertex and vertex not in junctions.signals:
            return rules.at_vertex
        return rules.at_border_with_signals if junctions.of[vertex] in junctions.signals else rules.at_border

    low, high = border(section.start), length - border(section.end)
    near = min((c.along for c in found if c.along <= low), default=None)
    far = max((c.along for c in found if c.along >= high), default=None)
    taken += [near] if near is not None else []
    taken += [far] if far is not None else []
    nodes = []
    for crossing in found:
        if crossing.along in (near, far) or any(
            abs(crossing.along - other) < rules.between for other in taken
        ):
            continue
        taken.append(crossing.along)
        nodes.append(crossing.node)
    return nodes
