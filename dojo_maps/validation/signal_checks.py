"""Checks of what signals show: states that fit the links, greens that never come or that collide."""

from collections import defaultdict
from collections.abc import Iterator

import shapely

from dojo_maps.description import CARRIAGEWAY, Connection, Lane
from dojo_maps.signals.programs import GREEN, following
from dojo_maps.validation.check import ERROR, NOTE, WARNING, Finding, check, element
from dojo_maps.validation.facts import Facts
from dojo_maps.validation.profiles import Limits
from dojo_maps.validation.programs import Conflict, SignalFacts, name_ways, programs_of, signals_of
from dojo_maps.wording import counted

GOES = "GgsoO"
"""Letters with which a vehicle may go, now or after a stop: green, stop first, signals off."""


@check(
    id="signals.state_length",
    code="SIG001",
    title="States have a letter for each link",
    severity=ERROR,
    limit="highest link index + 1, in every phase",
    source="SUMO tls_check.py; sumo: Mismatching phase size",
    hint="write states with a letter per link, or let netconvert --tls.rebuild make them",
)
def check_state_length(facts: Facts, _limits: Limits) -> Iterator[Finding]:
    """Find programs whose states have too few letters for the signal's links, or not all as many.

    Args:
        facts: of the map.
        _limits: there is none to this check.

    Yields:
        A finding for each such program, with the letters of its shortest state.
    """
    for signal in signals_of(facts):
        needed = max((link.index for link in signal.signal.links), default=-1) + 1
        for program in signal.signal.programs:
            sizes = {len(phase.state) for phase in program.phases}
            if sizes and (min(sizes) < needed or len(sizes) > 1):
                yield Finding(
                    elements=element("signal", signal.signal.id),
                    at=signal.middle,
                    message=f"{signal.named(program)} has states of {_list(sorted(sizes))} letters for "
                    f"{counted(needed, 'link')}",
                    measured=float(min(sizes)),
                    limit=float(needed),
                )


@check(
    id="signals.unused_index",
    code="SIG002",
    title="Letters of a state control a link",
    severity=NOTE,
    limit="none without a link",
    source="sumo: Unused state in tlLogic",
    hint="remove the letters with netconvert --tls.ungroup-signals, or add the missing connection",
)
def check_unused_index(facts: Facts, _limits: Limits) -> Iterator[Finding]:
    """Find letters of a state that control nothing.

    Args:
        facts: of the map; signals without a link do not count.
        _limits: there is none to this check.

    Yields:
        A finding for each such program, with the number of those letters.
    """
    for signal in signals_of(facts):
        used = {link.index for link in signal.signal.links}
        for program in signal.signal.programs:
            size = max((len(phase.state) for phase in program.phases), default=0)
            unused = [index for index in range(size) if index not in used]
            if unused and used:
                yield Finding(
                    elements=element("signal", signal.signal.id),
                    at=signal.middle,
                    message=f"in {signal.named(program)} the letters {_list(unused)} control no link",
                    measured=float(len(unused)),
                    limit=0.0,
                )


@check(
    id="signals.never_green",
    code="SIG003",
    title="Links get green",
    severity=ERROR,
    limit="one phase; warning where another program has it",
    source="sumo: Missing green phase",
    hint="add a phase in which the link has G or g",
)
def check_never_green(facts: Facts, _limits: Limits) -> Iterator[Finding]:
    """Find links that no phase of a program lets go; a warning where another program of the signal does.

    Args:
        facts: of the map.
        _limits: there is none to this check.

    Yields:
        A finding for each such link, over all programs in which it has to stand.
    """
    for signal in signals_of(facts):
        for index in (*signal.vehicle, *signal.walking):
            dark = [
                program.id
                for program in signal.signal.programs
                for letters in (signal.letters(program, index),)
                if letters and "?" not in letters and not set(letters) & set(GOES)
            ]
            if dark:
                yield Finding(
                    elements=signal.elements(index),
                    at=signal.place(index),
                    message=f"link {index} of the signal {signal.signal.id} never gets green in "
                    f"{_programs(dark)}",
                    severity=WARNING if len(dark) < len(signal.signal.programs) else ERROR,
                )


def _programs(names: list[str]) -> str:
    return f"program {names[0]}" if len(names) == 1 else f"{len(names)} programs, {names[0]} among them"


@check(
    id="signals.always_green",
    code="SIG004",
    title="Links that cross others stop at some time",
    severity=WARNING,
    limit="one phase",
    source="MUTCD 4D",
    hint="show red while the crossing link has green, or g if it has to yield",
)
def check_always_green(facts: Facts, _limits: Limits) -> Iterator[Finding]:
    """Find protected links that never stop while links that they cross get a green, too.

    Args:
        facts: of the map.
        _limits: there is none to this check.

    Yields:
        A finding for each program and link, with all links that it crosses.
    """
    for signal, program in programs_of(facts):
        foes: dict[int, set[int]] = defaultdict(set)
        for conflict in signal.conflicts:
            one, other = conflict.indices
            foes[one].add(other)
            foes[other].add(one)
        for index in signal.vehicle:
            if set(signal.letters(program, index)) != {"G"}:
                continue
            crossed = sorted(
                foe for foe in foes[index] if foe != index and set(signal.letters(program, foe)) & GREEN
            )
            if crossed:
                yield Finding(
                    elements=signal.elements(index, *crossed),
                    at=signal.place(index),
                    message=f"link {index} never stops in {signal.named(program)}, though link "
                    f"{crossed[0]} crosses it",
                )


