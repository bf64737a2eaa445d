"""Bodies of cars and vans: a rounded shell with wheel arches, a greenhouse on it, and details in clean lines.

A shell is lofted through stations along the car: in each its half width, its lower edge (which follows the
wheel arches) and its top are known, and a ring of corners runs over it. Lamps, grille, plates and lines are
flat patches a few millimetres before the shell. Lengths are metres, x points to the nose and is 0 there, y to
the left, z up; faces turn counter-clockwise, from outside.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from dojo_env.rendering.shapes import Face, Part, box, mirrored

Floats = NDArray[np.float64]
Curve = tuple[tuple[float, float], ...]
"""Places and values, by ascending place; straight between, constant beyond."""

FINE, COARSE = 0, 1
"""Levels of detail that have these bodies."""
_NOSE: Curve = ((0.0, 0.62), (0.03, 0.76), (0.09, 0.87), (0.2, 0.945), (0.45, 0.985), (0.8, 1.0))
"""Half width as a share, by metres behind the nose."""
_TAIL: Curve = ((0.0, 0.74), (0.03, 0.84), (0.09, 0.92), (0.22, 0.965), (0.6, 1.0))
"""The same, by metres before the tail."""
_LOW, _SHOULDER, _EDGE = 0.93, 0.97, 0.9
"""Half widths of the lower edge, the shoulder and the belt, as shares of the widest."""
_LONGEST_PANE = 0.25
"""Share of the way along the windows that is drawn straight."""
_OPEN_DECK = 0.4
"""Metres before the rear window's foot where the shell is closed under the windows, as it narrows there."""
_GAP = 0.012
"""Metres from the shell to what is painted on it."""


@dataclass(frozen=True, slots=True, kw_only=True)
class CarShape:
    """Measures of a car, metres; places along it are metres behind the nose, heights shares of its height.

    Attributes:
        length: from bumper to bumper.
        width: without mirrors.
        height: of the roof.
        cowl: foot of the windscreen.
        roof: front and rear end of the roof.
        foot: foot of the rear window.
        bonnet: height of the bonnet's front edge, as a share.
        belt: height of the windows' lower edge at the windscreen and at the rear window, as shares.
        deck: height of the tail's top, as a share.
        clearance: height of the sills.
        wheel: radius of a wheel.
        axles: places of the axles.
        lean: half width at the roof's edge, as a share of the widest.
        panes: side windows: begin and end of each, as shares of the way along the greenhouse.
    """

    length: float
    width: float
    height: float
    cowl: float
    roof: tuple[float, float]
    foot: float
    bonnet: float = 0.5
    belt: tuple[float, float] = (0.64, 0.67)
    deck: float = 0.66
    clearance: float = 0.17
    wheel: float = 0.32
    axles: tuple[float, float] = (0.85, 3.45)
    lean: float = 0.66
    panes: tuple[tuple[float, float], ...] = ((0.08, 0.47), (0.51, 0.86))

    def half_width(self, place: float) -> float:
        """Half of the widest width at a place, metres."""
        share = min(_at(_NOSE, place), _at(_TAIL, self.length - place))
        return 0.5 * self.width * share

    def top(self, place: float) -> float:
        """Height of the shell, under the windows that of the belt, metres."""
        front, rear = self.belt
        curve = (
            (0.0, self.bonnet - 0.035), (0.06, self.bonnet), (0.25, self.bonnet + 0.03), (self.cowl, front),
            (self.foot, rear), (max(self.foot, self.length - 0.12), self.deck),
            (self.length, self.deck - 0.05),
        )  # fmt: skip
        return self.height * _at(curve, place)

    def lower_edge(self, place: float) -> float:
        """Height of the sill, the bumper, or the wheel arch at a place, metres."""
        sill = ((0.0, self.clearance + 0.06), (0.4, self.clearance), (self.length - 0.4, self.clearance),
                (self.length, self.clearance + 0.1))  # fmt: skip
        low = _at(sill, place)
        reach = self.wheel + 0.05
        for axle in self.axles:
            if abs(place - axle) < reach:
                low = max(low, self.wheel + float(np.sqrt(reach**2 - (place - axle) ** 2)))
        return low


def _at(curve: Curve, place: float) -> float:
    places, values = zip(*curve, strict=True)
    return float(np.interp(place, places, values))


