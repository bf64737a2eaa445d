"""Checks of where people walk: crossings that join walking areas, and a network that one can walk through."""

from collections import defaultdict
from collections.abc import Iterator
from functools import partial

import numpy as np
import shapely

from dojo_maps.description import CARRIAGEWAY, Crossing, LaneKind, Program
from dojo_maps.geometry.polylines import Floats
from dojo_maps.signals.programs import GREEN
from dojo_maps.validation.check import ERROR, NOTE, WARNING, Check, Finding, Need, check, element
from dojo_maps.validation.facts import Facts, twisted_share
from dojo_maps.validation.profiles import Limits
from dojo_maps.validation.programs import SignalFacts, programs_of
from dojo_maps.wording import counted

_NAMED = 20
_FAR = 30.0
"""Metres, past any walking area."""


@check(
    id="pedestrians.crossing_ends",
    code="PED001",
    title="Crossings join two walking areas",
    severity=ERROR,
    limit="2",
    source="SUMO Simulation/Pedestrians",
    hint="rebuild the junction with netconvert --walkingareas, or add the missing connection",
)
def check_crossing_ends(facts: Facts, _limits: Limits) -> Iterator[Finding]:
    """Find crossings that do not join two walking areas, though a way leads off them.

    Args:
        facts: of the map; generated crossings and walking areas do not count.
        _limits: there is none to this check; 2 walking areas are its own.

    Yields:
        A finding for each such crossing, with the number of walking areas that it touches.
    """
    touched: dict[str, set[str]] = defaultdict(set)
    for walk in facts.map.walks:
        for one, other in ((walk.from_id, walk.to_id), (walk.to_id, walk.from_id)):
            if one in facts.crossings and other in facts.walking_areas:
                touched[one].add(other)
    left = {walk.from_id for walk in facts.map.walks}
    for crossing in facts.crossings.values():
        if crossing.id in left and len(touched[crossing.id]) < 2:
            yield Finding(
                elements=element("crossing", crossing.id),
                at=crossing.shape[0],
                message=f"the crossing {crossing.id} touches "
                f"{counted(len(touched[crossing.id]), 'walking area')}",
                measured=float(len(touched[crossing.id])),
                limit=2.0,
            )


@check(
    id="pedestrians.crossing_no_target",
    code="PED004",
    title="Crossings lead somewhere",
    severity=ERROR,
    limit="1 way off",
    source="SUMO: Invalid pedestrian topology: crossing has no target",
    hint="rebuild the junction with netconvert --walkingareas",
)
def check_crossing_no_target(facts: Facts, _limits: Limits) -> Iterator[Finding]:
    """Find crossings that nothing leads off.

    Args:
        facts: of the map; generated crossings do not count.
        _limits: there is none to this check.

    Yields:
        A finding for each such crossing, at its end.
    """
    left = {walk.from_id for walk in facts.map.walks}
    for crossing in facts.crossings.values():
        if crossing.id not in left:
            yield Finding(
                elements=element("crossing", crossing.id),
                at=crossing.shape[-1],
                message=f"no way leads off the crossing {crossing.id}",
            )


@check(
    id="pedestrians.walk_components",
    code="PED002",
    title="One can walk everywhere",
    severity=WARNING,
    limit="1 part",
    source="measured: 8 parts in one city network",
    hint="add a sidewalk or a crossing that joins the part",
)
def check_walk_components(facts: Facts, _limits: Limits) -> Iterator[Finding]:
    """Find sidewalks, crossings and walking areas that one cannot walk to from most others.

    Args:
        facts: of the map; without a walking area of the network nothing is found.
        _limits: there is none to this check.

    Yields:
        A finding for each part but the largest, with the number of its places; it names up to 20 of them.
    """
    if not facts.walking_areas:
        return
    groups = _walk_groups(facts)
    for group in groups[1:]:
        kind = partial(_kind_of, facts)
        yield Finding(
            elements=tuple(item for name in group[:_NAMED] for item in element(kind(name), name)),
            at=_start_of(facts, group[0]),
            message=f"cut off from the other {len(groups[0])}: {counted(len(group), 'place')} to walk, "
            f"{group[0]} among them",
            measured=float(len(group)),
            limit=0.0,
        )


