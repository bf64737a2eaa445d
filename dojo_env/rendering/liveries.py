"""What tells a car or a van in service from others: bands along its sides, signs, and lamps on its roof.

Bands are flat strips a few millimetres before the shell of a `CarShape`. Lengths are metres, x points to the
nose and is 0 there, y to the left, z up; faces turn counter-clockwise, from outside.
"""

from itertools import pairwise

import numpy as np

from dojo_env.rendering.car_bodies import CarShape
from dojo_env.rendering.shapes import Face, Part, box, mirrored, moved

_GAP = 0.006
"""Metres from the shell to a band, and from layer to layer."""
_ENDS = 0.62
"""Metres at nose and tail that bands leave free, for the shell is round there."""
_LEAN = 0.03
"""Share of the half width by which the shell narrows from its waist to its shoulder."""
_WALL = 0.9
"""Half width of a van's wall at the belt, as a share."""


def dress_police(shape: CarShape) -> list[Face]:
    """Give a police car its band, its letters, and its lights.

    Args:
        shape: the car's measures.

    Returns:
        The faces to add to its body, metres.
    """
    top = _shoulder(shape)
    faces = _band(shape, (_ENDS, shape.length - _ENDS), (top - 0.2, top), Part.ACCENT)
    faces += _band(shape, (_ENDS, shape.length - _ENDS), (top - 0.26, top - 0.2), Part.STRIPE)
    middle = 0.5 * sum(shape.axles)
    faces += _letters(shape, (middle - 0.55, middle + 0.55), (top - 0.15, top - 0.04), 6, Part.WHITE)
    reach = shape.wheel + 0.1
    doors = (shape.axles[0] + reach, shape.axles[1] - reach)
    faces += _band(shape, doors, (top - 0.46, top - 0.26), Part.ACCENT)
    return faces + _light_bar(shape, shape.roof[0] + 0.35, 0.62)


def dress_taxi(shape: CarShape) -> list[Face]:
    """Give a taxi a row of squares along its doors, and the sign on its roof.

    Args:
        shape: the car's measures.

    Returns:
        The faces to add to its body, metres.
    """
    top, size = _shoulder(shape) - 0.03, 0.09
    faces: list[Face] = []
    for row in range(2):
        high = top - row * size
        for place in np.arange(_ENDS + row * size, shape.length - _ENDS - size, 2 * size):
            faces += _band(shape, (place, place + size), (high - size, high), Part.TRIM)
    x, low = -0.5 * sum(shape.roof), shape.height - 0.03
    faces += box(x + 0.11, x - 0.11, 0.34, low, low + 0.17, Part.WHITE)
    for side in (1, -1):
        for y in (-0.21, -0.07, 0.07, 0.21):
            letter = np.array([(y - 0.04, 0.05), (y + 0.04, 0.05), (y + 0.04, 0.13), (y - 0.04, 0.13)])
            quad = np.column_stack([np.full(4, x + side * 0.115), letter[:, 0], low + letter[:, 1]])
            faces.append((quad[::side], Part.TRIM))
    return faces


def dress_ambulance(shape: CarShape) -> list[Face]:
    """Give an ambulance bands, letters, and lights at both ends of its roof.

    Args:
        shape: the van's measures; it has a wall from 44 % of its length on.

    Returns:
        The faces to add to its body, metres.
    """
    ends, top = (_ENDS, shape.length - _ENDS), _shoulder(shape)
    faces = _band(shape, ends, (top - 0.24, top), Part.ACCENT)
    faces += _band(shape, ends, (top - 0.32, top - 0.24), Part.STRIPE)
    wall = (0.44 * shape.length, shape.length - 0.2)
    faces += _panel(shape, (wall[0], wall[0] + 0.95), (1.35, 1.85), Part.GLASS)
    faces += _panel(shape, (wall[0] + 1.15, wall[1]), (1.3, 1.5), Part.ACCENT)
    step = (wall[1] - wall[0] - 1.15) / 7
    for k in range(7):
        place = wall[0] + 1.15 + k * step
        faces += _panel(shape, (place, place + 0.6 * step), (1.6, 1.8), Part.ACCENT)
    faces += _light_bar(shape, shape.roof[0] + 0.25, 0.66)
    rear = -shape.roof[1] + 0.15
    lamp = box(rear, rear - 0.18, 0.12, shape.height - 0.03, shape.height + 0.12, Part.BLUE)
    return faces + mirrored(moved(lamp, 0.5))


