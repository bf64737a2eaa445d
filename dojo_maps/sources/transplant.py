"""Write signal programs into a network that got crossings: old letters as they were, new ones appended.

`enrich_net` gives the trees and proves afterwards that nothing changed for vehicles; the rules for
pedestrians' letters and times are in `pedestrian_timing`, the links in `pedestrian_links`.
"""

import copy
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from decimal import Decimal, InvalidOperation
from xml.etree.ElementTree import Element

from dojo_maps.errors import SourceError
from dojo_maps.sources.net_tree import NetTree, name
from dojo_maps.sources.pedestrian_timing import (
    LEAST_GREEN,
    Green,
    TimedPhase,
    Walk,
    compute_greens,
    share_cuts,
)

_VARIABLE_KINDS = ("actuated", "delay_based")
"""Their phases last from minDur to maxDur, so only minDur is certain to be there for walking."""
_DETECTOR_GAP, _PASSING_TIME, _CAR_SPACE = 2.0, 1.9, 7.5
"""SUMO's defaults: seconds from detector to stop line, seconds per car that leaves, metres per car."""
_TIMED_KINDS = ("static", *_VARIABLE_KINDS)
_COORDINATED = ("earliestEnd", "latestEnd", "earlyTarget", "finalTarget")
_LANE_TIMES = ("detector-gap:", "passing-time:")
_ZERO = Decimal(0)


@dataclass(frozen=True, slots=True, kw_only=True)
class CrossingTimes:
    """What a program shows a crossing per cycle: certain seconds of green, those of them as `g`; why none."""

    green: Decimal
    yielding: Decimal
    reason: str | None


@dataclass(frozen=True, slots=True, kw_only=True)
class ProgramChange:
    """What was done to one program: its phases before and after, times by crossing, parameters renamed."""

    signal: str
    program: str
    kind: str
    phases: tuple[int, int]
    crossings: Mapping[str, CrossingTimes]
    renamed: Mapping[str, str]


def transplant_programs(
    old: NetTree, new: NetTree, walks: Mapping[str, Sequence[Walk]], lane_ids: Mapping[str, str]
) -> list[ProgramChange]:
    """Put the old network's programs in the place of netconvert's, with letters for new crossings.

    Args:
        old: the network before.
        new: the network with crossings, changed in place.
        walks: the new crossings of each signal.
        lane_ids: new lane id by old one, for parameters that name a lane.

    Returns:
        What was done to each program, in the order of the old network's.

    Raises:
        SourceError: a phase has a time that is missing or none, or names a next one that is not there.
    """
    place = next((at for at, child in enumerate(new.root) if child.tag in ("tlLogic", "junction")), 0)
    known = {logic.get("id") for logic in old.logics()}
    for logic in [logic for logic in new.logics() if logic.get("id") in known]:
        new.root.remove(logic)
    changes = []
    for number, logic in enumerate(old.logics()):
        extended = copy.deepcopy(logic)
        changes.append(_extend_program(old, extended, walks.get(logic.get("id", ""), ()), lane_ids))
        new.root.insert(place + number, extended)
    return changes


def _extend_program(
    old: NetTree, logic: Element, walks: Sequence[Walk], lane_ids: Mapping[str, str]
) -> ProgramChange:
    phases = logic.findall("phase")
    kind = logic.get("type", "static")
    variable = kind in _VARIABLE_KINDS
    spare = _detector_time(old, logic) if variable else None
    timed = [_timed(old, logic, number, phases, spare) for number in range(len(phases))]
    reason = _untimed_reason(logic, phases, kind)
    if reason:
        greens = [[Green(letter="r", seconds=_ZERO)] * len(phases) for _ in walks]
    else:
        greens = [compute_greens(timed, walk) for walk in walks]
    shown = [
        share_cuts([green[number] for green in greens], timed[number].least) for number in range(len(phases))
    ]
    pieces = [
        _split(phase, letters, timed[number].least, variable=variable)
        for number, (phase, letters) in enumerate(zip(phases, shown, strict=True))
    ]
    _replace_phases(logic, phases, pieces)
    return ProgramChange(
        signal=logic.get("id", ""),
        program=logic.get("programID", "0"),
        kind=kind,
        phases=(len(phases), sum(map(len, pieces))),
        crossings={
            walk.crossing: _times(walk, [row[number] for row in shown], reason)
            for number, walk in enumerate(walks)
        },
        renamed=_rename_parameters(logic, lane_ids),
    )


