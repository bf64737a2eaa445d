"""How high roads lie where bridges and tunnels part them: a level each, and ramps that lead there."""

import heapq
import math
from collections import defaultdict

from dojo_maps.sources.osm_graph import RoadGraph

_LEVEL = 5.0
"""Metres from one level to the next, as a truck needs under a bridge."""
_GRADE = 0.06


def compute_heights(graph: RoadGraph) -> dict[int, float]:
    """Give each node that is not on the ground its height, metres.

    Bridges and tunnels are level; from their ends the roads lead to the ground at a grade of 6 %.
    """
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
    return heights
