"""Bodies of cars and vans: a rounded shell with wheel arches, and a greenhouse on it.

A shell is lofted through stations along the car: in each its half width, its lower edge (which follows the
wheel arches) and its top are known, and a ring of corners runs over it; nose and tail lean back above and
below the bumper. What is painted on it is in `car_details`. Lengths are metres, x points to the nose and is
0 there, y to the left, z up; faces turn counter-clockwise, from outside.
"""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from dojo_env.rendering.shapes import Face, Part, mirrored

Floats = NDArray[np.float64]
Curve = tuple[tuple[float, float], ...]
"""Places and values, by ascending place; straight between, constant beyond."""

FINE, COARSE = 0, 1
"""Levels of detail that have these bodies."""
_NOSE: Curve = ((0.0, 0.6), (0.035, 0.75), (0.1, 0.87), (0.22, 0.945), (0.45, 0.985), (0.8, 1.0))
"""Half width as a share, by metres behind the nose."""
_TAIL: Curve = ((0.0, 0.72), (0.03, 0.83), (0.09, 0.92), (0.22, 0.965), (0.6, 1.0))
"""The same, by metres before the tail."""
_LOW, _SHOULDER, _EDGE = 0.93, 0.97, 0.88
"""Half widths of the lower edge, the shoulder and the belt, as shares of the widest."""
_LONGEST_PANE = 0.25
"""Share of the way along the windows that is drawn straight."""
_OPEN_DECK = 0.4
"""Metres before the rear window's foot where the shell is closed under the windows, as it narrows there."""
_HIGH_PANE = 0.1
"""Share of the way to the roof from which on there is metal, not a seal, under a pane."""
_LEAN_REACH = 0.5
"""Metres over which a leaning nose or tail becomes an upright side."""
_CHIN = 0.07
"""How far the bumper's lower edge lies behind the bumper, metres."""


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
        rear_glass: lower and upper edge of the rear window, as shares of the way from the belt to the roof.
        rake: how far the bonnet's front edge, and the top of the tail, lie behind the bumpers.
        grille: half width and height of the grille; its upper edge lies under the bonnet's.
        tall_lamps: the rear lamps stand upright beside the tailgate.
        rails: there are rails along the roof.
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
    lean: float = 0.68
    panes: tuple[tuple[float, float], ...] = ((0.08, 0.47), (0.51, 0.86))
    rear_glass: tuple[float, float] = (0.06, 0.93)
    rake: tuple[float, float] = (0.2, 0.08)
    grille: tuple[float, float] = (0.4, 0.13)
    tall_lamps: bool = False
    rails: bool = False

    def half_width(self, place: float) -> float:
        """Find half of the widest width at a place.

        Args:
            place: metres behind the nose.

        Returns:
            Metres; it shrinks towards nose and tail.
        """
        share = min(_at(_NOSE, place), _at(_TAIL, self.length - place))
        return 0.5 * self.width * share

    def top(self, place: float) -> float:
        """Find the height of the shell, under the windows that of the belt.

        Args:
            place: metres behind the nose.

        Returns:
            Metres above the ground.
        """
        front, rear = self.belt
        curve = (
            (0.0, self.bonnet - 0.025), (0.06, self.bonnet), (0.25, self.bonnet + 0.035),
            (0.6 * self.cowl, 0.45 * self.bonnet + 0.55 * front + 0.01), (self.cowl, front),
            (self.foot, rear), (max(self.foot, self.length - 0.12), self.deck),
            (self.length, self.deck - 0.05),
        )  # fmt: skip
        return self.height * _at(curve, place)

    def lower_edge(self, place: float) -> float:
        """Find the height of the sill, the bumper, or the wheel arch at a place.

        Args:
            place: metres behind the nose.

        Returns:
            Metres above the ground.
        """
        sill = ((0.0, self.clearance + 0.05), (0.4, self.clearance), (self.length - 0.4, self.clearance),
                (self.length, self.clearance + 0.1))  # fmt: skip
        low = _at(sill, place)
        reach = self.wheel + 0.05
        for axle in self.axles:
            if abs(place - axle) < reach:
                low = max(low, self.wheel + float(np.sqrt(reach**2 - (place - axle) ** 2)))
        return low

    def ring(self, place: float) -> Floats:
        """Cut the shell on its left side.

        Args:
            place: metres behind the nose; points above and below the bumper lean back from there.

        Returns:
            (7, 3) metres, from the lower edge to the middle of its top.
        """
        half, low, top = self.half_width(place), self.lower_edge(place), self.top(place)
        waist = max(low + 0.02, 0.45 * top + 0.1)
        shoulder = max(waist + 0.02, top - 0.09)
        points = (
            (_LOW * half, low), (half, min(max(low + 0.01, 0.3 * top + 0.1), waist)), (half, waist),
            (_SHOULDER * half, shoulder), (_EDGE * half, top), (0.5 * half, top + 0.03), (0.0, top + 0.04),
        )  # fmt: skip
        return np.array([(-place + self._lean(place, z), y, z) for y, z in points])

    def skin(self, y: float, z: float, *, ahead: bool) -> tuple[Floats, Floats]:
        """Find a point on the nose or the tail.

        Args:
            y: metres to the left along the bumper; beyond where it turns, the point lies on the side.
            z: height, metres.
            ahead: on the nose, or else on the tail.

        Returns:
            (3,) the point, and (3,) the level direction out of the shell there.
        """
        place, turned = self._around(y, ahead=ahead)
        ring = self.ring(place)
        side = min(abs(y), float(np.interp(z, ring[:5, 2], ring[:5, 1])))
        out = np.array([np.cos(turned) * (1 if ahead else -1), np.sin(turned) * np.sign(y), 0.0])
        return np.array([-place + self._lean(place, z), side * np.sign(y), z]), out

    def corners(self, *, ahead: bool) -> Floats:
        """Give the distances from the middle at which a bumper bends.

        Args:
            ahead: on the nose, or else on the tail.

        Returns:
            (k,) metres, ascending; right ones are negative.
        """
        shares = np.array([share for _, share in (_NOSE if ahead else _TAIL)])
        return 0.5 * self.width * np.concatenate([-shares[::-1], shares])

    def bends(self, y: float, *, ahead: bool) -> Floats:
        """Give the heights at which nose or tail bend.

        Args:
            y: metres to the left of the middle.
            ahead: on the nose, or else on the tail.

        Returns:
            (3,) metres above the ground, ascending.
        """
        return self.ring(self._around(y, ahead=ahead)[0])[1:4, 2]

    def _around(self, y: float, *, ahead: bool) -> tuple[float, float]:
        """Go along a bumper: the place there, and how far the bumper has turned to the side, radians."""
        backs, shares = np.array(_NOSE if ahead else _TAIL).T
        share = 2.0 * abs(y) / self.width
        back = float(np.interp(share, shares, backs))
        turned = 0.5 * np.pi * min(1.0, max(0.0, (share - shares[0]) / (1.0 - shares[0])))
        return (back if ahead else self.length - back), turned

    def _lean(self, place: float, z: float) -> float:
        """Tell how far ahead of its station a point lies: nose and tail lean back above and below bumpers."""
        front, rear = place / _LEAN_REACH, (self.length - place) / _LEAN_REACH
        if min(front, rear) >= 1.0:
            return 0.0
        end, rake = (0.0, self.rake[0]) if front < rear else (self.length, self.rake[1])
        top, low = self.top(end), self.lower_edge(end)
        waist, foot = 0.45 * top + 0.1, max(low + 0.01, 0.3 * top + 0.1)
        back = rake * max(0.0, z - waist) / (top - waist) + _CHIN * max(0.0, foot - z) / (foot - low)
        return back * (front - 1.0 if front < rear else 1.0 - rear)