def _timed(
    old: NetTree, logic: Element, number: int, phases: Sequence[Element], spare: Decimal | None
) -> TimedPhase:
    """Describe a phase; `spare` is the minDur that must be left after a cut where phases vary."""
    phase = phases[number]
    least, last_cut = _seconds(old, logic, phase, "duration"), None
    if spare is not None and "minDur" in phase.attrib:
        least = min(least, _seconds(old, logic, phase, "minDur"))
        last_cut = least - spare
    following = _following(phase)
    if any(not 0 <= after < len(phases) for after in following):
        raise SourceError(
            old.path, f"next={phase.get('next')!r} names no phase", element=f"tlLogic {name(logic)}"
        )
    return TimedPhase(
        state=phase.get("state", ""),
        least=least,
        following=following or ((number + 1) % len(phases),),
        last_cut=last_cut,
    )


def _detector_time(old: NetTree, logic: Element) -> Decimal:
    """Find the minDur from which on an actuated program's detectors no longer depend on it, in seconds.

    SUMO puts a detector as far from the stop line as cars go in `detector-gap`, but no farther than the
    queue that leaves within the least minDur of its lane's phases: a shorter rest of a phase would move it.
    Source: MSActuatedTrafficLightLogic::init. Infinite where lanes have times of their own.
    """
    parameters = {
        parameter.get("key", ""): parameter.get("value", "") for parameter in logic.iterfind("param")
    }
    if logic.get("type") != "actuated" or any(key.startswith(_LANE_TIMES) for key in parameters):
        return Decimal("Infinity")
    lanes = {key[:2] for key, link in old.vehicle_links.items() if link.get("tl") == logic.get("id")}
    try:
        gap = float(parameters.get("detector-gap", _DETECTOR_GAP))
        passing = float(parameters.get("passing-time", _PASSING_TIME))
        fastest = max((float(old.lanes(road)[lane].get("speed", "0")) for road, lane in lanes), default=0.0)
        return Decimal(max(1, math.ceil((gap * fastest / _CAR_SPACE - 0.5) * passing)))
    except (ValueError, OverflowError, LookupError):
        return Decimal("Infinity")


def _following(phase: Element) -> tuple[int, ...]:
    try:
        return tuple(int(after) for after in phase.get("next", "").split())
    except ValueError:
        return (-1,)


def _seconds(old: NetTree, logic: Element, phase: Element, key: str) -> Decimal:
    text = phase.get(key, "")
    try:
        value = Decimal(text)
    except InvalidOperation:
        value = Decimal("NaN")
    if not value.is_finite() or not 0 <= value < 1_000_000:
        what = f"tlLogic {name(logic)}"
        raise SourceError(old.path, f"{key}={text[:80]!r}, expected seconds", element=what)
    return value


def _untimed_reason(logic: Element, phases: Sequence[Element], kind: str) -> str | None:
    """Say why a program's times cannot be known beforehand, if so; its crossings then stay red."""
    if kind not in _TIMED_KINDS:
        return f"programs of type {kind} choose their own times"
    if any(child.tag not in ("phase", "param") for child in logic):
        return "the program is switched by conditions"
    if any(key in phase.attrib for phase in phases for key in _COORDINATED):
        return "the program is coordinated by times in its phases"
    return None


def _times(walk: Walk, greens: Sequence[Green], reason: str | None) -> CrossingTimes:
    green = sum((shown.seconds for shown in greens), _ZERO)
    if not green and not reason:
        if any(shown.letter in "Gg" for shown in greens):
            reason = f"no phase leaves {LEAST_GREEN} s to start and {walk.clearance} s to walk across"
        else:
            reason = "conflicting traffic moves in every phase"
    return CrossingTimes(
        green=green,
        yielding=sum((shown.seconds for shown in greens if shown.letter == "g"), _ZERO),
        reason=None if green else reason,
    )


