"""Keep carriageways off each other: they get narrower lanes where they are mapped too near, then move apart.

OpenStreetMap draws middles of carriageways, often a metre or two beside the truth. Lanes as wide as they are
would lie on each other there.
"""

import itertools
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
import shapely

from dojo_maps.geometry.polylines import Floats
from dojo_maps.sources.osm.layout.arms import Arm, Layout, ray, shift

_STEP = 2.0
_TRIED = 6
"""Distances that are tried between none and all that a road should move."""


def space_carriageways(layout: Layout) -> Layout:
    """Narrow the lanes of roads that lie on each other, and move them apart where that is not enough.

    Args:
        layout: with its roads drawn back.

    Returns:
        The layout with these widths of lanes, and with what it takes added to its asides.
    """
    rules = layout.rules.spacing
    names = [name for name in sorted(layout.graph.sections) if name not in layout.inner]
    lines = {
        name: shapely.LineString(shift(layout.trimmed(name), layout.asides.get(name, 0.0))) for name in names
    }
    tree = shapely.STRtree([lines[name].buffer(layout.half(name), cap_style="flat") for name in names])
    pairs = [(names[a], names[b]) for a, b in tree.query(tree.geometries, predicate="intersects").T if a < b]
    near = {pair: found for pair in pairs if (found := _near_places(layout, lines, *pair))}
    layout = _narrow(layout, {pair: apart for pair, (apart, _) in near.items()})
    asides: dict[str, float] = {}
    for pair, (apart, sides) in near.items():
        wanted = layout.half(pair[0]) + layout.half(pair[1]) + rules.gap - apart
        if wanted > 0:
            rooms = []
            for name, side in zip(pair, sides, strict=True):
                around = tree.query(lines[name], "dwithin", distance=layout.half(name) + wanted)
                thirds = sorted({names[hit] for hit in around} - {*pair})
                rooms.append(_room(layout, lines, name, thirds, -side, wanted))
            for name, side, metres in zip(
                pair, sides, _share_out(wanted, rooms, rules.taken_over), strict=True
            ):
                moved = asides.get(name, 0.0) - side * metres
                asides[name] = max(-rules.farthest, min(rules.farthest, moved))
    asides = {
        name: asides.get(name, 0.0) + layout.asides.get(name, 0.0) for name in {**layout.asides, **asides}
    }
    return replace(layout, asides=asides)


def _narrow(layout: Layout, near: Mapping[tuple[str, str], float]) -> Layout:
    """Narrow the lanes of pairs of roads to the metres between their middles, as far as lanes may be."""
    sections, rules = dict(layout.graph.sections), layout.rules.spacing
    for pair, apart in near.items():
        share = (apart - rules.gap) / sum(sections[name].road.drives / 2 for name in pair)
        for name in pair:
            road = sections[name].road
            width = round(min(road.width, max(rules.narrowest_lane, road.width * share)), 2)
            sections[name] = replace(sections[name], road=replace(road, width=width))
    return replace(layout, graph=replace(layout.graph, sections=sections))


def _share_out(wanted: float, rooms: Sequence[float], most_taken_over: float) -> tuple[float, float]:
    """Split the metres by which two roads move apart: half each, or what there is room for on either side."""
    one = min(wanted / 2, rooms[0])
    other = min(wanted - one, rooms[1])
    one = min(wanted - other, rooms[0])
    rest = (wanted - one - other) / 2
    if abs(one - other) / 2 > most_taken_over:
        return wanted / 2, wanted / 2
    return one + rest, other + rest


def _room(
    layout: Layout,
    lines: dict[str, shapely.LineString],
    name: str,
    thirds: Sequence[str],
    side: int,
    wanted: float,
) -> float:
    """Measure how far a road may move to a side, up to what is wanted, before it lies on others."""
    layer = layout.graph.sections[name].road.layer
    room = wanted
    for third in thirds:
        needed = layout.half(name) + layout.half(third)
        near, beside = _beside(lines[name], lines[third], needed + wanted)
        if beside == side and layout.graph.sections[third].road.layer == layer:
            steps = np.linspace(0.0, wanted, _TRIED)
            lying = np.maximum(needed + steps[:, None] - near, 0.0).sum(axis=1) * _STEP
            room = min(room, float(steps[lying < layout.rules.spacing.least_overlap].max(initial=0.0)))
    return room


