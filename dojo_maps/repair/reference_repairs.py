"""Repairs of what refers to what: connections to nothing, copies, letters without a link, rules."""

from collections.abc import Iterator, Sequence

from dojo_maps.issue import Element, Issue
from dojo_maps.repair.draft import Draft
from dojo_maps.repair.edits import Change, Edit, Key, Rebuild, Remove, SetAttributes, Site, named
from dojo_maps.repair.net_text import key_of
from dojo_maps.sources.sumo_xml import Attributes


def mend_references(site: Site, issues: Sequence[Issue]) -> Iterator[Edit]:
    """Let a connection name where its drawn way leads, or take it out; draw a way that is missing anew."""
    records = {name: record for record in site.text.records.connections for name in _names(record)}
    onward = {
        f"{r.get('from')}_{r.get('fromLane')}": r
        for r in site.text.records.connections
        if r.get("from", ":")[0] == ":"
    }
    for id_ in named(issues, "connection"):
        record = records.get(id_)
        if record is None:
            continue
        element, key = Element(kind="connection", id=id_), key_of("connection", record)
        if id_ in site.facts.connections:
            yield Edit(element=element, what="its way drawn anew by netconvert", changes=(Rebuild(),))
            continue
        target = _lane_after(site, record.get("via", ""), onward)
        if target is not None and f"{record.get('to')}_{record.get('toLane')}" not in site.facts.lanes:
            lane = site.facts.lanes[target]
            values = (("to", lane.road), ("toLane", str(lane.index)))
            yield Edit(
                element=element,
                what=f"leads to {target}, as its way does",
                changes=(SetAttributes(key=key, values=values),),
            )
        else:
            yield Edit(element=element, what="removed", changes=(Remove(key=key),))


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
    """Take out elements that are there twice, word for word."""
    seen: set[Key] = set()
    for issue in issues:
        fault = issue.elements[0]
        for key in _keys(site, fault):
            copies = site.text.copies(key)
            again = [k for k in range(1, len(copies)) if copies[k] == copies[0]]
            if again and key not in seen:
                seen.add(key)
                changes = tuple(Remove(key=key, copy=k) for k in again)
                yield Edit(element=fault, what=f"{len(again)} copies removed", changes=changes)


def _keys(site: Site, fault: Element) -> Iterator[Key]:
    if fault.kind in ("road", "crossing", "walking_area"):
        yield ("edge", fault.id)
    elif fault.kind == "junction":
        yield ("junction", fault.id)
    elif fault.kind == "connection":
        found = (r for r in site.text.records.connections if fault.id in _names(r))
        yield from dict.fromkeys(key_of("connection", record) for record in found)


def drop_unused_letters(site: Site, issues: Sequence[Issue]) -> Iterator[Edit]:
    """Take letters that control nothing out of all states of a signal, and number its links anew."""
    for id_ in named(issues, "signal"):
        used = {int(r["linkIndex"]) for r in _links(site, id_)}
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
                values=(("linkIndex", str(order[int(record["linkIndex"])])),),
            )
            for record in _links(site, id_)
            if order[int(record["linkIndex"])] != int(record["linkIndex"])
        ]
        what = f"{sizes.pop() - len(used)} letters without a link removed, links numbered anew"
        yield Edit(element=Element(kind="signal", id=id_), what=what, changes=tuple(changes))


def _links(site: Site, signal: str) -> list[Attributes]:
    return [
        r
        for r in site.text.records.connections
        if r.get("tl") == signal and r.get("linkIndex", "").isdecimal()
    ]


def _names_links(site: Site, drafts: Sequence[Draft]) -> bool:
    """Tell whether a program's parameters may name links by number, which would then be wrong."""
    keys = (key_of("tlLogic", draft.record.attributes) for draft in drafts)
    return any("<param" in copy for key in keys for copy in site.text.copies(key))


def rebuild_rules(_site: Site, issues: Sequence[Issue]) -> Iterator[Edit]:
    """Let netconvert compute anew who yields to whom."""
    for id_ in named(issues, "junction"):
        yield Edit(
            element=Element(kind="junction", id=id_),
            what="rules computed by netconvert",
            changes=(Rebuild(),),
        )