def _split(phase: Element, greens: Sequence[Green], least: Decimal, *, variable: bool) -> list[Element]:
    """Append pedestrian letters to a phase, cut where a crossing's green ends before it."""
    cuts = sorted({green.seconds for green in greens if 0 < green.seconds < least})
    starts = [_ZERO, *cuts]
    pieces = []
    for start in starts:
        piece = copy.deepcopy(phase)
        letters = (
            green.letter if green.letter == "o" or (green.letter in "Gg" and start < green.seconds) else "r"
            for green in greens
        )
        piece.set("state", phase.get("state", "") + "".join(letters))
        if start != starts[-1]:
            piece.attrib.pop("next", None)
        pieces.append(piece)
    if cuts:
        lengths = [end - start for start, end in zip(starts, cuts, strict=False)]
        (_share_variable if variable else _share_fixed)(pieces, lengths)
    return pieces


def _share_fixed(pieces: Sequence[Element], lengths: Sequence[Decimal]) -> None:
    """Divide a phase's duration; what minDur and maxDur leave open goes to the first piece.

    SUMO does not read these two in such a program, but a user may switch it: the time to clear stays whole.
    """
    total = Decimal(pieces[0].attrib["duration"])
    every = [*lengths, total - sum(lengths)]
    for piece, length in zip(pieces, every, strict=True):
        _set(piece, "duration", length)
    for piece, length in zip(pieces[1:], every[1:], strict=True):
        for key in ("minDur", "maxDur"):
            if key in piece.attrib:
                _set(piece, key, length)
    rest = total - every[0]
    lowest = min(LEAST_GREEN, every[0])
    for key in ("minDur", "maxDur"):
        if key in pieces[0].attrib:
            _set(pieces[0], key, max(Decimal(pieces[0].attrib[key]) - rest, lowest))


def _share_variable(pieces: Sequence[Element], lengths: Sequence[Decimal]) -> None:
    """Fix the pieces with a green crossing; the last keeps the choice of when to end.

    The cut lies before minDur, when no such program may end the phase yet, and leaves the detectors where
    they were: it decides as it did.
    """
    for piece, length in zip(pieces, lengths, strict=False):
        for key in ("duration", "minDur", "maxDur"):
            _set(piece, key, length)
    used, last = sum(lengths, _ZERO), pieces[-1]
    for key in ("duration", "minDur", "maxDur"):
        if key in last.attrib:
            _set(last, key, Decimal(last.attrib[key]) - used)


def _set(piece: Element, key: str, value: Decimal) -> None:
    piece.set(key, format(value.normalize(), "f"))


def _replace_phases(logic: Element, phases: Sequence[Element], pieces: Sequence[Sequence[Element]]) -> None:
    """Put each phase's pieces in its place, and let `next` name the first piece of its phases."""
    firsts = [sum(map(len, pieces[:number])) for number in range(len(pieces))]
    for phase, parts in zip(phases, pieces, strict=True):
        place = list(logic).index(phase)
        logic.remove(phase)
        for offset, part in enumerate(parts):
            if "next" in part.attrib:
                part.set("next", " ".join(str(firsts[after]) for after in _following(part)))
            logic.insert(place + offset, part)


def _rename_parameters(logic: Element, lane_ids: Mapping[str, str]) -> dict[str, str]:
    """Correct parameters that name a lane, alone or after a colon, such as `max-gap:LANE`."""
    renamed = {}
    for parameter in logic.iterfind("param"):
        key = parameter.get("key", "")
        before, colon, lane = key.rpartition(":")
        for prefix, old_lane in (("", key), (before + colon, lane)):
            moved = lane_ids.get(old_lane, old_lane)
            if moved != old_lane:
                renamed[key] = prefix + moved
                parameter.set("key", renamed[key])
                break
    return renamed
