"""Weigh an edit: what it mends against what it brings, by severity.

An error may be mended at the price of a warning or a note, a warning at that of a note; nothing is mended at
the price of something as severe. Issues are told apart one by one, so none hides behind another that goes.
"""

from collections import defaultdict
from collections.abc import Callable, Collection, Iterable, Sequence
from typing import Any

from dojo_maps.issue import Element, Issue, Severity

_RANK = {Severity.NOTE: 1, Severity.WARNING: 2, Severity.ERROR: 3}


def find_objection(
    check: str, before: Sequence[Issue], after: Sequence[Issue], uncovered: Collection[Element] = ()
) -> tuple[str, bool]:
    """Say why an edit for a check is not worth it.

    Args:
        check: what it is to mend.
        before: the network's issues without it.
        after: those with it.
        uncovered: elements that could not be checked before; what is found there was only hidden.

    Returns:
        The reason, empty where the edit is worth it; and whether something new is found at all.
    """
    new = [issue for issue in list_new(before, after) if not {*uncovered} & {*issue.elements}]
    worst = max(new, key=_rank, default=None)
    gained = _gained(check, before, after)
    if worst is not None and _rank(worst) >= gained:
        return f"it would bring the {worst.severity} {worst.check}: {worst.message}", True
    return "" if gained else "it would not help", bool(new)


def list_new(before: Iterable[Issue], after: Iterable[Issue]) -> list[Issue]:
    """List the issues that were not there: none as severe of the same check had their element or place.

    Args:
        before: the network's issues without an edit.
        after: those with it.

    Returns:
        Those of `after` that are new, most severe first.
    """
    old, new = list(before), list(after)
    for key in (_fault, _place):
        old, new = _pair_off(old, new, key)
    return new


def _pair_off(
    old: Iterable[Issue], new: Iterable[Issue], key: Callable[[Issue], Any]
) -> tuple[list[Issue], list[Issue]]:
    """Take away each new issue with an old one of the same key that is as severe; what is left of both."""
    waiting: dict[Any, list[Issue]] = defaultdict(list)
    for issue in sorted(old, key=_rank):
        waiting[key(issue)].append(issue)
    left = []
    for issue in sorted(new, key=_rank, reverse=True):
        same = waiting[key(issue)]
        if same and _rank(same[-1]) >= _rank(issue):
            same.pop()
        else:
            left.append(issue)
    return [issue for same in waiting.values() for issue in same], left


def _gained(check: str, before: Iterable[Issue], after: Iterable[Issue]) -> int:
    """Rank the most severe of a check's issues that got fewer; 0 if none did."""
    ranks = [[_rank(issue) for issue in issues if issue.check == check] for issues in (before, after)]
    fewer = (
        rank for rank in _RANK.values() if sum(k >= rank for k in ranks[1]) < sum(k >= rank for k in ranks[0])
    )
    return max(fewer, default=0)


def _rank(issue: Issue) -> int:
    return _RANK[issue.severity]


def _fault(issue: Issue) -> tuple[str, Element | None]:
    return issue.check, issue.elements[0] if issue.elements else None


def _place(issue: Issue) -> tuple[str, tuple[float, float, float]]:
    return issue.check, issue.position
