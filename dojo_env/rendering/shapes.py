"""The pieces that road users are built from: flat convex polygons, each with the part it shows.

A figure or a tyre is made of tubes; bodies of cars are lofted, and have lamps and panes painted on.

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
    HAIR = 13
    GEAR = 14
    """What somebody has with him: a bag, an umbrella, a helmet, the frame of a bicycle."""
    STRIPE = 15
    """The bright stripe of a police car or a fire engine."""
    ACCENT = 16
    """A vehicle's second colour: of its bands and letters."""
    CABIN = 17
    """What is seen through panes: seats."""


_SIDEWARD = 1e-3
"""A line of which no more than this goes up or ahead has no left side."""

Face = tuple[Floats, Part]
"""A flat convex polygon, (n, 3), and its part; or several that have as many corners, (m, n, 3)."""


def section(x: float, half: float, low: float, high: float) -> Floats:
    """Cut across a body.

    Args:
        x: of the cut, metres.
        half: of its width, metres.
        low: height of its lower edge, metres.
        high: height of its upper edge, metres.

    Returns:
        (4, 3) corners, metres, counter-clockwise seen from the front, the lower right one first.
    """
    return np.array([(x, -half, low), (x, half, low), (x, half, high), (x, -half, high)])


def loft(sections: Sequence[Floats], part: Part) -> list[Face]:
    """Join sections, from nose to tail, by quads, and close both ends.

    Args:
        sections: (k, 3) each, metres, of as many corners, counter-clockwise seen from the front.
        part: what all faces show.

    Returns:
        Both ends, then the quads.
    """
    faces: list[Face] = [(sections[0], part), (sections[-1][::-1], part)]
    for ahead, behind in pairwise(sections):
        for k in range(len(ahead)):
            m = (k + 1) % len(ahead)
            faces.append((np.array([ahead[m], ahead[k], behind[k], behind[m]]), part))
    return faces


def box(nose: float, tail: float, half: float, low: float, high: float, part: Part) -> list[Face]:
    """Make a box, as wide at the nose as at the tail.

    Args:
        nose: x of its front, metres.
        tail: x of its back, metres; less than at the nose.
        half: of its width, metres.
        low: height of its lower side, metres.
        high: height of its upper side, metres.
        part: what it shows.

    Returns:
        Its six sides.
    """
    return loft([section(nose, half, low, high), section(tail, half, low, high)], part)


def moved(faces: Iterable[Face], y: float) -> list[Face]:
    """Move faces to the left.

    Args:
        faces: the faces; they stay as they are.
        y: metres; negative to the right.

    Returns:
        New ones, in the same order.
    """
    return [(corners + np.array([0.0, y, 0.0]), part) for corners, part in faces]


def mirrored(faces: Iterable[Face]) -> list[Face]:
    """Put the same faces on the other side, too.

    Args:
        faces: of the left or the right side.

    Returns:
        Each face, followed by its twin at the negative y, which is turned to be seen from outside.
    """
    return [
        each
        for corners, part in faces
        for each in ((corners, part), ((corners * [1.0, -1.0, 1.0])[..., ::-1, :], part))
    ]


def tube(
    spine: Floats, radii: Sequence[float] | Floats, sides: int, parts: Part | NDArray[np.uint8]
) -> list[Face]:
    """Wrap a tube around a line, and close its ends.

    Args:
        spine: (..., n, 3) the line; several of them give several tubes at once.
        radii: (n,) of the tube at each point, or (..., n, 2): to the left, and across both line and that.
        sides: of its rings.
        parts: what it shows, or (n - 1, sides) what each side of each section shows; the first side lies to
            the left, and a rising tube turns over its back.

    Returns:
        Faces; their corners begin with the dimensions of `spine` before its last two.
    """
    across = np.asarray(radii, dtype=float)
    across = across[:, None] * np.ones(2) if across.ndim == 1 else across
    along = np.empty_like(spine)
    along[..., 1:-1, :] = spine[..., 2:, :] - spine[..., :-2, :]
    along[..., 0, :] = spine[..., 1, :] - spine[..., 0, :]
    along[..., -1, :] = spine[..., -1, :] - spine[..., -2, :]
    along /= np.sqrt((along * along).sum(axis=-1, keepdims=True))
    x, y, z = along[..., 0], along[..., 1], along[..., 2]
    level = np.hypot(x, z)
    # To the left of where the line runs, and at right angles to both; a line sideways has neither.
    slim = np.maximum(level, _SIDEWARD)
    left = np.stack([-x * y / slim, level, -z * y / slim], axis=-1)
    over = np.stack([-z / slim, np.zeros_like(x), x / slim], axis=-1)
    angles = (np.arange(sides) + 0.5) * 2 * np.pi / sides
    flat = across[..., None, :] * np.column_stack([np.cos(angles), np.sin(angles)])
    rings = spine[..., None, :] + flat[..., :1] * left[..., None, :] + flat[..., 1:] * over[..., None, :]
    return loft_rings(rings, parts)


