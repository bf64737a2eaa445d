"""The pieces that road users are built from: flat convex polygons, each with the part it shows.

Lengths are metres, x points to the nose, y to the left, z up; faces turn counter-clockwise, from outside.
"""

from collections.abc import Iterable, Sequence
from enum import IntEnum
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


class Part(IntEnum):
    """What a face of a model is; decides its colour."""

    BODY = 0
    GLASS = 1
    TYRE = 2
    TRIM = 3
    HEADLAMP = 4
    BRAKE = 5
    LEFT = 6
    RIGHT = 7
    BLUE = 8
    SKIN = 9
    LEGS = 10
    WHITE = 11
    CHROME = 12


Face = tuple[Floats, Part]
"""A flat convex polygon, (n, 3), and its part."""


def section(x: float, half: float, low: float, high: float) -> Floats:
    """Cut across a body: four corners, counter-clockwise seen from the front."""
    return np.array([(x, -half, low), (x, half, low), (x, half, high), (x, -half, high)])


def loft(sections: Sequence[Floats], part: Part) -> list[Face]:
    """Join sections, from nose to tail, by quads, and close both ends."""
    faces: list[Face] = [(sections[0], part), (sections[-1][::-1], part)]
    for ahead, behind in pairwise(sections):
        for k in range(len(ahead)):
            m = (k + 1) % len(ahead)
            faces.append((np.array([ahead[m], ahead[k], behind[k], behind[m]]), part))
    return faces


def box(nose: float, tail: float, half: float, low: float, high: float, part: Part) -> list[Face]:
    """Make a box, as wide at the nose as at the tail."""
    return loft([section(nose, half, low, high), section(tail, half, low, high)], part)


def moved(faces: Iterable[Face], y: float) -> list[Face]:
    """Move faces to the left."""
    return [(corners + np.array([0.0, y, 0.0]), part) for corners, part in faces]


def mirrored(faces: Iterable[Face]) -> list[Face]:
    """Put the same faces on the other side, too."""
    return [
        each
        for corners, part in faces
        for each in ((corners, part), ((corners * [1.0, -1.0, 1.0])[::-1], part))
    ]


def wheels(places: Iterable[float], half: float, radius: float, detail: int, tyre: float = 0.2) -> list[Face]:
    """Set eight-sided wheels against both sides of the body at each axle; discs where `detail` is not 0."""
    angles = np.arange(8) * np.pi / 4 + np.pi / 8
    faces: list[Face] = []
    for x in places:
        flat = np.column_stack([x + radius * np.cos(angles), np.zeros(8), radius + radius * np.sin(angles)])
        across = np.array([0.0, 1.0, 0.0])
        outer, inner = flat + half * across, flat + (half - tyre) * across
        left = [outer[::-1]]
        if detail == 0:
            left += [np.array([outer[k - 1], outer[k], inner[k], inner[k - 1]]) for k in range(8)]
        faces += [(face, Part.TYRE) for face in left]
        faces += [((face * [1.0, -1.0, 1.0])[::-1], Part.TYRE) for face in left]
    return faces


def lights(tail: float, half: float, front: tuple[float, float], rear: tuple[float, float]) -> list[Face]:
    """Put head lamps, brake lights and indicators on both ends, left and right."""
    faces: list[Face] = []
    for side, turn in ((1.0, Part.LEFT), (-1.0, Part.RIGHT)):
        inner, middle, outer = 0.5 * half * side, 0.8 * half * side, 0.98 * half * side
        for x, (low, high), ahead, part in (
            (0.01, front, 1.0, Part.HEADLAMP),
            (tail - 0.01, rear, -1.0, Part.BRAKE),
        ):
            for a, b, lamp in ((inner, middle, part), (middle, outer, turn)):
                quad = np.array([(x, a, low), (x, b, low), (x, b, high), (x, a, high)])
                faces.append((quad if side * ahead > 0 else quad[::-1], lamp))
    return faces


def screen(bottom: float, top: float, half: float, low: float, high: float) -> list[Face]:
    """A windscreen just ahead of the body behind it."""
    out = 0.03
    return [
        (
            np.array(
                [(bottom + out, -half, low), (bottom + out, half, low), (top + out, half, high),
                 (top + out, -half, high)]
            ),
            Part.GLASS,
        )
    ]  # fmt: skip


def windows(nose: float, tail: float, half: float, low: float, high: float) -> list[Face]:
    """Lay a band of glass against both sides."""
    left = np.array([(nose, half, low), (tail, half, low), (tail, half, high), (nose, half, high)])
    return mirrored([(left, Part.GLASS)])
