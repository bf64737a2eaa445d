"""Roundabouts: rings that close, tagged as such or not, and small ones widened.

A small ring grows by a few metres, so that a car finds room between two arms; netconvert leaves too little of
it between them otherwise. Mini-roundabouts are nodes: who goes first there is in `plain.right_of_way`, their
corners are in `plain.junction_nodes`.
"""

import math
from collections import defaultdict
from dataclasses import replace

import numpy as np
import shapely

from dojo_maps.geometry.polylines import Floats
from dojo_maps.sources.osm.graph.road_graph import RoadGraph, Section


def recognise_rings(graph: RoadGraph) -> RoadGraph:
    """Take one-way roads that close to a circle, in the sense of traffic, for an untagged roundabout.

    Args:
        graph: the roads.

    Returns:
        The graph with these roads marked as parts of a roundabout.
    """
    leaving: dict[int, list[Section]] = defaultdict(list)
    for _, section in sorted(graph.sections.items()):
        if section.road.oneway and not section.road.roundabout and section.start != section.end:
            leaving[section.start].append(section)
    sections = dict(graph.sections)
    for section in [section for parts in leaving.values() for section in parts]:
        ring = _turn_back(graph, leaving, section, graph.rules.roundabouts.most_parts)
        if ring and _is_circle(graph, ring):
            for part in ring:
                sections[part.id] = replace(part, road=replace(part.road, roundabout=True))
    return replace(graph, sections=sections)


def _turn_back(
    graph: RoadGraph, leaving: dict[int, list[Section]], first: Section, most: int
) -> list[Section]:
    """Follow at most so many one-way roads to the inner side until they lead back; empty if they never do."""
    side = -1 if graph.left_hand else 1
    ring = [first]
    while ring[-1].end != first.start:
        onward = leaving[ring[-1].end]
        if not onward or len(ring) == most:
            return []
        arriving = graph.line(ring[-1])[-2:]
        ring.append(max(onward, key=lambda s: (side * _turn(arriving, graph.line(s)[:2]), s.id)))
    return ring


def _turn(arriving: Floats, going: Floats) -> float:
    """Measure the turn between two straight lines, radians, positive to the left."""
    (a, b), (c, d) = arriving[1] - arriving[0], going[1] - going[0]
    return math.atan2(a * d - b * c, a * c + b * d)


def _is_circle(graph: RoadGraph, ring: list[Section]) -> bool:
    line = np.concatenate([graph.line(section)[:-1] for section in ring])
    if len(line) < 4:
        return False
    shape, rules = shapely.Polygon(line), graph.rules.roundabouts
    turns_right = shapely.is_ccw(shape.exterior) != graph.left_hand
    across = max(np.ptp(line, axis=0))
    return bool(
        turns_right
        and across <= rules.largest
        and 4 * math.pi * shape.area > rules.roundness * shape.length**2
    )


def widen_rings(graph: RoadGraph) -> RoadGraph:
    """Move the nodes of roundabouts outward where their arms lie too close together.

    The two lines of an arm with a splitter island are one arm.

    Args:
        graph: the roads.

    Returns:
        The graph with the nodes of these rings, and those of their arms near them, in other places.
    """
    ends, rules = graph.ends(), graph.rules.roundabouts
    for ring in find_rings(graph):
        nodes = sorted({node for section in ring for node in section.nodes})
        x, y = (sum(graph.places[node][axis] for node in nodes) / len(nodes) for axis in (0, 1))
        radius = sum(math.dist(graph.places[node], (x, y)) for node in nodes) / len(nodes)
        wanted = max(
            (
                sum(_mouth(graph, ends[vertex]) for vertex in (section.start, section.end))
                / graph.length(section)
                + rules.between_arms / graph.length(section)
                for section in ring
                if not _is_splitter(graph, ends, section)
            ),
            default=1.0,
        )
        wider = min((wanted - 1.0) * radius, rules.most_growth)
        if wider <= 0.0:
            continue
        arms = {name for node in nodes for name in ends.get(node, ())}
        places = dict(graph.places)
        for node in {node for name in arms for node in graph.sections[name].nodes}:
            a, b = places[node]
            apart = max(math.dist((a, b), (x, y)), 0.1)
            push = wider * min(max(1.0 - (apart - radius) / rules.fading, 0.0), 1.0) / apart
            places[node] = (round(a + (a - x) * push, 3), round(b + (b - y) * push, 3))
        graph = replace(graph, places=places)
    return graph


def find_rings(graph: RoadGraph) -> list[list[Section]]:
    """Find the roundabouts that close; arms that are tagged as parts of one do not belong to it.

    Args:
        graph: the roads.

    Returns:
        The sections of each, which lead from one to the next, and back to the first.
    """
    leaving: dict[int, list[Section]] = defaultdict(list)
    for _, section in sorted(graph.sections.items()):
        if section.road.roundabout and section.start != section.end:
            leaving[section.start].append(section)
    sections = [section for start in sorted(leaving) for section in leaving[start]]
    rings, taken = [], set[str]()
    for section in sections:
        if section.id not in taken:
            ring = _turn_back(graph, leaving, section, len(sections))
            taken.update(part.id for part in ring)
            rings += [ring] if ring else []
    return rings


def _is_splitter(graph: RoadGraph, ends: dict[int, list[str]], section: Section) -> bool:
    """Tell whether a part of a ring lies between the two lines of one arm: one leaves, the other arrives."""
    arms = [
        [graph.sections[name] for name in ends[vertex] if not graph.sections[name].road.roundabout]
        for vertex in (section.start, section.end)
    ]
    return (
        all(len(arm) == 1 and arm[0].road.oneway for arm in arms)
        and arms[0][0].start == section.start
        and arms[1][0].end == section.end
    )


def _mouth(graph: RoadGraph, names: list[str]) -> float:
    """Give half the width of the widest arm at a vertex, with its pavement; 0 where there is none."""
    pavement = graph.rules.roundabouts.pavement
    roads = [graph.sections[name].road for name in names]
    return max((road.drives / 2 + pavement for road in roads if not road.roundabout), default=0.0)