def _at(curve: Curve, place: float) -> float:
    places, values = zip(*curve, strict=True)
    return float(np.interp(place, places, values))


def build_shell(shape: CarShape, detail: int) -> list[Face]:
    """Build the body under the windows.

    Args:
        shape: its measures.
        detail: `FINE` or `COARSE`.

    Returns:
        Its faces, metres.
    """
    places = _stations(shape, detail)
    rings = [shape.ring(place) for place in places]
    if detail == COARSE:
        rings = [np.delete(ring, 5, axis=0) for ring in rings]
    last = len(rings[0]) - 1
    left: list[Face] = []
    for (front, ahead), (rear, behind) in pairwise(zip(places, rings, strict=True)):
        is_covered = front >= shape.cowl and rear <= shape.foot - _OPEN_DECK
        left += [
            (np.array([ahead[k + 1], ahead[k], behind[k], behind[k + 1]]), Part.BODY)
            for k in range(4 if is_covered else last)
        ]
    faces = mirrored(left)
    for ring, turn in ((rings[0], 1), (rings[-1], -1)):
        other = ring * [1.0, -1.0, 1.0]
        for k in range(last):
            quad = np.array([other[k], ring[k], ring[k + 1], other[k + 1]])
            faces.append((quad[::turn], Part.BODY))
    return faces


def _stations(shape: CarShape, detail: int) -> list[float]:
    """List the places of the shell's cuts: close together where it bends."""
    ends = [0.0, 0.035, 0.1, 0.22, 0.45] if detail == FINE else [0.0, 0.06, 0.22]
    places = [*ends, *(shape.length - place for place in ends), shape.cowl, shape.foot]
    if detail == FINE:
        places.append(0.6 * shape.cowl)
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


