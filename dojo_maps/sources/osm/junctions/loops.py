"""Roads that lead back to their own junction: some vanish in it, others are split, for SUMO has no loops."""

import math
from dataclasses import replace

import shapely

from dojo_maps.sources.osm.graph.road_graph import RoadGraph, Section, free_number
from dojo_maps.sources.osm.junctions.grouping import Junctions


def is_inner(graph: RoadGraph, section: Section) -> bool:
    """Tell whether a section between vertices of one junction vanishes in it.

    Args:
        graph: the roads.
        section: begins and ends at the same junction.

    Returns:
        Whether it does: it is short, or lies nearly on itself.
    """
    rules, length = graph.rules.junctions, graph.length(section)
    apart = math.dist(graph.places[section.start], graph.places[section.end])
    if section.road.roundabout:
        return length < max(rules.vanishing_ring, apart * rules.short_way_round)
    if length < min(rules.vanishing, rules.vanishing_loop + 2 * apart):
        return True
    return length < rules.vanishing and _area(graph, section) < rules.thin_loop * section.road.drives * length


def split_loops(graph: RoadGraph, junctions: Junctions) -> RoadGraph:
    """Split roads that lead back to their junction and stay.

    Args:
        graph: the roads.
        junctions: which of its vertices are one.

    Returns:
        The graph with two pieces in place of each; the same object where there is none.
    """
    cuts: dict[str, list[int]] = {}
    sections, places = dict(graph.sections), dict(graph.places)
    for name, section in sorted(graph.sections.items()):
        if junctions.of[section.start] != junctions.of[section.end] or is_inner(graph, section):
            continue
        if len(section.nodes) == 2:
            ends = [graph.places[vertex] for vertex in section.nodes]
            node = free_number(places)
            places[node] = ((ends[0][0] + ends[1][0]) / 2, (ends[0][1] + ends[1][1]) / 2)
            nodes = (section.start, node, section.end)
            sections[name] = replace(section, nodes=nodes, ways=section.ways * 2)
        cuts[name] = [len(sections[name].nodes) // 2]
    return replace(graph, sections=sections, places=places).split(cuts) if cuts else graph


def _area(graph: RoadGraph, section: Section) -> float:
    line = graph.line(section)
    return float(shapely.Polygon(line).area) if len(line) > 2 else 0.0
