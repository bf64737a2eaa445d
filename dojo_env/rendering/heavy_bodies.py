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
from dojo_env.rendering.shapes import Face, Part, box, lights, loft, mirrored, moved, section, windows

Floats = NDArray[np.float64]

_HALF = 1.25
"""Half of the widest width, metres."""
_GAP = 0.012
"""Metres from a body to what is painted on it."""
_ON_ROOF = 0.14
"""Height of what cools a bus on its roof, metres."""
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

    Returns:
        What gives its faces at a level of detail, 0 (finest) to 3.
    """
    low, top = sill * height, 0.82 * height

    def build(detail: int) -> list[Face]:
        faces = _chamfered(0.0, -length, _HALF, 0.32, height - _ON_ROOF, 0.16)
        faces += box(-0.22 * length, -0.5 * length, 0.75, height - _ON_ROOF - 0.02, height, Part.BODY)
        if detail == _COARSEST:
            return faces
        side = _along(-0.25, 0.35 - length, (low - 0.1, top + 0.08), Part.TRIM, _GAP / 2)
        faces += mirrored(side)
        faces += _front_glass(0.94, (0.27 * height, 0.8 * height), detail)
        faces += _across(-length, 0.82, (0.5 * height, 0.8 * height), Part.GLASS, ahead=False)
        faces += lights(-length, _HALF, (0.5, 0.76), (0.8, 1.25))
        if detail == _FAR:
            return faces + windows(-0.5, -length + 0.5, _HALF + _GAP, low, top)
        faces += _panes(-0.45, -length + 0.45, 1.55, low, top)
        faces += _bus_ends(length, height)
        faces += mirrored(_along(-0.4, 0.3 - length, (0.36, 0.52), Part.TRIM, _GAP / 2))
        faces += _mirrors(height)
        for axle in axles:
            faces += _axle(axle, detail)
        for door in doors:
            leaves, middle = (-door, -door - 1.25), (-door - 0.6, -door - 0.66)
            faces += _right_side(leaves, 0.4, top - 0.05, Part.TRIM, 1.5 * _GAP)
            for front in (door + 0.06, door + 0.69):
                faces += _right_side((-front, -front - 0.5), 0.55, top - 0.12, Part.GLASS, 2.5 * _GAP)
            faces += _right_side(middle, 0.4, top - 0.05, Part.TRIM, 3 * _GAP)
        return faces

    return build


def _bus_ends(length: float, height: float) -> list[Face]:
    """Put on nose and tail what shows from near: a display, plates, bumpers, the engine's grille."""
    faces = _across(_GAP, 0.94, (0.82 * height, 0.92 * height), Part.TRIM)
    for begin, end in ((-0.62, -0.42), (-0.3, 0.62)):
        faces += _strip(3 * _GAP, begin, end, (0.845 * height, 0.9 * height), Part.STRIPE)
    faces += _across(_GAP, 0.97, (0.33, 0.46), Part.TRIM) + _across(_GAP, 0.34, (0.56, 0.7), Part.TRIM)
    faces += _across(2 * _GAP, 0.2, (0.36, 0.47), Part.WHITE)
    back = -length - _GAP
    faces += _across(back, 0.2, (0.6, 0.71), Part.WHITE, ahead=False)
    faces += _across(back, 0.7, (0.9, 0.42 * height), Part.TRIM, ahead=False)
    faces += _across(back, 0.97, (0.34, 0.5), Part.TRIM, ahead=False)
    faces += _across(back, 0.3, (0.82 * height, 0.89 * height), Part.TRIM, ahead=False)
    return faces