def dress_van(shape: CarShape) -> list[Face]:
    """Paint a firm's name and a band under it on a van; in a van's own colour they do not show.

    Args:
        shape: the van's measures; it has a wall from 42 % of its length on.

    Returns:
        The faces to add to its body, metres.
    """
    front, rear = 0.42 * shape.length, shape.length - 0.35
    faces = _panel(shape, (front, rear), (1.25, 1.33), Part.ACCENT)
    step = (rear - front) / 8
    for k in range(7):
        place = front + (k + 0.5) * step
        low, high = (1.42, 1.76) if k in (0, 4) else (1.42, 1.66)
        faces += _panel(shape, (place, place + 0.62 * step), (low, high), Part.ACCENT)
    return faces + _band(shape, (_ENDS, shape.length - _ENDS), (0.8, 0.95), Part.ACCENT)


def load_bed(shape: CarShape) -> list[Face]:
    """Cover the bed behind a pick-up's cab, and set boards around it.

    Args:
        shape: the pick-up's measures; its bed begins behind the rear window's foot.

    Returns:
        The faces to add to its body, metres.
    """
    front, rear = -shape.foot - 0.12, -shape.length + 0.1
    half, low = 0.86 * shape.half_width(shape.length - 1.0), shape.top(shape.foot) - 0.02
    faces = box(front, rear, half - 0.06, low, low + 0.09, Part.TRIM)
    for side in (1.0, -1.0):
        faces += moved(box(front + 0.1, rear - 0.02, 0.045, low - 0.02, low + 0.13, Part.BODY), side * half)
    faces += box(rear + 0.03, rear - 0.05, half + 0.04, low - 0.02, low + 0.13, Part.BODY)
    return faces + box(front + 0.16, front + 0.1, half + 0.04, low - 0.02, low + 0.13, Part.BODY)


def _shoulder(shape: CarShape) -> float:
    """Height up to which a car's flank is nearly upright."""
    return shape.top(0.5 * sum(shape.axles)) - 0.1


def _light_bar(shape: CarShape, place: float, half: float) -> list[Face]:
    low = shape.height - 0.05
    faces = box(-place + 0.02, -place - 0.3, half + 0.02, low, low + 0.07, Part.TRIM)
    blue = box(-place, -place - 0.28, 0.5 * (half - 0.16), low + 0.07, low + 0.19, Part.BLUE)
    faces += moved(blue, 0.5 * (half + 0.16)) + moved(blue, -0.5 * (half + 0.16))
    return faces + box(-place, -place - 0.28, 0.15, low + 0.07, low + 0.16, Part.WHITE)


def _letters(
    shape: CarShape, ends: tuple[float, float], heights: tuple[float, float], count: int, part: Part
) -> list[Face]:
    """Hint at a word by as many blocks as it has letters."""
    step = (ends[1] - ends[0]) / count
    faces: list[Face] = []
    for k in range(count):
        place = ends[0] + k * step
        faces += _band(shape, (place, place + 0.68 * step), heights, part, layer=2)
    return faces


def _band(
    shape: CarShape, ends: tuple[float, float], heights: tuple[float, float], part: Part, *, layer: int = 1
) -> list[Face]:
    """Paint a strip along both flanks, between two places behind the nose."""
    waist, shoulder = 2 * shape.wheel + 0.07, _shoulder(shape) + 0.01

    def flank(place: float, z: float) -> tuple[float, float, float]:
        share = min(1.0, max(0.0, (z - waist) / max(shoulder - waist, 0.01)))
        return -place, shape.half_width(place) * (1.0 - _LEAN * share) + layer * _GAP, z

    # The shell bends at its waist, and narrows at these places.
    rows = sorted({*heights, min(max(waist, heights[0]), heights[1])})
    cuts = sorted({min(max(place, ends[0]), ends[1]) for place in (*ends, 0.8, shape.length - 0.6)})
    left: list[Face] = []
    for low, high in pairwise(rows):
        for a, b in pairwise(cuts):
            left.append((np.array([flank(a, high), flank(a, low), flank(b, low), flank(b, high)]), part))
    return mirrored(left)


def _panel(
    shape: CarShape, ends: tuple[float, float], heights: tuple[float, float], part: Part
) -> list[Face]:
    """Paint a rectangle on both walls of a van, over its belt."""
    half = 0.5 * shape.width
    belt, edge = shape.top(0.5 * shape.length), shape.height - 0.07

    def wall(z: float) -> float:
        return half * (_WALL + (shape.lean - _WALL) * (z - belt) / (edge - belt)) + _GAP

    (a, b), (low, high) = ends, heights
    quad = [(-a, wall(high), high), (-a, wall(low), low), (-b, wall(low), low), (-b, wall(high), high)]
    return mirrored([(np.array(quad), part)])