def build_car(shape: CarShape, detail: int) -> list[Face]:
    """Build a car.

    Args:
        shape: its measures.
        detail: `FINE` or `COARSE`.

    Returns:
        Its faces.
    """
    faces = _shell(shape, detail) + _greenhouse(shape, detail)
    faces += _front_details(shape, detail) + _rear_details(shape, detail)
    for axle in shape.axles:
        half = shape.half_width(axle)
        faces += build_wheels(-axle, half, shape.wheel, 14 if detail == FINE else 8)
        reach = shape.wheel + 0.03
        faces += box(-axle + reach, -axle - reach, 0.84 * half, 0.14, 2 * shape.wheel, Part.TRIM)
    mirror = box(-shape.cowl - 0.12, -shape.cowl - 0.3, 0.09, 0.0, 0.14, Part.BODY)
    lift = np.array([0.0, _EDGE * shape.half_width(shape.cowl) + 0.08, shape.top(shape.cowl) + 0.01])
    faces += mirrored([(corners + lift, part) for corners, part in mirror])
    if detail == FINE:
        faces += _side_lines(shape)
    return faces


def _stations(shape: CarShape, detail: int) -> list[float]:
    """List the places of the shell's cuts: close together where it bends."""
    ends = [0.0, 0.03, 0.09, 0.2, 0.45] if detail == FINE else [0.0, 0.06, 0.25]
    places = [*ends, *(shape.length - place for place in ends), shape.cowl, shape.foot]
    reach = shape.wheel + 0.05
    turns = (
        (-1.0, -0.92, -0.7, -0.35, 0.0, 0.35, 0.7, 0.92, 1.0)
        if detail == FINE
        else (-1.0, -0.7, 0.0, 0.7, 1.0)
    )
    places += [axle + turn * reach for axle in shape.axles for turn in turns]
    places.append(0.5 * sum(shape.axles))
    inside = sorted({round(min(max(place, 0.0), shape.length), 4) for place in places})
    return [0.0, *(b for a, b in pairwise(inside) if b - a > 0.015)]


def _ring(shape: CarShape, place: float) -> Floats:
    """Cut the shell on its left side: (6, 3), from the lower edge to the middle of its top."""
    half, low, top = shape.half_width(place), shape.lower_edge(place), shape.top(place)
    waist = max(low + 0.02, 0.45 * top + 0.1)
    shoulder = max(waist + 0.02, top - 0.09)
    points = (
        (_LOW * half, low), (half, min(max(low + 0.01, 0.3 * top + 0.1), waist)), (half, waist),
        (_SHOULDER * half, shoulder), (_EDGE * half, top), (0.0, top + 0.025),
    )  # fmt: skip
    return np.array([(-place, y, z) for y, z in points])


def _shell(shape: CarShape, detail: int) -> list[Face]:
    places = _stations(shape, detail)
    rings = [_ring(shape, place) for place in places]
    left: list[Face] = []
    for (front, ahead), (rear, behind) in pairwise(zip(places, rings, strict=True)):
        is_covered = front >= shape.cowl and rear <= shape.foot - _OPEN_DECK
        left += [
            (np.array([ahead[k + 1], ahead[k], behind[k], behind[k + 1]]), Part.BODY)
            for k in range(4 if is_covered else 5)
        ]
    faces = mirrored(left)
    for ring, turn in ((rings[0], 1), (rings[-1], -1)):
        outline = np.concatenate([ring * [1.0, -1.0, 1.0], ring[-2::-1]])
        faces.append((outline[::-1] if turn > 0 else outline, Part.BODY))
    return faces


def _greenhouse(shape: CarShape, detail: int) -> list[Face]:
    """Build roof, pillars and windows; the side windows stand on the belt and lean inwards."""
    front, rear = shape.roof
    edge, crown = shape.height - 0.07, shape.height
    half = 0.5 * shape.width
    slim = shape.lean * half

    def belt(place: float) -> tuple[float, float, float]:
        return -place, _EDGE * shape.half_width(place), shape.top(place)

    foot, head = (
        np.array([belt(shape.cowl), belt(shape.foot)]),
        np.array([(-front, slim, edge), (-rear, slim, edge)]),
    )

    def along(share: float, up: float) -> Floats:
        low = np.array(belt(shape.cowl + share * (shape.foot - shape.cowl)))
        high = head[0] + share * (head[1] - head[0])
        return low + up * (high - low)

    def pane(a: float, b: float, low: float, high: float, part: Part) -> Face:
        return np.array([along(a, high), along(a, low), along(b, low), along(b, high)]), part

    cuts = [0.0, *(place for each in shape.panes for place in each), 1.0]
    left: list[Face] = []
    for number, (a, b) in enumerate(pairwise(cuts)):
        pillar = Part.TRIM if 0 < number < len(cuts) - 2 else Part.BODY
        bands = ((0.0, 0.05, Part.BODY), (0.05, 0.9, Part.GLASS), (0.9, 1.0, Part.BODY))
        for start, end in pairwise(np.linspace(a, b, 1 + int(np.ceil((b - a) / _LONGEST_PANE)))):
            for low, high, part in bands if number % 2 else ((0.0, 1.0, pillar),):
                left.append(pane(start, end, low, high, part))
    screen, window = (foot[0], head[0], 0.1), (foot[1], head[1], -0.06)
    rows = [_across(*screen, crown, 1.0), _across(*window, crown, 1.0)]
    if detail == FINE:
        rows.insert(1, 0.5 * (rows[0] + rows[1]))
    for ahead, behind in pairwise(rows):
        left += [(np.array([ahead[k + 1], ahead[k], behind[k], behind[k + 1]]), Part.BODY) for k in range(3)]
    left += _pane_across(*screen, crown)
    left += _pane_across(*window, crown, tail=True)
    return mirrored(left)


