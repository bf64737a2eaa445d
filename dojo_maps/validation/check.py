"""What a check is: a pure function from the facts of a map to findings, with its card on it."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from enum import StrEnum

import numpy as np

from dojo_maps.issue import Element, Severity
from dojo_maps.validation.facts import Facts
from dojo_maps.validation.profiles import Limits

ERROR, WARNING, NOTE = Severity.ERROR, Severity.WARNING, Severity.NOTE


@dataclass(frozen=True, slots=True, kw_only=True)
class Finding:
    """One thing found.

    Attributes:
        elements: everything involved, the element at fault first.
        at: (x, y) or (x, y, z), metres, map frame, within 5 m of the element.
        message: what is wrong, in a sentence.
        measured: the value found, if one is measured.
        limit: the value expected, if there is one.
        severity: where it differs from the check's own.
    """

    elements: tuple[Element, ...]
    at: Iterable[float]
    message: str
    measured: float | None = None
    limit: float | None = None
    severity: Severity | None = None


Run = Callable[[Facts, Limits], Iterable[Finding]]


class Need(StrEnum):
    """What a check cannot do without, beyond the description."""

    NOTHING = ""
    MESHES = "the scene's meshes, which a bundle has: convert the map first"
    IMPORT = "an import from OpenStreetMap, OpenDRIVE or CityFlow, which counts what it could not build"
    SUMO = "SUMO's program, and a network that makes it read and write nothing else"
    OSM = "the OpenStreetMap data that the network was made from, which no network holds"


@dataclass(frozen=True, slots=True, kw_only=True)
class Check:
    """One check of the catalogue; those without `run` are made while the source is read.

    Attributes:
        id: the check's dotted name.
        code: its number in the catalogue.
        title: what holds where it finds nothing.
        severity: of its findings, unless a finding says otherwise.
        limit: in words.
        source: where the limit comes from.
        hint: what to do about a finding.
        run: the function.
        needs: what has to be there; without it the check is skipped.
    """

    id: str
    code: str
    title: str
    severity: Severity
    limit: str
    source: str
    hint: str
    run: Run | None = None
    needs: Need = Need.NOTHING


def check(
    *,
    id: str,  # noqa: A002 - a check's name is its id wherever one meets it
    code: str,
    title: str,
    severity: Severity,
    limit: str,
    source: str,
    hint: str,
    needs: Need = Need.NOTHING,
) -> Callable[[Run], Check]:
    """Put a card on a function, which makes it a check of its module.

    Args:
        id: the check's dotted name; before the dot stands one of the report's themes, as `geometry`.
        code: its number in the catalogue, by which the checks of a theme are sorted.
        title: what holds where it finds nothing.
        severity: of findings that do not say otherwise.
        limit: in words.
        source: where the limit comes from.
        hint: what to do about a finding.
        needs: what has to be there; without it the check is skipped.

    Returns:
        What puts the card on: it takes the function and gives the check that runs it.
    """

    def put_on(run: Run) -> Check:
        return Check(
            id=id,
            code=code,
            title=title,
            severity=severity,
            limit=limit,
            source=source,
            hint=hint,
            run=run,
            needs=needs,
        )

    return put_on


def element(kind: str, *ids: str) -> tuple[Element, ...]:
    """Name things of one kind.

    Args:
        kind: `lane`, `junction` and so on, as in `Element`.
        ids: of any number of them.

    Returns:
        An element for each id, in their order.
    """
    return tuple(Element(kind=kind, id=id_) for id_ in ids)


def place(values: Iterable[float]) -> tuple[float, float, float]:
    """Make a position of (x, y) or (x, y, z).

    Args:
        values: metres, map frame.

    Returns:
        (x, y, z), metres, map frame; z is 0 where there was none.
    """
    x, y, *z = np.asarray(values, dtype=np.float64).tolist()
    return (x, y, z[0] if z else 0.0)