def build_greenhouse(shape: CarShape, detail: int) -> list[Face]:
    """Build roof, pillars and windows; the side windows stand on the belt and lean inwards.

    Args:
        shape: the car's measures.
        detail: `FINE` or `COARSE`.

    Returns:
        Its faces, metres.
    """
    front, rear = shape.roof
    edge, crown = shape.height - 0.07, shape.height
    half = 0.5 * shape.width
    slim = shape.lean * half

    foot = np.array([shape.ring(place)[4] for place in (shape.cowl, shape.foot)])
    head = np.array([(-front, slim, edge), (-rear, min(slim, 0.96 * foot[1, 1]), edge)])

    def along(share: float, up: float) -> Floats:
        low = shape.ring(shape.cowl + share * (shape.foot - shape.cowl))[4]
        high = head[0] + share * (head[1] - head[0])
        return low + up * (high - low)

    def pane(a: float, b: float, low: float, high: float, part: Part) -> Face:
        return np.array([along(a, high), along(a, low), along(b, low), along(b, high)]), part

    cuts = [0.0, *(place for each in shape.panes for place in each), 1.0]
    left: list[Face] = []
    for number, (a, b) in enumerate(pairwise(cuts)):
        pillar = Part.TRIM if 0 < number < len(cuts) - 2 else Part.BODY
        bands = ((0.0, 0.05, Part.TRIM), (0.05, 0.9, Part.GLASS), (0.9, 1.0, Part.BODY))
        for start, end in pairwise(np.linspace(a, b, 1 + int(np.ceil((b - a) / _LONGEST_PANE)))):
            for low, high, part in bands if number % 2 else ((0.0, 1.0, pillar),):
                left.append(pane(start, end, low, high, part))
    screen, window = (foot[0], head[0], 0.1), (foot[1], head[1], -0.06)
    rows = [_across(*screen, crown, 1.0), _across(*window, crown, 1.0)]
    if detail == FINE:
        rows.insert(1, 0.5 * (rows[0] + rows[1]))
    for ahead, behind in pairwise(rows):
        left += [(np.array([ahead[k + 1], ahead[k], behind[k], behind[k + 1]]), Part.BODY) for k in range(3)]
    left += _pane_across(*screen, crown, (0.06, 0.93))
    if detail == FINE:
        left += _behind_screen(*screen, crown) + _roof_lines(head, crown)
    left += _pane_across(*window, crown, shape.rear_glass, tail=True)
    return mirrored(left)


_SHARES = (1.0, 0.93, 0.5, 0.0)
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


def _pane_across(
    low: Floats, high: Floats, bend: float, crown: float, glass: tuple[float, float], *, tail: bool = False
) -> list[Face]:
    """Build the left half of windscreen or rear window: a pillar, two panes, and a strip under the roof."""
    rows = [_across(low, high, bend, crown, up) for up in (0.0, *glass, 1.0)]
    sill = Part.BODY if glass[0] > _HIGH_PANE else Part.TRIM
    faces: list[Face] = []
    for (below, above), part in zip(pairwise(rows), (sill, Part.GLASS, Part.BODY), strict=True):
        for k in range(3):
            quad = np.array([below[k], above[k], above[k + 1], below[k + 1]])
            faces.append((quad[::-1] if tail else quad, Part.BODY if k == 0 else part))
    return faces


def _behind_screen(low: Floats, high: Floats, bend: float, crown: float) -> list[Face]:
    """Show the left half of what is seen through the windscreen: dashboard, a seat, and the mirror."""
    faces: list[Face] = []
    for (begin, end), (bottom, top), part in (
        ((0.0, 0.95), (0.06, 0.16), Part.TRIM),
        ((0.22, 0.68), (0.25, 0.68), Part.CABIN),
        ((0.34, 0.56), (0.7, 0.83), Part.CABIN),
        ((0.0, 0.1), (0.83, 0.91), Part.TRIM),
    ):
        rows = []
        for up in (bottom, top):
            row = _across(low, high, bend, crown, up)
            rows.append(
                [[np.interp(share, _SHARES[::-1], row[::-1, k]) for k in range(3)] for share in (end, begin)]
            )
        (a, b), (c, d) = np.array(rows) + np.array([0.02, 0.0, 0.02])
        faces.append((np.array([a, c, d, b]), part))
    return faces


def _roof_lines(head: Floats, crown: float) -> list[Face]:
    """Draw the left seam between the roof and the body's side."""
    a, b = (end * [1.0, 0.95, 1.0] + [0.0, 0.0, 0.1 * (crown - end[2]) + 0.012] for end in head)
    side = np.array([0.0, 0.025, -0.004])
    return [(np.array([a, a + side, b + side, b]), Part.TRIM)]
