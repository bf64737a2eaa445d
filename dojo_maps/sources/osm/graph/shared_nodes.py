"""Roads that cross on the ground, but have no node in common there: they get one.

OpenStreetMap asks for a common node wherever roads cross on one level; without one no one could turn there,
and the two would lie on each other as a bridge does. Bridges and tunnels are left as they are, and so are
one-way roads that cross each other: they are the lanes of a junction, drawn one by one.
"""

from collections import defaultdict
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
import shapely

from dojo_maps.errors import SourceError
from dojo_maps.geometry.polylines import Floats, Ints
from dojo_maps.sources.osm.graph.road_graph import free_number
from dojo_maps.sources.osm.read.way_tags import RoadTags
from dojo_maps.sources.osm.rules import SectionRules

Run = tuple[int, tuple[int, ...]]
"""A way, and nodes that it runs through without a break."""


def share_nodes(
    runs: Sequence[Run],
    roads: Mapping[int, RoadTags],
    places: dict[int, tuple[float, float]],
    path: Path | str,
    rules: SectionRules,
) -> tuple[list[Run], list[tuple[int, int]]]:
    """Lead roads that cross on the ground through a common node.

    Args:
        runs: ways with the nodes that they run through.
        roads: what the ways are.
        places: where nodes lie, metres; the new ones, negative numbers, are added.
        path: named in errors.
        rules: how near a node is taken, and how many crossings are believed.

    Returns:
        The runs with the new nodes; and of each of these, a way that it lies on.

    Raises:
        SourceError: roads cross each other at far more places than streets do.
    """
    pieces = [
        (number, index)
        for number, (way, nodes) in enumerate(runs)
        for index in range(len(nodes) - 1)
        if not roads[way].layer
    ]
    if not pieces:
        return list(runs), []
    ends = np.array([runs[number][1][index : index + 2] for number, index in pieces]).reshape(-1, 2)
    ways = np.array([runs[number][0] for number, _ in pieces])
    oneway = np.array([roads[way].oneway for way in ways.tolist()], dtype=bool)
    lines = shapely.linestrings([[places[int(node)] for node in pair] for pair in ends])
    added: dict[int, list[tuple[int, float, int]]] = defaultdict(list)
    found, new = [], free_number(places)
    pairs = _crossing(lines, ends, ways)
    if len(pairs) > rules.most_crossing + len(pieces) * rules.most_crossing_share:
        problem = f"roads cross each other at {len(pairs)} places without a common node; add the nodes"
        raise SourceError(path, problem, element=f"way {ways[pairs[0][0]]}")
    for one, other in pairs:
        if oneway[one] and oneway[other]:
            continue
        point = shapely.get_coordinates(shapely.intersection(lines[one], lines[other]))[0]
        node = _node_at(point, [*ends[one].tolist(), *ends[other].tolist()], places, new, rules.same_place)
        if node == new:
            places[node] = (round(float(point[0]), 3), round(float(point[1]), 3))
            found.append((node, int(ways[one])))
            new -= 1
        for piece in (one, other):
            number, index = pieces[piece]
            if node not in ends[piece]:
                along = float(shapely.line_locate_point(lines[piece], shapely.Point(point)))
                added[number].append((index, along, node))
    return [(way, _with(nodes, added.get(number, ()))) for number, (way, nodes) in enumerate(runs)], found


def _crossing(lines: Floats, ends: Ints, ways: Ints) -> list[tuple[int, int]]:
    """Pair the straight pieces of two ways that cross each other away from common nodes."""
    one, other = shapely.STRtree(lines).query(lines, predicate="crosses")
    shared = (ends[one][:, :, None] == ends[other][:, None, :]).any(axis=(1, 2))
    kept = (one < other) & ~shared & (ways[one] != ways[other])
    return sorted(zip(one[kept].tolist(), other[kept].tolist(), strict=True))


def _node_at(
    point: Floats, near: Sequence[int], places: dict[int, tuple[float, float]], new: int, same: float
) -> int:
    """Take the node that a crossing lies at, or a new one."""
    nodes = np.array([places[node] for node in near])
    apart = np.hypot(*(nodes - point).T)
    best = int(np.argmin(apart))
    return near[best] if apart[best] < same else new


def _with(nodes: tuple[int, ...], added: Sequence[tuple[int, float, int]]) -> tuple[int, ...]:
    """Put nodes into a run: each with the piece that it lies on, and how far along."""
    found = list(nodes)
    for index, _, node in sorted(added, reverse=True):
        found.insert(index + 1, node)
    return tuple(found)
