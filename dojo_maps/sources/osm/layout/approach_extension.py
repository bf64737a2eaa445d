"""Roads that reach into a wide junction, up to where a crossing is mapped inside it.

Where a turning lane leaves far before a junction's middle, the vertex there is part of the junction, and the
crossing lies behind it. Its road goes on to the crossing; what lies beside it there is the junction's ground.
"""

import heapq
import math
from collections import defaultdict
from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import shapely
import shapely.ops

from dojo_maps.geometry.polylines import Floats, along
from dojo_maps.sources.osm.graph.road_graph import RoadGraph, free_number
from dojo_maps.sources.osm.junctions.mapped_crossings import MappedCrossing
from dojo_maps.sources.osm.layout.arms import Arm, Layout, ray, trim
from dojo_maps.sources.osm.layout.crossing_arms import host_crossings


def extend_approaches(layout: Layout) -> Layout:
    """Lead roads on to the crossings ahead of them that would find no place near.

    Where lanes are mapped one by one, the first of a crossing's pieces is enough.

    Args:
        layout: with no crossing in its place yet.

    Returns:
        The layout with longer roads, their vertices moved; the rest as it was.
    """
    trial = host_crossings(layout)
    ends, arms = trial.graph.ends(), trial.arms()
    free = _free_vertices(trial, arms)
    inside = _far_from_place(trial)
    found = [
        (float(along(line)[-1]), vertex, arm, line)
        for vertex, arm in sorted(free.items() if inside else ())
        for line in _ways_on(trial, ends, inside, vertex, arm)
        if not _is_in_the_way(trial, arms, arm, line)
    ]
    reached: list[Floats] = []
    nearest = layout.rules.extension.nearest
    for _, vertex, arm, line in sorted(found, key=lambda f: f[:3]):
        if vertex in free and all(math.dist(line[-1], place) > nearest for place in reached):
            del free[vertex]
            layout = replace(layout, graph=_lead_on(layout.graph, vertex, arm, line))
            reached.append(line[-1])
    return layout


def _free_vertices(layout: Layout, arms: dict[int, list[Arm]]) -> dict[int, Arm]:
    """Find the vertices of wide junctions where a single road arrives, and that road."""
    arms_at: dict[int, list[Arm]] = defaultdict(list)
    for meeting in arms.values():
        for arm in meeting:
            section = layout.graph.sections[arm.section]
            arms_at[section.end if arm.at_end else section.start].append(arm)
    return {vertex: there[0] for vertex, there in arms_at.items() if len(there) == 1}


def _far_from_place(layout: Layout) -> dict[str, list[MappedCrossing]]:
    """List the crossings inside junctions that found a place far off, or none, by section."""
    graph = layout.graph
    placed = {id(crossing): arm for arm, crossing in layout.hosted.items()}
    found: dict[str, list[MappedCrossing]] = defaultdict(list)
    for crossing in layout.crossings:
        if crossing.section in layout.inner:
            arm = placed.get(id(crossing))
            if arm is None or math.dist(ray(graph, arm)[0], crossing.place) > layout.rules.extension.nearest:
                found[crossing.section].append(crossing)
    return found


def _ways_on(
    layout: Layout,
    ends: dict[int, list[str]],
    inside: dict[str, list[MappedCrossing]],
    vertex: int,
    arm: Arm,
) -> Iterator[Floats]:
    """Follow the ways inside a junction from an arm's vertex, shortest first, to the crossings ahead."""
    graph, rules = layout.graph, layout.rules.extension
    start, outward = ray(graph, arm)
    queue, seen = [(0.0, 0, np.array([start]), vertex)], {arm.section}
    while queue:
        _, _, line, here = heapq.heappop(queue)
        for name in sorted(set(ends[here]) & layout.inner - seen):
            section = graph.sections[name]
            onward = graph.line(section) if section.start == here else graph.line(section)[::-1]
            path = shapely.LineString(onward)
            found = min((path.project(shapely.Point(c.place)) for c in inside.get(name, ())), default=None)
            cut = path if found is None else shapely.ops.substring(path, 0.0, found)
            walked = np.vstack([line, shapely.get_coordinates(cut)[1:]])
            seen.add(name)
            length = float(along(walked)[-1])
            if length > rules.farthest or (start - walked[-1]) @ outward < rules.straight_on * length:
                continue
            if found is None:
                beyond = section.end if section.start == here else section.start
                heapq.heappush(queue, (length, len(seen), walked, beyond))  # No two have seen as many.
            else:
                yield walked


def _is_in_the_way(layout: Layout, arms: dict[int, list[Arm]], arm: Arm, line: Floats) -> bool:
    """Tell whether a road led on along a line would lie before roads from the sides, or near one ahead."""
    graph, rules = layout.graph, layout.rules.extension
    outward = ray(graph, arm)[1]
    farthest = rules.nearer_from_other_side * float(along(line)[-1])
    ground = shapely.LineString(trim(line, 0.0, layout.rules.crossings.width / 2)).buffer(
        layout.half(arm.section), cap_style="flat"
    )
    for other in arms[layout.junction(arm)]:
        start, way = ray(graph, other)
        if way @ outward < -rules.from_side and math.dist(start, line[-1]) < farthest:
            return True
        drawn = start + way * layout.cuts.get(other, 0.0)
        road = shapely.LineString([drawn + way * rules.kept_free, drawn - way * rules.kept_free_before])
        strip = road.buffer(layout.half(other.section), cap_style="flat")
        if abs(way @ outward) < rules.from_side and strip.intersects(ground):
            return True
    return False


def _lead_on(graph: RoadGraph, vertex: int, arm: Arm, line: Floats) -> RoadGraph:
    """Make a road longer, its vertex moved along a line; the ways inside the junction stay tied to it."""
    section, places = graph.sections[arm.section], dict(graph.places)
    passed = []
    for x, y in line[:-1].tolist():
        passed.append(free_number(places))
        places[passed[-1]] = (x, y)
    places[vertex] = (round(float(line[-1][0]), 3), round(float(line[-1][1]), 3))
    if arm.at_end:
        nodes = (*section.nodes[:-1], *passed, vertex)
        ways = (*section.ways, *section.ways[-1:] * len(passed))
    else:
        nodes = (vertex, *passed[::-1], *section.nodes[1:])
        ways = (*section.ways[:1] * len(passed), *section.ways)
    sections = {**graph.sections, arm.section: replace(section, nodes=nodes, ways=ways)}
    return replace(graph, places=places, sections=sections)
