"""Signal programs in SUMO's words, read and walked through: their times, and which phase follows which.

A NEMA program is written as single movements; `nema` turns it into the phases that are really shown.
"""

import math
from collections.abc import Mapping, Sequence
from functools import lru_cache

from dojo_maps.description import Phase, Program
from dojo_maps.signals.nema import NEMA, read_rings

GREEN, YELLOW = frozenset("Gg"), frozenset("yY")
_PARTS = (86_400, 3_600, 60, 1)
"""Seconds of a day, an hour, a minute and a second."""
_LONGEST = 1e12


def read_seconds(text: str) -> float:
    """Read a time as SUMO does: seconds, `h:m:s` or `d:h:m:s`.

    Args:
        text: what is written; a minus before it counts for all of it.

    Returns:
        Seconds.

    Raises:
        ValueError: it is no time.
    """
    sign, parts = (-1, text.strip()[1:]) if text.strip().startswith("-") else (1, text)
    values = [float(part) for part in parts.split(":")]
    if len(values) not in {1, 3, 4} or not all(abs(value) <= _LONGEST for value in values):
        raise ValueError(f"{text[:80]!r} is no time; write seconds, h:m:s or d:h:m:s")
    return sign * sum(value * part for value, part in zip(values, _PARTS[-len(values) :], strict=True))


def read_program(
    attributes: Mapping[str, str], phases: Sequence[Mapping[str, str]], parameters: Mapping[str, str]
) -> Program:
    """Describe a program from the attributes of its tlLogic, its phases and its parameters by key.

    An offset of `begin` is that of the simulation's begin, which no network knows: it counts as 0.

    Args:
        attributes: of the tlLogic.
        phases: the attributes of each phase, in order.
        parameters: values by key; only a NEMA program's rings are read from them.

    Returns:
        The program, its times in seconds. Places of phases that there are not are left out.

    Raises:
        ValueError: a time cannot be read, or a phase has no state, no duration, or a negative one.
    """
    kind, offset = attributes.get("type", "static"), attributes.get("offset", "0")
    return Program(
        id=attributes.get("programID", "0"),
        kind=kind,
        offset=0.0 if offset == "begin" else _read_time({"offset": offset}, "offset") or 0.0,
        phases=tuple(_read_phase(phase, len(phases)) for phase in phases),
        rings=read_rings(parameters, [phase.get("name", "") for phase in phases]) if kind == NEMA else (),
    )


def _read_phase(attributes: Mapping[str, str], count: int) -> Phase:
    duration = _read_time(attributes, "duration")
    if duration is None:
        raise ValueError("has a phase without duration")
    if duration < 0:
        raise ValueError(f"duration={attributes.get('duration', '')[:80]!r}, expected a time of at least 0")
    if not attributes.get("state"):
        raise ValueError("has a phase without state")
    places = (int(text) for text in attributes.get("next", "").split() if text.isdecimal() and len(text) < 9)
    return Phase(
        duration=duration,
        min_duration=_read_time(attributes, "minDur"),
        max_duration=_read_time(attributes, "maxDur"),
        state=attributes["state"],
        following=tuple(place for place in places if place < count),
        yellow=_read_time(attributes, "yellow"),
        red=_read_time(attributes, "red"),
    )


def _read_time(attributes: Mapping[str, str], key: str) -> float | None:
    if key not in attributes:
        return None
    try:
        seconds = read_seconds(attributes[key])
    except ValueError:
        seconds = math.nan
    if not math.isfinite(seconds):
        raise ValueError(f"{key}={attributes[key][:80]!r}, expected a number of seconds, h:m:s or d:h:m:s")
    return seconds


def following(program: Program, phase: int) -> tuple[int, ...]:
    """The places of the phases that may come after one.

    Args:
        program: with phases.
        phase: the place of the one.

    Returns:
        At least one place; where the program names none, the next phase's, after the last the first's.
    """
    return program.phases[phase].following or ((phase + 1) % len(program.phases),)


def least(phase: Phase) -> float:
    """The seconds that a phase lasts at least.

    Args:
        phase: of any program.

    Returns:
        Seconds: its minimum if it has one, but never more than its duration.
    """
    return phase.duration if phase.min_duration is None else min(phase.duration, phase.min_duration)


def run_from(program: Program, letters: str, phase: int, wanted: frozenset[str]) -> float:
    """Measure how long a letter of `wanted` is shown at least, from the start of a phase.

    Where several phases may follow, the first of them does.

    Args:
        program: with phases.
        letters: what a link shows in each phase.
        phase: the place of the phase to start from.
        wanted: letters that count, such as `GREEN`.

    Returns:
        Seconds; 0 where the phase shows another letter, one round at most.
    """
    total, seen = 0.0, set[int]()
    while letters[phase] in wanted and phase not in seen:
        seen.add(phase)
        total += least(program.phases[phase])
        phase = following(program, phase)[0]
    return total


def starts(program: Program, letters: str, wanted: frozenset[str]) -> list[int]:
    """The phases in which a letter of `wanted` begins to be shown.

    Args:
        program: with phases.
        letters: what a link shows in each phase.
        wanted: letters that count, such as `GREEN`.

    Returns:
        Places of phases, ascending; none where such a letter is always shown, or never.
    """
    begun = {
        after
        for phase in range(len(letters))
        if letters[phase] not in wanted
        for after in following(program, phase)
        if letters[after] in wanted
    }
    return sorted(begun)


@lru_cache(maxsize=4096)
def green_links(state: str) -> frozenset[int]:
    """List the links that a state lets go, with priority or without, by their places in it.

    Args:
        state: a signal's letters.

    Returns:
        The places of `G` and `g`.
    """
    return frozenset(link for link, letter in enumerate(state) if letter in GREEN)


def is_green(state: str) -> bool:
    """Tell a green phase from what lies between two of them, and from a signal that is off.

    Args:
        state: a signal's letters.

    Returns:
        True where a link is green and none is yellow, red and yellow, or off.
    """
    shown = set(state)
    return bool(GREEN & shown) and not shown & set("yYuoO")
