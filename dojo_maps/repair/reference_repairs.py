"""Repairs of what refers to what: connections to nothing, copies, letters without a link, rules."""

import math
from collections.abc import Iterator, Sequence

from dojo_maps.issue import Element, Issue
from dojo_maps.repair.draft import Draft
from dojo_maps.repair.edits import Change, Edit, Key, Rebuild, Remove, SetAttributes, Site, named
from dojo_maps.repair.net_text import key_of
from dojo_maps.safe_xml import Attributes
from dojo_maps.wording import counted

_TOUCHES = 2.0
"""Metres between a lane's end and the start of a way that leaves it."""


def mend_references(site: Site, issues: Sequence[Issue]) -> Iterator[Edit]:
    """Let connections name where their drawn ways lead, and roads the junctions that they are drawn at.

    Args:
        site: the network as it is.
        issues: with connections and roads that name what is not there.

    Yields:
        An edit for each connection, which may take it out or let netconvert draw its way; then one for
        each road whose junctions follow from what lists its lanes.
    """
    records = {name: record for record in site.text.records.connections for name in _names(record)}
    for id_ in named(issues, "connection"):
        record = records.get(id_)
        if record is not None:
            lost = id_ not in site.facts.connections
            change, what = _retarget(site, record) if lost else _redraw(site, record)
            element = Element(kind="connection", id=id_)
            signal = (Element(kind="signal", id=record["tl"]),) if "tl" in record else ()
            lane = Element(kind="lane", id=f"{record.get('from')}_{record.get('fromLane')}")
            yield Edit(element=element, what=what, changes=(change,), uncovers=(element, lane, *signal))
    for id_ in named(issues, "road"):
        values = dict(_junctions_of(site, id_))
        if values:
            what = " and ".join(f"{end} {junction}" for end, junction in values.items())
            change = SetAttributes(key=("edge", id_), values=tuple(values.items()))
            element = Element(kind="road", id=id_)
            yield Edit(element=element, what=f"leads {what}", changes=(change,), uncovers=(element,))


def _onward(site: Site) -> dict[str, Attributes]:
    """The connections from internal lanes."""
    return {
        f"{r.get('from')}_{r.get('fromLane')}": r
        for r in site.text.records.connections
        if r.get("from", "").startswith(":")
    }


def _retarget(site: Site, record: Attributes) -> tuple[Change, str]:
    """Let a connection lead where its way does; without such a way there is nothing to keep."""
    key = key_of("connection", record)
    target = _lane_after(site, record.get("via", ""), _onward(site))
    if (
        target not in site.facts.lanes
        or f"{record.get('from')}_{record.get('fromLane')}" not in site.facts.lanes
    ):
        return Remove(key=key), "removed"
    lane = site.facts.lanes[target]
    values = (("to", lane.road), ("toLane", str(lane.index)))
    return SetAttributes(key=key, values=values), f"leads to {target}, as its way does"


def _redraw(site: Site, record: Attributes) -> tuple[Change, str]:
    """Name the one drawn way between a connection's lanes that no other names, or have a way drawn."""
    taken = {r.get("via") for r in site.text.records.connections}
    source, target = (f"{record.get(end)}_{record.get(f'{end}Lane')}" for end in ("from", "to"))
    onward = _onward(site)
    free = [
        lane
        for lane in onward
        if lane not in taken and _lane_after(site, lane, onward) == target and _begins_at(site, lane, source)
    ]
    if len(free) != 1:
        return Rebuild(), "its way drawn anew by netconvert"
    change = SetAttributes(key=key_of("connection", record), values=(("via", free[0]),))
    return change, f"its way is {free[0]}"


def _begins_at(site: Site, internal: str, lane: str) -> bool:
    shape = site.text.elements.get(("lane", internal), {}).get("shape", "").split()
    if not shape:
        return False
    x, y = (float(value) for value in shape[0].split(",")[:2])
    end = site.facts.lanes[lane].shape[-1]
    return math.hypot(x - end[0], y - end[1]) < _TOUCHES


def _junctions_of(site: Site, road: str) -> Iterator[tuple[str, str]]:
    """Find the junctions at the ends of a road whose names are wrong, by what lists its lanes."""
    found = site.facts.roads.get(road)
    if found is None:  # It could not be read.
        return
    if found.to_junction not in site.facts.junctions:
        listing = [j.get("id", "") for j in site.text.records.junctions if found.lanes[0] in _incoming(j)]
        if len(listing) == 1:
            yield "to", listing[0]
    if found.from_junction not in site.facts.junctions:
        ways = {r.get("via", "") for r in site.text.records.connections if r.get("to") == road}
        listing = [j.get("id", "") for j in site.text.records.junctions if ways & _inside(j)]
        if len(listing) == 1:
            yield "from", listing[0]


