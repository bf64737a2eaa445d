"""NEMA programs: rings of movements that run side by side, and barriers that all rings cross together.

Each phase of such a program is one movement with a yellow and a red of its own. A ring shows one of them at a
time; what drivers see are pairs, one movement of each ring from the same side of a barrier. Source: SUMO,
Simulation/NEMA; NEMA TS 2.

            barrier        barrier
    ring 1:  1   2    |    3   4    |
    ring 2:  5   6    |    7   8    |
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import product

from dojo_maps.description import Phase, Program

NEMA = "NEMA"
"""SUMO's type of such programs."""
Rings = tuple[tuple[tuple[int, ...], ...], ...]
"""Per ring and side of a barrier, the places of its phases in the program."""
_PRIORITY = "GgyYsuoOr"
"""Of two letters for a link, the first one here is shown."""
_SIDE = 2
"""Entries of a ring from one barrier to the next; one that is 0 stays empty."""


def read_rings(parameters: Mapping[str, str], names: Sequence[str]) -> Rings:
    """Read the rings from a program's parameters; SUMO takes every digit for the name of a phase.

    Args:
        parameters: `ring1` and `ring2` by key.
        names: those of the program's phases.

    Returns:
        The rings; none where a ring is missing or names no phase, which SUMO refuses to run.
    """
    places = {int(name): place for place, name in reversed(list(enumerate(names))) if name.isdecimal()}
    rings = []
    for key in ("ring1", "ring2"):
        entries = [int(letter) for letter in parameters.get(key, "") if letter in "0123456789"]
        if not any(entries) or any(entry and entry not in places for entry in entries):
            return ()
        sides = [entries[k : k + _SIDE] for k in range(0, len(entries), _SIDE)]
        rings.append(tuple(tuple(places[entry] for entry in side if entry) for side in sides))
    return tuple(rings)


def list_pairs(program: Program) -> list[tuple[int, ...]]:
    """List the movements that may be green together, side by side of the barriers.

    Args:
        program: with rings; others have no pairs.

    Returns:
        Places of phases in the program, one for each ring that has some on that side.
    """
    return [pair for side in _sides(program) for pair in product(*side)]


def list_cycle(program: Program) -> list[tuple[int, ...]]:
    """List the pairs of one cycle in which the rings go on together; each movement comes up.

    Args:
        program: with rings; others have no pairs.

    Returns:
        Places of phases in the program, in the order in which they are shown. A ring with fewer phases on a
        side stays in its last one.
    """
    return [
        tuple(ring[min(step, len(ring) - 1)] for ring in side)
        for side in _sides(program)
        for step in range(max(map(len, side)))
    ]


def _sides(program: Program) -> Iterator[list[tuple[int, ...]]]:
    """List for each side of the barriers what the rings have there."""
    for number in range(max(map(len, program.rings), default=0)):
        side = [ring[number] for ring in program.rings if number < len(ring) and ring[number]]
        if side:
            yield side


def show(program: Program, pair: Sequence[int]) -> str:
    """Write the letters that movements show together.

    Args:
        program: whose phases they are.
        pair: places of phases in it.

    Returns:
        A letter for each link: green, if one of the movements has it green.
    """
    states = (program.phases[place].state for place in pair)
    return "".join(min(letters, key=_rank) for letters in zip(*states, strict=False))


def _rank(letter: str) -> int:
    return _PRIORITY.find(letter) % (len(_PRIORITY) + 1)


def unroll(program: Program) -> Program:
    """Write a NEMA program as the phases that are shown: every pair, and the changes between them.

    A pair is followed by the change to any other one: the yellow of the movements that end, and their red.
    Other programs stay as they are.

    Args:
        program: of any kind.

    Returns:
        The program: its first phases are the pairs in the order of `list_pairs`, then come the changes, and
        `following` tells which comes after which.
    """
    if not program.rings:
        return program
    pairs = list_pairs(program)
    phases = [_pair_phase(program, pair) for pair in pairs]
    follows: list[list[int]] = [[] for _ in pairs]
    for one, other in product(range(len(pairs)), repeat=2):
        if one != other and phases[one].state != phases[other].state:
            change = _change(program, pairs[one], pairs[other])
            follows[one].append(len(phases) if change else other)
            for number, phase in enumerate(change):
                after = other if number + 1 == len(change) else len(phases) + 1
                phases.append(replace(phase, following=(after,)))
    return replace(
        program,
        phases=tuple(
            replace(phase, following=tuple(dict.fromkeys(follows[k]))) if k < len(pairs) else phase
            for k, phase in enumerate(phases)
        ),
    )


def _pair_phase(program: Program, pair: Sequence[int]) -> Phase:
    movements = [program.phases[place] for place in pair]
    least = [phase.duration if phase.min_duration is None else phase.min_duration for phase in movements]
    return Phase(
        duration=min(phase.duration for phase in movements),
        min_duration=min(least),
        max_duration=None,
        state=show(program, pair),
    )


def _change(program: Program, old: Sequence[int], new: Sequence[int]) -> list[Phase]:
    """Show yellow, then red to those that lose green, for as long as the movements that end ask for."""
    ending = [program.phases[place] for place in old if place not in new]
    before, after = show(program, old), show(program, new)
    lost = [a in "Gg" and b not in "Gg" for a, b in zip(before, after, strict=True)]
    kept = [a if b in "Gg" else "r" for a, b in zip(before, after, strict=True)]
    yellow = "".join("y" if gone else letter for gone, letter in zip(lost, kept, strict=True))
    # SUMO shows a step of yellow even where the program has none.
    seconds = max([1.0, *(phase.yellow or 0.0 for phase in ending)]) if any(lost) else 0.0
    red = max((phase.red or 0.0 for phase in ending), default=0.0)
    return [_fixed(time, state) for time, state in ((seconds, yellow), (red, "".join(kept))) if time]


def _fixed(seconds: float, state: str) -> Phase:
    return Phase(duration=seconds, min_duration=seconds, max_duration=seconds, state=state)
