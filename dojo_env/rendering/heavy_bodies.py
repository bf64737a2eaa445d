"""Bodies of buses, coaches and lorries: chamfered boxes with rows of panes, cabs, lamps and wheels.

Lengths are metres, x points to the nose and is 0 there, y to the left, z up; faces turn counter-clockwise,
from outside.
"""

from collections.abc import Callable, Sequence
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from dojo_env.rendering.car_bodies import FINE
from dojo_env.rendering.car_details import build_wheels
from dojo_env.rendering.shapes import Face, Part, box, lights, loft, mirrored, moved, windows

Floats = NDArray[np.float64]

_HALF = 1.25
"""Half of the widest width, metres."""
_GAP = 0.012
"""Metres from a body to what is painted on it."""
_FAR, _COARSEST = 2, 3
"""Levels of detail with fewer parts."""


def build_bus(
    length: float, height: float, axles: Sequence[float], *, doors: Sequence[float] = (), sill: float = 0.36
) -> Callable[[int], list[Face]]:
    """Tell how to build a bus or a coach.

    Args:
        length: metres.
        height: metres.
        axles: places of the axles, metres behind the nose.
        doors: places of the doors' front edges on the right side, metres behind the nose.
        sill: height of the windows' lower edge, as a share of the height.
    """
    low, top = sill * height, 0.84 * height

    def build(detail: int) -> list[Face]:
        faces = _chamfered(0.0, -length, _HALF, 0.32, height, 0.16)
        if detail == _COARSEST:
            return faces
        faces += _across(0.0, 0.9, (0.3 * height, 0.8 * height), Part.GLASS)
        faces += _across(-length, 0.8, (0.48 * height, 0.8 * height), Part.GLASS, ahead=False)
        faces += lights(-length, _HALF, (0.55, 0.78), (0.75, 1.1))
        if detail == _FAR:
            return faces + windows(-0.5, -length + 0.5, _HALF + _GAP, low, top)
        faces += _panes(-0.45, -length + 0.45, 1.5, low, top)
        faces += _across(_GAP, 0.72, (0.83 * height, 0.93 * height), Part.TRIM)
        faces += _across(2 * _GAP, 0.4, (0.855 * height, 0.905 * height), Part.RIGHT)
        faces += _across(_GAP, 0.2, (0.38, 0.49), Part.WHITE) + _across(
            -length - _GAP, 0.2, (0.6, 0.71), Part.WHITE, ahead=False
        )
        faces += _across(-length - _GAP, 0.7, (0.9, 0.4 * height), Part.TRIM, ahead=False)
        faces += _mirrors(height)
        for axle in axles:
            faces += _axle(axle, detail)
        for door in doors:
            leaves, middle = (-door, -door - 1.25), (-door - 0.6, -door - 0.66)
            faces += _right_side(leaves, 0.4, top - 0.05, Part.GLASS, 2 * _GAP)
            faces += _right_side(middle, 0.4, top - 0.05, Part.TRIM, 3 * _GAP)
        return faces

    return build


