"""Bodies of buses, coaches and lorries: chamfered boxes with rows of panes, cabs, lamps and wheels.

Lengths are metres, x points to the nose and is 0 there, y to the left, z up; faces turn counter-clockwise,
from outside.
"""

from collections.abc import Callable, Sequence
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from dojo_env.rendering.car_bodies import FINE, build_wheels
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
        faces += box(-begin, -length, _HALF, low, high, Part.ACCENT)
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


def build_road_train(detail: int) -> list[Face]:
    """Build a lorry with a trailer behind it, 18.75 m long."""
    lorry = build_lorry(10.2, 2.2, (2.45, 1.05, 3.9), (1.4, 6.6, 7.8), 3.3)(detail)
    faces = [(c, part) for c, part in lorry if c[..., 0].max() > -9.0 or part not in _REAR_LAMPS]
    nose, tail = -11.7, -18.75
    faces += box(nose, tail, _HALF, 1.05, 3.9, Part.ACCENT) + box(
        -9.9, nose - 0.3, 0.12, 0.6, 0.75, Part.TRIM
    )
    if detail == _COARSEST:
        return faces
    faces += box(nose - 0.1, tail + 0.2, 0.45, 0.6, 1.06, Part.TRIM)
    faces += [(c, part) for c, part in lights(tail, _HALF, (0.6, 0.85), (0.75, 1.0)) if c[0, 0] < nose]
    if detail == _FAR:
        return faces
    faces += _across(tail - _GAP, 0.98, (0.8, 0.93), Part.TRIM, ahead=False)
    faces += _across(tail - 2 * _GAP, 0.02, (1.05, 3.9), Part.TRIM, ahead=False)
    return faces + [face for axle in (12.7, 16.3, 17.4) for face in _axle(axle, detail)]


_REAR_LAMPS = (Part.BRAKE, Part.LEFT, Part.RIGHT)
_SHUTTERS = ((3.35, 4.65), (4.8, 6.55), (6.7, 7.85))
"""Begin and end of a fire engine's lockers, metres behind the nose."""


def build_fire_engine(detail: int) -> list[Face]:
    """Build a fire engine, 8 m long: cab for a crew, lockers with roller shutters, a ladder on the roof."""
    cab, length, roof, high = 3.1, 8.0, 2.95, 3.05
    faces = _chamfered(0.0, -cab, _HALF, 0.45, roof, 0.2)
    faces += box(-cab - 0.08, -length, _HALF, 0.5, high, Part.BODY)
    faces += box(-cab + 0.1, -cab - 0.2, 1.1, 0.6, 2.6, Part.TRIM)
    faces += mirrored(moved(box(-0.5, -0.85, 0.42, roof - 0.05, 3.3, Part.BLUE), 0.62))
    if detail == _COARSEST:
        return faces
    faces += _across(0.0, 0.92, (0.56 * roof, 0.87 * roof), Part.GLASS)
    faces += lights(-length, _HALF, (0.72, 0.95), (0.72, 1.0))
    faces += _stripes(-0.45, 0.3 - cab, (1.16, 1.34), Part.STRIPE)
    faces += _stripes(-0.45, 0.3 - cab, (0.98, 1.1), Part.WHITE)
    faces += _across(_GAP, 0.98, (0.46, 0.68), Part.WHITE)
    for front, rear in ((0.35, 1.35), (1.75, 2.75)):
        faces += windows(-front, -rear, _HALF + _GAP, 0.56 * roof, 0.86 * roof)
    faces += [face for each in _SHUTTERS for face in _locker(*each, high, detail)]
    faces += _ladder(-1.0, -length + 0.1, high, detail)
    if detail == _FAR:
        return faces
    faces += _stripes(-3.25, 0.05 - length, (0.98, 1.1), Part.STRIPE)
    for k in range(9):  # The back of a fire engine is barred, for who drives up behind it.
        part, y, x = (Part.STRIPE, Part.BODY)[k % 2], 1.08 - 0.24 * k, -length - _GAP
        corners = [(x, y, 1.4), (x, y - 0.24, 1.4), (x, y - 0.24, 1.05), (x, y, 1.05)]
        faces.append((np.array(corners), part))
    faces += _across(-length, 0.75, (1.45, 2.75), Part.CHROME, ahead=False)
    for z in np.arange(1.55, 2.7, 0.13):
        faces += _across(-length - _GAP, 0.75, (z, z + 0.02), Part.TRIM, ahead=False)
    faces += _across(_GAP, 0.55, (0.8, 1.5), Part.TRIM) + _across(2 * _GAP, 0.4, (1.2, 1.4), Part.CHROME)
    faces += _across(2 * _GAP, 0.2, (0.5, 0.61), Part.WHITE)
    faces += mirrored(moved(box(0.35 - length, 0.1 - length, 0.12, high - 0.02, 3.25, Part.BLUE), 1.05))
    for door in (0.25, 1.55, 2.9):
        faces += _stripes(-door, -door - 0.025, (0.6, 0.86 * roof), Part.TRIM, 2 * _GAP)
    return faces + _mirrors(0.95 * roof) + _axle(1.35, detail) + _axle(5.7, detail)


def _stripes(
    front: float, rear: float, heights: tuple[float, float], part: Part, gap: float = 1.5 * _GAP
) -> list[Face]:
    """Paint a strip along both sides."""
    y, (low, high) = _HALF + gap, heights
    left = np.array([(front, y, high), (front, y, low), (rear, y, low), (rear, y, high)])
    return mirrored([(left, part)])


def _locker(front: float, rear: float, high: float, detail: int) -> list[Face]:
    """Close a locker on each side by a roller shutter; over a wheel it is shorter."""
    low = 1.25 if front < 5.7 < rear else 0.62
    faces = _stripes(-front, -rear, (low, high - 0.25), Part.CHROME, _GAP)
    if detail < _FAR:
        for z in np.arange(low + 0.12, high - 0.3, 0.14):
            faces += _stripes(-front, -rear, (z, z + 0.02), Part.TRIM)
    return faces


def _ladder(front: float, rear: float, low: float, detail: int) -> list[Face]:
    """Lay a ladder on the roof, right of the middle."""
    faces: list[Face] = []
    for y in (0.15, 0.7):
        faces += moved(box(front, rear, 0.035, low + 0.08, low + 0.2, Part.CHROME), y)
    rungs = np.arange(rear + 0.2, front, 0.4) if detail < _FAR else ()
    for x in rungs:
        faces += moved(box(x + 0.03, x - 0.03, 0.28, low + 0.11, low + 0.17, Part.CHROME), 0.425)
    for x in (rear + 0.5, front - 1.4, front - 3.5):
        faces += moved(box(x + 0.05, x - 0.05, 0.4, low - 0.05, low + 0.09, Part.TRIM), 0.425)
    return faces


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
