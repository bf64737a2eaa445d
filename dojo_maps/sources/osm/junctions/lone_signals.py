"""Signals with neither a junction nor a crossing near: stop lines before an extract's border, ramp meters.

They get a junction of their own, in the middle of the road.
"""

import math
from collections.abc import Iterable, Sequence

from dojo_maps.sources.osm.graph.road_graph import RoadGraph
from dojo_maps.sources.osm.junctions.mapped_crossings import MappedCrossing


def find_lone_signals(
    graph: RoadGraph, stray: Iterable[int], others: Iterable[int], crossings: Sequence[MappedCrossing]
) -> list[int]:
    """Find signals of no junction with no other signal, track over a road or crossing of their road near.

    Args:
        graph: the roads.
        stray: signal nodes of no junction.
        others: vertices with signals.
        crossings: where people cross.

    Returns:
        Their nodes; of several that are near each other, the first.
    """
    rules = graph.rules.signals
    positions = graph.positions()
    met = {node for section in graph.tracks.values() for node in section.nodes} & positions.keys()
    around = [(graph.places[vertex], rules.before_junction) for vertex in others]
    around += [(graph.places[node], graph.rules.tracks.stray_signal) for node in met]
    found: list[int] = []
    for node in sorted(stray):
        place, sections = graph.places[node], {name for name, _ in positions[node]}
        own = [
            (crossing.place, rules.signal_at_crossing)
            for crossing in crossings
            if crossing.section in sections
        ]
        if all(math.dist(place, other) > metres for other, metres in (*around, *own)):
            found.append(node)
            around.append((place, rules.before_junction))
    return found


def add_lone_vertices(graph: RoadGraph, lone: Iterable[int]) -> RoadGraph:
    """Make vertices of lone signals that are within a section, as far as that leaves no short one.

    Args:
        graph: the roads.
        lone: nodes of the signals.

    Returns:
        The graph with the sections split there.
    """
    positions, least = graph.positions(), graph.rules.crossings.least_beyond_border
    cuts: dict[str, list[int]] = {}
    for node in lone:
        (name, _), *more = positions[node]
        section = graph.sections[name]
        ends = (graph.places[section.start], graph.places[section.end])
        if not more and all(math.dist(graph.places[node], end) >= least for end in ends):
            cuts.setdefault(name, []).append(node)
    return graph.split_at_nodes(cuts)
