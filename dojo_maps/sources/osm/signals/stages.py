"""Which movements of a signal may have green together: stages, by the network's own rules of right of way.

Opposite approaches share a stage; a far turn (to the left where traffic keeps right) gets a stage of its own
where it has lanes of its own, and otherwise waits for gaps. Who walks shares a stage with turning traffic
that yields, never with traffic that goes straight or is protected. Where a signal has several junctions, the
roads between them have green together with the roads that fill them, or they would block those.
"""

import itertools
import math
from collections import defaultdict
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

from dojo_maps.description import Connection, Crossing, Lane, LaneKind, RoadMap, Signal
from dojo_maps.geometry.polylines import along
from dojo_maps.index import MapIndex
from dojo_maps.signals.conflicts import list_foes

_OPPOSITE, _ALONGSIDE = 120.0, 45.0
"""Degrees between the headings of approaches that face each other, and of those that run side by side."""

_BETWEEN = 30.0
"""Metres from a junction within which a road may begin that leads to another stop line of its signal."""
_LONGEST_RIDE = 30.0
"""Metres across a junction beyond which a cyclist finds no gap in a stream of cars: 7 s at 4 m/s."""
SHORT = 30.0
"""Metres of a road between two junctions that a few who wait to turn fill."""


@dataclass(frozen=True, slots=True, kw_only=True)
class SignalLink:
    """A link of a signal.

    Attributes:
        foes, yields_to: links of the same signal, by index.
        length: metres across the junction.
        speed: m/s; of those who walk, zero.
        heading: of a vehicle as it arrives, degrees counter-clockwise from east.
        far: it turns across the opposite traffic.
        alone: the lane it starts from is for such turns only.
        to: the road it leads to; "" of those who walk.
        onto: the road by which it leads to another stop line of the signal, soon; "" if to none.
        over: the roads that those who walk cross.
        cycles: its lane is for bicycles.
        room: metres of that lane.
    """

    index: int
    road: str
    walks: bool
    foes: frozenset[int]
    yields_to: frozenset[int]
    length: float
    speed: float
    heading: float
    direction: str
    far: bool
    alone: bool
    to: str = ""
    onto: str = ""
    over: frozenset[str] = frozenset()
    cycles: bool = False
    room: float = math.inf


@dataclass(frozen=True, slots=True, kw_only=True)
class Stage:
    """Links that have green together; `protected` tells that it is for far turns only."""

    vehicles: frozenset[int]
    walks: frozenset[int]
    protected: bool


def read_links(road_map: RoadMap, signal: Signal) -> dict[int, SignalLink]:
    """Collect the links of a signal by index.

    Args:
        road_map: the network.
        signal: of it.

    Returns:
        The links of vehicles and of those who walk, by index, ascending.
    """
    connections = [c for c in road_map.connections if c.signal == signal.id and c.link_index is not None]
    crossings = [c for c in road_map.crossings if c.signal == signal.id and c.link_index is not None]
    index = {connection.id: connection.link_index for connection in connections}
    index |= {crossing.id: crossing.link_index for crossing in crossings}
    foes: dict[int, set[int]] = defaultdict(set)
    yields: dict[int, set[int]] = defaultdict(set)
    for junction in road_map.junctions:
        if junction.id not in signal.junctions:
            continue
        for pair in list_foes(junction):
            one, other = index.get(pair.one), index.get(pair.other)
            if one is None or other is None:
                continue
            foes[one].add(other)
            foes[other].add(one)
            if pair.one_waits:
                yields[one].add(other)
            if pair.other_waits:
                yields[other].add(one)
    map_index = MapIndex(road_map)
    lanes = map_index.lanes
    stopping = {lanes[connection.from_lane].road for connection in connections}
    far = "r" if road_map.left_hand else "l"
    turns: dict[str, set[str]] = defaultdict(set)
    for connection in connections:
        turns[connection.from_lane].add(connection.direction.lower())
    links = {}
    for connection in connections:
        lane = lanes[connection.from_lane]
        link = _vehicle(connection, lane, turns[lane.id], far)
        target = lanes[connection.to_lane]
        onto = _find_next_stop(map_index, target, stopping)
        links[link.index] = replace(_with(link, foes, yields), to=target.road, onto=onto)
    for crossing in crossings:
        link = _walk(crossing)
        links[link.index] = _with(link, foes, yields)
    return dict(sorted(links.items()))


def _find_next_stop(index: MapIndex, first: Lane, stopping: set[str]) -> str:
    """Name the road by which a lane soon leads to another stop line of the signal; "" if it does not."""
    queue, seen = [(first, 0.0)], set()
    while queue:
        lane, metres = queue.pop(0)
        if lane.road in stopping:
            return lane.road
        metres += lane.length
        if lane.id not in seen and metres <= _BETWEEN:
            seen.add(lane.id)
            onward = (c for c in index.leaving.get(lane.id, ()) if c.signal is None)
            queue += [(index.lanes[c.to_lane], metres) for c in onward]
    return ""