def _incoming(junction: Attributes) -> set[str]:
    return set(junction.get("incLanes", "").split())


def _inside(junction: Attributes) -> set[str]:
    return set(junction.get("intLanes", "").split()) if junction.get("type") != "internal" else set()


def _names(record: Attributes) -> Iterator[str]:
    """Name a connection as reports do: by lanes, or by whole edges where people walk."""
    ends = [
        (record.get(end, ""), f"{record.get(end, '')}_{record.get(f'{end}Lane')}") for end in ("from", "to")
    ]
    for start in ends[0]:
        for target in ends[1]:
            yield f"{start}->{target}"


def _lane_after(site: Site, lane: str, onward: dict[str, Attributes]) -> str | None:
    """Follow a way across a junction to the lane that it leads to."""
    for _ in range(8):
        record = onward.get(lane)
        if record is None:
            return None
        target = f"{record.get('to')}_{record.get('toLane')}"
        if target in site.facts.lanes:
            return target
        lane = record.get("via", target)
    return None


def remove_copies(site: Site, issues: Sequence[Issue]) -> Iterator[Edit]:
    """Take out elements that are there twice, word for word.

    Args:
        site: the network as it is.
        issues: with what is there more than once as their first element.

    Yields:
        An edit for each element with copies of its first text; copies that say something else stay.
    """
    seen: set[Key] = set()
    for issue in issues:
        fault = issue.elements[0]
        for key in _keys(site, fault):
            copies = site.text.copies(key)
            again = [k for k in range(1, len(copies)) if copies[k] == copies[0]]
            if again and key not in seen:
                seen.add(key)
                changes = tuple(Remove(key=key, copy=k) for k in again)
                yield Edit(
                    element=fault, what=f"{counted(len(again), 'copy', 'copies')} removed", changes=changes
                )


def _keys(site: Site, fault: Element) -> Iterator[Key]:
    if fault.kind in ("road", "crossing", "walking_area"):
        yield ("edge", fault.id)
    elif fault.kind == "junction":
        yield ("junction", fault.id)
    elif fault.kind == "connection":
        found = (r for r in site.text.records.connections if fault.id in _names(r))
        yield from dict.fromkeys(key_of("connection", record) for record in found)


def drop_unused_letters(site: Site, issues: Sequence[Issue]) -> Iterator[Edit]:
    """Take letters that control nothing out of all states of a signal, and number its links anew.

    Args:
        site: the network as it is.
        issues: with the signals.

    Yields:
        An edit for each signal; none where its states differ in length or lack a letter that a link has, or
        where parameters of a program may name links by number.
    """
    for id_ in named(issues, "signal"):
        used = {index for record in links_of(site, id_) for index in link_indices(record).values()}
        drafts = [Draft(record, site.path) for record in site.text.logics(id_)]
        sizes = {len(phase.get("state", "")) for draft in drafts for phase in draft.phases}
        if not used or len(sizes) != 1 or max(used) >= min(sizes) or _names_links(site, drafts):
            continue
        order = {old: new for new, old in enumerate(sorted(used))}
        for draft in drafts:
            for phase in draft.phases:
                phase["state"] = "".join(phase["state"][old] for old in order)
        changes: list[Change] = [draft.change for draft in drafts if draft.change is not None]
        changes += [
            SetAttributes(
                key=key_of("connection", record),
                values=tuple((name, str(order[index])) for name, index in link_indices(record).items()),
            )
            for record in links_of(site, id_)
            if any(order[index] != index for index in link_indices(record).values())
        ]
        what = f"{counted(sizes.pop() - len(used), 'letter')} without a link removed, links numbered anew"
        yield Edit(element=Element(kind="signal", id=id_), what=what, changes=tuple(changes))


def links_of(site: Site, signal: str) -> list[Attributes]:
    """List what a signal controls.

    Args:
        site: the network.
        signal: its id.

    Returns:
        The attributes of its connections, those on foot as well, in file order.
    """
    return [r for r in site.text.records.connections if r.get("tl") == signal]


def link_indices(record: Attributes) -> dict[str, int]:
    """Read a link's letters; a turn in two steps has one for each.

    Args:
        record: the attributes of a connection.

    Returns:
        The index by attribute, `linkIndex` and `linkIndex2`, without what is missing or no number.
    """
    values = {name: record.get(name, "") for name in ("linkIndex", "linkIndex2")}
    return {name: int(value) for name, value in values.items() if value.isdecimal() and len(value) < 9}


def _names_links(site: Site, drafts: Sequence[Draft]) -> bool:
    """Tell whether a program's parameters may name links by number, which would then be wrong."""
    keys = (key_of("tlLogic", draft.record.attributes) for draft in drafts)
    return any("<param" in copy for key in keys for copy in site.text.copies(key))
