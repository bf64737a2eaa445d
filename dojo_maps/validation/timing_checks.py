"""Checks of how long signals show what they show: yellow, clearance, walking, cycles."""

from collections import defaultdict
from collections.abc import Iterator
from functools import lru_cache

from dojo_maps.description import Connection, Crossing, Program
from dojo_maps.geometry.polylines import along
from dojo_maps.issue import Element
from dojo_maps.signals.programs import GREEN, YELLOW, following, least, run_from, starts
from dojo_maps.signals.timing import clearing_time, yellow_needed
from dojo_maps.validation.check import ERROR, NOTE, WARNING, Finding, check
from dojo_maps.validation.facts import Facts
from dojo_maps.validation.profiles import Limits
from dojo_maps.validation.programs import Conflict, SignalFacts, programs_of
from dojo_maps.wording import counted

_LONGEST_ALL_RED = 6.0


@check(
    id="signals.yellow_short",
    code="SIG007",
    title="Yellow is long enough to stop",
    severity=ERROR,
    limit="3 s; warning at 0.5 s less than 1 s + v / 6.1 m/s²",
    source="MUTCD, ITE",
    hint="lengthen the yellow phase",
)
def check_yellow_short(facts: Facts, limits: Limits) -> Iterator[Finding]:
    """Find yellows too short for the speed to stop from: Y = 1 s + v / (2 × 3.05 m/s²), 3 to 6 s.

    Args:
        facts: of the map.
        limits: `yellow`, below which it is an error, and `yellow_tolerance`, which may be missing from what
            the speed needs; seconds.

    Yields:
        A finding for each program and phase in which such a yellow begins, with the seconds of the link that
        lacks most.
    """
    for signal, program in programs_of(facts):
        short: dict[int, list[tuple[float, float, int]]] = defaultdict(list)
        for index in signal.vehicle:
            letters = signal.letters(program, index)
            wanted = yellow_for(signal, index, limits.yellow)
            for phase in starts(program, letters, YELLOW):
                shown = run_from(program, letters, phase, YELLOW)
                if shown < limits.yellow or shown < wanted - limits.yellow_tolerance:
                    short[phase].append((shown, wanted, index))
        for phase, found in short.items():
            shown, wanted, index = min(found, key=lambda row: row[0] - row[1])
            yield Finding(
                elements=signal.elements(index, *(row[2] for row in found)),
                at=signal.place(index),
                message=f"the yellow of phase {phase} in {signal.named(program)} lasts {shown:g} s for "
                f"{counted(len(found), 'link')}, {wanted:.1f} s are needed",
                measured=shown,
                limit=wanted,
                severity=ERROR if shown < limits.yellow else WARNING,
            )


def yellow_for(signal: SignalFacts, index: int, shortest: float) -> float:
    """Compute the yellow that a link's speed needs.

    Args:
        signal: the link's.
        index: of the link.
        shortest: seconds that it has at least.

    Returns:
        Seconds, from `shortest` to 6, for the fastest of the link's lanes.
    """
    lanes = [way.from_lane for way in signal.links.get(index, ()) if isinstance(way, Connection)]
    speed = max((signal.facts.lanes[lane].speed for lane in lanes), default=0.0)
    return yellow_needed(speed, shortest)


@check(
    id="signals.all_red",
    code="SIG008",
    title="The junction clears before the next green",
    severity=NOTE,
    limit="(way + 6 m) / v, at most 6 s",
    source="ITE",
    hint="put a phase with r for all after the yellow",
)
def check_all_red(facts: Facts, _limits: Limits) -> Iterator[Finding]:
    """Find programs that start a green before those who left last are across: R = (way + 6 m) / v.

    Args:
        facts: of the map.
        _limits: there is none to this check; 6 s at most are its own.

    Yields:
        A finding for each such program, with the seconds of the two links that lack most.
    """
    for signal, program in programs_of(facts):
        worst: tuple[float, float, Conflict] | None = None
        for conflict in signal.conflicts:
            for one, other in (conflict.indices, conflict.indices[::-1]):
                leaving = conflict.one if one == conflict.indices[0] else conflict.other
                needed = _all_red_for(facts, leaving)
                shown = _time_between(
                    program, signal.letters(program, one), signal.letters(program, other), YELLOW
                )
                if (
                    shown is not None
                    and shown < needed
                    and (worst is None or needed - shown > worst[1] - worst[0])
                ):
                    worst = (shown, needed, conflict)
        if worst is not None:
            shown, needed, conflict = worst
            yield Finding(
                elements=signal.elements(*conflict.indices),
                at=conflict.one.shape[0],
                message=f"in {signal.named(program)} link {conflict.indices[0]} and link "
                f"{conflict.indices[1]} are {shown:g} s of red apart, {needed:.1f} s clear the junction",
                measured=shown,
                limit=needed,
            )


