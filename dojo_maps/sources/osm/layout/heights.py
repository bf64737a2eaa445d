"""How high roads lie where bridges and tunnels part them: a level each, and ramps that lead there."""

import heapq
import itertools
import math
from collections import defaultdict
from collections.abc import Sequence
from collections.abc import Set as AbstractSet
from dataclasses import replace

import numpy as np
import shapely

from dojo_maps.sources.osm.graph.road_graph import RoadGraph, free_number
from dojo_maps.sources.osm.layout.ground import Ground


def compute_heights(
    graph: RoadGraph, natural: AbstractSet[str] = frozenset()
) -> tuple[RoadGraph, dict[int, float]]:
    """Give each node that is not on the ground its height above it, metres.

    Bridges and tunnels are level; from their ends the roads lead to the ground at a gentle grade, or as
    steep as it takes to pass under a bridge or above a deeper tunnel, where they get another node.

    Args:
        graph: the roads.
        natural: bridges and tunnels that run from ground to ground, as `clear_by_nature` finds them.

    Returns:
        The roads with these nodes; and the heights.
    """
    rules = graph.rules.heights
    graph, low = _add_nodes_under_bridges(graph)
    graph, deep = _add_nodes_above_tunnels(graph)
    beside: dict[int, list[tuple[int, float]]] = defaultdict(list)
    fixed: dict[int, float] = {}
    for name in sorted(graph.sections):
        section = graph.sections[name]
        for one, other in zip(section.nodes, section.nodes[1:], strict=False):
            apart = math.dist(graph.places[one], graph.places[other])
            beside[one].append((other, apart))
            beside[other].append((one, apart))
        for node in section.nodes if section.road.layer and name not in natural else ():
            height = rules.level * section.road.layer
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
            left = abs(height) - rules.grade * apart
            if left > 0 and other not in heights:
                heapq.heappush(queue, (-left, other, math.copysign(left, height)))
    _level(heights, beside, dict.fromkeys(low, 0.0), fixed, 1, rules.steepest)
    _level(heights, beside, deep, fixed, -1, rules.steepest)
    return graph, heights


def clear_by_nature(graph: RoadGraph, ground: Ground) -> set[str]:
    """Find the bridges and tunnels that need no ramps: the ground leads them clear of all that they pass.

    Args:
        graph: the roads, or roads and tracks.
        ground: under them.

    Returns:
        Ids of sections.
    """
    layers = {name: section.road.layer for name, section in graph.sections.items()}
    natural = {name for name, layer in layers.items() if layer}
    for one, other, place in _passing(graph, layers.keys(), natural):
        lower, upper = sorted((one, other), key=layers.__getitem__)
        apart = ground.at(graph, upper, place) - ground.at(graph, lower, place)
        if layers[lower] != layers[upper] and apart < graph.rules.heights.clear:
            natural -= {one, other}
    return natural


def _level(
    heights: dict[int, float],
    beside: dict[int, list[tuple[int, float]]],
    most: dict[int, float],
    fixed: dict[int, float],
    sign: int,
    steepest: float,
) -> None:
    """Bring nodes as near to the ground as they must be, and those around them as far as it takes.

    Args:
        heights: of the nodes, metres; corrected in place.
        beside: the nodes next to each, and the metres to them.
        most: metres that nodes may be away from the ground.
        fixed: heights of bridges and tunnels, which are not left.
        sign: 1 above the ground, -1 below.
        steepest: rise over length, at most.
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
            heapq.heappush(queue, (least + steepest * apart, other))


def _add_nodes_under_bridges(graph: RoadGraph) -> tuple[RoadGraph, list[int]]:
    """Give roads on the ground a node where they pass under a bridge."""
    on_ground = {name for name, section in graph.sections.items() if not section.road.layer}
    bridges = {name for name, section in graph.sections.items() if section.road.layer > 0}
    return _insert(graph, [(name, place) for name, _, place in _passing(graph, on_ground, bridges)])


def _add_nodes_above_tunnels(graph: RoadGraph) -> tuple[RoadGraph, dict[int, float]]:
    """Give tunnels a node where they pass above deeper ones; and how deep they may be there."""
    layers = {name: section.road.layer for name, section in graph.sections.items() if section.road.layer < 0}
    passing = _passing(graph, layers.keys(), layers.keys())
    above = [(name, place) for name, other, place in passing if layers[name] > layers[other]]
    graph, nodes = _insert(graph, above)
    return graph, {
        node: -graph.rules.heights.level * layers[name] for node, (name, _) in zip(nodes, above, strict=True)
    }


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
                if all(
                    math.dist((x, y), graph.places[node]) > graph.rules.heights.parting for node in shared
                ):
                    found.append((name, known[hit], (x, y)))
    return found


def _insert(
    graph: RoadGraph, found: Sequence[tuple[str, tuple[float, float]]]
) -> tuple[RoadGraph, list[int]]:
    """Give sections nodes at places on their lines; list these nodes."""
    sections, places = dict(graph.sections), dict(graph.places)
    inserted = []
    for name, place in found:
        section = sections[name]
        line = np.array([places[node] for node in section.nodes])
        pieces = [shapely.LineString(piece) for piece in itertools.pairwise(line)]
        index = int(np.argmin([piece.distance(shapely.Point(place)) for piece in pieces]))
        node = free_number(places)
        places[node] = place
        nodes = (*section.nodes[: index + 1], node, *section.nodes[index + 1 :])
        ways = (*section.ways[: index + 1], *section.ways[index:])
        sections[name] = replace(section, nodes=nodes, ways=ways)
        inserted.append(node)
    return replace(graph, sections=sections, places=places), inserted