def _walk_groups(facts: Facts) -> list[list[str]]:
    sidewalks = [lane.id for lane in facts.map.lanes if lane.kind is LaneKind.SIDEWALK]
    joined: dict[str, set[str]] = defaultdict(set)
    steps = [(walk.from_id, walk.to_id) for walk in facts.map.walks]
    steps += [(c.from_lane, c.to_lane) for c in facts.map.connections if "pedestrian" in facts.users(c)]
    for one, other in steps:
        joined[one].add(other)
        joined[other].add(one)
    groups, seen = [], set[str]()
    for start in (*sidewalks, *facts.crossings, *facts.walking_areas):
        group, rest = [], [] if start in seen else [start]
        seen.add(start)
        while rest:
            group.append(rest.pop())
            fresh = sorted(joined[group[-1]] - seen)
            seen.update(fresh)
            rest += fresh
        if group:
            groups.append(group)
    return sorted(groups, key=len, reverse=True)


def _kind_of(facts: Facts, name: str) -> str:
    if name in facts.crossings:
        return "crossing"
    return "walking_area" if name in facts.walking_areas else "lane"


def _start_of(facts: Facts, name: str) -> Floats:
    if name in facts.crossings:
        return facts.crossings[name].shape[0]
    if name in facts.walking_areas:
        return facts.walking_areas[name].polygon[0]
    return facts.lanes[name].shape[0]


def _joins(facts: Facts) -> dict[str, set[str]]:
    """Tell for each place to walk which others lie next to it."""
    joins: dict[str, set[str]] = defaultdict(set)
    for walk in facts.map.walks:
        joins[walk.from_id].add(walk.to_id)
        joins[walk.to_id].add(walk.from_id)
    return joins


@check(
    id="pedestrians.dead_end_walking_area",
    code="PED003",
    title="Walking areas lead on",
    severity=WARNING,
    limit="2 ways, unless the map ends there",
    source="SUMO: Invalid walkingarea does not allow continuation",
    hint="add a crossing, or the sidewalk that is missing",
)
def check_dead_end_walking_area(facts: Facts, _limits: Limits) -> Iterator[Finding]:
    """Find walking areas that lead nowhere, unless the map ends there.

    Args:
        facts: of the map; generated walking areas do not count.
        _limits: there is none to this check; 2 ways are its own.

    Yields:
        A finding for each such walking area, with the number of ways to walk that it joins.
    """
    joins = _joins(facts)
    for area in facts.walking_areas.values():
        if len(joins[area.id]) < 2 and facts.legs(area.junction) > 1:
            yield Finding(
                elements=(*element("walking_area", area.id), *element("junction", area.junction)),
                at=area.polygon[0],
                message=f"the walking area {area.id} joins {counted(len(joins[area.id]), 'way')} to walk",
                measured=float(len(joins[area.id])),
                limit=2.0,
            )


@check(
    id="pedestrians.missing_crossing",
    code="PED005",
    title="Signalised junctions can be crossed on foot",
    severity=WARNING,
    limit="each leg with sidewalks on both sides, from three legs",
    source="a-b-street/speedwalk 14",
    hint="add the crossing in netedit, or with netconvert --crossings.guess",
)
def check_missing_crossing(facts: Facts, _limits: Limits) -> Iterator[Finding]:
    """Find signalised junctions where a leg with sidewalks on both sides cannot be crossed.

    Args:
        facts: of the map; generated crossings do not count, nor do junctions with fewer than three legs.
        _limits: there is none to this check.

    Yields:
        A finding for each such junction, with the number of its legs that have none.
    """
    crossed = {road for crossing in facts.crossings.values() for road in crossing.roads}
    for junction in facts.map.junctions:
        if not junction.kind.startswith("traffic_light") or facts.legs(junction.id) < 3:
            continue
        out = {facts.roads[road].to_junction: road for road in junction.outgoing}
        pairs = [(road, out.get(facts.roads[road].from_junction)) for road in junction.incoming]
        bare = [
            (road, back)
            for road, back in pairs
            if back is not None
            and _is_street_with_sidewalk(facts, road)
            and _is_street_with_sidewalk(facts, back)
            and not {road, back} & crossed
        ]
        if bare:
            yield Finding(
                elements=(
                    *element("junction", junction.id),
                    *element("road", *(road for pair in bare for road in pair)),
                ),
                at=junction.position if not len(junction.polygon) else junction.polygon[0],
                message=f"{counted(len(bare), 'leg')} of the signal at {junction.id} with sidewalks and "
                "no crossing",
                measured=float(len(bare)),
                limit=0.0,
            )


