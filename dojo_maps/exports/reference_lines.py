"""Reference lines of OpenDRIVE roads: lines with rounded corners, curves across junctions, places beside.

Every piece begins exactly where the one before it ends, and at a road's ends the lanes' corners lie across
its heading, so that the lanes of a junction meet those of its roads.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import shapely

from dojo_maps.geometry.polylines import Floats, along

Place = tuple[Floats, float]
"""A position (2,), metres, and the heading there, radians counter-clockwise from east."""

_ROUNDING = 0.05
"""How far a rounded corner may leave its vertex, metres."""
_STRAIGHT = 0.002
"""Vertices that lie closer to the line between their neighbours than this are left out, metres."""
_SHARPEST = 3.0
"""Radians; a line that turns further than this turns back, which no arc can follow."""
_SHORTEST = 0.005
"""Metres that a line without length gets, because OpenDRIVE has no road without."""
_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(48)


@dataclass(frozen=True, slots=True, kw_only=True)
class Piece:
    """A line, an arc, or a parametric cubic curve; metres and radians.

    Attributes:
        cubic: for curves, the coefficients of u and of v, (2, 4), lowest power first, for p from 0 to 1.
    """

    s: float
    start: Floats
    heading: float
    length: float
    curvature: float = 0.0
    cubic: Floats | None = None

    def place(self, s: float) -> Place:
        """Find the position and the heading at a distance along the road; not for cubic curves.

        Args:
            s: metres from the road's start, not from the piece's.

        Returns:
            The position (2,), metres, and the heading, radians counter-clockwise from east.
        """
        ahead, middle = s - self.s, self.heading + self.curvature * (s - self.s) / 2
        chord = ahead * np.sinc(self.curvature * ahead / 2 / np.pi)
        return self.start + chord * unit(middle), self.heading + self.curvature * ahead


class ReferenceLine:
    """The pieces of a road's reference line, with places on it and beside it."""

    def __init__(self, line: Floats) -> None:
        """Lay lines and arcs along a centre line.

        Args:
            line: (n, 3) metres, n >= 1.
        """
        self.pieces = _lines_and_arcs(_with_length(line[:, :2]))
        self.length = self.pieces[-1].s + self.pieces[-1].length
        self.heights = heights_along(line, self.length)
        self._starts = np.array([*(piece.s for piece in self.pieces), self.length])
        self.chords = shapely.LineString(
            [*(piece.start for piece in self.pieces), self.place(self.length)[0]]
        )

    def place(self, s: float) -> Place:
        """Find the position and the heading at a distance from the start.

        Args:
            s: metres; before the start or past the end, the first or the last piece is carried on.

        Returns:
            The position (2,), metres, and the heading, radians counter-clockwise from east.
        """
        index = int(np.searchsorted(self._starts[:-1], s, side="right")) - 1
        return self.pieces[max(index, 0)].place(s)

    def beside(self, s: float, t: float) -> Place:
        """Find a place beside the line, and the heading of the line there.

        Args:
            s: metres from the line's start.
            t: metres to the left of the line.

        Returns:
            The position (2,), metres, and the heading, radians counter-clockwise from east.
        """
        position, heading = self.place(s)
        return position + t * unit(heading + np.pi / 2), heading

    def locate(self, position: Floats) -> tuple[float, float]:
        """Find the place on the line next to a position.

        Args:
            position: (2 or more,), metres; only x and y count.

        Returns:
            Metres from the line's start, within the line, and metres to its left.
        """
        along_chords = self.chords.project(shapely.Point(position[:2]))
        nearest = float(np.interp(along_chords, along(shapely.get_coordinates(self.chords)), self._starts))
        foot, heading = self.place(nearest)
        return nearest, float(np.dot(position[:2] - foot, unit(heading + np.pi / 2)))

    def height(self, s: float) -> float:
        """Tell the line's height at a distance from its start.

        Args:
            s: metres; held to the line's ends.

        Returns:
            Metres.
        """
        return float(np.interp(s, self.heights[:, 0], self.heights[:, 1]))


def unit(heading: float) -> Floats:
    """Make the unit vector of a heading.

    Args:
        heading: radians, counter-clockwise from east.

    Returns:
        (2,), x east and y north.
    """
    return np.array([np.cos(heading), np.sin(heading)])


def heights_along(line: Floats, length: float) -> Floats:
    """List where the slope of a line changes.

    Args:
        line: (n, 3) metres.
        length: metres that the whole line is given.

    Returns:
        (k, 2), distance from the start and height there, metres; one row for a line without length.
    """
    distances = along(line)
    if distances[-1] == 0:
        return np.array([[0.0, line[0, 2]]])
    places = np.column_stack([distances * length / distances[-1], line[:, 2]])
    return shapely.get_coordinates(shapely.LineString(places).simplify(_STRAIGHT))