@check(
    id="signals.green_conflict",
    code="SIG005",
    title="No two protected greens collide",
    severity=ERROR,
    limit="none of the network's foes; a warning where their ways stay 2.5 m apart",
    source="sumo: Unsafe green phase; mutual conflict",
    hint="give one of the two g, so that it yields, or a phase of its own",
)
def check_green_conflict(facts: Facts, limits: Limits) -> Iterator[Finding]:
    """Find pairs of letters that show protected green at once though ways they control cross or join.

    Args:
        facts: of the map.
        limits: `car_width`, metres; where the ways stay as far apart it is a warning.

    Yields:
        A finding for each program and pair of letters, with how near their ways come to each other, metres.
    """
    for signal in signals_of(facts):
        pairs: dict[tuple[int, int], list[Conflict]] = defaultdict(list)
        for conflict in signal.conflicts:
            one, other = sorted(conflict.indices)
            pairs[one, other].append(conflict)
        for program in signal.programs:
            for (one, other), conflicts in pairs.items():
                shown = zip(signal.letters(program, one), signal.letters(program, other), strict=True)
                both = [k for k, letters in enumerate(shown) if letters == ("G", "G")]
                if both:
                    ways = dict.fromkeys(way for c in conflicts for way in (c.one, c.other))
                    apart = min(_distance(c) for c in conflicts)
                    meet = apart < limits.car_width
                    yield Finding(
                        elements=(*element("signal", signal.signal.id), *name_ways(ways)),
                        at=conflicts[0].one.shape[0],
                        message=f"phase {both[0]} of {signal.named(program)} gives G to the links {one} and "
                        f"{other}, "
                        + ("whose ways cross or join" if meet else "foes whose ways do not meet"),
                        measured=apart,
                        limit=limits.car_width,
                        severity=ERROR if meet else WARNING,
                    )


def _distance(conflict: Conflict) -> float:
    """Measure how near two ways come to each other, in metres, from middle to middle."""
    one, other = (shapely.LineString(way.shape[:, :2]) for way in (conflict.one, conflict.other))
    return float(one.distance(other))


@check(
    id="signals.missing_yellow",
    code="SIG006",
    title="Yellow comes between green and red",
    severity=WARNING,
    limit="one phase",
    source="sumo: Missing yellow phase",
    hint="put a phase with y for these links after it",
)
def check_missing_yellow(facts: Facts, _limits: Limits) -> Iterator[Finding]:
    """Find phases after which vehicles see red straight after green.

    Args:
        facts: of the map.
        _limits: there is none to this check.

    Yields:
        A finding for each program and phase, with all links that lack yellow after it.
    """
    for signal, program in programs_of(facts):
        for phase in range(len(program.phases)):
            cut = [
                index
                for index in signal.vehicle
                for letters in (signal.letters(program, index),)
                if letters[phase] in GREEN
                and any(letters[after] in "rs" for after in following(program, phase))
            ]
            if cut:
                yield Finding(
                    elements=signal.elements(*cut),
                    at=signal.place(cut[0]),
                    message=f"after phase {phase} of {signal.named(program)} the links {_list(cut)} go "
                    "from green to red without yellow",
                )


def _list(values: list[int]) -> str:
    return ", ".join(map(str, values))


@check(
    id="signals.no_room",
    code="SIG020",
    title="There is room between stop lines for who must wait there",
    severity=WARNING,
    limit="a vehicle, 7.5 m, where no phase lets it over both",
    source="SUMO's gap and length of a car",
    hint="let both links have green together, or join the junctions",
)
def check_no_room(facts: Facts, limits: Limits) -> Iterator[Finding]:
    """Find short lanes that a signal fills in phases in which it lets nobody off them.

    Args:
        facts: of the map.
        limits: `vehicle_length`, metres; lanes as long have room.

    Yields:
        A finding for each program, link and such lane that it leads to, with the lane's length, metres.
    """
    for signal, program in programs_of(facts):
        for index, lanes in _entered(signal).items():
            filled = signal.letters(program, index)
            for lane in lanes:
                leaving = [way.link_index for way in facts.leaving[lane.id] if way.signal == signal.signal.id]
                emptied = [signal.letters(program, other) for other in leaving if other is not None]
                together = any(
                    now in GREEN and then in GREEN
                    for letters in emptied
                    for now, then in zip(filled, letters, strict=True)
                )
                if lane.length < limits.vehicle_length and emptied and not together:
                    yield Finding(
                        elements=(*element("lane", lane.id), *signal.elements(index)),
                        at=lane.shape[-1],
                        message=f"in {signal.named(program)} link {index} never has green together with the "
                        f"next stop line, and the lane {lane.id} between them is {lane.length:.1f} m long",
                        measured=lane.length,
                        limit=limits.vehicle_length,
                    )


def _entered(signal: SignalFacts) -> dict[int, list[Lane]]:
    """List the lanes for cars that each vehicle link of a signal leads to."""
    lanes = signal.facts.lanes
    return {
        index: [
            lanes[way.to_lane]
            for way in signal.links[index]
            if isinstance(way, Connection) and lanes[way.to_lane].kind in CARRIAGEWAY
        ]
        for index in signal.vehicle
    }