def _is_street_with_sidewalk(facts: Facts, road: str) -> bool:
    kinds = {lane.kind for lane in facts.lanes_of(road)}
    return LaneKind.SIDEWALK in kinds and bool(kinds & set(CARRIAGEWAY))


@check(
    id="pedestrians.walking_area_invalid",
    code="PED006",
    title="Walking areas have an outline and room",
    severity=WARNING,
    limit="1 m², at most 1 % of it twisted",
    source="SUMO tracker 5661",
    hint="delete the walking area's custom shape",
)
def check_walking_area_invalid(facts: Facts, limits: Limits) -> Iterator[Finding]:
    """Find walking areas that cross themselves or that no one fits on.

    Those that only carry one path on into the next are as thin as the bend there, and are fine.

    Args:
        facts: of the map; generated walking areas do not count.
        limits: `twisted`, a share of the ground, and `walking_area`, square metres.

    Yields:
        A finding for each such walking area, with its square metres unless it crosses itself.
    """
    joins = _joins(facts)
    areas = [
        area
        for area in facts.walking_areas.values()
        if len(joins[area.id]) > 2 or any(name in facts.crossings for name in joins[area.id])
    ]
    mended = shapely.area(facts.polygons_of([area.polygon for area in areas]))
    for area, size in zip(areas, mended.tolist(), strict=True):
        ring = area.polygon[:, :2] - facts.origin[:2]
        twisted = len(ring) > 2 and twisted_share(shapely.Polygon(ring), size) > limits.twisted
        if twisted or size < limits.walking_area:
            problem = "crosses itself" if twisted else f"has {size:.2f} m²"
            yield Finding(
                elements=(*element("walking_area", area.id), *element("junction", area.junction)),
                at=area.polygon[0],
                message=f"the walking area {area.id} {problem}",
                measured=None if twisted else size,
                limit=None if twisted else limits.walking_area,
            )


@check(
    id="pedestrians.walkway_extent",
    code="PED007",
    title="There is room to wait at crossings",
    severity=NOTE,
    limit="1 m (strict: 3 m)",
    source="autoware_lanelet2_map_validator Walkway; SUMO's default sidewalk is 2 m wide",
    hint="widen the sidewalk",
)
def check_walkway_extent(facts: Facts, limits: Limits) -> Iterator[Finding]:
    """Find crossings that end on pavement too shallow to wait on.

    Args:
        facts: of the map; generated crossings and walking areas do not count.
        limits: `waiting_depth`, metres on from a crossing's end.

    Yields:
        A finding for each such crossing, at its shallower end, with the metres there.
    """
    polygons: dict[str, shapely.Geometry] = {}
    for area in facts.walking_areas.values():
        polygons[area.id] = facts.polygons_of([area.polygon])[0]
    touching: dict[str, dict[str, None]] = defaultdict(dict)
    for walk in facts.map.walks:
        for one, other in ((walk.from_id, walk.to_id), (walk.to_id, walk.from_id)):
            if one in facts.crossings and other in polygons:
                touching[one][other] = None
    for crossing in facts.crossings.values():
        line = crossing.shape[:, :2] - facts.origin[:2]
        areas = [polygons[name] for name in touching[crossing.id]]
        depths = [_depth(line[::step], areas) for step in (1, -1)] if areas else []
        if depths and min(depths) < limits.waiting_depth:
            end = -1 if depths[0] <= depths[1] else 0
            yield Finding(
                elements=(
                    *element("crossing", crossing.id),
                    *element("walking_area", *touching[crossing.id]),
                ),
                at=crossing.shape[end],
                message=f"past the crossing {crossing.id} the pavement is {min(depths):.1f} m deep",
                measured=min(depths),
                limit=limits.waiting_depth,
            )