def curve(start: Place, end: Place, between: Floats) -> list[Piece]:
    """Draw a smooth curve from a place to a place through positions.

    Args:
        start: position (2,) and heading.
        end: position (2,) and heading.
        between: (n, 2); those that do not lie ahead of the start and before the end are left out.

    Returns:
        Cubic curves, at least one; each begins where the one before it ends, the first at `s` 0.
    """
    (first, heading), (last, end_heading) = start, end
    margin = min(0.5, float(np.hypot(*(last - first))) / 4)
    ahead = (between - first) @ unit(heading) > margin
    before = (last - between) @ unit(end_heading) > margin
    kept = np.flatnonzero(ahead & before)
    inner = between[kept[0] : kept[-1] + 1] if len(kept) else between[:0]
    vertices = _with_length(np.vstack([first, inner, last]), heading)
    steps = np.diff(vertices, axis=0)
    lengths = np.hypot(*steps.T)
    slopes = steps / lengths[:, None]
    tangents = slopes[:-1] * lengths[1:, None] + slopes[1:] * lengths[:-1, None]
    headings = [heading, *np.arctan2(tangents[:, 1], tangents[:, 0]), end_heading]
    pieces: list[Piece] = []
    s = 0.0
    for k, step in enumerate(steps):
        pieces.append(_cubic(s, vertices[k], step, headings[k], headings[k + 1]))
        s += pieces[-1].length
    return pieces


def sample(pieces: Sequence[Piece], *, apart: float) -> Floats:
    """Take positions along the curves that `curve` draws.

    Args:
        pieces: cubic curves, at least one.
        apart: metres from one position to the next, about.

    Returns:
        (n, 2), metres, n >= 2, from the first curve's start to the last one's end.
    """
    places = [pieces[0].start[None]]
    for piece in pieces:
        p = np.linspace(0.0, 1.0, max(int(np.ceil(piece.length / apart)), 1) + 1)[1:]
        ahead, aside = piece.cubic @ np.array([np.ones_like(p), p, p**2, p**3])
        turn = np.array([unit(piece.heading), unit(piece.heading + np.pi / 2)])
        places.append(piece.start + np.column_stack([ahead, aside]) @ turn)
    return np.vstack(places)


def _cubic(s: float, start: Floats, step: Floats, heading: float, end_heading: float) -> Piece:
    """Make the Hermite curve with both headings; its tangents are as long as the step."""
    turn = np.array([unit(heading), unit(heading + np.pi / 2)])
    chord = float(np.hypot(*step))
    end, first, last = turn @ step, np.array([chord, 0.0]), turn @ unit(end_heading) * chord
    cubic = np.column_stack([np.zeros(2), first, 3 * end - 2 * first - last, first + last - 2 * end])
    p = (_NODES + 1) / 2
    speed = np.hypot(*(cubic[:, 1:] @ np.array([np.ones_like(p), 2 * p, 3 * p**2])))
    return Piece(s=s, start=start, heading=heading, length=float(_WEIGHTS @ speed / 2), cubic=cubic)


def _with_length(line: Floats, heading: float = 0.0) -> Floats:
    """Drop repeated vertices; a line without length becomes a very short one along the heading."""
    apart = np.hypot(*np.diff(line, axis=0).T) > 1e-3
    kept = line[np.append(True, apart)]
    return kept if len(kept) > 1 else np.vstack([kept, kept + _SHORTEST * unit(heading)])


def _lines_and_arcs(line: Floats) -> list[Piece]:
    vertices = shapely.get_coordinates(shapely.LineString(line).simplify(_STRAIGHT))
    vertices = _with_length(vertices)
    steps = np.diff(vertices, axis=0)
    lengths, headings = np.hypot(*steps.T), np.arctan2(steps[:, 1], steps[:, 0])
    turns = (np.diff(headings) + np.pi) % (2 * np.pi) - np.pi
    cuts = _cut_corners(lengths, turns)
    pieces: list[Piece] = []
    s = 0.0
    for k, heading in enumerate(headings):
        length = lengths[k] - cuts[k] - cuts[k + 1]
        if length > 1e-9:
            pieces.append(
                Piece(s=s, start=vertices[k] + cuts[k] * unit(heading), heading=heading, length=length)
            )
            s += length
        if k < len(turns) and cuts[k + 1] > 0:
            curvature = np.tan(turns[k] / 2) / cuts[k + 1]
            start = vertices[k + 1] - cuts[k + 1] * unit(heading)
            length = turns[k] / curvature
            pieces.append(Piece(s=s, start=start, heading=heading, length=length, curvature=curvature))
            s += length
    return pieces


def _cut_corners(lengths: Floats, turns: Floats) -> Floats:
    """Choose how far from each vertex its arc begins and ends, metres, none at the line's ends."""
    cuts = np.zeros(len(lengths) + 1)
    room = np.minimum(lengths[:-1], lengths[1:]) / 2
    angle = np.abs(turns)
    cuts[1:-1] = np.where(
        (angle > 1e-4) & (angle < _SHARPEST),
        np.minimum(room, _ROUNDING / np.maximum(np.tan(angle / 4), 1e-9)),
        0.0,
    )
    return cuts


def outline_of(ring: Sequence[Sequence[float]] | Floats, origin: Floats, heading: float) -> Floats:
    """Turn positions into a frame at an origin, its first axis along a heading.

    Args:
        ring: (n, 3), metres.
        origin: (3,), metres, in the frame of the positions.
        heading: radians, counter-clockwise from east.

    Returns:
        (n, 3), metres ahead of the origin, to its left, and above it.
    """
    away = np.asarray(ring) - origin
    forward, left = unit(heading), unit(heading + np.pi / 2)
    return np.column_stack([away[:, :2] @ forward, away[:, :2] @ left, away[:, 2]])
