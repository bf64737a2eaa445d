"""Read numbers and shapes from XML attributes; a bad one is an error that names its element."""

import math
from pathlib import Path

from dojo_maps.description import Points, points
from dojo_maps.errors import SourceError
from dojo_maps.safe_xml import Attributes

_MAX_COORDINATE = 1e8
"""Metres; farther out, double precision no longer keeps the millimetre that meshes are made with."""
_MAX_POSITIONS = 5_000
"""In one shape: fifty times the longest in the networks that come with SUMO; an OSM way has at most 2,000."""
LARGEST = 1e12
"""The largest number that is read."""
MIN_WIDTH = 0.01
"""The least width of a lane or crossing that is read, metres."""


def read_text(attributes: Attributes, key: str, path: Path, what: str) -> str:
    """Read a text that must not be empty.

    Args:
        attributes: the element's.
        key: the attribute.
        path: where the network came from, for errors.
        what: names the element in errors, such as `lane A_0`.

    Returns:
        The text.

    Raises:
        SourceError: it is missing or empty.
    """
    if not attributes.get(key):
        raise SourceError(path, f"has no {key}", element=what)
    return attributes[key]


def read_float(
    attributes: Attributes,
    key: str,
    path: Path,
    what: str,
    *,
    default: float | None = None,
    least: float | None = None,
) -> float:
    """Read a finite number that is not below `least`.

    Args:
        attributes: the element's.
        key: the attribute.
        path: where the network came from, for errors.
        what: names the element in errors, such as `lane A_0`.
        default: taken, unchecked, where the attribute is missing; None makes that an error.
        least: the smallest that is taken; None for any.

    Returns:
        The number.

    Raises:
        SourceError: it is missing, no number, below `least`, or larger than any that is read.
    """
    text = attributes.get(key)
    if text is None:
        if default is None:
            raise SourceError(path, f"has no {key}", element=what)
        return default
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not math.isfinite(value) or abs(value) > LARGEST or (least is not None and value < least):
        bound = f" of at least {least:g}" if least is not None else ""
        raise SourceError(path, f"{key}={text[:80]!r}, expected a number{bound}", element=what)
    return value


def read_int(attributes: Attributes, key: str, path: Path, what: str, *, default: int | None = None) -> int:
    """Read a whole number.

    Args:
        attributes: the element's.
        key: the attribute.
        path: where the network came from, for errors.
        what: names the element in errors, such as `lane A_0`.
        default: taken where the attribute is missing; None makes that an error.

    Returns:
        The number; it may be below 0.

    Raises:
        SourceError: it is missing or no whole number.
    """
    text = attributes.get(key)
    if text is None and default is not None:
        return default
    try:
        return int(text or "")
    except ValueError:
        raise SourceError(
            path, f"{key}={(text or '')[:80]!r}, expected a whole number", element=what
        ) from None


def read_link(attributes: Attributes, path: Path, what: str) -> tuple[str, int] | tuple[None, None]:
    """Read a connection's signal and link index.

    Args:
        attributes: the connection's.
        path: where the network came from, for errors.
        what: names the connection in errors.

    Returns:
        Both, or None twice where it names no signal or an index below zero.

    Raises:
        SourceError: it names a signal, and its link index is missing or no whole number.
    """
    index = read_int(attributes, "linkIndex", path, what) if "tl" in attributes else -1
    return (attributes["tl"], index) if index >= 0 else (None, None)


def read_shape(text: str, path: Path, what: str) -> Points:
    """Read a SUMO position list, `x,y` or `x,y,z` by spaces.

    Args:
        text: the list.
        path: where the network came from, for errors.
        what: names the element in errors, such as `lane A_0`.

    Returns:
        (n, 3), metres, map frame, n >= 1; heights are 0 where there are none.

    Raises:
        SourceError: it has no position, too many, or one that is not two or three numbers within bounds.
    """
    positions = text.split()
    if len(positions) > _MAX_POSITIONS:
        raise SourceError(
            path,
            f"its shape has {len(positions)} positions, at most {_MAX_POSITIONS} are converted; thin it out "
            "with netconvert --geometry.min-dist",
            element=what,
        )
    try:
        rows = [[float(value) for value in position.split(",")] for position in positions]
        valid = bool(rows) and all(len(row) in (2, 3) for row in rows)
        valid = valid and all(abs(value) <= _MAX_COORDINATE for row in rows for value in row)
    except ValueError:
        valid = False
    if not valid:
        shown = text if len(text) <= 60 else f"{text[:60]}..."
        raise SourceError(path, f"shape={shown!r}, expected positions as x,y or x,y,z", element=what)
    return points([row if len(row) == 3 else [*row, 0.0] for row in rows])


def read_offset(text: str, path: Path, what: str) -> tuple[float, float]:
    """Read how far a network was moved, `x,y` or `x,y,z`; however far, nothing is drawn there.

    Args:
        text: the network's `netOffset`.
        path: where the network came from, for errors.
        what: names the element in errors.

    Returns:
        x and y, metres.

    Raises:
        SourceError: they are missing, no numbers, or not finite.
    """
    try:
        x, y, *_ = (float(value) for value in text.split(","))
    except ValueError:
        x = y = math.nan
    if not (math.isfinite(x) and math.isfinite(y)):
        raise SourceError(path, f"netOffset={text[:60]!r}, expected x,y", element=what)
    return (x, y)