def _vehicle(c: Connection, lane: Lane, turns: set[str], far: str) -> SignalLink:
    way = c.shape[min(1, len(c.shape) - 1)] - c.shape[0]
    cycles = lane.kind is LaneKind.BICYCLE
    return SignalLink(
        index=c.link_index or 0, road=lane.road, walks=False, foes=frozenset(), yields_to=frozenset(),
        length=float(along(c.shape)[-1]), speed=lane.speed, heading=math.degrees(math.atan2(way[1], way[0])),
        direction=c.direction, far=c.direction.lower() in (far, "t"),
        alone=turns <= {far, "t"} and not cycles, cycles=cycles, room=lane.length,
    )  # fmt: skip


def _walk(crossing: Crossing) -> SignalLink:
    return SignalLink(
        index=crossing.link_index or 0, road=crossing.id, walks=True, foes=frozenset(), yields_to=frozenset(),
        length=float(along(crossing.shape)[-1]), speed=0.0, heading=0.0, direction="s",
        far=False, alone=False, over=frozenset(crossing.roads),
    )  # fmt: skip


def _with(link: SignalLink, foes: dict[int, set[int]], yields: dict[int, set[int]]) -> SignalLink:
    return replace(
        link, foes=frozenset(foes[link.index]) - {link.index}, yields_to=frozenset(yields[link.index])
    )


def build_stages(links: dict[int, SignalLink]) -> list[Stage]:
    """Divide a signal's links into stages; every link has green in one of them at least.

    Args:
        links: of the signal, by index.

    Returns:
        The stages; `stage_order` decides which follows which.
    """
    groups = _groups(links)
    whole = {group: _with_fed(links, groups, group) for group in groups}
    fed = {other for group in groups for other in groups if other < whole[group] and other != group}
    waiting = sorted(groups, key=lambda g: (g in fed, _is_far(links, g), -len(g), min(g)))
    stages: list[set[int]] = []
    while waiting:
        first = waiting.pop(0)
        if any(first <= stage for stage in stages):
            continue
        stage = set(whole[first])
        same = [g for g in waiting if _is_far(links, g) == _is_far(links, first)]
        other = [g for g in waiting if _is_far(links, g) != _is_far(links, first)]
        for group in (*sorted(same, key=lambda g: _turned(links, first, g)), *other):
            if _compatible(links, stage, whole[group]):
                stage |= whole[group]
                waiting.remove(group)
        stages.append(stage)
    filled = [_stage(links, _filled(links, whole, stage)) for stage in stages]
    return _without_needless(_with_walkers_stage(links, whole.values(), filled))


def _without_needless(stages: Sequence[Stage]) -> list[Stage]:
    """Leave out stages whose links all have green in others."""
    kept = list(stages)
    for stage in reversed(stages):
        others = [other for other in kept if other is not stage]
        vehicles = frozenset[int]().union(*(other.vehicles for other in others))
        walks = frozenset[int]().union(*(other.walks for other in others))
        if stage.vehicles <= vehicles and stage.walks <= walks:
            kept = others
    return kept


def _with_fed(
    links: dict[int, SignalLink], groups: Sequence[frozenset[int]], group: frozenset[int]
) -> frozenset[int]:
    """Add the roads inside the signal that a group's traffic goes on along, as far as they let each other."""
    whole, waiting = set(group), [group]
    while waiting:
        roads = {links[k].onto for k in waiting.pop()} - {""}
        for other in groups:
            following = links[min(other)].road in roads and not other <= whole
            if following and not _is_far(links, other) and _compatible(links, whole, other):
                whole |= other
                waiting.append(other)
    return frozenset(whole)


def _filled(
    links: dict[int, SignalLink], whole: dict[frozenset[int], frozenset[int]], stage: set[int]
) -> frozenset[int]:
    """Add what can go along besides."""
    for group, added in whole.items():
        if not group <= stage and not _is_far(links, group) and _compatible(links, stage, added):
            stage |= added
    return frozenset(stage)


def _stage(links: dict[int, SignalLink], vehicles: frozenset[int]) -> Stage:
    """Let people walk where a stage's vehicles let them."""
    walks = frozenset(
        link.index
        for link in links.values()
        if link.walks and all(_lets_walk(links[k], link) for k in vehicles)
    )
    protected = bool(vehicles) and all(links[k].far and links[k].alone for k in vehicles)
    return Stage(vehicles=vehicles, walks=walks, protected=protected)