def side_by_side(layout: Layout, arms: Sequence[Arm]) -> list[list[Arm]]:
    """Group a junction's arms: those with no room for an island between them are crossed as one.

    Args:
        layout: with its roads drawn back.
        arms: of one junction.

    Returns:
        Each arm in one group, many of them alone.
    """
    groups = [[arm] for arm in arms]
    for arm, other in itertools.combinations(arms, 2):
        if not _touch(layout, arm, other):
            continue
        one, two = (next(group for group in groups if a in group) for a in (arm, other))
        if one is not two:
            one += two
            groups.remove(two)
    return groups


def _touch(layout: Layout, arm: Arm, other: Arm) -> bool:
    if arm.section == other.section:
        return False
    rules = layout.rules.spacing
    rays = [ray(layout.graph, a) for a in (arm, other)]
    if float(rays[0][1] @ rays[1][1]) < rules.parallel:
        return False
    lines = [layout.trimmed(name) for name, _ in (arm, other)]
    ends = [line[-1] if at_end else line[0] for line, (_, at_end) in zip(lines, (arm, other), strict=True)]
    room = shapely.distance(shapely.Point(ends[0]), shapely.LineString(lines[1]))
    ahead = abs(float((ends[1] - ends[0]) @ rays[0][1]))
    return (
        ahead < rules.on_one_line
        and room - layout.half(arm.section) - layout.half(other.section) < rules.island
    )


def _near_places(
    layout: Layout, lines: dict[str, shapely.LineString], one: str, other: str
) -> tuple[float, tuple[int, int]] | None:
    """Measure how far apart two roads run where they lie on each other; and on which side of each.

    Returns:
        Metres between their middles, and for each road 1 where the other lies to its left, -1 to its right;
        None where they do not run along each other on one level, or are parts of a ring.
    """
    roads = [layout.graph.sections[name].road for name in (one, other)]
    if roads[0].layer != roads[1].layer or all(road.roundabout for road in roads):
        return None
    needed = layout.half(one) + layout.half(other)
    near, side = _beside(lines[one], lines[other], needed)
    if float((needed - near).sum()) * _STEP < layout.rules.spacing.least_overlap:
        return None
    back, other_side = _beside(lines[other], lines[one], needed)
    return (
        (float(np.quantile(near, layout.rules.spacing.near_share)), (side, other_side)) if len(back) else None
    )


def _beside(line: shapely.LineString, other: shapely.LineString, needed: float) -> tuple[Floats, int]:
    """Measure a line's distances to another where that is too near, and on which side it lies."""
    places, headings = _samples(line)
    distances = shapely.distance(shapely.points(places), other)
    close = distances < needed
    nearest = shapely.get_coordinates(
        shapely.line_interpolate_point(other, shapely.line_locate_point(other, shapely.points(places[close])))
    )
    across = nearest - places[close]
    turn = headings[close][:, 0] * across[:, 1] - headings[close][:, 1] * across[:, 0]
    return distances[close], 1 if float(turn.sum()) > 0 else -1


def _samples(line: shapely.LineString) -> tuple[Floats, Floats]:
    """Take places every two metres along a line, and the unit vectors ahead."""
    at = np.arange(_STEP / 2, max(line.length, _STEP), _STEP)
    places = shapely.get_coordinates(line.interpolate(at))
    ahead = shapely.get_coordinates(line.interpolate(np.minimum(at + 0.5, line.length)))
    behind = shapely.get_coordinates(line.interpolate(np.maximum(at - 0.5, 0.0)))
    way = ahead - behind
    return places, way / np.maximum(np.hypot(*way.T), 1e-9)[:, None]