def _front_glass(share: float, heights: tuple[float, float], detail: int) -> list[Face]:
    """Set in a windscreen: in its dark frame, and from near with seats, wipers and the middle's bar."""
    low, high = heights
    faces = _across(-_GAP / 2, share, (low - 0.05, high + 0.04), Part.TRIM)
    faces += _across(_GAP / 2, 0.96 * share, heights, Part.GLASS)
    if detail < _FAR:
        tall = high - low
        faces += _across(_GAP, 0.9 * share, (low, low + 0.1 * tall), Part.TRIM)
        for begin, end in ((0.28, 0.68), (-0.68, -0.28)):
            faces += _strip(1.5 * _GAP, begin, end, (low + 0.1 * tall, low + 0.5 * tall), Part.CABIN)
        faces += _across(1.5 * _GAP, 0.015, heights, Part.TRIM)
        for y in (-0.06, 0.5):
            x = 3 * _GAP
            wiper = [(x, y, low + 0.02), (x, y + 0.03, low + 0.02), (x, y + 0.36, low + 0.42 * tall),
                     (x, y + 0.33, low + 0.42 * tall)]  # fmt: skip
            faces.append((np.array(wiper), Part.TRIM))
    return faces


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

    Returns:
        What gives its faces at a level of detail, 0 (finest) to 3.
    """
    begin, low, high = load

    def build(detail: int) -> list[Face]:
        faces = _chamfered(0.0, -cab, 0.97 * _HALF, 0.45, height, 0.2)
        faces += box(-begin, -length, _HALF, low, high, Part.ACCENT)
        faces += box(-cab + 0.1, -length + 0.2, 0.45, 0.6, low + 0.01, Part.TRIM)
        if detail == _COARSEST:
            return faces
        faces += _front_glass(0.95, (0.53 * height, 0.83 * height), detail)
        faces += lights(-length, _HALF, (0.55, 0.82), (0.75, 1.0))
        faces += mirrored(_along(-0.3, -1.3, (0.5 * height, 0.83 * height), Part.TRIM, _GAP / 2))
        faces += windows(-0.36, -1.2, 0.97 * _HALF + _GAP, 0.52 * height, 0.81 * height)
        faces += _deflector(cab, height, high)
        if detail == _FAR:
            return faces
        faces += _lorry_nose(height) + _lorry_load(begin, length, low, high, axles)
        faces += _mirrors(0.95 * height)
        for axle in axles:
            faces += _axle(axle, detail)
        return faces

    return build


def build_road_train(detail: int) -> list[Face]:
    """Build a lorry with a trailer behind it, 18.75 m long.

    Args:
        detail: level of detail, 0 (finest) to 3.

    Returns:
        Its faces, metres.
    """
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
    """Build a fire engine, 8 m long: cab for a crew, lockers with roller shutters, a ladder on the roof.

    Args:
        detail: level of detail, 0 (finest) to 3.

    Returns:
        Its faces, metres.
    """
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


def _deflector(cab: float, height: float, high: float) -> list[Face]:
    """Lead the air over the load: a wedge on the roof of the cab."""
    top = min(high, height + 0.75)
    if top < height + 0.2:
        return []
    return loft(
        [section(-0.55, 0.8, height - 0.05, height), section(-0.75, 0.95, height - 0.05, height + 0.15),
         section(-cab + 0.05, 1.1, height - 0.05, top)],
        Part.BODY,
    )  # fmt: skip


def _lorry_nose(height: float) -> list[Face]:
    """Paint a cab's front: visor, grille with bars and badge, bumper, plate; and steps, doors and handles."""
    low, high = 0.86, 0.5 * height
    faces = _across(_GAP, 0.97, (0.84 * height, 0.88 * height), Part.TRIM)
    faces += _across(_GAP, 0.78, (low, high - 0.04), Part.TRIM)
    for z in np.arange(low + 0.08, high - 0.12, 0.13):
        faces += _across(2 * _GAP, 0.72, (z, z + 0.035), Part.CHROME)
    faces += _across(3 * _GAP, 0.12, (high - 0.32, high - 0.12), Part.CHROME)
    # Under the lamps, which lie 1 cm before the body.
    faces += _across(-_GAP / 2, 0.98, (0.47, 0.84), Part.TRIM) + _across(_GAP, 0.36, (0.66, 0.8), Part.BODY)
    faces += _across(2 * _GAP, 0.2, (0.5, 0.61), Part.WHITE)
    y = 0.97 * _HALF
    for front, rear, z, tall in ((0.3, 0.325, 0.55, 0.86 * height), (1.5, 1.525, 1.2, 0.86 * height)):
        quad = [(-front, tall), (-front, z), (-rear, z), (-rear, tall)]
        faces += mirrored([(np.array([(x, y + 1.5 * _GAP, h) for x, h in quad]), Part.TRIM)])
    for z in (0.5, 0.85):
        faces += mirrored(_along(-0.42, -0.95, (z, z + 0.2), Part.TRIM, _GAP))
    faces += mirrored(_along(-1.2, -1.42, (0.47 * height, 0.47 * height + 0.05), Part.TRIM, _GAP))
    return faces


