"""Repairs of what signals show: missing letters, colliding greens, yellows left out or too short."""

from collections.abc import Callable, Iterator, Sequence

from dojo_maps.issue import Element, Issue
from dojo_maps.repair.draft import Draft, in_seconds
from dojo_maps.repair.edits import Edit, Repair, Site, named
from dojo_maps.signals.conflicts import list_foes
from dojo_maps.signals.nema import NEMA
from dojo_maps.signals.programs import GREEN, YELLOW, read_seconds, run_from, starts
from dojo_maps.signals.timing import whole
from dojo_maps.validation.profiles import Limits
from dojo_maps.validation.programs import SignalFacts, signals_of
from dojo_maps.validation.timing_checks import yellow_for

LEAST_GREEN = 7.0
"""Seconds of green that stay where a longer yellow takes its time from the green before it."""
_LONGEST_CLEARANCE = 8.0
"""Seconds; a phase that gives no green and is not longer is what clears the junction."""

Mend = Callable[[SignalFacts, Draft, Limits], None]


def repair_programs(mend: Mend, *, uncovers: bool = False) -> Repair:
    """Make a repair of what mends one program.

    Args:
        mend: given a signal, one of its programs and the limits; changes the program in place, or leaves it.
        uncovers: broken programs hide their signal from other checks; what is found there then is not new.

    Returns:
        A repair with an edit for each program that was changed; NEMA programs are left alone.
    """

    def repair(site: Site, issues: Sequence[Issue]) -> Iterator[Edit]:
        wanted = set(named(issues, "signal"))
        for signal in signals_of(site.facts):
            if signal.signal.id not in wanted:
                continue
            for record in site.text.logics(signal.signal.id):
                if record.attributes.get("type") == NEMA:
                    continue  # Its phases are movements: what it shows is not what stands there.
                draft = Draft(record, site.path)
                mend(signal, draft, site.limits)
                if draft.change is not None:
                    what = f"program {draft.name}: {', '.join(draft.lines)}"
                    element = Element(kind="signal", id=signal.signal.id)
                    shown = (element,) if uncovers else ()
                    yield Edit(element=element, what=what, changes=(draft.change,), uncovers=shown)

    return repair


def lengthen_yellow(signal: SignalFacts, draft: Draft, limits: Limits) -> None:
    """Lengthen yellows to whole seconds that are enough; the green before gives the time if it can.

    Args:
        signal: whose links they are.
        draft: one of its programs; changed in place, with lines that say what was done.
        limits: the shortest yellow, and how much one may lack of what the speed needs.
    """
    added: dict[int, float] = {}
    for _ in draft.phases:
        phase, lacking = _worst_yellow(signal, draft, limits)
        if lacking <= 0:
            break
        added[phase] = added.get(phase, 0.0) + lacking
        draft.lengthen(phase, lacking)
        draft.take(draft.before(phase), lacking, LEAST_GREEN)
    draft.lines += [f"yellow of phase {k} {in_seconds(time)} s longer" for k, time in sorted(added.items())]


def _worst_yellow(signal: SignalFacts, draft: Draft, limits: Limits) -> tuple[int, float]:
    """Find the phase whose yellow lacks most, and by how many seconds."""
    program, worst = draft.program, (0, 0.0)
    for index in signal.vehicle:
        letters = signal.letters(program, index)
        wanted = yellow_for(signal, index, limits.yellow)
        for phase in starts(program, letters, YELLOW):
            shown = run_from(program, letters, phase, YELLOW)
            lacks = shown < limits.yellow or shown < wanted - limits.yellow_tolerance
            if lacks and whole(wanted) - shown > worst[1]:
                worst = (phase, whole(wanted) - shown)
    return worst


def add_yellow(signal: SignalFacts, draft: Draft, limits: Limits) -> None:
    """Show yellow between green and red: in the phase that clears the junction, or in one of its own.

    Args:
        signal: whose links they are.
        draft: one of its programs; changed in place, with lines that say what was done.
        limits: the shortest yellow; the links' speed may need more.
    """
    done: list[str] = []
    phase = 0
    while phase < len(draft.phases):
        after = draft.after(phase)
        cut = _cut_greens(signal, draft, phase, after) if after is not None else []
        if cut and after is not None:
            seconds = whole(max(yellow_for(signal, index, limits.yellow) for index in cut))
            if _clears(draft, phase, after):
                draft.set_state(after, dict.fromkeys(cut, "y"))
                lacking = seconds - draft.least(after)
                if lacking > 0:
                    draft.lengthen(after, lacking)
                    draft.take(phase, lacking, LEAST_GREEN)
            else:
                state = _between(draft.phases[phase]["state"], draft.phases[after]["state"], cut)
                draft.insert_after(phase, {"duration": in_seconds(seconds), "state": state})
                draft.take(phase, seconds, LEAST_GREEN)
                phase += 1
            done.append(f"yellow for links {' '.join(map(str, cut))} after phase {phase}")
        phase += 1
    draft.lines += done