def _all_red_for(facts: Facts, way: Connection | Crossing) -> float:
    if isinstance(way, Crossing):
        return 0.0
    speed = max(facts.lanes[way.from_lane].speed, 1.0)
    return round(min(clearing_time(facts.way_length[way.id], speed), _LONGEST_ALL_RED), 2)


@lru_cache(maxsize=1024)  # many links of a signal show the same letters
def _time_between(program: Program, ending: str, starting: str, last: frozenset[str]) -> float | None:
    """Measure the least time from the end of one link's letters to the other's protected green; seconds.

    Walkers who had a green beside that green all along yielded to it then, and do so still.
    """
    times = [
        time
        for phase in range(len(program.phases))
        if ending[phase] in last and not (last is GREEN and starting[phase] == "G")
        for after in following(program, phase)
        if ending[after] not in last | GREEN
        for time in (_time_until(program, starting, after),)
        if time is not None
    ]
    return min(times, default=None)


def _time_until(program: Program, letters: str, phase: int) -> float | None:
    time, seen = 0.0, set[int]()
    while phase not in seen:
        if letters[phase] == "G":
            return time
        seen.add(phase)
        time += least(program.phases[phase])
        phase = following(program, phase)[0]
    return None


@check(
    id="pedestrians.crossing_clearance",
    code="SIG009",
    title="Walkers are across before vehicles get green",
    severity=ERROR,
    limit="length / 1.2 m/s; a warning within 0.5 s of it",
    source="signal timing manuals, 4 ft/s; netconvert's own clearance is 5 s, however long the crossing",
    hint="end the walkers' green earlier, or lengthen the phase after it",
)
def check_crossing_clearance(facts: Facts, limits: Limits) -> Iterator[Finding]:
    """Find crossings whose red leaves too little time to walk across before the next vehicles' green.

    Args:
        facts: of the map.
        limits: `walking_speed`, m/s, and `clearance_tolerance`, seconds; where more is missing it is an
            error.

    Yields:
        A finding for each program, link and crossing, with the shortest time that it leaves, seconds.
    """
    for signal, program in programs_of(facts):
        foes: dict[str, dict[int, None]] = defaultdict(dict)
        for conflict in signal.conflicts:
            for way, foe in ((conflict.one, 1), (conflict.other, 0)):
                if isinstance(way, Crossing):
                    foes[way.id][conflict.indices[foe]] = None
        for index in signal.walking:
            ending = signal.letters(program, index)
            for crossing in (way for way in signal.links.get(index, ()) if isinstance(way, Crossing)):
                needed = float(along(crossing.shape)[-1]) / limits.walking_speed
                shown = [
                    (time, foe)
                    for foe in foes[crossing.id]
                    for time in (_time_between(program, ending, signal.letters(program, foe), GREEN),)
                    if time is not None
                ]
                if shown and min(shown)[0] < needed - 1e-6:
                    time, foe = min(shown)
                    yield Finding(
                        elements=(*_crossing_first(signal, index, crossing.id), *signal.elements(foe)[1:]),
                        at=crossing.shape[0],
                        message=f"in {signal.named(program)} the crossing {crossing.id} has {time:g} s "
                        f"from the red of link {index} to the green of link {foe}, walking across takes "
                        f"{needed:.1f} s",
                        measured=time,
                        limit=needed,
                        severity=ERROR if time < needed - limits.clearance_tolerance else WARNING,
                    )


def _crossing_first(signal: SignalFacts, index: int, crossing: str) -> tuple[Element, ...]:
    first = Element(kind="crossing", id=crossing)
    return (first, *(item for item in signal.elements(index) if item != first))


