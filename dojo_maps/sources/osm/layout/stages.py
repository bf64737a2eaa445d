"""Lay out what is to be built: group junctions, place crossings, keep roads off each other, in this order."""

import math
from collections.abc import Iterable, Mapping
from types import MappingProxyType

from dojo_maps.sources.osm.graph.loops import is_inner, split_loops
from dojo_maps.sources.osm.graph.road_graph import RoadGraph
from dojo_maps.sources.osm.junctions.grouping import group_junctions
from dojo_maps.sources.osm.junctions.roundabouts import recognise_rings, widen_rings
from dojo_maps.sources.osm.layout.approach_extension import reach_in
from dojo_maps.sources.osm.layout.arms import Layout
from dojo_maps.sources.osm.layout.carriageway_spacing import space_carriageways
from dojo_maps.sources.osm.layout.crossing_arms import align_carriageways, host_crossings
from dojo_maps.sources.osm.layout.fork_trimming import part_roads
from dojo_maps.sources.osm.layout.mapped_crossings import find_crossings
from dojo_maps.sources.osm.layout.midblock_crossings import (
    extend_ends,
    over_both_carriageways,
    signal_between,
    split_between,
)
from dojo_maps.sources.osm.read.data import OsmData


def lay_out(
    data: OsmData,
    graph: RoadGraph,
    joined: Iterable[tuple[int, int]] = (),
    moved: Mapping[int, tuple[int, float]] = MappingProxyType({}),
) -> Layout:
    """Group junctions and place crossings.

    Args:
        data: the extract.
        graph: its roads; sections are split where a crossing lies between junctions.
        joined: vertices to join because a section between them came out too short before.
        moved: crossings to move for the same reason, by node: towards which node, and how far.
    """
    recognise_rings(graph)
    widen_rings(graph)
    crossings = find_crossings(data, graph)
    if extend_ends(graph, crossings):
        crossings = find_crossings(data, graph)
    junctions = group_junctions(data, graph, crossings)
    if split_between(graph, junctions, crossings):
        crossings = find_crossings(data, graph)
    joined = [*joined, *over_both_carriageways(graph, crossings)]
    junctions = group_junctions(data, graph, crossings, joined)
    while split_loops(graph, junctions):
        crossings = find_crossings(data, graph)
        junctions = group_junctions(data, graph, crossings, joined)
    layout = Layout(graph=graph, junctions=junctions, crossings=crossings)
    for name, section in graph.sections.items():
        if junctions.of[section.start] == junctions.of[section.end] and is_inner(graph, section):
            layout.inner.add(name)
    for node, (towards, metres) in moved.items():
        _move(graph, node, towards, metres)
    host_crossings(layout)
    if reach_in(layout):
        host_crossings(layout)
    align_carriageways(layout)
    part_roads(layout)
    space_carriageways(layout)
    signal_between(layout)
    return layout


def _move(graph: RoadGraph, node: int, towards: int, metres: float) -> None:
    (x, y), (a, b) = graph.places[node], graph.places[towards]
    share = min(metres / max(math.dist((x, y), (a, b)), 1e-3), 0.8)
    graph.places[node] = (x + (a - x) * share, y + (b - y) * share)