def _depth(line: Floats, areas: list[shapely.Geometry]) -> float:
    """Measure how far pavement goes on past a line's end, metres; the ways beside it count, too."""
    step = line[-1] - line[-2]
    length = float(np.hypot(*step))
    if length == 0:
        return _FAR
    ray = shapely.LineString([line[-1], line[-1] + step / length * _FAR])
    return max(float(ray.intersection(area).length) for area in areas)


MISSING_CROSSING = Check(
    id="osm.missing_crossing",
    code="PED008",
    title="Crossings of OpenStreetMap are in the network",
    severity=WARNING,
    limit="10 m",
    source="measured: 60 % are",
    hint="add the crossing in netedit",
    needs=Need.IMPORT,
)
GUESSED_CROSSING = Check(
    id="osm.guessed_crossing",
    code="PED009",
    title="Crossings of the network are in OpenStreetMap",
    severity=NOTE,
    limit="none guessed",
    source="measured: 66 % are",
    hint="remove the crossing, or map it",
    needs=Need.IMPORT,
)


@check(
    id="pedestrians.walk_before_green",
    code="PED010",
    title="Nobody walks before a stop line whose vehicles have green",
    severity=WARNING,
    limit="0 s of green for both",
    source="MUTCD 4I.02; RiLSA 2.3.1: who turns waits for those who cross the road that it turns into",
    hint="let people walk while the road's own vehicles have red",
)
def check_walk_before_green(facts: Facts, _limits: Limits) -> Iterator[Finding]:
    """Find crossings that are green together with a yielding green of the road that they lead over.

    Its vehicles have to wait at the stop line for all who walk, or stand on the crossing while they wait for
    others; SUMO's come to no end of it.

    Args:
        facts: of the map.
        _limits: there is none to this check.

    Yields:
        A finding for each program and crossing, with the longest time for which one link's vehicles and
        walkers have green together in a cycle, seconds.
    """
    for signal, program in programs_of(facts):
        for crossing, (seconds, k, w) in _walked_before(signal, program).items():
            yield Finding(
                elements=(*element("crossing", crossing), *signal.elements(k, w)),
                at=facts.crossings[crossing].shape[0],
                message=f"in {signal.named(program)} the crossing {crossing} is green for "
                f"{seconds:g} s together with vehicles before whose stop line it lies",
                measured=seconds,
                limit=0.0,
            )


def _walked_before(signal: SignalFacts, program: Program) -> dict[str, tuple[float, int, int]]:
    """Give crossings the longest time for which they are so, with the letters of vehicles and walkers."""
    found: dict[str, tuple[float, int, int]] = {}
    lanes = signal.facts.lanes
    for conflict in signal.conflicts:
        ways = ((conflict.one, conflict.indices[0]), (conflict.other, conflict.indices[1]))
        for (way, k), (walk, w) in (ways, ways[::-1]):
            if isinstance(way, Crossing) or not isinstance(walk, Crossing):
                continue
            if lanes[way.from_lane].road in walk.roads:
                seconds = _both_green(program, signal.letters(program, k), signal.letters(program, w))
                if seconds > found.get(walk.id, (0.0,))[0]:
                    found[walk.id] = (seconds, k, w)
    return found


def _both_green(program: Program, drives: str, walks: str) -> float:
    """Add up the phases in which vehicles have a yielding green, and walkers theirs."""
    return sum(
        phase.duration
        for phase, drive, walk in zip(program.phases, drives, walks, strict=True)
        if drive == "g" and walk in GREEN
    )
