"""Where each crossing goes: at an arm of a junction, whose border moves out to it."""

import itertools
import math
from dataclasses import replace

from dojo_maps.sources.osm.graph.road_graph import RoadGraph
from dojo_maps.sources.osm.junctions.mapped_crossings import MappedCrossing
from dojo_maps.sources.osm.layout.arms import Arm, Layout, ray


def host_crossings(layout: Layout) -> Layout:
    """Give each crossing the arm nearest to it, nearest crossings first.

    Args:
        layout: whose cuts and hosted crossings, if it has some, are forgotten.

    Returns:
        The layout with the crossing at each arm, cuts that draw its road back to there, and the crossings
        with no place.
    """
    graph, rules = layout.graph, layout.rules.crossings
    hosted: dict[Arm, MappedCrossing] = {}
    cuts: dict[Arm, float] = {}
    arms = layout.arms()
    wishes = []
    for number, crossing in enumerate(layout.crossings):
        candidates = _candidates(layout, arms, crossing)
        for arm in candidates:
            distance, cut = _reach_of(graph, arm, crossing)
            distance -= rules.straight_on * _leads_to(graph, candidates, arm, crossing)
            back = _faces_back(graph, arms[layout.junction(arm)][0], arm)
            wishes.append((round(distance, 1), back, number, arm, cut))
    placed: set[int] = set()
    for distance, _, number, arm, cut in sorted(wishes):
        if number in placed or arm in hosted or distance > rules.farthest_from_arm:
            continue
        room = layout.room(arm, cuts, left=rules.road_left)
        if cut > rules.may_be_moved and cut > room + rules.may_be_moved:
            continue
        hosted[arm] = layout.crossings[number]
        cuts[arm] = max(min(cut, room), 0.0)
        placed.add(number)
    lost = [
        (crossing, "another crossing or the road's end is too near")
        for number, crossing in enumerate(layout.crossings)
        if number not in placed
    ]
    return replace(layout, hosted=hosted, cuts=cuts, lost=lost)


def align_carriageways(layout: Layout) -> Layout:
    """Draw both carriageways of an arm back to one line; netconvert would pull the one to the other.

    Args:
        layout: with its crossings at their arms.

    Returns:
        The layout with more cuts.
    """
    graph, rules, cuts = layout.graph, layout.rules, dict(layout.cuts)
    for arms in layout.arms().values():
        rays = {arm: ray(graph, arm) for arm in arms}
        for arm, other in itertools.permutations(arms, 2):
            (place, way), (twin, back) = rays[arm], rays[other]
            apart = twin - place
            ahead = float(apart @ way)
            aside = abs(float(apart[0] * way[1] - apart[1] * way[0]))
            if (
                arm not in layout.hosted
                or float(way @ back) < rules.spacing.parallel
                or not 0 < aside < rules.junctions.carriageways_apart
            ):
                continue
            wanted = cuts[arm] - ahead
            if cuts.get(other, 0.0) < wanted < layout.room(other, cuts, left=rules.crossings.road_left):
                cuts[other] = wanted
    return replace(layout, cuts=cuts)


def _candidates(layout: Layout, arms: dict[int, list[Arm]], crossing: MappedCrossing) -> list[Arm]:
    """List the arms where a crossing may be built."""
    section = layout.graph.sections[crossing.section]
    if crossing.section not in layout.inner and crossing.node not in (section.start, section.end):
        return [Arm(crossing.section, at_end=False), Arm(crossing.section, at_end=True)]
    if crossing.section in layout.inner:
        return arms.get(layout.junctions.of[section.start], [])
    return arms.get(layout.junctions.of[crossing.node], [])


def _reach_of(graph: RoadGraph, arm: Arm, crossing: MappedCrossing) -> tuple[float, float]:
    """Measure from an arm's vertex to a crossing, and how far the arm must be drawn back for it."""
    section, width = graph.sections[arm.section], graph.rules.crossings.width
    if crossing.section == arm.section:
        distance = graph.length(section) - crossing.along if arm.at_end else crossing.along
        return distance, distance + width / 2
    distance = math.dist(graph.places[_vertex(graph, arm)], crossing.place)
    return distance + 0.01, width / 2


def _leads_to(graph: RoadGraph, arms: list[Arm], arm: Arm, crossing: MappedCrossing) -> bool:
    """Tell whether the road that a crossing inside a junction lies on begins where a single arm ends."""
    road, vertex = graph.sections[crossing.section], _vertex(graph, arm)
    single = [_vertex(graph, other) for other in arms].count(vertex) == 1
    return single and crossing.section != arm.section and vertex in (road.start, road.end)


def _vertex(graph: RoadGraph, arm: Arm) -> int:
    section = graph.sections[arm.section]
    return section.end if arm.at_end else section.start


def _faces_back(graph: RoadGraph, first: Arm, arm: Arm) -> bool:
    """Tell whether an arm leads to the other side than the first, so that crossings line up on one side."""
    return float(ray(graph, first)[1] @ ray(graph, arm)[1]) < 0
