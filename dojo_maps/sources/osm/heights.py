"""How high roads lie where bridges and tunnels part them: a level each, and ramps that lead there."""

import heapq
import itertools
import math
from collections import defaultdict
from dataclasses import replace

import numpy as np
import shapely

from dojo_maps.sources.osm.graph import RoadGraph

_LEVEL = 5.0
"""Metres from one level to the next, as a truck needs under a bridge."""
_GRADE, _STEEP = 0.06, 0.15
"""Of ramps, and at most, where a ramp has to be down before it passes under a bridge."""
_APART = 15.0
"""Metres from where a road leaves a bridge, within which it does not pass under it."""


def compute_heights(graph: RoadGraph) -> dict[int, float]:
    """Give each node that is not on the ground its height, metres.

    Bridges and tunnels are level; from their ends the roads lead to the ground at a grade of 6 %, or as
    steep as it takes to pass under a bridge, where they get another node.
    """
    low = _nodes_under_bridges(graph)
    beside: dict[int, list[tuple[int, float]]] = defaultdict(list)
    fixed: dict[int, float] = {}
    for name in sorted(graph.sections):
        section = graph.sections[name]
        for one, other in zip(section.nodes, section.nodes[1:], strict=False):
            apart = math.dist(graph.places[one], graph.places[other])
            beside[one].append((other, apart))
            beside[other].append((one, apart))
        for node in section.nodes if section.road.layer else ():
            height = _LEVEL * section.road.layer
            fixed[node] = max(fixed.get(node, height), height, key=abs)
    heights: dict[int, float] = {}
    queue = [(-abs(height), node, height) for node, height in fixed.items()]
    heapq.heapify(queue)
    while queue:
        _, node, height = heapq.heappop(queue)
        if node in heights:
            continue
        heights[node] = round(height, 2)
        for other, apart in beside[node]:
            left = abs(height) - _GRADE * apart
            if left > 0 and other not in heights:
                heapq.heappush(queue, (-left, other, math.copysign(left, height)))
    _lower(heights, beside, low, fixed)
    return heights


def _lower(
    heights: dict[int, float],
    beside: dict[int, list[tuple[int, float]]],
    low: set[int],
    fixed: dict[int, float],
) -> None:
    """Bring nodes under bridges to the ground, and those around them as far down as it takes."""
    queue = [(0.0, node) for node in sorted(low)]
    seen: set[int] = set()
    while queue:
        most, node = heapq.heappop(queue)
        if node in seen or node in fixed or heights.get(node, 0.0) < most:
            continue
        seen.add(node)
        heights[node] = round(most, 2)
        for other, apart in beside[node]:
            heapq.heappush(queue, (most + _STEEP * apart, other))


def _nodes_under_bridges(graph: RoadGraph) -> set[int]:
    """Give roads on the ground a node where they pass under a bridge."""
    names = sorted(name for name, section in graph.sections.items() if section.road.layer > 0)
    bridges = [shapely.LineString(graph.line(graph.sections[name])) for name in names]
    tree = shapely.STRtree(bridges)
    low: set[int] = set()
    for name, section in sorted(graph.sections.items()):
        if section.road.layer:
            continue
        line = shapely.LineString(graph.line(section))
        points = []
        for hit in sorted(tree.query(line, predicate="crosses")):
            shared = set(section.nodes) & set(graph.sections[names[hit]].nodes)
            points += [
                place
                for place in shapely.get_coordinates(line.intersection(bridges[hit])).tolist()
                if all(math.dist(place, graph.places[node]) > _APART for node in shared)
            ]
        for place in points:
            low.add(_insert(graph, name, (place[0], place[1])))
    return low


def _insert(graph: RoadGraph, name: str, place: tuple[float, float]) -> int:
    """Give a section a node at a place on its line."""
    section = graph.sections[name]
    line = graph.line(section)
    pieces = [shapely.LineString(piece) for piece in itertools.pairwise(line)]
    index = int(np.argmin([piece.distance(shapely.Point(place)) for piece in pieces]))
    node = min(0, *graph.places) - 1
    graph.places[node] = place
    nodes = (*section.nodes[: index + 1], node, *section.nodes[index + 1 :])
    ways = (*section.ways[: index + 1], *section.ways[index:])
    graph.sections[name] = replace(section, nodes=nodes, ways=ways)
    return node
