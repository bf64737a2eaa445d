"""Join signals of one intersection: one controller that shows, at every second, what the two showed."""

import math
from collections.abc import Iterator, Sequence

from dojo_maps.issue import Element, Issue
from dojo_maps.repair.draft import in_seconds
from dojo_maps.repair.edits import Change, Edit, Remove, SetAttributes, SetPhases, Site
from dojo_maps.repair.net_text import key_of
from dojo_maps.repair.reference_repairs import link_indices, links_of
from dojo_maps.signals.programs import read_seconds
from dojo_maps.sources.sumo_xml import LogicRecord
from dojo_maps.wording import counted

_TICK = 100
"""Hundredths of a second: the finest that programs are written in."""


def join_signals(site: Site, issues: Sequence[Issue]) -> Iterator[Edit]:
    """Join pairs of signals with one fixed program each and the same cycle; times and states stay.

    Args:
        site: the network as it is.
        issues: each with two signals near each other.

    Yields:
        An edit for each pair that a road for cars links: the first signal gets the program of both, the
        second goes, and its links move to the first. A signal is in one pair at most.
    """
    taken: set[str] = set()
    for issue in issues:
        ids = [e.id for e in issue.elements if e.kind == "signal"]
        if len(ids) != 2 or taken & set(ids):
            continue
        logics = [_fixed(site, id_) for id_ in ids] if _joined_by_road(site, *ids) else [None, None]
        if logics[0] is None or logics[1] is None:
            continue
        phases = _overlay(logics[0], logics[1])
        if phases is not None:
            taken |= set(ids)
            what = f"one program of {counted(len(phases), 'phase')} with {ids[1]}"
            changes = tuple(_changes(site, logics[0], logics[1], phases))
            yield Edit(element=Element(kind="signal", id=ids[0]), what=what, changes=changes)


def _joined_by_road(site: Site, one: str, other: str) -> bool:
    """Tell whether cars drive straight from a junction of one signal to one of the other."""
    owner = {j: signal.id for signal in site.facts.signals for j in signal.junctions}
    pair = {one, other}
    return any(
        {owner.get(road.from_junction), owner.get(road.to_junction)} == pair
        and "passenger" in site.facts.classes(road.id)
        for road in site.facts.roads.values()
    )


def _fixed(site: Site, signal: str) -> LogicRecord | None:
    """Find a signal's only program, if it is fixed and simple."""
    logics = site.text.logics(signal)
    if len(logics) != 1 or logics[0].attributes.get("type", "static") != "static":
        return None
    plain = all(set(phase) <= {"duration", "state", "name", "minDur", "maxDur"} for phase in logics[0].phases)
    params = "<param" in site.text.copies(key_of("tlLogic", logics[0].attributes))[0]
    return logics[0] if plain and logics[0].phases and not params else None


def _overlay(one: LogicRecord, other: LogicRecord) -> list[tuple[int, str]] | None:
    """Write both programs' letters side by side, over the first one's cycle; None if the cycles differ."""
    rows = [_ticks(one), _ticks(other)]
    cycle = sum(lasts for lasts, _ in rows[0])
    if cycle != sum(lasts for lasts, _ in rows[1]) or not cycle:
        return None
    offsets = [_offset(logic) for logic in (one, other)]
    shift = (offsets[1] - offsets[0]) % cycle
    starts = [_starts(rows[0], 0, cycle), _starts(rows[1], shift, cycle)]
    times = sorted({time for found in starts for time in found} | {0})
    states = [
        "".join(found[max((t for t in found if t <= time), default=max(found))] for found in starts)
        for time in times
    ]
    ends = [*times[1:], cycle]
    return [(end - time, state) for time, end, state in zip(times, ends, states, strict=True)]


def _ticks(logic: LogicRecord) -> list[tuple[int, str]]:
    return [(round(read_seconds(p.get("duration", "0")) * _TICK), p.get("state", "")) for p in logic.phases]


def _offset(logic: LogicRecord) -> int:
    try:
        offset = read_seconds(logic.attributes.get("offset", "0"))
    except ValueError:
        return 0
    return round(offset * _TICK) if math.isfinite(offset) else 0


def _starts(rows: Sequence[tuple[int, str]], shift: int, cycle: int) -> dict[int, str]:
    """Tell at which time of the cycle each state begins."""
    found, time = {}, shift
    for lasts, state in rows:
        if lasts:
            found[time % cycle] = state
        time += lasts
    return found


def _changes(
    site: Site, one: LogicRecord, other: LogicRecord, phases: Sequence[tuple[int, str]]
) -> Iterator[Change]:
    written = tuple((("duration", in_seconds(t / _TICK)), ("state", state)) for t, state in phases)
    yield SetPhases(key=key_of("tlLogic", one.attributes), phases=written)
    yield Remove(key=key_of("tlLogic", other.attributes))
    size = len(one.phases[0].get("state", ""))
    for record in links_of(site, other.attributes["id"]):
        moved = ((name, str(index + size)) for name, index in link_indices(record).items())
        values = (("tl", one.attributes["id"]), *moved)
        yield SetAttributes(key=key_of("connection", record), values=values)
