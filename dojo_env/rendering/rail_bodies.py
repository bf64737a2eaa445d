"""Bodies of trams and trains: rounded ends, bands of windows, doors, bogies, lamps and a pantograph.

Lengths are metres, x points to the nose and is 0 there, y to the left, z up; faces turn counter-clockwise,
from outside. SUMO moves a tram as one straight piece, so its sections stay in line.
"""

from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from dojo_env.rendering.shapes import Face, Part, box, disc, loft, mirrored, tube, windows

Floats = NDArray[np.float64]

_FAR, _COARSEST = 2, 3
"""Levels of detail with fewer parts."""
_GAP, _JOINT = 0.012, 0.35
"""Metres from a body to what is painted on it, and between two sections."""


@dataclass(frozen=True, slots=True, kw_only=True)
class RailShape:
    """Measures of a tram or a train, metres.

    Attributes:
        length: from end to end.
        width: of the body.
        height: of the roof.
        sections: pieces of equal length, with bellows between them.
        floor: height of the body's lower edge.
        nose: length of each rounded end.
        doors: on each side of a section.
        stripe: a bright band runs under the windows.
    """

    length: float
    width: float
    height: float
    sections: int
    floor: float = 0.32
    nose: float = 1.3
    doors: int = 2
    stripe: bool = False


