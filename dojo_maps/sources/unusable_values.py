"""Values that SUMO loads and no map can be drawn with: each gets a substitute and becomes an issue.

Only a network that cannot be read as it is comes here, and its records are changed in place. Text that is no
number at all stays, since SUMO refuses it, too.
"""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from dojo_maps.errors import SourceError
from dojo_maps.issue import Element, Issue, Severity
from dojo_maps.safe_xml import Attributes
from dojo_maps.sources.limits import HIGHEST, MAX_WIDTH, WIDEST
from dojo_maps.sources.sumo_xml import EdgeRecord, NetRecords
from dojo_maps.sources.values import LARGEST, MIN_WIDTH, read_shape

CHECK = "geometry.unusable_value"
_SPEED = "13.89"
"""SUMO's default, metres a second."""

Place = tuple[float, float]


@dataclass(frozen=True, slots=True)
class _Owner:
    """An element as an issue names it, and its attributes."""

    element: Element
    attributes: Attributes


def replace_unusable(records: NetRecords, path: Path) -> tuple[Issue, ...]:
    """Replace what cannot be drawn, in the records themselves.

    Widths become SUMO's defaults, speeds 13.89 m/s, lengths those of the shapes; lanes are numbered in their
    order; positions without end or hundreds of kilometres away are left out, and such heights are 0.

    Args:
        records: the network's elements, changed in place.
        path: where the network came from, for errors.

    Returns:
        An issue for each value.
    """
    middle = _middle(records.junctions)
    return tuple(
        _issue(owner.element, key, text, substitute, _place_of(owner.attributes, middle))
        for owner, key, text, substitute in _replace(records, middle, path)
    )


def _replace(records: NetRecords, middle: Place, path: Path) -> Iterator[tuple[_Owner, str, str, str | None]]:
    """Replace values; gives each one's owner, key, text as it was, and substitute, None for the default."""
    yield from _replace_offset(records.location)
    for edge in records.edges:
        function = edge.attributes.get("function", "normal")
        yield from _replace_indices(edge)
        for lane in edge.lanes:
            owner = _Owner(_name(edge, lane, function), lane)
            yield from _replace_shape(owner, middle, least=2 if function != "walkingarea" else 1)
            if function in ("normal", "connector", "crossing"):
                yield from _replace_number(owner, "width", MIN_WIDTH, MAX_WIDTH, None)
            yield from _replace_number(owner, "speed", 0.0, LARGEST, _SPEED)
            yield from _replace_number(owner, "length", 0.0, LARGEST, _drawn_length(lane, path))
    for junction in records.junctions:
        owner = _Owner(Element(kind="junction", id=junction.get("id", "")), junction)
        yield from _replace_shape(owner, middle, least=0)
        for key, at in zip("xy", middle, strict=True):
            yield from _replace_number(owner, key, at - WIDEST / 2, at + WIDEST / 2, f"{at:.2f}")
        yield from _replace_number(owner, "z", -HIGHEST, HIGHEST, "0")


def _replace_offset(location: Attributes) -> Iterator[tuple[_Owner, str, str, str]]:
    text = location.get("netOffset", "0,0")
    if any(word in text.lower() for word in ("nan", "inf")):
        location["netOffset"] = "0,0"
        yield _Owner(Element(kind="location", id="netOffset"), location), "netOffset", text, "0,0"


def _name(edge: EdgeRecord, lane: Attributes, function: str) -> Element:
    kinds = {"crossing": "crossing", "walkingarea": "walking_area"}
    if function in kinds:
        return Element(kind=kinds[function], id=edge.attributes.get("id", ""))
    return Element(kind="lane", id=lane.get("id", ""))


def _replace_indices(edge: EdgeRecord) -> Iterator[tuple[_Owner, str, str, str]]:
    """Number lanes in the order in which they stand, as SUMO does."""
    if sorted(lane.get("index", "") for lane in edge.lanes) == sorted(map(str, range(len(edge.lanes)))):
        return
    for number, lane in enumerate(edge.lanes):
        text = lane.get("index", "")
        if text != str(number):
            lane["index"] = str(number)
            yield _Owner(Element(kind="lane", id=lane.get("id", "")), lane), "index", text, str(number)


def _replace_number(
    owner: _Owner, key: str, least: float, most: float, substitute: str | None
) -> Iterator[tuple[_Owner, str, str, str | None]]:
    text = owner.attributes.get(key)
    try:
        value = least if text is None else float(text)
    except ValueError:
        return
    if text is None or least <= value <= most:
        return
    if substitute is None:
        del owner.attributes[key]
    else:
        owner.attributes[key] = substitute
    yield owner, key, text, substitute


def _replace_shape(owner: _Owner, middle: Place, *, least: int) -> Iterator[tuple[_Owner, str, str, str]]:
    """Leave out positions that are not near the network, and repeat what is left up to `least` positions."""
    text = owner.attributes.get("shape", "")
    try:
        rows = [[float(value) for value in position.split(",")] for position in text.split()]
    except ValueError:
        return
    kept = [_level(row) for row in rows if _is_near(row, middle)]
    if kept == rows:
        return
    kept = (kept or ([list(middle)] if least else [])) * (1 if len(kept) >= least else least)
    owner.attributes["shape"] = " ".join(",".join(map(str, row)) for row in kept)
    yield owner, "shape", text, owner.attributes["shape"]


def _is_near(row: Sequence[float], middle: Place) -> bool:
    return all(abs(value - at) <= WIDEST / 2 for value, at in zip(row[:2], middle, strict=False))


def _level(row: list[float]) -> list[float]:
    return row if all(abs(height) <= HIGHEST for height in row[2:]) else [*row[:2], 0.0]


def _drawn_length(lane: Attributes, path: Path) -> str:
    try:
        shape = read_shape(lane.get("shape", ""), path, "")
    except SourceError:
        return "0"
    return f"{np.hypot(*np.diff(shape[:, :2], axis=0).T).sum():.2f}"


def _middle(junctions: Sequence[Attributes]) -> Place:
    """Take the median of the junctions' positions, metres, which a few misplaced ones do not move."""
    places = [place for place in map(_position, junctions) if place]
    x, y = np.median(places, axis=0).tolist() if places else (0.0, 0.0)
    return (x, y)


def _position(junction: Attributes) -> Place | None:
    try:
        place = (float(junction["x"]), float(junction["y"]))
    except (KeyError, ValueError):
        return None
    return place if all(math.isfinite(value) for value in place) else None


def _place_of(attributes: Attributes, middle: Place) -> Place:
    first = next(iter(attributes.get("shape", "").split()), "")
    x, y, *_ = (float(value) for value in first.split(",")) if first else _position(attributes) or middle
    return (x, y)


def _issue(element: Element, key: str, text: str, substitute: str | None, at: Place) -> Issue:
    shown = text if len(text) <= 60 else f"{text[:60]}..."
    instead = "SUMO's default" if substitute is None else repr(substitute[:60])
    return Issue(
        check=CHECK,
        severity=Severity.ERROR,
        elements=(element,),
        position=(*at, 0.0),
        message=f"the {element.kind} {element.id} has {key}={shown!r}, which cannot be drawn; "
        f"{instead} is taken",
        hint="give it a value that a street can have, then rebuild with netconvert",
    )
