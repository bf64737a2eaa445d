"""When a signal program can show green to a new crossing, without a change for vehicles.

Pure rules over phases; `transplant` applies them to a network. A letter per phase says what traffic allows:
`G` (whoever turns across yields), `g` (a protected turner comes too, so pedestrians yield), `-` (turners
are at yellow: no one may start to walk), `r` (conflicting traffic moves), `o` (signals are off).
A green is cut short so that who starts last is across before the next conflicting green begins. Protected
turners count as conflicting traffic for every crossing that gets a green without sharing it with them.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from decimal import Decimal

from dojo_maps.signals.timing import walking_time

LEAST_GREEN = Decimal(4)
"""Seconds. Source: netconvert's own least, option `tls.crossing-min.time`; MUTCD allows it where few walk."""

_STOPPED = "rs"
"""An `s` link stops first and yields to all, as on a right turn on red."""
_ZERO = Decimal(0)


@dataclass(frozen=True, slots=True, kw_only=True)
class Foe:
    """A vehicle link that crosses a crossing.

    Attributes:
        index: its letter in the state, or None where another signal or none controls it.
        blocks: it goes straight, or leaves the road that is crossed: nobody may walk while it moves.
        yields: the network's right of way makes it wait for pedestrians.
    """

    index: int | None
    blocks: bool
    yields: bool


@dataclass(frozen=True, slots=True, kw_only=True)
class Walk:
    """A signalled crossing: its letter's index, its length in metres and its foes."""

    crossing: str
    index: int
    length: float
    foes: tuple[Foe, ...]

    @property
    def clearance(self) -> Decimal:
        """Whole seconds to walk across."""
        return Decimal(int(walking_time(self.length)))


@dataclass(frozen=True, slots=True, kw_only=True)
class TimedPhase:
    """A phase as pedestrians need to know it.

    Attributes:
        state: its vehicle letters.
        least: the seconds that it lasts at least.
        following: the phases that may follow.
        last_cut: the latest second at which it may be cut in two; None where any will do.
    """

    state: str
    least: Decimal
    following: tuple[int, ...]
    last_cut: Decimal | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class Green:
    """What one crossing is shown in one phase: `letter` for the first `seconds`, then red."""

    letter: str
    seconds: Decimal


def traffic_letter(walk: Walk, state: str) -> str:
    """Tell what the vehicles' letters allow a crossing, shared greens included; see the module.

    Args:
        walk: the crossing.
        state: the letters of a phase, at least those of the crossing's foes.

    Returns:
        One of G, g, -, r and o.
    """
    if state and not state.strip("oO"):
        return "o"
    worst = "G"
    for foe in walk.foes:
        letter = "g" if foe.index is None else state[foe.index]
        if letter == "r" or (letter in _STOPPED and foe.yields):
            continue
        if foe.blocks or letter not in "GgyY":
            return "r"
        if foe.index is None and not foe.yields:
            return "r"
        if letter in "yY":
            worst = "-"
        elif (letter == "G" or not foe.yields) and worst == "G":
            worst = "g"
    return worst


def compute_greens(phases: Sequence[TimedPhase], walk: Walk) -> list[Green]:
    """Find the longest green of each phase that keeps the clearance and the least green time.

    Args:
        phases: the program, with vehicle letters.
        walk: the crossing.

    Returns:
        One entry per phase; `seconds` equal to the phase's `least` means all of it, 0 none.
    """
    letters = [traffic_letter(walk, phase.state) for phase in phases]
    alone = ["r" if letter == "g" else letter for letter in letters]
    greens = _compute_greens(phases, walk, alone)
    return greens if any(green.seconds for green in greens) else _compute_greens(phases, walk, letters)


def _compute_greens(phases: Sequence[TimedPhase], walk: Walk, letters: Sequence[str]) -> list[Green]:
    margins = _margins(phases, walk, letters)
    seconds = [
        phase.least if letter in "Gg" else _ZERO for phase, letter in zip(phases, letters, strict=True)
    ]
    while _shorten(phases, seconds, margins, walk.clearance) or _drop_short(phases, seconds):
        pass
    return [Green(letter=letter, seconds=length) for letter, length in zip(letters, seconds, strict=True)]


def share_cuts(greens: Sequence[Green], least: Decimal) -> list[Green]:
    """End the greens of several crossings together where they can, so that a phase is cut less often.

    Args:
        greens: of all crossings in one phase.
        least: the seconds that the phase lasts at least.

    Returns:
        The greens in the same order; those that end within the phase, and last long enough, all end with the
        first of them.
    """
    ends = sorted({green.seconds for green in greens if LEAST_GREEN <= green.seconds < least})

    def shared(green: Green) -> Green:
        if not LEAST_GREEN <= green.seconds < least:
            return green
        return replace(green, seconds=ends[0])

    return [shared(green) for green in greens]


def _margins(phases: Sequence[TimedPhase], walk: Walk, letters: Sequence[str]) -> list[Decimal]:
    """Find the shortest time from each phase's end to the next conflicting green, at most the clearance."""
    protected = [_protected(walk, phase.state) for phase in phases]
    margins = [walk.clearance] * len(phases)

    def beyond(current: int, following: int) -> Decimal:
        if letters[following] == "r" or protected[following] - protected[current]:
            return _ZERO
        return phases[following].least + margins[following]

    changed = True
    while changed:
        changed = False
        for current in reversed(range(len(phases))):
            margin = min([margins[current], *(beyond(current, after) for after in phases[current].following)])
            changed = changed or margin < margins[current]
            margins[current] = margin
    return margins


def _protected(walk: Walk, state: str) -> frozenset[int]:
    """Find the turners that have a green and do not yield."""
    return frozenset(
        number
        for number, foe in enumerate(walk.foes)
        if foe.index is not None and (state[foe.index] == "G" or (state[foe.index] == "g" and not foe.yields))
    )


def _shorten(
    phases: Sequence[TimedPhase], seconds: list[Decimal], margins: Sequence[Decimal], clearance: Decimal
) -> bool:
    """Cut each green whose end leaves too little time; tell whether any was."""
    changed = False
    for current in reversed(range(len(phases))):
        full = phases[current].least
        if not seconds[current]:
            continue
        goes_on = all(seconds[after] > 0 for after in phases[current].following)
        if margins[current] >= clearance or (goes_on and seconds[current] == full):
            continue
        last_cut = phases[current].last_cut
        allowed = full - (clearance - margins[current])
        allowed = max(_ZERO, allowed if last_cut is None else min(allowed, last_cut))
        if allowed < seconds[current]:
            seconds[current] = allowed
            changed = True
    return changed


def _drop_short(phases: Sequence[TimedPhase], seconds: list[Decimal]) -> bool:
    """Turn one green that is shorter than the least to red; tell whether there was one."""
    lengths = [LEAST_GREEN] * len(phases)
    changed = True
    while changed:
        changed = False
        for current in reversed(range(len(phases))):
            length = seconds[current]
            if length == phases[current].least and length:
                length += min((lengths[after] for after in phases[current].following), default=_ZERO)
            changed = changed or length < lengths[current]
            lengths[current] = min(length, lengths[current])
    starts = {
        after
        for phase, length in zip(phases, seconds, strict=True)
        for after in phase.following
        if length < phase.least or not length
    }
    for current in sorted(starts):
        if seconds[current] and lengths[current] < LEAST_GREEN:
            seconds[current] = _ZERO
            return True
    return False
