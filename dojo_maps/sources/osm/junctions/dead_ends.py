"""Ends of roads that end at no other, as at the border of an extract."""

import math
from dataclasses import replace

import numpy as np
import shapely

from dojo_maps.geometry.polylines import along
from dojo_maps.sources.osm.graph.road_graph import RoadGraph, free_number
from dojo_maps.sources.osm.junctions.mapped_crossings import MappedCrossing


def extend_ends(graph: RoadGraph, crossings: list[MappedCrossing]) -> RoadGraph:
    """Lead roads that end at a crossing a little farther, as they do beyond the extract's border.

    So do one-way roads that end near one: nobody could walk on from there.
    """
    sections, places = dict(graph.sections), dict(graph.places)
    for vertex, name in _list_dead_ends(graph):
        if not _ends_at_crossing(graph, vertex, name, crossings):
            continue
        section = sections[name]
        at_end = section.end == vertex
        (x, y), (a, b) = (places[n] for n in (section.nodes[-2:] if at_end else section.nodes[1::-1]))
        share = graph.rules.crossings.beyond_border / max(math.dist((x, y), (a, b)), 1e-3)
        node = free_number(places)
        places[node] = (round(a + (a - x) * share, 3), round(b + (b - y) * share, 3))
        nodes = (*section.nodes, node) if at_end else (node, *section.nodes)
        ways = (*section.ways, section.ways[-1]) if at_end else (section.ways[0], *section.ways)
        sections[name] = replace(section, nodes=nodes, ways=ways)
    return replace(graph, sections=sections, places=places)


def _ends_at_crossing(graph: RoadGraph, vertex: int, name: str, crossings: list[MappedCrossing]) -> bool:
    oneway = graph.sections[name].road.oneway
    reach = graph.rules.crossings.beyond_border if oneway else 0.0
    return any(
        crossing.node == vertex
        or (crossing.section == name and math.dist(crossing.place, graph.places[vertex]) < reach)
        for crossing in crossings
    )


def draw_back_ends(graph: RoadGraph, crossings: list[MappedCrossing]) -> RoadGraph:
    """Shorten roads that end on another one, as far as crossings allow: their junction is missing."""
    for vertex, name in _list_dead_ends(graph):
        metres = _measure_lying(graph, vertex, name)
        for crossing in crossings:
            if crossing.section == name:
                beyond = math.dist(crossing.place, graph.places[vertex])
                metres = min(metres, beyond - graph.rules.junctions.dead_end_beyond)
        if metres > 0:
            graph = _shorten(graph, vertex, name, metres)
    return graph


def _list_dead_ends(graph: RoadGraph) -> list[tuple[int, str]]:
    return [(vertex, at[0]) for vertex, at in sorted(graph.ends().items()) if len(at) == 1]


def _measure_lying(graph: RoadGraph, vertex: int, name: str) -> float:
    """Measure how far a road lies on others from its end; 0 where it may not be drawn back so far."""
    section, rules = graph.sections[name], graph.rules.junctions
    line = graph.line(section)
    line = line[::-1] if section.end == vertex else line
    lengths = along(line)
    most = min(rules.dead_end, float(lengths[-1]) - rules.dead_end_left)
    at = np.arange(0.0, most + 0.5, 1.0)
    places = shapely.points(np.column_stack([np.interp(at, lengths, values) for values in line.T]))
    lies = np.zeros(len(at), dtype=bool)
    for other in graph.sections.values():
        reach = (section.road.drives + other.road.drives) / 2
        if other.road.layer == section.road.layer and not {*other.nodes} & {*section.nodes}:
            lies |= shapely.dwithin(places, shapely.LineString(graph.line(other)), reach)
    return 0.0 if lies.all() or not lies.any() else float(at[lies.argmin()])


def _shorten(graph: RoadGraph, vertex: int, name: str, metres: float) -> RoadGraph:
    at_end = graph.sections[name].end == vertex
    place = graph.length(graph.sections[name]) - metres if at_end else metres
    graph, (node,) = graph.add_nodes([(name, place)])
    section = graph.sections[name]
    cut = section.nodes.index(node)
    nodes, ways = section.nodes, section.ways
    nodes, ways = (nodes[: cut + 1], ways[:cut]) if at_end else (nodes[cut:], ways[cut:])
    return replace(graph, sections={**graph.sections, name: replace(section, nodes=nodes, ways=ways)})