def build_rail(shape: RailShape) -> Callable[[int], list[Face]]:
    """Tell how to build a tram or a train.

    Args:
        shape: its measures.

    Returns:
        What gives its faces at a level of detail, 0 (finest) to 3.
    """

    def build(detail: int) -> list[Face]:
        cut = shape.length / shape.sections
        faces: list[Face] = []
        for k in range(shape.sections):
            nose, tail = -k * cut, -(k + 1) * cut
            ends = k == 0, k == shape.sections - 1
            faces += _section(shape, nose, tail, ends, detail)
            if k:
                faces += box(
                    nose + _JOINT, nose - _JOINT, 0.44 * shape.width, 0.5, 0.94 * shape.height, Part.TRIM
                )
        if detail < _COARSEST:
            faces += _end(shape, detail)
            faces += _turned(_end(shape, detail, rear=True), shape.length)
            faces += _pantograph(shape, -cut * (shape.sections // 2 + 0.5), detail)
        return faces

    return build


def _turned(faces: list[Face], length: float) -> list[Face]:
    """Turn a front end round to be the rear end."""
    about = np.array([-1.0, -1.0, 1.0])
    return [(corners * about - [length, 0.0, 0.0], part) for corners, part in faces]


def _ring(shape: RailShape, x: float, share: float, drop: float) -> Floats:
    """Cut the body: eight corners, narrower and lower by a share and by metres towards the ends."""
    half, low, high = 0.5 * shape.width * share, shape.floor + 0.3 * drop, shape.height - drop
    return np.array(
        [(x, -0.94 * half, low), (x, 0.94 * half, low), (x, half, low + 0.35), (x, half, high - 0.5),
         (x, 0.78 * half, high), (x, -0.78 * half, high), (x, -half, high - 0.5), (x, -half, low + 0.35)]
    )  # fmt: skip


def _rounded(shape: RailShape) -> list[tuple[float, float, float]]:
    """List the cuts of a rounded end: metres behind its tip, share of the width, drop of the roof."""
    return [(0.0, 0.62, 0.75), (0.12, 0.76, 0.5), (0.4 * shape.nose, 0.9, 0.2), (shape.nose, 1.0, 0.0)]


def _section(shape: RailShape, nose: float, tail: float, ends: tuple[bool, bool], detail: int) -> list[Face]:
    cuts = _rounded(shape) if detail < _COARSEST else [(0.0, 0.8, 0.4), (shape.nose, 1.0, 0.0)]
    front = [(nose - x, share, drop) for x, share, drop in cuts] if ends[0] else [(nose - 0.2, 1.0, 0.0)]
    rear = [(tail + x, share, drop) for x, share, drop in cuts[::-1]] if ends[1] else [(tail + 0.2, 1.0, 0.0)]
    faces = loft([_ring(shape, *each) for each in (*front, *rear)], Part.BODY)
    begin = nose - (shape.nose + 0.25 if ends[0] else 0.7)
    end = tail + (shape.nose + 0.25 if ends[1] else 0.7)
    if detail == _COARSEST:
        return faces
    half, low, high = 0.5 * shape.width + _GAP, 0.42 * shape.height, shape.height - 0.72
    faces += _side(begin, end, half, low, high, detail, shape.doors)
    if shape.stripe:
        faces += _band(begin, end, half, low - 0.3, low - 0.12, Part.WHITE)
    middle = 0.5 * (nose + tail)
    for x in (nose - 0.2 * (nose - tail), tail + 0.2 * (nose - tail)) if shape.floor > 0.5 else (middle,):
        faces += _bogie(shape, x, detail)
    if detail < _FAR:
        faces += box(
            middle + 1.6,
            middle - 1.6,
            0.32 * shape.width,
            shape.height - 0.02,
            shape.height + 0.22,
            Part.CHROME,
        )
    return faces


def _band(a: float, b: float, half: float, low: float, high: float, part: Part) -> list[Face]:
    left = np.array([(a, half, low), (b, half, low), (b, half, high), (a, half, high)])
    return mirrored([(left, part)])


def _side(
    begin: float, end: float, half: float, low: float, high: float, detail: int, doors: int
) -> list[Face]:
    """Paint windows, and doors that reach to the floor, on both sides."""
    if detail == _FAR:
        return windows(begin, end, half, low, high)
    length, wide = begin - end, 1.3
    middles = [begin - length * (k + 0.5) / doors for k in range(doors)]
    faces: list[Face] = []
    edges = [
        begin,
        *(x for middle in middles for x in (middle + wide / 2 + 0.1, middle - wide / 2 - 0.1)),
        end,
    ]
    for a, b in zip(edges[::2], edges[1::2], strict=True):
        panes = np.linspace(a, b, 1 + max(1, round((a - b) / 1.6)))
        for front, rear in pairwise(panes):
            faces += windows(front - 0.05, rear + 0.05, half, low, high)
    for middle in middles:
        faces += _band(middle + wide / 2, middle - wide / 2, half, 0.5, high, Part.TRIM)
        for a, b in ((wide / 2 - 0.06, 0.03), (-0.03, 0.06 - wide / 2)):
            faces += _band(middle + a, middle + b, half + _GAP, 0.6, high - 0.06, Part.GLASS)
    return faces


def _bogie(shape: RailShape, x: float, detail: int) -> list[Face]:
    """Set two axles under the body."""
    faces = box(x + 1.1, x - 1.1, 0.4 * shape.width, 0.14, shape.floor + 0.05, Part.TRIM)
    if detail >= _FAR:
        return faces
    half = 0.42 * shape.width
    for axle in (x + 0.85, x - 0.85):
        faces += mirrored(disc((axle, half, 0.33), 0.33, 0.02, 12, Part.TYRE)[:1])
    return faces


def _end(shape: RailShape, detail: int, *, rear: bool = False) -> list[Face]:
    """Paint an end: a large windscreen, the sign over it, and lamps."""
    half, high = 0.5 * shape.width, shape.height
    reach = 0.66 * half
    low, top = 0.43 * high, high - 0.8
    tip = _GAP
    faces: list[Face] = [(_patch(tip, (-0.9 * reach, 0.9 * reach), low, top), Part.GLASS)]
    bent = np.array(
        [(tip, 0.9 * reach, low), (0.06 - 0.4 * shape.nose, 0.9 * half + _GAP, low),
         (0.06 - 0.4 * shape.nose, 0.9 * half + _GAP, top), (tip, 0.9 * reach, top)]
    )  # fmt: skip
    faces += mirrored([(bent, Part.GLASS)])
    left, right = (Part.RIGHT, Part.LEFT) if rear else (Part.LEFT, Part.RIGHT)
    lamp = Part.BRAKE if rear else Part.HEADLAMP
    for side, turn in ((1.0, left), (-1.0, right)):
        for a, b, part in ((0.5, 0.82, lamp), (0.82, 0.94, turn)):
            y = sorted((side * a * reach, side * b * reach))
            faces.append((_patch(tip, (y[0], y[1]), 0.26 * high, 0.32 * high), part))
    if detail < _FAR:
        faces.append(
            (_patch(tip, (-0.95 * reach, 0.95 * reach), shape.floor + 0.28, shape.floor + 0.42), Part.TRIM)
        )
        faces.append(
            (
                _patch(2 * tip, (-0.6 * reach, 0.6 * reach), top - 0.3, top - 0.06),
                Part.RIGHT if not rear else Part.TRIM,
            )
        )
    return faces


def _patch(x: float, ends: tuple[float, float], low: float, high: float) -> Floats:
    return np.array([(x, ends[0], low), (x, ends[1], low), (x, ends[1], high), (x, ends[0], high)])


def _pantograph(shape: RailShape, x: float, detail: int) -> list[Face]:
    """Raise a pantograph over the roof."""
    if detail >= _FAR:
        return []
    low = shape.height
    faces: list[Face] = []
    for y in (0.3, -0.3):
        arm = np.array([(x, y, low), (x + 0.9, y, low + 0.55), (x, y, low + 1.1)])
        faces += tube(arm, [0.035, 0.035, 0.03], 4, Part.TRIM)
    bow = np.array([(x, 0.8, low + 1.05), (x, 0.5, low + 1.14), (x, -0.5, low + 1.14), (x, -0.8, low + 1.05)])
    return faces + tube(bow, [0.035] * 4, 4, Part.TRIM)
