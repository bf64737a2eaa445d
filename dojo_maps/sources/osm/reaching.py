"""Roads that reach into a wide junction, up to where a crossing is mapped inside it.

Where a turning lane leaves far before a junction's middle, the vertex there is part of the junction, and the
crossing lies behind it. Its road goes on to the crossing; what lies beside it there is the junction's ground.
"""

import math
from collections import defaultdict
from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import shapely
import shapely.ops

from dojo_maps.geometry.polylines import Floats, along
from dojo_maps.sources.osm.arms import Arm, Layout, ray
from dojo_maps.sources.osm.crossings import MappedCrossing

_NEAREST, _FARTHEST = 10.0, 45.0
"""Metres from a road's vertex to a crossing inside the junction between which the road goes on to it."""
_NEARER = 0.7
"""Share of the way to a crossing that the nearest road from another side must be away from it."""
_ASIDE = 0.5
"""Cosine of the angle between roads that arrive from different sides."""
_AHEAD = 0.8
"""Cosine of the angle that the way on may make with the road."""


def reach_in(layout: Layout) -> bool:
    """Lead roads on to the crossings ahead of them that found no place near; tell whether any were."""
    ends, free = layout.graph.ends(), _free_vertices(layout)
    inside = _far_from_place(layout)
    best: dict[int, tuple[float, int, Arm, Floats]] = {}
    for vertex, arm in sorted(free.items()) if inside else ():
        for node, line in _way_on(layout, ends, inside, vertex, arm):
            length = float(along(line)[-1])
            if _is_behind(layout, arm, line):
                continue
            if node not in best or length < best[node][0]:
                best[node] = (length, vertex, arm, line)
    for _, vertex, arm, line in sorted(best.values(), key=lambda found: found[:3]):
        if free.pop(vertex, None):
            _lead_on(layout, vertex, arm, line)
    return bool(best)


def _free_vertices(layout: Layout) -> dict[int, Arm]:
    """Find the vertices of wide junctions where a single road arrives, and that road."""
    arms_at: dict[int, list[Arm]] = defaultdict(list)
    for arms in layout.arms().values():
        for arm in arms:
            section = layout.graph.sections[arm[0]]
            arms_at[section.end if arm[1] else section.start].append(arm)
    return {vertex: arms[0] for vertex, arms in arms_at.items() if len(arms) == 1}


def _far_from_place(layout: Layout) -> dict[str, list[MappedCrossing]]:
    """List the crossings inside junctions that found a place far off, or none, by section."""
    graph = layout.graph
    placed = {id(crossing): arm for arm, crossing in layout.hosted.items()}
    found: dict[str, list[MappedCrossing]] = defaultdict(list)
    for crossing in layout.crossings:
        if crossing.section in layout.inner:
            arm = placed.get(id(crossing))
            if arm is None or math.dist(ray(graph, arm)[0], crossing.place) > _NEAREST:
                found[crossing.section].append(crossing)
    return found


def _way_on(
    layout: Layout,
    ends: dict[int, list[str]],
    inside: dict[str, list[MappedCrossing]],
    vertex: int,
    arm: Arm,
) -> Iterator[tuple[int, Floats]]:
    """Follow the ways straight ahead from an arm's vertex to the first crossing."""
    graph = layout.graph
    ahead = -ray(graph, arm)[1]
    line, here, seen = np.array([graph.places[vertex]]), vertex, {arm[0]}
    while (walked := float(along(line)[-1])) < _FARTHEST:
        options = []
        for name in ends[here]:
            if name in layout.inner and name not in seen:
                section = graph.sections[name]
                onward = graph.line(section) if section.start == here else graph.line(section)[::-1]
                way = onward[-1] - onward[0]
                options.append((float(way @ ahead) / max(math.hypot(*way), 1e-6), name, onward))
        straight, name, onward = max(options, key=lambda option: option[:2], default=(0.0, "", line))
        if straight < _AHEAD:
            return
        path = shapely.LineString(onward)
        found = sorted((path.project(shapely.Point(c.place)), c.node) for c in inside.get(name, ()))
        if found and walked + found[0][0] < _FARTHEST:
            cut = shapely.ops.substring(path, 0.0, found[0][0])
            yield found[0][1], np.vstack([line, shapely.get_coordinates(cut)[1:]])
            return
        line = np.vstack([line, onward[1:]])
        seen.add(name)
        section = graph.sections[name]
        here = section.end if section.start == here else section.start


def _is_behind(layout: Layout, arm: Arm, line: Floats) -> bool:
    """Tell whether the end of a way from an arm lies nearer to a road from another side."""
    outward = ray(layout.graph, arm)[1]
    rays = [ray(layout.graph, other) for other in layout.arms()[layout.junction(arm)]]
    farthest = _NEARER * float(along(line)[-1])
    return any(way @ outward < _ASIDE and math.dist(start, line[-1]) < farthest for start, way in rays)


def _lead_on(layout: Layout, vertex: int, arm: Arm, line: Floats) -> None:
    """Make a road longer, its vertex moved along a line; the ways inside the junction stay tied to it."""
    graph = layout.graph
    section = graph.sections[arm[0]]
    passed = []
    for x, y in line[:-1].tolist():
        node = min(0, *graph.places) - 1
        graph.places[node] = (x, y)
        passed.append(node)
    graph.places[vertex] = (round(float(line[-1][0]), 3), round(float(line[-1][1]), 3))
    if arm[1]:
        nodes = (*section.nodes[:-1], *passed, vertex)
        ways = (*section.ways, *section.ways[-1:] * len(passed))
    else:
        nodes = (vertex, *passed[::-1], *section.nodes[1:])
        ways = (*section.ways[:1] * len(passed), *section.ways)
    graph.sections[arm[0]] = replace(section, nodes=nodes, ways=ways)
