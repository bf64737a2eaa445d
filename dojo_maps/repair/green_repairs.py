"""Repair of links that never get green: in a phase that leaves them free, or in one of their own."""

from collections.abc import Sequence

from dojo_maps.description import Crossing
from dojo_maps.geometry.polylines import along
from dojo_maps.repair.draft import Draft, in_seconds
from dojo_maps.repair.signal_repairs import add_yellow
from dojo_maps.repair.walk_repairs import clear_crossings
from dojo_maps.signals.conflicts import Conflicts, read_conflicts
from dojo_maps.signals.programs import GREEN, is_green, read_seconds
from dojo_maps.signals.timing import walking_time
from dojo_maps.validation.profiles import Limits
from dojo_maps.validation.programs import SignalFacts
from dojo_maps.validation.signal_checks import GOES

_OWN_GREEN = 10.0
"""Seconds of a phase that is added for vehicles."""
_BEFORE_GREEN = "uU"
"""Red and yellow: what comes next is told already."""


def give_green(signal: SignalFacts, draft: Draft, limits: Limits) -> None:
    """Let links go that no program of the signal lets go; programs that let nobody go are meant so.

    Args:
        signal: whose links they are, with its programs as they were.
        draft: one of its programs; changed in place, with lines that say what was done.
        limits: for the yellow before and after, and for the time that walkers need.
    """
    states = [phase.get("state", "") for phase in draft.phases]
    dark = [
        index
        for index in (*signal.vehicle, *signal.walking)
        if not any(set(signal.letters(program, index)) & {*GOES, "?"} for program in signal.signal.programs)
    ]
    if not dark or len(set(map(len, states))) != 1 or not any(set(state) & GREEN for state in states):
        return
    conflicts = read_conflicts(signal.facts.map, signal.signal, len(states[0]))
    left = [index for index in dark if not _join_phase(signal, draft, conflicts, index)]
    while left:
        together = _compatible(conflicts, left)
        left = [index for index in left if index not in together]
        if not _add_phase(signal, draft, conflicts, together, limits):
            return
    add_yellow(signal, draft, limits)
    clear_crossings(signal, draft, limits)


def _join_phase(signal: SignalFacts, draft: Draft, conflicts: Conflicts, index: int) -> bool:
    """Let a link go in the longest green phase in which it is free to."""
    found: list[tuple[bool, float, int, str]] = []
    for place, phase in enumerate(draft.phases):
        letter = _free_letter(signal, conflicts, index, phase["state"]) if is_green(phase["state"]) else ""
        if letter:
            found.append((letter == "G", read_seconds(phase.get("duration", "0")), -place, letter))
    if not found:
        return False
    _, _, place, letter = max(found)
    draft.set_state(-place, {index: letter})
    draft.lines.append(f"link {index} goes in phase {-place} ({letter})")
    return True


def _free_letter(signal: SignalFacts, conflicts: Conflicts, index: int, state: str) -> str:
    """Choose the letter for a link beside those that go: G, g where it yields to walkers only, or none.

    Those who cross it and go as well must be such that yield to it already.
    """
    foes = [foe for foe, letter in enumerate(state) if letter in GREEN and conflicts.foes[index, foe]]
    if all(state[foe] == "g" and conflicts.yields[foe, index] for foe in foes):
        return "G"
    yields = all(foe in signal.walking and conflicts.yields[index, foe] for foe in foes)
    return "g" if yields and index not in signal.walking else ""


def _compatible(conflicts: Conflicts, links: Sequence[int]) -> list[int]:
    """Choose links, the first one among them, of which none conflict."""
    chosen: list[int] = []
    for index in links:
        if not any(conflicts.foes[index, other] for other in chosen):
            chosen.append(index)
    return chosen


def _add_phase(
    signal: SignalFacts, draft: Draft, conflicts: Conflicts, links: Sequence[int], limits: Limits
) -> bool:
    """Put a phase for links where it cuts the fewest greens short, as late in the cycle as can be."""
    found: list[tuple[int, int, str]] = []
    for place, phase in enumerate(draft.phases):
        after = draft.after(place)
        if after is None or set(phase["state"]) & set(_BEFORE_GREEN):
            continue
        state = "".join(
            "G"
            if k in links
            else one
            if one in GREEN and other in GREEN and not conflicts.foes[k, list(links)].any()
            else "r"
            for k, (one, other) in enumerate(zip(phase["state"], draft.phases[after]["state"], strict=True))
        )
        cut = sum(a in GREEN and b not in GREEN for a, b in zip(phase["state"], state, strict=True))
        found.append((-cut, place, state))
    if not found:
        return False
    _, place, state = max(found)
    seconds = _OWN_GREEN
    for way in (way for index in links for way in signal.links[index] if isinstance(way, Crossing)):
        across = walking_time(float(along(way.shape)[-1]), limits.walking_speed)
        seconds = max(seconds, limits.walk + across)
    draft.insert_after(place, {"duration": in_seconds(seconds), "state": state})
    draft.lines.append(f"a phase for links {' '.join(map(str, links))} after phase {place}")
    return True
