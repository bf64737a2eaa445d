"""Repair of lanes that lead nowhere: a connection beside those of the lanes next to them."""

import re
from collections.abc import Iterator, Sequence

from dojo_maps.description import Connection, Lane
from dojo_maps.issue import Element, Issue
from dojo_maps.repair.draft import Draft
from dojo_maps.repair.edits import Change, Connect, Edit, Key, Site, named
from dojo_maps.signals.nema import NEMA
from dojo_maps.validation.facts import Facts

_OUTWARDS = {"l": 0, "L": 1, "s": 2, "R": 3, "r": 4}
"""Turns from one side to the other; those that lead back are none of them."""

_VERSION = re.compile(r"(\d{1,4})\.(\d{1,4})")
_MERGES = (0, 25)
"""The first version of networks in which lanes of one road may merge. Source: sumo's loader warns before."""


def lead_on(site: Site, issues: Sequence[Issue]) -> Iterator[Edit]:
    """Let a lane lead where one beside it does: into a lane that nobody enters, or to merge with it.

    Args:
        site: the network as it is.
        issues: with the lanes that lead nowhere.

    Yields:
        An edit for each lane that has one beside it to follow; at each signal for one lane only, since
        letters are added one at a time.
    """
    facts, told = site.facts, set[str]()
    version = _VERSION.match(facts.map.source.sumo_version)
    can_merge = version is not None and tuple(map(int, version.groups())) >= _MERGES
    for id_ in named(issues, "lane"):
        lane = facts.lanes[id_]
        found = [
            (_rank(facts, lane, way, target), way, target)
            for way in _ways_beside(facts, lane)
            for target in facts.lanes_of(facts.lanes[way.to_lane].road)
            if way.via and set(target.allow) & set(lane.allow) and _keeps_order(facts, lane, target)
            if can_merge or not _merges(facts, lane, target)
        ]
        if not found or facts.roads[lane.road].to_junction not in facts.junctions:
            continue
        _, way, target = min(found, key=lambda row: row[0])
        if way.signal is not None and way.signal in told:
            continue  # Letters are added one at a time; the next round goes on.
        merges = _merges(facts, lane, target)
        drafts = (
            [] if way.signal is None else _add_letter(site, way, yields=bool(facts.entering.get(target.id)))
        )
        told.add(way.signal or "")
        change = Connect(
            key=_key(lane, target),
            junction=facts.roads[lane.road].to_junction,
            like=_key(facts.lanes[way.from_lane], facts.lanes[way.to_lane]),
            letter=len(drafts[0].phases[0]["state"]) - 1 if drafts else None,
        )
        what = f"leads on to {target.id}{' and merges there' if merges else ''}"
        changes: list[Change] = [draft.change for draft in drafts if draft.change is not None]
        if way.signal is None or drafts:
            yield Edit(element=Element(kind="lane", id=id_), what=what, changes=(*changes, change))


def _add_letter(site: Site, way: Connection, *, yields: bool) -> list[Draft]:
    """Show a new link what the one beside it is shown, g where it yields; none where that cannot be."""
    drafts = [Draft(record, site.path) for record in site.text.logics(way.signal or "")]
    sizes = {len(phase.get("state", "")) for draft in drafts for phase in draft.phases}
    if len(sizes) != 1 or any(draft.record.attributes.get("type") == NEMA for draft in drafts):
        return []
    if way.link_index is None or way.link_index >= min(sizes):
        return []
    for draft in drafts:
        for phase in draft.phases:
            letter = phase["state"][way.link_index]
            phase["state"] += letter.replace("G", "g") if yields else letter
    return drafts


def _ways_beside(facts: Facts, lane: Lane) -> Iterator[Connection]:
    """List the way of the next lane on each side that is nearest, so that nothing that turns is crossed."""
    lanes = sorted(facts.lanes_of(lane.road), key=lambda other: abs(other.index - lane.index))
    for inner in (False, True):
        beside = [other for other in lanes if other != lane and (other.index > lane.index) == inner]
        ways = [
            [way for way in facts.leaving.get(other.id, ()) if way.direction in _OUTWARDS] for other in beside
        ]
        nearest = next(filter(None, ways), [])
        if nearest:
            outermost = inner != facts.map.left_hand
            choose = max if outermost else min
            yield choose(nearest, key=lambda way: _OUTWARDS[way.direction])


def _rank(facts: Facts, lane: Lane, way: Connection, target: Lane) -> tuple[int, ...]:
    """Sort what is best first: lanes that the road, or any other, does not enter yet, straight on, near."""
    beside, its_target = facts.lanes[way.from_lane], facts.lanes[way.to_lane]
    return (
        _merges(facts, lane, target),
        bool(facts.entering.get(target.id)),
        way.direction != "s",
        abs(beside.index - lane.index),
        abs(target.index - its_target.index),
        target.index,
    )


def _merges(facts: Facts, lane: Lane, target: Lane) -> bool:
    """Tell whether another lane of a road leads into a lane already."""
    entering = facts.entering.get(target.id, ())
    return any(facts.lanes[each.from_lane].road == lane.road for each in entering)


def _keeps_order(facts: Facts, lane: Lane, target: Lane) -> bool:
    """Tell whether the lanes of both roads would stay in order, so that no way crosses another."""
    ways = [way for other in facts.lanes_of(lane.road) for way in facts.leaving.get(other.id, ())]
    pairs = [(facts.lanes[way.from_lane], facts.lanes[way.to_lane]) for way in ways]
    return all(
        (one.index - lane.index) * (other.index - target.index) >= 0
        for one, other in pairs
        if other.road == target.road
    )


def _key(lane: Lane, target: Lane) -> Key:
    return ("connection", lane.road, str(lane.index), target.road, str(target.index))
