"""What is on the body of a car: lamps, grille, plates, bumpers, lines, mirrors and wheels.

Lamps, grille and plates are flat patches a few millimetres before the shell. Lengths are metres, x points to
the nose and is 0 there, y to the left, z up; faces turn counter-clockwise, from outside.
"""

from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from dojo_env.rendering.car_bodies import FINE, CarShape, Floats, build_greenhouse, build_shell
from dojo_env.rendering.shapes import Face, Part, box, mirrored, moved

_GAP = 0.012
"""Metres from the shell to what is painted on it."""
_FLAT = 1e-3
"""Metres; what is less high is not drawn."""
_LAMP = ((0.0, 0.1), (0.6, 0.13), (0.75, 0.15), (0.87, 0.15), (0.945, 0.13), (0.985, 0.08))
"""Outline of a head lamp: how far to the side, as a share of the half width (the first begins at the grille),
and how high, metres."""
Row = tuple[float, float, float]
"""Of a patch: metres to the left, lower and upper edge."""


def build_car(shape: CarShape, detail: int) -> list[Face]:
    """Build a car.

    Args:
        shape: its measures.
        detail: `FINE` or `COARSE`.

    Returns:
        Its faces.
    """
    faces = build_shell(shape, detail) + build_greenhouse(shape, detail)
    faces += _front(shape, detail) + _rear(shape, detail) + _sides(shape, detail)
    for axle in shape.axles:
        half = shape.half_width(axle)
        faces += build_wheels(-axle, half, shape.wheel, 16 if detail == FINE else 8)
        reach = shape.wheel + 0.03
        faces += box(-axle + reach, -axle - reach, 0.84 * half, 0.14, 2 * shape.wheel, Part.TRIM)
    return faces


def _patch(
    shape: CarShape, rows: Sequence[Row] | Floats, part: Part, *, ahead: bool, layer: float = 1.0
) -> list[Face]:
    """Paint a strip on the nose or the tail.

    Args:
        shape: the car.
        rows: the strip's edges, from the middle to the left, or from right to left.
        part: what it shows.
        ahead: it is on the nose, or else on the tail.
        layer: how many layers before the shell it lies.
    """
    # The shell bends at these places and heights; a patch that goes straight past one would lie behind it.
    ys, lows, highs = np.array(rows).T
    knots = shape.corners(ahead=ahead)
    places = np.unique([*ys, *knots[(knots > ys[0]) & (knots < ys[-1])]])
    columns = []
    for y in places.tolist():
        low, high = float(np.interp(y, ys, lows)), float(np.interp(y, ys, highs))
        bends = np.clip(shape.bends(y, ahead=ahead), low, high)
        found = [shape.skin(y, z, ahead=ahead) for z in (low, *bends, high)]
        columns.append([place + layer * _GAP * out for place, out in found])
    faces: list[Face] = []
    for left, right in pairwise(columns):
        for k in range(len(left) - 1):
            quad = np.array([left[k], right[k], right[k + 1], left[k + 1]])
            if np.ptp(quad[:, 2]) > _FLAT:
                faces.append((quad if ahead else quad[::-1], part))
    return faces


def _band(half: float, heights: tuple[float, float]) -> list[Row]:
    """Give the rows of a level strip across the middle."""
    return [(-half, *heights), (half, *heights)]


def _front(shape: CarShape, detail: int) -> list[Face]:
    """Paint lamps, grille, plate and the lower intake on the nose."""
    half, top, low = 0.5 * shape.width, shape.top(0.0), shape.clearance
    wide, high = shape.grille[0] * half, shape.grille[1]
    roof = top - 0.03

    shares, tall = np.array(_LAMP).T
    shares[0] = wide / half + 0.06
    edge = roof + 0.07 * shape.height * np.maximum(0.0, shares - 0.6)
    inset = np.array([0.018, *np.zeros(len(shares) - 2), -0.018])
    housing = np.column_stack([half * shares, edge - tall, edge])
    lens = np.column_stack([half * (shares + inset), edge - tall + 0.018, edge - 0.018])
    left = _patch(shape, housing, Part.TRIM, ahead=True)
    left += _patch(shape, lens[:5], Part.HEADLAMP, ahead=True, layer=1.6)
    if detail == FINE:
        mirror = lens.copy()
        mirror[:, 1] += 0.3 * (lens[:, 2] - lens[:, 1])
        mirror[:, 2] -= 0.1 * (lens[:, 2] - lens[:, 1])
        for pair in (mirror[:2], mirror[2:4]):
            left += _patch(shape, pair, Part.CHROME, ahead=True, layer=2.2)
    faces = mirrored(left) + _indicators(_patch(shape, lens[4:], Part.LEFT, ahead=True, layer=1.6))
    faces += _patch(shape, _band(wide, (roof - high, roof)), Part.TRIM, ahead=True)
    faces += _patch(shape, _band(0.62 * half, (low + 0.09, low + 0.2)), Part.TRIM, ahead=True)
    faces += _plate(shape, max(low + 0.21, 0.36), ahead=True)
    if detail == FINE:
        faces += _front_jewels(shape, wide, roof, high)
    return faces


