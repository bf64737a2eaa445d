"""Connections of lanes across junctions, as lines of SUMO's plain XML."""

import itertools
from collections import Counter, defaultdict
from collections.abc import Mapping, Sequence, Set
from typing import NamedTuple

from dojo_maps.sources.osm.layout.arms import Arm, Layout
from dojo_maps.sources.osm.plain.lane_connections import STRAIGHT, connect_lanes
from dojo_maps.sources.osm.plain.movements import Movement
from dojo_maps.sources.osm.plain.track_edges import NO_WAIT_INSIDE
from dojo_maps.sources.osm.plain.turns_over_tracks import find_turns_over_tracks
from dojo_maps.sources.osm.read.lane_tags import LaneTags, LaneUse

_NO_LANE_CHANGE = ' changeLeft="authority" changeRight="authority"'
"""Of a connection: a car that changed lanes inside a junction could stand beside another for ever, each in
the other's way."""


class _Link(NamedTuple):
    """From a lane of an arm, by a movement, into a lane of its road; lanes count from the outermost."""

    source: Arm
    lane: int
    movement: Movement
    onto: int


def write_lane_connections(
    layout: Layout, movements: Mapping[int, Sequence[Movement]]
) -> dict[int, list[str]]:
    """Write which lane leads into which.

    Args:
        layout: what to build.
        movements: of each junction.

    Returns:
        Lines of XML, by junction.
    """
    links = {junction: _with_entries(layout, _links(layout, found)) for junction, found in movements.items()}
    onward: dict[Arm, dict[Arm, set[int]]] = defaultdict(lambda: defaultdict(set))
    for link in (link for found in links.values() for link in found):
        onward[link.source][link.movement.target].add(link.lane)
    over_tracks = find_turns_over_tracks(layout, itertools.chain.from_iterable(movements.values()))
    return {
        junction: _lines(layout, [*found, *_into_lanes_ahead(layout, found, onward)], over_tracks)
        for junction, found in links.items()
    }


def _links(layout: Layout, movements: Sequence[Movement]) -> list[_Link]:
    by_source: dict[Arm, list[Movement]] = defaultdict(list)
    for movement in movements:
        by_source[movement.source].append(movement)
    links = []
    for source, found in by_source.items():
        lanes = layout.arriving(source)
        targets = [layout.leaving(movement.target) for movement in found]
        pairs = connect_lanes(lanes, targets, [m.angle for m in found], left_hand=layout.graph.left_hand)
        links += [_Link(source, lane, found[number], onto) for lane, number, onto in pairs]
    return links


def _with_entries(layout: Layout, links: list[_Link]) -> list[_Link]:
    """Lead traffic into lanes that nothing leads to, from the straightest movement beside them."""
    onto_road: dict[Arm, list[_Link]] = defaultdict(list)
    for link in links:
        onto_road[link.movement.target].append(link)
    added = []
    for target, found in onto_road.items():
        lanes = layout.leaving(target)
        entered = {link.onto for link in found}
        for number, lane in enumerate(lanes):
            able = [link for link in found if not (lane.bicycle and _source_lane(layout, link).bus)]
            if number not in entered and able and lane.use is not LaneUse.PARKING:
                best = min(
                    able, key=lambda e: (abs(e.onto - number), abs(e.movement.angle), e.source, e.lane)
                )
                added.append(best._replace(onto=number))
    return [*links, *added]


def _into_lanes_ahead(
    layout: Layout, links: Sequence[_Link], onward: Mapping[Arm, Mapping[Arm, set[int]]]
) -> list[_Link]:
    """Lead traffic into the lanes that it needs behind a road on which there is no room to change lanes.

    Args:
        layout: what to build.
        links: of one junction.
        onward: of each arm, the lanes that lead to each road behind its junction.

    Returns:
        More links, of movements that have one.
    """
    by_roads: dict[tuple[Arm, Arm], list[_Link]] = defaultdict(list)
    for link in links:
        if _source_lane(layout, link).motor:
            by_roads[link.source, link.movement.target].append(link)
    added = []
    for (_, target), found in by_roads.items():
        if layout.left_of(layout.graph.sections[target.section]) >= layout.rules.movements.to_change_lanes:
            continue
        reached = {link.onto for link in found}
        drives = {k for k, lane in enumerate(layout.leaving(target)) if lane.use is LaneUse.DRIVING}
        for lanes in onward.get(target._replace(at_end=not target.at_end), {}).values():
            if lanes & drives and not lanes & reached:
                pairs = itertools.product(found, sorted(lanes & drives))
                link, lane = min(pairs, key=lambda pair: (abs(pair[0].onto - pair[1]), pair[0].lane))
                added.append(link._replace(onto=lane))
                reached.add(lane)
    return added


def _lines(layout: Layout, links: Sequence[_Link], over_tracks: Set[Movement]) -> list[str]:
    lines = []
    abreast = Counter((link.source, link.movement.target) for link in links)
    entries = Counter((link.source, link.movement.target, link.onto) for link in links)
    for link in links:
        source, lane, movement, onto = link
        origin, goal = source.incoming, movement.target.outgoing
        shifts = [bool(layout.walk(edge)) for edge in (origin, goal)]
        more = _NO_LANE_CHANGE if abreast[source, movement.target] > 1 else ""
        merges = entries[source, movement.target, onto] > 1
        if merges or movement in over_tracks or _cuts_cycle_lane(layout, link):
            # Lanes that become one have no room to wait beside each other; and who waits inside a junction
            # is told of no cyclist who still rides up to it.
            more += NO_WAIT_INSIDE
        lines.append(
            f'<connection from="{origin}" to="{goal}" fromLane="{lane + shifts[0]}" '
            f'toLane="{onto + shifts[1]}"{more}/>'
        )
    return lines


def _cuts_cycle_lane(layout: Layout, link: _Link) -> bool:
    """Tell whether a turn leads over a cycle lane beside it, which who waits behind it for people blocks."""
    source, number, movement, _ = link
    lanes = layout.arriving(source)
    aside = lanes[:number] if movement.angle < -STRAIGHT else lanes[number + 1 :]
    return abs(movement.angle) > STRAIGHT and lanes[number].motor and any(lane.bicycle for lane in aside)


def _source_lane(layout: Layout, link: _Link) -> LaneTags:
    return layout.arriving(link.source)[link.lane]