@check(
    id="pedestrians.walk_min",
    code="SIG010",
    title="Walkers have time to start",
    severity=WARNING,
    limit="7 s; error below 4 s",
    source="MUTCD 4E.06; netconvert --tls.crossing-min.time (4 s)",
    hint="lengthen the phase",
)
def check_walk_min(facts: Facts, limits: Limits) -> Iterator[Finding]:
    """Find greens for walkers that are too short to notice and start.

    Args:
        facts: of the map.
        limits: `walk`, and `walk_error` below which it is an error; seconds.

    Yields:
        A finding for each program and link, with its shortest green, seconds.
    """
    for signal, program in programs_of(facts):
        for index in signal.walking:
            letters = signal.letters(program, index)
            shown = [run_from(program, letters, phase, GREEN) for phase in starts(program, letters, GREEN)]
            crossings = [way for way in signal.links.get(index, ()) if isinstance(way, Crossing)]
            if shown and crossings and min(shown) < limits.walk:
                yield Finding(
                    elements=_crossing_first(signal, index, crossings[0].id),
                    at=crossings[0].shape[0],
                    message=f"walkers on link {index} get {min(shown):g} s of green in "
                    f"{signal.named(program)}",
                    measured=min(shown),
                    limit=limits.walk,
                    severity=ERROR if min(shown) < limits.walk_error else WARNING,
                )


@check(
    id="signals.minor_green_fast",
    code="SIG015",
    title="Turns that yield are not too fast",
    severity=WARNING,
    limit="70 km/h",
    source="netconvert --tls.minor-left.max-speed (19.44 m/s)",
    hint="give the turn a phase of its own",
)
def check_minor_green_fast(facts: Facts, limits: Limits) -> Iterator[Finding]:
    """Find turns across traffic that have to yield on roads where that is too fast to judge.

    Args:
        facts: of the map; right turns count where traffic keeps left.
        limits: `minor_speed`, m/s.

    Yields:
        A finding for each program and link, with the speed limit of the first lane that it comes from too
        fast, m/s.
    """
    turn = "r" if facts.map.left_hand else "l"
    for signal, program in programs_of(facts):
        for index in signal.vehicle:
            ways = [way for way in signal.links.get(index, ()) if isinstance(way, Connection)]
            fast = [
                way
                for way in ways
                if way.direction == turn and facts.lanes[way.from_lane].speed > limits.minor_speed + 0.01
            ]
            if fast and "g" in signal.letters(program, index):
                speed = facts.lanes[fast[0].from_lane].speed
                yield Finding(
                    elements=signal.elements(index),
                    at=signal.place(index),
                    message=f"link {index} of {signal.named(program)} crosses traffic at {speed:.1f} m/s",
                    measured=speed,
                    limit=limits.minor_speed,
                )


@check(
    id="signals.cycle",
    code="SIG017",
    title="Cycles have a usual length",
    severity=NOTE,
    limit="30 to 120 s",
    source="netconvert: high cycle time",
    hint="shorten or lengthen the green phases",
)
def check_cycle(facts: Facts, limits: Limits) -> Iterator[Finding]:
    """Find fixed programs with very long or very short cycles.

    Args:
        facts: of the map.
        limits: `cycle_least` and `cycle_most`, seconds.

    Yields:
        A finding for each such program, with its cycle, seconds.
    """
    for signal, program in programs_of(facts):
        cycle = sum(phase.duration for phase in program.phases)
        if program.kind == "static" and not limits.cycle_least <= cycle <= limits.cycle_most:
            yield Finding(
                elements=signal.elements(),
                at=signal.middle,
                message=f"{signal.named(program)} takes {cycle:g} s",
                measured=cycle,
                limit=limits.cycle_least if cycle < limits.cycle_least else limits.cycle_most,
            )


@check(
    id="signals.green_fraction",
    code="SIG018",
    title="Links get a share of the cycle",
    severity=NOTE,
    limit="above 1 %",
    source="sumo's loader",
    hint="lengthen the link's green",
)
def check_green_fraction(facts: Facts, limits: Limits) -> Iterator[Finding]:
    """Find links that get hardly any of the cycle.

    Args:
        facts: of the map; programs of rings do not count, nor do links that never get green.
        limits: `green_share`, of the cycle.

    Yields:
        A finding for each program and link, with its share of the cycle.
    """
    for signal, program in programs_of(facts):
        if program.rings:
            continue  # How often each pair comes up is for the detectors to say.
        cycle = sum(phase.duration for phase in program.phases)
        for index in (*signal.vehicle, *signal.walking):
            letters = signal.letters(program, index)
            green = sum(
                phase.duration
                for phase, letter in zip(program.phases, letters, strict=True)
                if letter in GREEN
            )
            if 0 < green <= limits.green_share * cycle:
                yield Finding(
                    elements=signal.elements(index),
                    at=signal.place(index),
                    message=f"link {index} gets {green / cycle * 100:.1f} % of {signal.named(program)}",
                    measured=green / cycle,
                    limit=limits.green_share,
                )
