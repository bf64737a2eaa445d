"""Ends of roads that end at no other, as at the border of an extract."""

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import shapely

from dojo_maps.sources.osm.graph.road_graph import RoadGraph, Section, free_number
from dojo_maps.sources.osm.junctions.mapped_crossings import MappedCrossing

_Place = tuple[float, float]


def extend_ends(graph: RoadGraph, crossings: list[MappedCrossing], signals: Sequence[int]) -> RoadGraph:
    """Lead roads that end at a crossing or a signal a little farther, as they do beyond the extract's border.

    So do one-way roads that end near a crossing, from where nobody could walk on, and all near a signal.

    Args:
        graph: the roads.
        crossings: where people cross.
        signals: the nodes of those before the border.

    Returns:
        The graph with another node at the end of each of these roads.
    """
    ends = [(vertex, at[0]) for vertex, at in sorted(graph.ends().items()) if len(at) == 1]
    for vertex, name in ends:
        if not (
            _ends_at_crossing(graph, vertex, name, crossings) or _ends_at_signal(graph, vertex, name, signals)
        ):
            continue
        section = graph.sections[name]
        at_end = section.end == vertex
        before, last = (graph.places[n] for n in (section.nodes[-2:] if at_end else section.nodes[1::-1]))
        place = _lead_on(graph, section, before, last)
        if place is None:
            continue
        node = free_number(graph.places)
        nodes = (*section.nodes, node) if at_end else (node, *section.nodes)
        ways = (*section.ways, section.ways[-1]) if at_end else (section.ways[0], *section.ways)
        graph = replace(
            graph,
            places={**graph.places, node: place},
            sections={**graph.sections, name: replace(section, nodes=nodes, ways=ways)},
        )
    return graph


def _lead_on(graph: RoadGraph, section: Section, before: _Place, last: _Place) -> _Place | None:
    """Find where a road that is led straight on ends: before the ground of other roads, if there is room.

    None where it would lie across another road: the two meet there, and the extract does not hold how.
    """
    rules = graph.rules.crossings
    (x, y), (a, b) = before, last
    way = np.array([a - x, b - y]) / max(math.dist(before, last), 1e-3)
    at = np.arange(rules.least_beyond_border, rules.beyond_border + 0.5)
    places = shapely.points(np.array(last) + at[:, None] * way)
    shortest = shapely.LineString([last, np.array(last) + at[0] * way])
    free = np.ones(len(at), dtype=bool)
    for other in graph.sections.values():
        reach = (section.road.drives + other.road.drives) / 2
        if other.road.layer == section.road.layer and not {*other.nodes} & {*section.nodes}:
            line = shapely.LineString(graph.line(other))
            if line.intersects(shortest):
                return None
            free &= ~shapely.dwithin(places, line, reach)
    # Up to the first place that lies on another road.
    metres = at[-1] if free.all() else at[max(int(free.argmin()) - 1, 0)]
    return round(a + float(way[0] * metres), 3), round(b + float(way[1] * metres), 3)


def _ends_at_crossing(graph: RoadGraph, vertex: int, name: str, crossings: list[MappedCrossing]) -> bool:
    oneway = graph.sections[name].road.oneway
    reach = graph.rules.crossings.beyond_border if oneway else 0.0
    return any(
        crossing.node == vertex
        or (crossing.section == name and math.dist(crossing.place, graph.places[vertex]) < reach)
        for crossing in crossings
    )


def _ends_at_signal(graph: RoadGraph, vertex: int, name: str, signals: Sequence[int]) -> bool:
    reach = graph.rules.crossings.beyond_border
    return any(
        node in graph.sections[name].nodes and math.dist(graph.places[node], graph.places[vertex]) < reach
        for node in signals
    )
