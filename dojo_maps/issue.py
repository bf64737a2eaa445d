"""What a check reports: one finding, with everything needed to look at it and to mend it."""

from dataclasses import dataclass
from enum import StrEnum
from html import escape
from typing import Any

from dojo_maps.wording import counted

_MOST_SHOWN = 50


class Severity(StrEnum):
    """How much a finding matters: an error blocks or is unsafe, a warning looks wrong, a note informs."""

    ERROR = "error"
    WARNING = "warning"
    NOTE = "note"


@dataclass(frozen=True, slots=True, kw_only=True)
class Element:
    """A thing of the map, by its list's name in the singular (`lane`, `connection`) and its id."""

    kind: str
    id: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Issue:
    """One finding of one check.

    Attributes:
        check: dotted id of the check, such as `topology.dangling_reference`.
        severity: how much it matters.
        elements: everything involved, the element at fault first.
        position: (x, y, z), metres, map frame.
        message: what is wrong, in a sentence.
        measured: the value found, if the check measures one.
        limit: the value expected, if there is one.
        hint: what to do about it.
    """

    check: str
    severity: Severity
    elements: tuple[Element, ...]
    position: tuple[float, float, float]
    message: str
    measured: float | None = None
    limit: float | None = None
    hint: str


class Report(dict[str, Any]):
    """What checks found, as JSON values; a notebook shows it as a table, worst first."""

    def __str__(self) -> str:
        """Count what was found."""
        return ", ".join(counted(self["counts"][severity], severity) for severity in Severity)

    def __repr__(self) -> str:
        """Tell of which map, and count what was found."""
        return f"Report({self['map']!r}: {self})"

    def _repr_html_(self) -> str:
        """Give what a notebook shows. Source: IPython's "rich display" protocol."""
        worst = sorted(self["issues"], key=lambda issue: list(Severity).index(issue["severity"]))
        rows = "".join(
            "<tr>" + "".join(f"<td>{escape(cell)}</td>" for cell in _tell(issue)) + "</tr>"
            for issue in worst[:_MOST_SHOWN]
        )
        more = f"; the first {_MOST_SHOWN} are shown" if len(worst) > _MOST_SHOWN else ""
        return f"<table><caption>{escape(self['map'])}: {self}{more}</caption>{rows}</table>"


def _tell(issue: dict[str, Any]) -> tuple[str, ...]:
    """Give the cells of an issue: how bad, which check, where, what, what to do."""
    where = " ".join(issue["elements"][0].values()) if issue["elements"] else ""
    return issue["severity"], issue["check"], where, issue["message"], issue["hint"]