def _lorry_load(begin: float, length: float, low: float, high: float, axles: Sequence[float]) -> list[Face]:
    """Put on a lorry's box its frame, doors and lamps, and side guards, a tank and an underrun bar below."""
    back, side = -length - _GAP, -begin - 0.02
    faces = _across(_GAP / 2 - length, 1.06, (low - 0.22, low), Part.TRIM, ahead=False)
    faces += _across(back - _GAP, 1.0, (0.52, 0.66), Part.CHROME, ahead=False)
    faces += _across(back - _GAP, 0.02, (low, high - 0.08), Part.TRIM, ahead=False)
    faces += _across(back, 1.06, (high - 0.09, high), Part.CHROME, ahead=False)
    faces += _across(back - 2 * _GAP, 0.22, (low - 0.17, low - 0.06), Part.WHITE, ahead=False)
    for y in (-1.02, -0.5, -0.06, 0.46):
        faces += _strip(back - 2 * _GAP, y, y + 0.045, (low - 0.1, high - 0.1), Part.CHROME, ahead=False)
    for y in (-1.12, 1.02):
        faces += _strip(back - _GAP, y, y + 0.1, (low, high), Part.CHROME, ahead=False)
    for z, tall in ((low, 0.1), (high - 0.08, 0.08)):
        faces += mirrored(_along(side, -length + 0.02, (z, z + tall), Part.CHROME, _GAP))
    faces += mirrored(_along(side, side - 0.08, (low, high), Part.CHROME, _GAP))
    faces += mirrored(_along(-length + 0.1, -length + 0.02, (low, high), Part.CHROME, _GAP))
    first = next(axle for axle in axles if axle > begin)
    last = axles[-2] if axles[-2] > first + 2.0 else first
    for front, rear in ((begin + 0.2, first - 0.75), (first + 0.75, last - 0.75)):
        if rear - front > 0.6:
            faces += mirrored(moved(box(-front, -rear, 0.03, 0.78, 0.94, Part.CHROME), 1.15))
            faces += mirrored(moved(box(-front, -rear, 0.03, 0.46, 0.62, Part.CHROME), 1.15))
    return faces + mirrored(moved(box(-begin - 0.1, -begin - 1.1, 0.3, 0.42, 1.0, Part.TRIM), 0.8))


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


def _strip(
    x: float, begin: float, end: float, heights: tuple[float, float], part: Part, *, ahead: bool = True
) -> list[Face]:
    """Paint a strip on the nose or the tail, from `begin` to `end` metres to the left."""
    (low, high), x = heights, x + (_GAP if ahead else -_GAP)
    quad = np.array([(x, begin, low), (x, end, low), (x, end, high), (x, begin, high)])
    return [(quad if ahead else quad[::-1], part)]


def _along(front: float, rear: float, heights: tuple[float, float], part: Part, gap: float) -> list[Face]:
    """Paint a strip on the left side, `gap` before it."""
    y, (low, high) = _HALF + gap, heights
    return [(np.array([(front, y, high), (front, y, low), (rear, y, low), (rear, y, high)]), part)]


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