def _front_jewels(shape: CarShape, wide: float, roof: float, high: float) -> list[Face]:
    """Add what shows from near: bars and badge of the grille, fog lamps, and gaps around the bonnet."""
    half, low = 0.5 * shape.width, shape.clearance
    faces = _patch(shape, _band(wide, (roof - 0.012, roof + 0.008)), Part.CHROME, ahead=True, layer=2)
    for share in (0.36, 0.7):
        z = roof - share * high
        faces += _patch(shape, _band(0.94 * wide, (z - 0.007, z + 0.007)), Part.CHROME, ahead=True, layer=1.6)
    badge = [(-0.055, roof - 0.075, roof - 0.045), (-0.025, roof - 0.105, roof - 0.015),
             (0.025, roof - 0.105, roof - 0.015), (0.055, roof - 0.075, roof - 0.045)]  # fmt: skip
    faces += _patch(shape, badge, Part.CHROME, ahead=True, layer=2.4)
    fog = [(0.7 * half, low + 0.1, low + 0.2), (0.87 * half, low + 0.12, low + 0.2)]
    faces += mirrored(_patch(shape, fog, Part.TRIM, ahead=True))
    lamp = [(0.75 * half, low + 0.13, low + 0.18), (0.83 * half, low + 0.13, low + 0.18)]
    faces += mirrored(_patch(shape, lamp, Part.CHROME, ahead=True, layer=1.6))
    return faces + _bonnet_lines(shape)


def _bonnet_lines(shape: CarShape) -> list[Face]:
    """Draw the gaps around the bonnet and the trough of the wipers."""
    places = (0.12, 0.3, 0.6 * shape.cowl, shape.cowl - 0.12)
    left: list[Face] = []
    for a, b in pairwise(places):
        lines = [shape.ring(place)[4] * [1, 0.93, 1] + [0, 0, 0.012] for place in (a, b)]
        side = np.array([0.0, 0.014, -0.001])
        left.append((np.array([lines[0], lines[0] + side, lines[1] + side, lines[1]]), Part.TRIM))
    for place, thick in ((places[0], 0.014), (places[-1], 0.07)):
        corners = [
            shape.ring(x)[4:] * [[1, 0.93, 1], [1, 1, 1], [1, 1, 1]] + [0, 0, 0.012]
            for x in (place, place + thick)
        ]
        (a, b, c), (d, e, f) = corners
        left += [(np.array([b, a, d, e]), Part.TRIM), (np.array([c, b, e, f]), Part.TRIM)]
    return mirrored(left)


def _rear(shape: CarShape, detail: int) -> list[Face]:
    """Paint lamps, plate and bumper on the tail."""
    half, low = 0.5 * shape.width, shape.clearance
    top = shape.top(shape.length) - 0.02
    tall, inner = (0.32, 0.8) if shape.tall_lamps else (0.17, 0.58)
    shares = (inner, 0.83, 0.92, 0.965)
    rows = [(half * share, top - tall + 0.1 * (share - inner), top) for share in shares]
    left = _patch(shape, rows, Part.BRAKE, ahead=False)
    turn = [(y, a + 0.02, a + 0.02 + 0.25 * tall) for y, a, _ in rows[:2]]
    faces = mirrored(left)
    faces += _indicators(_patch(shape, turn, Part.LEFT, ahead=False, layer=1.6))
    faces += _patch(shape, _band(0.78 * half, (low + 0.11, low + 0.22)), Part.TRIM, ahead=False)
    faces += _plate(shape, max(low + 0.28, top - 0.22), ahead=False)
    if detail == FINE:
        faces += _patch(shape, _band(0.5 * half, (top - 0.06, top - 0.04)), Part.CHROME, ahead=False)
        seam = top - tall - 0.02
        faces += _patch(shape, _band(0.8 * half, (seam - 0.012, seam)), Part.TRIM, ahead=False)
    return faces


def _indicators(left: list[Face]) -> list[Face]:
    """Put the left ones' twins on the right."""
    return left + [(corners, Part.RIGHT) for corners, _ in mirrored(left)[1::2]]


