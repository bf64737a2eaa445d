"""What a check reports: one finding, with everything needed to look at it and to mend it."""

from dataclasses import dataclass
from enum import StrEnum


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
