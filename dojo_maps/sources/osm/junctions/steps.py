"""Decide which vertices are one junction and which sections vanish inside of one, in this order."""

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from types import MappingProxyType

from dojo_maps.sources.osm.graph.road_graph import RoadGraph
from dojo_maps.sources.osm.junctions.controllers import assign_signals, signals_of_junctions
from dojo_maps.sources.osm.junctions.dead_ends import extend_ends
from dojo_maps.sources.osm.junctions.grouping import Junctions, group_vertices
from dojo_maps.sources.osm.junctions.lone_signals import add_lone_vertices, find_lone_signals
from dojo_maps.sources.osm.junctions.loops import is_inner, split_loops
from dojo_maps.sources.osm.junctions.mapped_crossings import MappedCrossing, find_crossings
from dojo_maps.sources.osm.junctions.midblock_crossings import over_both_carriageways, split_between


@dataclass(frozen=True, slots=True, kw_only=True)
class JunctionPlan:
    """The junctions of a graph.

    Attributes:
        graph: the roads.
        crossings: where people cross them.
        junctions: which vertices are one.
        inner: sections that lie inside a junction and vanish.
    """

    graph: RoadGraph
    crossings: tuple[MappedCrossing, ...]
    junctions: Junctions
    inner: frozenset[str]


def add_midblock_vertices(graph: RoadGraph) -> RoadGraph:
    """Give crossings and signals that lie between junctions a vertex of their own.

    Args:
        graph: the roads.

    Returns:
        The graph with these vertices; roads that end at a crossing or a signal go on a little.
    """
    crossings = find_crossings(graph)
    assigned, stray = assign_signals(graph)
    lone = find_lone_signals(graph, stray, assigned, crossings)
    graph = add_lone_vertices(extend_ends(graph, crossings, lone), lone)
    crossings = find_crossings(graph)
    return split_between(graph, _group(graph, crossings), crossings)


def plan_junctions(
    graph: RoadGraph,
    joined: Iterable[tuple[int, int]] = (),
    moved: Mapping[int, tuple[int, float]] = MappingProxyType({}),
) -> JunctionPlan:
    """Group vertices to junctions.

    Args:
        graph: the roads, with a vertex at each crossing between junctions.
        joined: vertices to join besides, because a section between them came out too short before.
        moved: crossings to move for the same reason, by node: towards which node, and how far.

    Returns:
        The plan; in its graph roads that lead back to their junction are split, and the crossings are moved.
    """
    crossings = find_crossings(graph)
    joined = [*joined, *over_both_carriageways(graph, crossings)]
    junctions = _group(graph, crossings, joined)
    # Each turn halves what is split; short sections vanish, so there is an end.
    while (split := split_loops(graph, junctions)) is not graph:
        graph, crossings = split, find_crossings(split)
        junctions = _group(graph, crossings, joined)
    inner = {
        name
        for name, section in graph.sections.items()
        if junctions.of[section.start] == junctions.of[section.end] and is_inner(graph, section)
    }
    return JunctionPlan(
        graph=_move(graph, moved),
        crossings=tuple(crossings),
        junctions=junctions,
        inner=frozenset(inner),
    )


def _group(
    graph: RoadGraph, crossings: Sequence[MappedCrossing], joined: Iterable[tuple[int, int]] = ()
) -> Junctions:
    assigned, stray = assign_signals(graph)
    ends = graph.ends()
    lone = {
        node: [node]
        for node in find_lone_signals(graph, stray, assigned, crossings)
        if len(ends.get(node, ())) == 2
    }
    assigned, stray = assigned | lone, [node for node in stray if node not in lone]
    of = group_vertices(graph, assigned, joined)
    return Junctions(of=of, signals=signals_of_junctions(graph, of, assigned, crossings), stray=stray)


def _move(graph: RoadGraph, moved: Mapping[int, tuple[int, float]]) -> RoadGraph:
    places = dict(graph.places)
    for node, (towards, metres) in moved.items():
        (x, y), (a, b) = places[node], places[towards]
        share = min(metres / max(math.dist((x, y), (a, b)), 1e-3), 0.8)
        places[node] = (x + (a - x) * share, y + (b - y) * share)
    return replace(graph, places=places)