def _with_walkers_stage(
    links: dict[int, SignalLink], groups: Iterable[frozenset[int]], stages: list[Stage]
) -> list[Stage]:
    """Add a stage for crossings that no other stage leaves time for, and for what passes them.

    Args:
        links: of the signal.
        groups: of its vehicles, each with the roads that it fills.
        stages: those that there are.
    """
    served = {walk for stage in stages for walk in stage.walks}
    left = frozenset(link.index for link in links.values() if link.walks) - served
    if not left:
        return stages
    stage: set[int] = set()
    for group in groups:
        passes = all(_lets_walk(links[k], links[w]) for k in group for w in left)
        if passes and _compatible(links, stage, group):
            stage |= group
    return [*stages, _stage(links, frozenset(stage))]


def letters_of(links: dict[int, SignalLink], stage: Stage) -> dict[int, str]:
    """Give the letter of each link that has green: g where it must let others of the stage go first.

    Args:
        links: of the signal, by index.
        stage: of them.

    Returns:
        `G` or `g` by index, ascending; without links that are red.
    """
    green = stage.vehicles | stage.walks
    letters: dict[int, str] = {}
    for k in sorted(green):
        # Lanes of one road that cross each other leave neither the right of way.
        crossed = any(letters.get(other) == "G" for other in links[k].foes)
        yields = links[k].yields_to & green or crossed
        letters[k] = "g" if yields and not links[k].walks else "G"
    return letters


def _groups(links: dict[int, SignalLink]) -> list[frozenset[int]]:
    """Group the links of each road; far turns with lanes of their own are apart."""
    found: dict[tuple[str, bool], set[int]] = defaultdict(set)
    for link in links.values():
        if not link.walks:
            found[link.road, link.far and link.alone].add(link.index)
    return [frozenset(group) for _, group in sorted(found.items())]


def _is_far(links: dict[int, SignalLink], group: frozenset[int]) -> bool:
    return all(links[k].far and links[k].alone for k in group)


def _turned(links: dict[int, SignalLink], one: frozenset[int], other: frozenset[int]) -> tuple[float, int]:
    """Order groups so that the one that faces another comes first."""
    turn = abs((links[min(one)].heading - links[min(other)].heading + 180) % 360 - 180)
    return (abs(180 - turn), min(other))


def _compatible(links: dict[int, SignalLink], stage: set[int], group: frozenset[int]) -> bool:
    green = stage | group
    if _wait_in_circle(links, green) or _block_in_circle(links, green):
        return False
    pairs = itertools.product(sorted(stage), sorted(group))
    return all(_may_share(links[a], links[b]) for a, b in pairs)


def _wait_in_circle(links: dict[int, SignalLink], green: set[int]) -> bool:
    """Tell whether cyclists could wait for each other for ever: each for the next, the last for the first."""
    left = {k for k in green if links[k].cycles}
    while free := {k for k in left if not links[k].yields_to & left}:
        left -= free
    return bool(left)


def _block_in_circle(links: dict[int, SignalLink], green: set[int]) -> bool:
    """Tell whether two that turn out of short roads could each wait for who stands behind the other."""
    turning = [links[k] for k in green if links[k].far and not links[k].alone and links[k].room < SHORT]
    waits_for = {link.index: {links[k].onto for k in link.yields_to & green} for link in turning}
    return any(
        other.road in waits_for[one.index] and one.road in waits_for[other.index]
        for one, other in itertools.combinations(turning, 2)
    )


def _may_share(one: SignalLink, other: SignalLink) -> bool:
    """Tell whether two vehicle links may have green together.

    Who turns across the opposite traffic finds gaps in it; who merges with a stream would find none. Cyclists
    let each other pass as people do who walk.
    """
    if other.index not in one.foes or one.road == other.road:
        return True
    yielding = [a for a, b in ((one, other), (other, one)) if b.index in a.yields_to]
    if len(yielding) != 1:
        return False
    if one.cycles and other.cycles:
        return True
    if yielding[0].cycles and yielding[0].length > _LONGEST_RIDE:
        return False
    turn = abs((one.heading - other.heading + 180) % 360 - 180)
    if _ALONGSIDE < turn < _OPPOSITE:
        return False
    first, second = yielding[0], other if yielding[0] is one else one
    merges = first.to == second.to and not first.far
    return first.direction.lower() != "s" and not merges and not (first.far and first.alone)


def _lets_walk(link: SignalLink, walk: SignalLink) -> bool:
    """Tell whether people may walk while a vehicle link has green: where it turns and waits for them.

    Not before its own stop line: it would wait there for all who walk, or stand in their way.
    """
    if walk.index not in link.foes:
        return True
    if link.road in walk.over:
        return False
    turns = link.direction.lower() in ("l", "r") and not (link.far and link.alone)
    return turns and walk.index in link.yields_to
