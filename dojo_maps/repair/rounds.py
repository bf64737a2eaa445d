"""Repair in rounds: propose, try, keep what mends its check and brings nothing as severe."""

from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

from dojo_maps.errors import DojoError
from dojo_maps.issue import Issue, Severity
from dojo_maps.repair.edits import Change, Edit, Site
from dojo_maps.repair.net_text import NetText
from dojo_maps.repair.patch import apply_changes
from dojo_maps.repair.repairs import ON_REQUEST, REPAIRS
from dojo_maps.repair.weighing import find_objection, list_new
from dojo_maps.sources.sumo_net import read_network
from dojo_maps.sumo_loading import loading
from dojo_maps.validation.facts import Facts
from dojo_maps.validation.profiles import DEFAULT, Profile
from dojo_maps.validation.runner import find_issues
from dojo_maps.validation.sumo_checks import check_refused, check_warned

MOST_ROUNDS = 5
_MOST_TRIALS = 60
"""Per check and round; each is one validation of the whole network."""
_SUMO = frozenset({check_refused.id, check_warned.id})

Counts = Mapping[str, tuple[int, int]]
"""By check: its issues, and those of them that are errors."""


@dataclass(frozen=True, slots=True, kw_only=True)
class State:
    """A network at one moment of its repair."""

    data: bytes
    site: Site
    issues: Sequence[Issue]
    counts: Counts


@dataclass(frozen=True, slots=True, kw_only=True)
class Made:
    """An edit that was kept, or one that was given up, and why."""

    check: str
    edit: Edit
    reason: str = ""


@dataclass(slots=True, kw_only=True)
class Fixed:
    """The network before and after, the edits that were kept and given up, and how many rounds it took."""

    before: State
    after: State
    made: list[Made] = field(default_factory=list)
    refused: list[Made] = field(default_factory=list)
    rounds: int = 0


Look = Callable[[bytes], State]


def fix_network(data: bytes, path: Path, only: Collection[str] = (), profile: Profile = DEFAULT) -> Fixed:
    """Repair a network in memory.

    Args:
        data: its bytes, unpacked.
        path: where they came from, for errors.
        only: the checks to repair; empty means all but those that are repaired on request.
        profile: the limits to reach.

    Returns:
        The network before and after, with the edits that were kept and given up.

    Raises:
        SourceError: the bytes are not a network.
    """

    def look(changed: bytes) -> State:
        return _inspect(changed, path, profile)

    def ask(changed: bytes) -> State:
        return _ask_sumo(look(changed), profile)

    first = ask(data)
    fixed = Fixed(before=first, after=first)
    wanted = [check for check in REPAIRS if check in only or not (only or check in ON_REQUEST)]
    for number in range(1, MOST_ROUNDS + 1):
        kept = sum([_repair_loadable(check, fixed, look, ask) for check in wanted])
        if not kept:
            break
        fixed.rounds = number
    return fixed


def _repair_loadable(check: str, fixed: Fixed, look: Look, ask: Look) -> int:
    """Repair one check, then let SUMO load the network; where it objects, it is asked of each trial."""
    before, made, refused = fixed.after, len(fixed.made), len(fixed.refused)
    kept = _repair(check, fixed, look)
    if not kept:
        return 0
    fixed.after = ask(fixed.after.data)
    if not any(issue.check in _SUMO for issue in list_new(before.issues, fixed.after.issues)):
        return kept
    fixed.after = before
    del fixed.made[made:], fixed.refused[refused:]
    return _repair(check, fixed, ask)


def _ask_sumo(state: State, profile: Profile) -> State:
    """Add SUMO's own word on a network, which drafts go without."""
    with loading(state.data) as sumo:
        checks = (check_refused, check_warned)
        said, _ = find_issues(state.site.facts.map, None, (), profile, checks, sumo)
    issues = (*state.issues, *said)
    return replace(state, issues=issues, counts=_count(issues))


def _repair(check: str, fixed: Fixed, look: Look) -> int:
    """Repair one check as far as that is worth it; how many edits were kept."""
    issues = [issue for issue in fixed.after.issues if issue.check == check]
    known = {(made.check, made.edit.element) for made in fixed.refused}
    edits = REPAIRS[check](fixed.after.site, issues) if issues else ()
    waiting = [[edit for edit in edits if (check, edit.element) not in known]]
    kept, trials = 0, 0
    while waiting and trials < _MOST_TRIALS:
        batch = waiting.pop(0)
        if not batch:
            continue
        trials += 1
        after, reason = _try(check, fixed.after, batch, look)
        if after is not None:
            fixed.after = after
            fixed.made += [Made(check=check, edit=edit) for edit in batch]
            kept += len(batch)
        elif len(batch) == 1:
            fixed.refused.append(Made(check=check, edit=batch[0], reason=reason))
        else:
            half = len(batch) // 2
            waiting[:0] = [batch[:half], batch[half:]]
    reason = "too many others had to be tried one by one"
    fixed.refused += [Made(check=check, edit=edit, reason=reason) for batch in waiting for edit in batch]
    return kept


def _try(check: str, state: State, batch: Sequence[Edit], look: Look) -> tuple[State | None, str]:
    """Make edits and look again; the network after, or why it stays as it was."""
    changes: list[Change] = [change for edit in batch for change in edit.changes]
    try:
        after = look(apply_changes(state.site.text, changes, state.site.path))
        if check in ON_REQUEST:
            after = _follow_up(state, after, look)
    except DojoError as error:
        return None, str(error)
    uncovered = {element for edit in batch for element in edit.uncovers}
    objection, costs = find_objection(check, state.issues, after.issues, uncovered)
    if objection or (costs and len(batch) > 1):  # What an edit costs is weighed with what it mends itself.
        return None, objection
    return after, ""


def _follow_up(before: State, after: State, look: Look) -> State:
    """Mend at once what an addition brings with it, such as programs that leave too little time to walk."""
    for check in sorted({issue.check for issue in list_new(before.issues, after.issues)}):
        if check in REPAIRS and check not in ON_REQUEST:
            issues = [issue for issue in after.issues if issue.check == check]
            changes = [change for edit in REPAIRS[check](after.site, issues) for change in edit.changes]
            after = look(apply_changes(after.site.text, changes, after.site.path))
    return after


def _inspect(data: bytes, path: Path, profile: Profile) -> State:
    road_map, known = read_network(data, path=path, name=path.name, sha256="")
    issues, _ = find_issues(road_map, None, known, profile)
    site = Site(facts=Facts(road_map), text=NetText(data, path), limits=profile.limits, path=path)
    return State(data=data, site=site, issues=issues, counts=_count(issues))


def _count(issues: Iterable[Issue]) -> dict[str, tuple[int, int]]:
    counts: dict[str, tuple[int, int]] = {}
    for issue in issues:
        count, errors = counts.get(issue.check, (0, 0))
        counts[issue.check] = (count + 1, errors + (issue.severity is Severity.ERROR))
    return counts