_SHARES = (1.0, 0.91, 0.5, 0.0)
"""Where windscreen, rear window and roof bend on their way from the side to the middle."""


def _across(low: Floats, high: Floats, bend: float, crown: float, up: float) -> Floats:
    """Go over the car at a height between the belt and the roof: (4, 3), from the left side to the middle."""
    side = low + up * (high - low)
    rise = (crown - high[2]) * up
    return np.array(
        [
            (side[0] + bend * (1.0 - s**2) * (1.0 - 0.6 * up), s * side[1], side[2] + rise * (1.0 - s**2))
            for s in _SHARES
        ]
    )


def _pane_across(low: Floats, high: Floats, bend: float, crown: float, *, tail: bool = False) -> list[Face]:
    """Build the left half of windscreen or rear window: a pillar, two panes, and a strip under the roof."""
    heights = (0.0, 0.05, 0.93, 1.0)
    rows = [_across(low, high, bend, crown, up) for up in heights]
    faces: list[Face] = []
    for (below, above), part in zip(pairwise(rows), (Part.TRIM, Part.GLASS, Part.BODY), strict=True):
        for k in range(3):
            quad = np.array([below[k], above[k], above[k + 1], below[k + 1]])
            faces.append((quad[::-1] if tail else quad, Part.BODY if k == 0 else part))
    return faces


def _patch(
    place: Callable[[float], float],
    ends: tuple[float, float],
    heights: tuple[float, float],
    part: Part,
    *,
    columns: int = 1,
    ahead: bool = True,
) -> list[Face]:
    """Paint a strip on the nose or the tail.

    Args:
        place: how far ahead the strip lies at each distance from the middle, metres.
        ends: where it begins and ends, metres to the left.
        heights: its lower and upper edge, metres.
        part: what it shows.
        columns: flat pieces that it is made of.
        ahead: it is seen from before the car, or else from behind.
    """
    ys = np.linspace(*ends, columns + 1)
    low, high = heights
    faces: list[Face] = []
    for a, b in pairwise(ys):
        quad = np.array([(place(a), a, low), (place(b), b, low), (place(b), b, high), (place(a), a, high)])
        faces.append((quad if (b > a) == ahead else quad[::-1], part))
    return faces


def _bumper(shape: CarShape, curve: Curve, gap: float) -> Callable[[float], float]:
    """Tell how far ahead the nose lies, or the tail behind, at a distance from the middle, and `gap` more."""
    shares = [share for _, share in curve]
    backs = [back for back, _ in curve]
    half = 0.5 * shape.width

    def back(y: float) -> float:
        return gap - float(np.interp(abs(y) / half, shares, backs))

    return back


def _front_details(shape: CarShape, detail: int) -> list[Face]:
    """Paint lamps, grille, plate and the lower intake on the nose."""
    half, height = 0.5 * shape.width, shape.height
    top = shape.bonnet * height - 0.05
    at = [_bumper(shape, _NOSE, _GAP * k) for k in (1, 1.6, 2.2)]
    lamp = (top - 0.13, top)
    faces: list[Face] = []
    left: list[Face] = []
    left += _patch(
        at[0], (0.56 * half, 0.965 * half), (lamp[0] - 0.02, lamp[1] + 0.015), Part.TRIM, columns=4
    )
    left += _patch(at[1], (0.58 * half, 0.9 * half), lamp, Part.HEADLAMP, columns=3)
    turn = _patch(at[1], (0.9 * half, 0.955 * half), lamp, Part.LEFT)
    faces += mirrored(left) + _indicators(turn)
    faces += _patch(at[0], (-0.53 * half, 0.53 * half), (top - 0.12, top - 0.015), Part.TRIM, columns=2)
    faces += _patch(
        at[0],
        (-0.66 * half, 0.66 * half),
        (shape.clearance + 0.08, shape.clearance + 0.2),
        Part.TRIM,
        columns=2,
    )
    faces += _plate(at, 0.5 * (shape.clearance + 0.2 + top - 0.12) - 0.055, ahead=True)
    if detail == FINE:
        for z in (top - 0.085, top - 0.05):
            faces += _patch(at[1], (-0.5 * half, 0.5 * half), (z, z + 0.012), Part.CHROME)
        fog = _patch(
            at[0], (0.74 * half, 0.84 * half), (shape.clearance + 0.1, shape.clearance + 0.18), Part.TRIM
        )
        faces += mirrored(fog)
        faces += _bonnet_line(shape)
    return faces


