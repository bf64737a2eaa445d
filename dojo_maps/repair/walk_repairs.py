"""Repairs of what walkers are shown: greens that end in time to get across, and are long enough to start."""

from dojo_maps.description import Crossing
from dojo_maps.geometry.polylines import along
from dojo_maps.repair.draft import Draft, in_seconds
from dojo_maps.signals.programs import GREEN, following, least, run_from, starts
from dojo_maps.signals.timing import whole
from dojo_maps.validation.profiles import Limits
from dojo_maps.validation.programs import SignalFacts

_SIMULTANEOUS = 1e-6


def clear_crossings(signal: SignalFacts, draft: Draft, limits: Limits) -> None:
    """End walkers' greens early enough; vehicles are shown the same, longer if time is short.

    Args:
        signal: whose links they are, with the conflicts among them.
        draft: one of its programs; changed in place, with lines that say what was done.
        limits: how fast people walk, and the green that stays for them where there is so much.
    """
    cut: dict[int, float] = {}
    for _ in range(4 * len(draft.phases)):
        worst = _worst_clearance(signal, draft, limits)
        if worst is None:
            break
        index, phase, lacking = worst
        cut[index] = max(cut.get(index, 0.0), lacking)
        _end_early(draft, index, phase, lacking, limits.walk)
    draft.lines += [
        f"green of link {index} ends {in_seconds(time)} s earlier" for index, time in sorted(cut.items())
    ]


def _worst_clearance(signal: SignalFacts, draft: Draft, limits: Limits) -> tuple[int, int, float] | None:
    """Find the walkers' letter, the last phase of its green, and the whole seconds that are lacking."""
    program = draft.program
    found = []
    for conflict in signal.conflicts:
        for way, index, foe in (
            (conflict.one, *conflict.indices),
            (conflict.other, *conflict.indices[::-1]),
        ):
            if not isinstance(way, Crossing):
                continue
            needed = float(along(way.shape)[-1]) / limits.walking_speed
            walk, drive = signal.letters(program, index), signal.letters(program, foe)
            for phase in range(len(walk)):
                for after in following(program, phase):
                    if walk[phase] not in GREEN or walk[after] in GREEN or drive[phase] == "G":
                        continue
                    shown = _time_until_green(draft, drive, after)
                    if shown is not None and shown < needed - _SIMULTANEOUS:
                        found.append((whole(needed - shown), index, phase))
    if not found:
        return None
    lacking, index, phase = max(found)
    return index, phase, lacking


def _time_until_green(draft: Draft, letters: str, phase: int) -> float | None:
    program, time = draft.program, 0.0
    for _ in program.phases:
        if letters[phase] == "G":
            return time
        time += least(program.phases[phase])
        phase = following(program, phase)[0]
    return None


def _end_early(draft: Draft, index: int, phase: int, lacking: float, walk: float) -> None:
    """Divide a phase, with red for walkers in its second piece; `walk` seconds of green stay if there are."""
    lasts = draft.least(phase)
    before, at = 0.0, draft.before(phase)
    for _ in draft.phases:
        if at is None or at == phase or draft.phases[at]["state"][index] not in GREEN:
            break
        before += draft.least(at)
        at = draft.before(at)
    green = max(lasts - lacking, min(lasts, walk - before), 0.0)
    if green > 0:
        phase = draft.split(phase, green, lacking)
    draft.set_state(phase, {index: "r"})


def lengthen_walks(signal: SignalFacts, draft: Draft, limits: Limits) -> None:
    """Lengthen phases until walkers have time to notice their green and start.

    Args:
        signal: whose links they are.
        draft: one of its programs; changed in place, with lines that say what was done.
        limits: the green that walkers get at least, `walk`.
    """
    added: dict[int, float] = {}
    for index in signal.walking:
        for phase in starts(draft.program, signal.letters(draft.program, index), GREEN):
            program = draft.program
            lacking = whole(limits.walk - run_from(program, signal.letters(program, index), phase, GREEN))
            if lacking > 0:
                draft.lengthen(phase, lacking)
                added[phase] = added.get(phase, 0.0) + lacking
    draft.lines += [f"phase {phase} {in_seconds(time)} s longer" for phase, time in sorted(added.items())]
