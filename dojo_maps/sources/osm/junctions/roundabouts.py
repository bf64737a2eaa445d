"""Small roundabouts, widened by a few metres, so that a car finds room between two of their arms.

Without it netconvert leaves too little of the ring between the arms, and the ring would become one junction.
"""

import math
from collections import defaultdict

from dojo_maps.sources.osm.graph.road_graph import RoadGraph, Section

_ROOM = 6.5
"""Metres of ring to keep between the mouths of two arms, with their rounded corners."""
_WALK = 2.5
"""Metres of pavement on each side of an arm."""
_WIDER = 3.0
"""Metres by which a ring's radius grows at most."""
_FADES = 12.0
"""Metres out from a ring over which its arms give way to it."""
_HOPELESS = 1.8
"""Rings that would have to grow by more than this factor stay as they are."""


def widen_rings(graph: RoadGraph) -> None:
    """Move the nodes of roundabouts outward where their arms lie too close together."""
    ends = graph.ends()
    for ring in _rings(graph):
        nodes = sorted({node for section in ring for node in section.nodes})
        x, y = (sum(graph.places[node][axis] for node in nodes) / len(nodes) for axis in (0, 1))
        radius = sum(math.dist(graph.places[node], (x, y)) for node in nodes) / len(nodes)
        wanted = max(
            sum(_mouth(graph, ends[vertex]) for vertex in (section.start, section.end))
            / graph.length(section)
            + _ROOM / graph.length(section)
            for section in ring
        )
        if not 1.0 < wanted <= _HOPELESS:
            continue
        wider = min((wanted - 1.0) * radius, _WIDER)
        arms = {name for node in nodes for name in ends.get(node, ())}
        for node in {node for name in arms for node in graph.sections[name].nodes}:
            a, b = graph.places[node]
            apart = max(math.dist((a, b), (x, y)), 0.1)
            push = wider * min(max(1.0 - (apart - radius) / _FADES, 0.0), 1.0) / apart
            graph.places[node] = (round(a + (a - x) * push, 3), round(b + (b - y) * push, 3))


def _rings(graph: RoadGraph) -> list[list[Section]]:
    """Find the roundabouts that close: sections that lead from each to the next, back to the first."""
    leaving: dict[int, list[Section]] = defaultdict(list)
    for _, section in sorted(graph.sections.items()):
        if section.road.roundabout and section.start != section.end:
            leaving[section.start].append(section)
    rings, seen = [], set()
    for start in sorted(leaving):
        ring: list[Section] = []
        here = start
        while here not in seen and len(leaving[here]) == 1:
            seen.add(here)
            ring.append(leaving[here][0])
            here = ring[-1].end
        if ring and here == start:
            rings.append(ring)
    return rings


def _mouth(graph: RoadGraph, names: list[str]) -> float:
    """Give half the width of the widest arm at a vertex, with its pavement; 0 where there is none."""
    roads = [graph.sections[name].road for name in names]
    return max((road.drives / 2 + _WALK for road in roads if not road.roundabout), default=0.0)