def _bonnet_line(shape: CarShape) -> list[Face]:
    """Draw the gap at the bonnet's front edge and the trough of the wipers."""
    faces: list[Face] = []
    for place, thick in ((0.14, 0.015), (shape.cowl - 0.1, 0.05)):
        half = _EDGE * shape.half_width(place)
        corners = []
        for x, turn in ((place, 1.0), (place + thick, -1.0)):
            lift = shape.top(x) + 0.01
            corners += [
                (-x, turn * half * 0.96, lift),
                (-x, 0.0, lift + 0.027),
                (-x, -turn * half * 0.96, lift),
            ]
        a, b, c, d, e, f = (np.array(corner) for corner in corners)
        faces += [(np.array([f, a, b, e]), Part.TRIM), (np.array([e, b, c, d]), Part.TRIM)]
    return faces


def _rear_details(shape: CarShape, detail: int) -> list[Face]:
    """Paint lamps, plate and bumper on the tail."""
    half, height = 0.5 * shape.width, shape.height
    back = [_bumper(shape, _TAIL, _GAP * k) for k in (1, 1.6, 2.2)]

    def moved(place: Callable[[float], float]) -> Callable[[float], float]:
        return lambda y: -shape.length - place(y)

    at = [moved(place) for place in back]
    top = (shape.deck - 0.08) * height
    lamp = (top - 0.16, top)
    faces: list[Face] = []
    left = _patch(at[0], (0.6 * half, 0.95 * half), lamp, Part.BRAKE, columns=3, ahead=False)
    faces += mirrored(left)
    turn = _patch(at[1], (0.66 * half, 0.9 * half), (lamp[0] + 0.01, lamp[0] + 0.05), Part.LEFT, ahead=False)
    faces += _indicators(turn)
    faces += _patch(
        at[0],
        (-0.8 * half, 0.8 * half),
        (shape.clearance + 0.12, shape.clearance + 0.24),
        Part.TRIM,
        columns=2,
        ahead=False,
    )
    faces += _plate(at, top - 0.17, ahead=False)
    if detail == FINE:
        faces += _patch(
            at[0], (-0.58 * half, 0.58 * half), (top - 0.035, top - 0.02), Part.CHROME, ahead=False
        )
    return faces


def _indicators(left: list[Face]) -> list[Face]:
    """Put the left ones' twins on the right."""
    return left + [(corners, Part.RIGHT) for corners, _ in mirrored(left)[1::2]]


def _plate(at: Sequence[Callable[[float], float]], low: float, *, ahead: bool) -> list[Face]:
    """Screw a number plate on, 52 cm wide, with a few letters."""
    faces = list(_patch(at[1], (-0.26, 0.26), (low, low + 0.11), Part.WHITE, ahead=ahead))
    for y in (-0.19, -0.1, 0.02, 0.1, 0.18):
        faces += _patch(at[2], (y - 0.025, y + 0.025), (low + 0.02, low + 0.09), Part.TRIM, ahead=ahead)
    return faces


def _side_lines(shape: CarShape) -> list[Face]:
    """Draw door gaps and handles on the sides."""
    left: list[Face] = []
    doors = [shape.cowl + 0.1, 0.5 * (shape.cowl + shape.foot) - 0.05, shape.axles[1] - shape.wheel - 0.12]
    for place in doors:
        a, b = _ring(shape, place), _ring(shape, place + 0.018)
        for k in range(1, 4):
            quad = np.array([a[k + 1], a[k], b[k], b[k + 1]]) + np.array([0.0, 0.006, 0.0])
            left.append((quad, Part.TRIM))
    for place in (doors[1] - 0.28, doors[2] - 0.2):
        y, z = shape.half_width(place) + 0.004, shape.top(place) - 0.17
        left.append(
            (
                np.array(
                    [
                        (-place, y, z + 0.03),
                        (-place, y, z),
                        (-place - 0.16, y, z),
                        (-place - 0.16, y, z + 0.03),
                    ]
                ),
                Part.TRIM,
            )
        )
    return mirrored(left)


def build_wheels(x: float, half: float, radius: float, sides: int) -> list[Face]:
    """Set a wheel on each side: tread, walls of the tyre, and a bright rim with dark gaps.

    Args:
        x: of the axle.
        half: of the wheels' outer sides, from the middle.
        radius: of a wheel.
        sides: of its tread.
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