def loft_rings(rings: Floats, parts: Part | NDArray[np.uint8]) -> list[Face]:
    """Join rings by quads, and close the first and the last.

    Args:
        rings: (..., n, sides, 3), each counter-clockwise seen from the next.
        parts: see `tube`.

    Returns:
        Faces; their corners begin with the dimensions of `rings` before its last three.
    """
    after = np.roll(rings, -1, axis=-2)
    quads = np.stack(
        [rings[..., :-1, :, :], after[..., :-1, :, :], after[..., 1:, :, :], rings[..., 1:, :, :]], axis=-2
    )
    ends = rings[..., 0, ::-1, :], rings[..., -1, :, :]
    if isinstance(parts, Part):
        every = quads.reshape(*quads.shape[:-4], -1, 4, 3)
        return [(every, parts), *((end, parts) for end in ends)]
    faces: list[Face] = [(quads[..., parts == part, :, :], Part(part)) for part in np.unique(parts)]
    return [*faces, (ends[0], Part(parts[0, 0])), (ends[1], Part(parts[-1, 0]))]


def ring(
    middle: Sequence[float], radii: tuple[float, float], half: float, sides: int, part: Part
) -> list[Face]:
    """Make a wheel without a disc, such as a tyre: its tread, and a flat ring on each side.

    Args:
        middle: (x, y, z) of the wheel, metres.
        radii: inner and outer, metres.
        half: of its thickness, metres.
        sides: of its tread.
        part: what it shows.

    Returns:
        Four faces of `sides` quads each: the left ring, the right one, the tread, and the inside.
    """
    angles = np.arange(sides) * 2 * np.pi / sides
    unit = np.column_stack([np.cos(angles), np.zeros(sides), np.sin(angles)])
    inner, outer = (np.asarray(middle) + radius * unit for radius in radii)
    side = np.array([0.0, half, 0.0])

    def band(a: Floats, b: Floats) -> Floats:
        return np.stack([a, b, np.roll(b, -1, axis=0), np.roll(a, -1, axis=0)], axis=1)

    faces: list[Face] = [
        (band(inner + side, outer + side)[:, ::-1], part),
        (band(inner - side, outer - side), part),
        (band(outer + side, outer - side)[:, ::-1], part),
        (band(inner + side, inner - side), part),
    ]
    return faces


def disc(middle: Sequence[float], radius: float, half: float, sides: int, part: Part) -> list[Face]:
    """Make two round sides of a wheel, each seen from its own.

    Args:
        middle: (x, y, z) of the wheel, metres.
        radius: metres.
        half: of its thickness, metres.
        sides: corners of each.
        part: what it shows.

    Returns:
        The left side and the right one.
    """
    angles = np.arange(sides) * 2 * np.pi / sides
    flat = radius * np.column_stack([np.cos(angles), np.zeros(sides), np.sin(angles)]) + np.asarray(middle)
    side = np.array([0.0, half, 0.0])
    return [((flat + side)[::-1], part), (flat - side, part)]


def lights(tail: float, half: float, front: tuple[float, float], rear: tuple[float, float]) -> list[Face]:
    """Put head lamps, brake lights and indicators on both ends, left and right.

    Args:
        tail: x of the rear end, metres; the front end is at 0.
        half: of the body's width, metres.
        front: lower and upper edge of the lamps at the front, metres.
        rear: the same at the rear.

    Returns:
        Flat faces, a centimetre before the ends.
    """
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


def windows(nose: float, tail: float, half: float, low: float, high: float) -> list[Face]:
    """Lay a band of glass against both sides.

    Args:
        nose: x of its front end, metres.
        tail: x of its rear end, metres.
        half: distance from the middle, metres; a little more than the body's.
        low: height of the lower edge, metres.
        high: height of the upper edge, metres.

    Returns:
        The left pane and the right one.
    """
    left = np.array([(nose, half, low), (tail, half, low), (tail, half, high), (nose, half, high)])
    return mirrored([(left, Part.GLASS)])