def _plate(shape: CarShape, low: float, *, ahead: bool) -> list[Face]:
    """Screw a number plate on, 52 cm wide, with a few letters."""
    faces = _patch(shape, _band(0.28, (low - 0.02, low + 0.13)), Part.TRIM, ahead=ahead, layer=1.5)
    faces += _patch(shape, _band(0.26, (low, low + 0.11)), Part.WHITE, ahead=ahead, layer=2.1)
    for y in (-0.19, -0.1, 0.02, 0.1, 0.18):
        letter = [(y - 0.025, low + 0.02, low + 0.09), (y + 0.025, low + 0.02, low + 0.09)]
        faces += _patch(shape, letter, Part.TRIM, ahead=ahead, layer=2.6)
    return faces


def _sides(shape: CarShape, detail: int) -> list[Face]:
    """Hang the mirrors; from near draw door gaps and handles, sills, and rails on the roof."""
    mirror = box(-shape.cowl - 0.14, -shape.cowl - 0.32, 0.1, 0.0, 0.15, Part.BODY)
    glass = np.array(
        [
            (-shape.cowl - 0.325, y, z)
            for y, z in ((-0.085, 0.02), (-0.085, 0.13), (0.085, 0.13), (0.085, 0.02))
        ]
    )
    lift = shape.ring(shape.cowl)[4] * [0, 1, 1] + [0.0, 0.1, 0.01]
    left: list[Face] = [(corners + lift, part) for corners, part in [*mirror, (glass, Part.GLASS)]]
    if detail != FINE:
        return mirrored(left)
    doors = [shape.cowl + 0.1, 0.5 * (shape.cowl + shape.foot) - 0.05, shape.axles[1] - shape.wheel - 0.12]
    for place in doors:
        a, b = shape.ring(place), shape.ring(place + 0.018)
        for k in range(1, 4):
            quad = np.array([a[k + 1], a[k], b[k], b[k + 1]]) + np.array([0.0, 0.006, 0.0])
            left.append((quad, Part.TRIM))
    for place in (doors[1] - 0.28, doors[2] - 0.2):
        y, z = shape.half_width(place) + 0.004, shape.top(place) - 0.17
        corners = [(-place, y, z + 0.03), (-place, y, z), (-place - 0.16, y, z), (-place - 0.16, y, z + 0.03)]
        left.append((np.array(corners), Part.TRIM))
    reach = shape.wheel + 0.06
    sill = [shape.ring(place)[0] + [0, 0.02, 0] for place in (shape.axles[0] + reach, shape.axles[1] - reach)]
    up = np.array([0.0, 0.02, 0.09])
    left.append((np.array([sill[0] + up, sill[0], sill[1], sill[1] + up]), Part.TRIM))
    if shape.rails:
        y, z = 0.9 * shape.lean * 0.5 * shape.width, shape.height
        ends = -shape.roof[0] - 0.15, -shape.roof[1] + 0.1
        left += moved(box(*ends, 0.02, z - 0.07, z - 0.002, Part.CHROME), y)
    return mirrored(left)


def build_wheels(x: float, half: float, radius: float, sides: int) -> list[Face]:
    """Set a wheel on each side: tread, walls of the tyre, and a bright rim with dark gaps.

    Args:
        x: of the axle, metres.
        half: of the wheels' outer sides, from the middle, metres.
        radius: of a wheel, metres; it stands on the ground.
        sides: of its tread.

    Returns:
        Faces of both wheels, metres.
    """
    angles = np.arange(sides) * 2 * np.pi / sides - np.pi / 2

    def circle(share: float, y: float) -> Floats:
        return np.column_stack([
            x + share * radius * np.cos(angles), np.full(sides, y), radius + share * radius * np.sin(angles)
        ])  # fmt: skip

    outer, inner, rim = circle(1.0, half - 0.01), circle(1.0, half - 0.2), circle(0.68, half - 0.005)
    left: list[Face] = [(rim[::-1], Part.CHROME), (inner, Part.TYRE)]
    for k in range(sides):
        left.append((np.array([outer[k - 1], outer[k], inner[k], inner[k - 1]]), Part.TYRE))
        left.append((np.array([outer[k], outer[k - 1], rim[k - 1], rim[k]]), Part.TYRE))
    hub, spoke = circle(0.2, half + 0.002), circle(0.58, half + 0.002)
    step = max(1, sides // 5)
    for k in range(0, sides - step + 1, step):
        m = (k + max(1, step // 2)) % sides
        left.append((np.array([hub[k], spoke[m], spoke[k]]), Part.TYRE))
    return mirrored(left)
