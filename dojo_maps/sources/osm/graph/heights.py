"""How high roads lie where bridges and tunnels part them: a level each, and ramps that lead there."""

import heapq
import itertools
import math
from collections import defaultdict
from collections.abc import Callable
from collections.abc import Set as AbstractSet
from dataclasses import replace

import numpy as np
import shapely

from dojo_maps.sources.osm.graph.road_graph import RoadGraph

_LEVEL = 5.0
"""Metres from one level to the next, as a truck needs under a bridge."""
_CLEAR = 4.5
"""Metres between two roads that pass, where the ground itself parts them."""
_GRADE, _STEEP = 0.06, 0.15
"""Of ramps, and at most, where a ramp ends before it passes under a bridge or above a tunnel."""
_APART = 15.0
"""Metres from where a road leaves a bridge or tunnel, within which it does not pass under or above it."""


def compute_heights(graph: RoadGraph, natural: AbstractSet[str] = frozenset()) -> dict[int, float]:
    """Give each node that is not on the ground its height above it, metres.

    Bridges and tunnels are level; from their ends the roads lead to the ground at a grade of 6 %, or as
    steep as it takes to pass under a bridge or above a deeper tunnel, where they get another node.

    Args:
        graph: the roads.
        natural: bridges and tunnels that run from ground to ground, as `clear_by_nature` finds them.
    """
    low, deep = _nodes_under_bridges(graph), _nodes_above_tunnels(graph)
    beside: dict[int, list[tuple[int, float]]] = defaultdict(list)
    fixed: dict[int, float] = {}
    for name in sorted(graph.sections):
        section = graph.sections[name]
        for one, other in zip(section.nodes, section.nodes[1:], strict=False):
            apart = math.dist(graph.places[one], graph.places[other])
            beside[one].append((other, apart))
            beside[other].append((one, apart))
        for node in section.nodes if section.road.layer and name not in natural else ():
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
    _level(heights, beside, dict.fromkeys(low, 0.0), fixed, 1)
    _level(heights, beside, deep, fixed, -1)
    return heights


def clear_by_nature(graph: RoadGraph, ground: Callable[[str, tuple[float, float]], float]) -> set[str]:
    """Find the bridges and tunnels that need no ramps: the ground leads them clear of all that they pass.

    Args:
        graph: the roads.
        ground: gives the height of the ground under a section at a place; that of a bridge or a tunnel is a
            straight line between its ends.
    """
    layers = {name: section.road.layer for name, section in graph.sections.items()}
    natural = {name for name, layer in layers.items() if layer}
    for one, other, place in _passing(graph, layers.keys(), natural):
        lower, upper = sorted((one, other), key=layers.__getitem__)
        if layers[lower] != layers[upper] and ground(upper, place) - ground(lower, place) < _CLEAR:
            natural -= {one, other}
    return natural


def _level(
    heights: dict[int, float],
    beside: dict[int, list[tuple[int, float]]],
    most: dict[int, float],
    fixed: dict[int, float],
    sign: int,
) -> None:
    """Bring nodes as near to the ground as they must be, and those around them as far as it takes.

    Args:
        heights: of the nodes, metres; corrected in place.
        beside: the nodes next to each, and the metres to them.
        most: metres that nodes may be away from the ground.
        fixed: heights of bridges and tunnels, which are not left.
        sign: 1 above the ground, -1 below.
    """
    queue = [(metres, node) for node, metres in sorted(most.items())]
    heapq.heapify(queue)
    seen: set[int] = set()
    while queue:
        metres, node = heapq.heappop(queue)
        least = max(metres, sign * fixed.get(node, 0.0))
        if node in seen or sign * heights.get(node, 0.0) < least:
            continue
        seen.add(node)
        heights[node] = round(sign * least, 2)
        for other, apart in beside[node]:
            heapq.heappush(queue, (least + _STEEP * apart, other))


def _nodes_under_bridges(graph: RoadGraph) -> set[int]:
    """Give roads on the ground a node where they pass under a bridge."""
    on_ground = {name for name, section in graph.sections.items() if not section.road.layer}
    bridges = {name for name, section in graph.sections.items() if section.road.layer > 0}
    passing = _passing(graph, on_ground, bridges)
    return {_insert(graph, name, place) for name, _, place in passing}


def _nodes_above_tunnels(graph: RoadGraph) -> dict[int, float]:
    """Give tunnels a node where they pass above deeper ones; and how deep they may be there."""
    layers = {name: section.road.layer for name, section in graph.sections.items() if section.road.layer < 0}
    passing = _passing(graph, layers.keys(), layers.keys())
    above = [(name, place) for name, other, place in passing if layers[name] > layers[other]]
    return {_insert(graph, name, place): -_LEVEL * layers[name] for name, place in above}


def _passing(
    graph: RoadGraph, names: AbstractSet[str], others: AbstractSet[str]
) -> list[tuple[str, str, tuple[float, float]]]:
    """List where sections pass over or under others, except near the places where they part."""
    known = sorted(others)
    lines = [shapely.LineString(graph.line(graph.sections[name])) for name in known]
    tree = shapely.STRtree(lines)
    found = []
    for name in sorted(names):
        line = shapely.LineString(graph.line(graph.sections[name]))
        for hit in sorted(tree.query(line, predicate="crosses")):
            shared = set(graph.sections[name].nodes) & set(graph.sections[known[hit]].nodes)
            for x, y in shapely.get_coordinates(line.intersection(lines[hit])).tolist():
                if all(math.dist((x, y), graph.places[node]) > _APART for node in shared):
                    found.append((name, known[hit], (x, y)))
    return found


def _insert(graph: RoadGraph, name: str, place: tuple[float, float]) -> int:
    """Give a section a node at a place on its line."""
    section = graph.sections[name]
    line = graph.line(section)
    pieces = [shapely.LineString(piece) for piece in itertools.pairwise(line)]
    index = int(np.argmin([piece.distance(shapely.Point(place)) for piece in pieces]))
    node = graph.add_node(place)
    nodes = (*section.nodes[: index + 1], node, *section.nodes[index + 1 :])
    ways = (*section.ways[: index + 1], *section.ways[index:])
    graph.sections[name] = replace(section, nodes=nodes, ways=ways)
    return node
