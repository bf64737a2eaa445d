"""Known issues that a user has decided to live with: a file that names them, each with a reason.

    {"exclude": [{"check": "geometry.kink", "element": "lane 12_0", "reason": "a hairpin bend, looked at"}]}

`check` may end in `*`; without `element` the rule holds for every issue of the check.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from fnmatch import fnmatchcase
from pathlib import Path
from typing import Any

from dojo_maps.errors import SourceError
from dojo_maps.issue import Issue
from dojo_maps.safe_json import read_json


@dataclass(frozen=True, slots=True, kw_only=True)
class Exclusion:
    """One rule: issues of `check` whose first element is `element` are left out, for `reason`."""

    check: str
    reason: str
    element: str | None = None

    def covers(self, issue: Issue) -> bool:
        """Tell whether the rule is about an issue.

        Args:
            issue: of any check.

        Returns:
            Whether its check matches `check`, in which `*` stands for anything, and its first element is
            `element`, if the rule has one.
        """
        named = f"{issue.elements[0].kind} {issue.elements[0].id}" if issue.elements else ""
        return fnmatchcase(issue.check, self.check) and self.element in (None, named)


def read_exclusions(path: Path) -> tuple[Exclusion, ...]:
    """Read an exclusion file.

    Args:
        path: of a JSON file.

    Returns:
        The rules, in the file's order.

    Raises:
        SourceError: the file is missing or not in the format; a rule without a reason is refused.
    """
    value = read_json(path)
    rules = value.get("exclude") if isinstance(value, dict) else None
    if not isinstance(rules, list):
        raise SourceError(path, 'expected {"exclude": [{"check": ..., "element": ..., "reason": ...}]}')
    return tuple(_read_rule(rule, number, path) for number, rule in enumerate(rules, 1))


def split_excluded(
    issues: Iterable[Issue], exclusions: Sequence[Exclusion]
) -> tuple[list[Issue], list[tuple[Issue, str]]]:
    """Take the excluded issues out.

    Args:
        issues: all that were found.
        exclusions: the rules; the first one that covers an issue counts.

    Returns:
        The issues that are left, and those taken out, each with the reason of its rule; both in the order of
        `issues`.
    """
    kept: list[Issue] = []
    excluded: list[tuple[Issue, str]] = []
    for issue in issues:
        rule = next((rule for rule in exclusions if rule.covers(issue)), None)
        if rule is None:
            kept.append(issue)
        else:
            excluded.append((issue, rule.reason))
    return kept, excluded


def _read_rule(rule: Any, number: int, path: Path) -> Exclusion:
    known = isinstance(rule, dict) and set(rule) <= {"check", "element", "reason"}
    texts = known and all(isinstance(value, str) and value.strip() for value in rule.values())
    if not texts or not {"check", "reason"} <= set(rule):
        raise SourceError(
            path, "expected texts for check, reason and, if need be, element", element=f"rule {number}"
        )
    return Exclusion(**rule)