def build_lorry(
    length: float, cab: float, load: tuple[float, float, float], axles: Sequence[float], height: float
) -> Callable[[int], list[Face]]:
    """Tell how to build a lorry or an articulated one.

    Args:
        length: metres.
        cab: length of the cab, metres.
        load: begin of the load's box behind the nose, its lower and upper edge, metres.
        axles: places of the axles, metres behind the nose.
        height: of the cab, metres.
    """
    begin, low, high = load

    def build(detail: int) -> list[Face]:
        faces = _chamfered(0.0, -cab, 0.97 * _HALF, 0.45, height, 0.2)
        faces += box(-begin, -length, _HALF, low, high, Part.WHITE)
        faces += box(-cab + 0.1, -length + 0.2, 0.45, 0.6, low + 0.01, Part.TRIM)
        if detail == _COARSEST:
            return faces
        faces += _across(0.0, 0.9, (0.52 * height, 0.84 * height), Part.GLASS)
        faces += lights(-length, _HALF, (0.6, 0.85), (0.75, 1.0))
        faces += windows(-0.35, -1.15, 0.97 * _HALF + _GAP, 0.52 * height, 0.82 * height)
        if detail == _FAR:
            return faces
        faces += _across(_GAP, 0.75, (0.9, 0.48 * height), Part.TRIM) + _across(
            _GAP, 0.9, (0.47, 0.58), Part.TRIM
        )
        for z in (1.0, 1.15, 1.3):
            faces += _across(2 * _GAP, 0.7, (z, z + 0.03), Part.CHROME)
        faces += _across(2 * _GAP, 0.2, (0.62, 0.73), Part.WHITE)
        faces += _across(-length - _GAP, 0.98, (low - 0.25, low - 0.12), Part.TRIM, ahead=False)
        faces += _across(-length - 2 * _GAP, 0.02, (low, high), Part.TRIM, ahead=False)
        faces += _mirrors(0.95 * height)
        for axle in axles:
            faces += _axle(axle, detail)
        skirt = box(-begin - 0.3, -length + 2.6, 0.96 * _HALF, 0.5, low, Part.TRIM)
        return faces + skirt

    return build


def _chamfered(nose: float, tail: float, half: float, low: float, high: float, cut: float) -> list[Face]:
    """Make a box whose edges are cut off along the roof and at both ends."""

    def ring(x: float, wide: float, top: float) -> Floats:
        return np.array(
            [(x, -0.97 * wide, low), (x, 0.97 * wide, low), (x, wide, low + 0.3), (x, wide, top - cut),
             (x, wide - 0.8 * cut, top), (x, cut - wide, top), (x, -wide, top - cut), (x, -wide, low + 0.3)]
        )  # fmt: skip

    ends = [(nose, 0.92, 0.12), (nose - 0.12, 0.985, 0.03), (nose - 0.4, 1.0, 0.0),
            (tail + 0.25, 1.0, 0.0), (tail, 0.95, 0.06)]  # fmt: skip
    return loft([ring(x, share * half, high - drop) for x, share, drop in ends], Part.BODY)


def _across(
    x: float, share: float, heights: tuple[float, float], part: Part, *, ahead: bool = True
) -> list[Face]:
    """Paint a strip across the nose or the tail."""
    y, (low, high) = share * 0.92 * _HALF, heights
    x += _GAP if ahead else -_GAP
    quad = np.array([(x, -y, low), (x, y, low), (x, y, high), (x, -y, high)])
    return [(quad if ahead else quad[::-1], part)]


def _panes(nose: float, tail: float, pitch: float, low: float, high: float) -> list[Face]:
    """Paint a row of side windows with pillars between them."""
    cuts = np.linspace(nose, tail, 1 + max(1, round((nose - tail) / pitch)))
    faces: list[Face] = []
    for a, b in pairwise(cuts):
        faces += windows(a - 0.04, b + 0.04, _HALF + _GAP, low, high)
    return faces


def _right_side(ends: tuple[float, float], low: float, high: float, part: Part, gap: float) -> list[Face]:
    """Paint a strip on the right side, `gap` before it."""
    (a, b), y = ends, -_HALF - gap
    return [(np.array([(a, y, low), (a, y, high), (b, y, high), (b, y, low)]), part)]


def _mirrors(height: float) -> list[Face]:
    """Hang a mirror before each front corner."""
    mirror = box(0.12, 0.0, 0.11, 0.62 * height, 0.78 * height, Part.TRIM)
    return mirrored(moved(mirror, _HALF + 0.06))


def _axle(place: float, detail: int) -> list[Face]:
    """Set wheels in dark arches."""
    radius = 0.5
    turns = np.linspace(np.pi, 0.0, 7)
    reach, middle = radius + 0.08, radius + 0.05
    outline = [(-place + reach * np.cos(t), _HALF + _GAP / 2, middle + reach * np.sin(t)) for t in turns]
    arch = [(np.array(outline), Part.TRIM)]
    return mirrored(arch) + build_wheels(-place, _HALF + 2 * _GAP, radius, 14 if detail == FINE else 8)