def _cut_greens(signal: SignalFacts, draft: Draft, phase: int, after: int) -> list[int]:
    states = [draft.phases[k].get("state", "") for k in (phase, after)]
    size = min(map(len, states))
    return [k for k in signal.vehicle if k < size and states[0][k] in GREEN and states[1][k] in "rs"]


def _clears(draft: Draft, phase: int, after: int) -> bool:
    """Tell whether a phase only ends greens, is short, and comes after nothing else."""
    old, new = draft.phases[phase]["state"], draft.phases[after]["state"]
    gains = any(b in GREEN and a not in GREEN for a, b in zip(old, new, strict=False))
    short = read_seconds(draft.phases[after].get("duration", "0")) <= _LONGEST_CLEARANCE
    return short and not gains and draft.before(after) == phase and not set(old) & set(YELLOW)


def _between(old: str, new: str, cut: Sequence[int]) -> str:
    """Write the state between two: yellow for what ends, green only for what has it before and after."""
    return "".join(
        "y" if index in cut else after if after in "rs" else before
        for index, (before, after) in enumerate(zip(old, new, strict=False))
    )


def let_yield(signal: SignalFacts, draft: Draft, _limits: Limits) -> None:
    """Give g, which yields, to the one of two colliding greens that the junction's rules make yield.

    Args:
        signal: whose links they are, with the conflicts among them.
        draft: one of its programs; changed in place, with a line that says what was done.
        _limits: not needed.
    """
    yields = {
        pair
        for name in signal.signal.junctions
        if (junction := signal.facts.junctions.get(name)) is not None
        for foes in list_foes(junction)
        for pair, waits in (
            ((foes.one, foes.other), foes.one_waits),
            ((foes.other, foes.one), foes.other_waits),
        )
        if waits
    }
    changed: dict[int, None] = {}
    for conflict in signal.conflicts:
        ways = ((conflict.one, conflict.indices[0]), (conflict.other, conflict.indices[1]))
        pairs = ((conflict.one.id, conflict.other.id), (conflict.other.id, conflict.one.id))
        minors = [way for way, pair in zip(ways, pairs, strict=True) if pair in yields]
        if not minors:
            continue
        minor = min(minors, key=lambda way: getattr(way[0], "direction", "") == "s")[1]
        for phase, attributes in enumerate(draft.phases):
            letters = [attributes.get("state", "")[k : k + 1] for k in conflict.indices]
            if letters == ["G", "G"]:
                draft.set_state(phase, {minor: "g"})
                changed[minor] = None
    if changed:
        draft.lines.append(f"links {' '.join(map(str, sorted(changed)))} yield where they had a foe's G (g)")


def complete_states(signal: SignalFacts, draft: Draft, _limits: Limits) -> None:
    """Give every state a letter per link: what its neighbours in time agree on, or its lane's other link.

    Letters beyond the last link go. Nothing happens where more are missing than the signal has links.

    Args:
        signal: whose links they are.
        draft: one of its programs; changed in place, with lines that say what was done.
        _limits: not needed.
    """
    needed = max((link.index for link in signal.signal.links), default=-1) + 1
    states = [phase.get("state", "") for phase in draft.phases]
    size, longest = max(needed, 0), max(map(len, states), default=0)
    absurd = size > longest + len(signal.signal.links)
    if not size or absurd or all(len(state) == size for state in states):
        return
    lanes = {link.index: link.from_id for link in signal.signal.links}
    for phase, state in enumerate(states):
        full = state[:size]
        for index in range(len(full), size):
            full += _missing_letter(states, phase, index, lanes)
        if full != state:
            draft.phases[phase]["state"] = full
            draft.lines.append(f"phase {phase} has {size} letters")


def _missing_letter(states: Sequence[str], phase: int, index: int, lanes: dict[int, str]) -> str:
    before, after = states[phase - 1], states[(phase + 1) % len(states)]
    if index < len(before) and index < len(after):
        a, b = before[index], after[index]
        return a if a == b else "y" if a in GREEN and b in "rs" and set(states[phase]) & set(YELLOW) else "r"
    beside = [k for k, lane in lanes.items() if lane == lanes.get(index) and k < len(states[phase])]
    return states[phase][beside[0]].replace("G", "g") if beside else "r"
