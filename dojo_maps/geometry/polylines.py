"""Lines of positions: lengths along them, places on them, and heights beside them."""

from collections.abc import Sequence

import numpy as np
import shapely
from numpy.typing import NDArray

from dojo_maps.description import Points, points

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Flags = NDArray[np.bool_]
Shapes = NDArray[np.object_]
"""(n,) shapely geometries, metres, in the frame of `RoadMap.origin`."""


def along(line: Floats) -> Floats:
    """Measure each point's distance from the start along the line, in the plane.

    Args:
        line: (n, 2 or 3), metres; heights do not count.

    Returns:
        (n,) metres, the first one 0.
    """
    lengths = np.zeros(len(line))
    np.cumsum(np.hypot(line[1:, 0] - line[:-1, 0], line[1:, 1] - line[:-1, 1]), out=lengths[1:])
    return lengths


def drop_repeats(line: Points, *, closer_than: float = 1e-3) -> Points:
    """Drop points that lie on the one before them; a line without length comes back as one point.

    Args:
        line: (n, 2 or 3), metres.
        closer_than: metres in x and in y, up to which two points are one.

    Returns:
        (k, 2 or 3), metres; the line itself where nothing is dropped.
    """
    apart = np.abs(line[1:, :2] - line[:-1, :2]).max(axis=1) > closer_than
    return line if apart.all() else line[np.append(True, apart)]


def place_on(line: Points, distance: float) -> tuple[Floats, float]:
    """Find a place on a line and the direction there.

    Args:
        line: (n, 3), metres, n >= 2, with length.
        distance: metres from the start, or from the end if negative; held to the line's ends.

    Returns:
        The position (3,), metres, and the heading, radians counter-clockwise from east.
    """
    positions, headings = places_on(line, np.array([distance]))
    return positions[0], float(headings[0])


def places_on(line: Points, distances: Floats) -> tuple[Floats, Floats]:
    """Find several places on a line, as `place_on` does.

    Args:
        line: (k, 3), metres, k >= 2, with length.
        distances: (n,) metres from the start, or from the end if negative; held to the line's ends.

    Returns:
        Positions (n, 3), metres, and headings (n,), radians counter-clockwise from east.
    """
    lengths = along(line)
    wanted = np.clip(np.where(distances >= 0, distances, lengths[-1] + distances), 0.0, lengths[-1])
    # The last piece that has length also holds the line's end.
    last = max(int(np.searchsorted(lengths, lengths[-1])) - 1, 0)
    piece = np.minimum(np.searchsorted(lengths, wanted, side="right") - 1, last)
    positions = np.column_stack([np.interp(wanted, lengths, values) for values in line.T])
    step = line[piece + 1] - line[piece]
    return positions, np.arctan2(step[:, 1], step[:, 0])


def offset_lines(lines: Shapes, distances: Floats) -> Shapes:
    """Offset centre lines sideways.

    Args:
        lines: (n,) line strings, metres.
        distances: (n,) metres, positive to the left.

    Returns:
        (n,) lines, some of several parts; empty where 0.1 m or less remains.
    """
    moved = shapely.offset_curve(lines, distances, join_style="mitre", mitre_limit=2.0)
    return np.where(shapely.length(moved) > 0.1, moved, shapely.LineString())


def lift(places: Floats, line: Points) -> Points:
    """Give places the heights of their nearest points on a line.

    Args:
        places: (n, 2), metres, in the line's frame.
        line: (k, 3), metres.

    Returns:
        (n, 3), metres, in the same order; read-only.
    """
    heights = np.zeros(len(places))
    if line[:, 2].any():
        heights = HeightLines([line]).at(np.zeros(len(places), dtype=np.int64), places)
    return points(np.column_stack([places, heights]))


def lift_to_nearest(places: Floats, lines: Sequence[Points]) -> Points:
    """Give places the heights of the nearest of several lines.

    Args:
        places: (n, 2), metres, in the lines' frame.
        lines: (k, 3) each, metres; without any, all heights are 0.

    Returns:
        (n, 3), metres, in the same order; read-only.
    """
    heights = HeightLines(lines)
    nearest = np.zeros(len(places), dtype=np.int64)
    if not heights.flat:
        tree = shapely.STRtree(_line_strings(lines))
        nearest = tree.nearest(shapely.points(places))
    return points(np.column_stack([places, heights.at(nearest, places)]))


def strip_outline(shape: Points, width: float) -> Points:
    """Outline the strip of one centre line, as `strip_outlines` does.

    Args:
        shape: (k, 3), metres, k >= 1.
        width: metres.

    Returns:
        (n, 3), metres.
    """
    return strip_outlines([shape], [width])[0]


def strip_outlines(shapes: Sequence[Points], widths: Sequence[float]) -> list[Points]:
    """Outline the strips of centre lines, flat at their ends.

    Args:
        shapes: (k, 3) each, metres, k >= 1.
        widths: metres.

    Returns:
        (n, 3) each, metres, with the line's heights; the ring closes implicitly. A line without length has a
        disc around it.
    """
    if not shapes:
        return []
    lines, halves = _line_strings(shapes), np.asarray(widths) / 2
    strips = shapely.buffer(lines, halves, cap_style="flat", join_style="mitre", mitre_limit=2.0)
    odd = (shapely.get_type_id(strips) != shapely.GeometryType.POLYGON) | shapely.is_empty(strips)
    strips[odd] = shapely.convex_hull(shapely.buffer(lines[odd], halves[odd]))
    corners, owner = shapely.get_coordinates(shapely.get_exterior_ring(strips), return_index=True)
    heights = HeightLines(shapes).at(owner, corners)
    rings = np.split(np.column_stack([corners, heights]), np.flatnonzero(np.diff(owner)) + 1)
    return [points(ring[:-1]) for ring in rings]


class HeightLines:
    """Heights known along one reference line per piece, asked for at any place beside it."""

    def __init__(self, lines: Sequence[Points]) -> None:
        """Take one (n, 3) line per piece, metres, in the frame of the places asked for."""
        self._flat = all(not line[:, 2].any() for line in lines)
        if self._flat:
            return
        lengths = [along(line) for line in lines]
        spans = np.array([length[-1] + 1.0 for length in lengths])
        self._starts = np.concatenate([[0.0], np.cumsum(spans)])
        self._along = np.concatenate([a + start for a, start in zip(lengths, self._starts, strict=False)])
        self._heights = np.concatenate([line[:, 2] for line in lines])
        self._lines = _line_strings(lines)

    @property
    def flat(self) -> bool:
        """Whether every height is zero."""
        return self._flat

    def at(self, pieces: Ints, places: Floats) -> Floats:
        """Take the height of each piece's line at its nearest point to a place.

        Args:
            pieces: (n,) indices of lines.
            places: (n, 2) metres.

        Returns:
            (n,) metres.
        """
        if self._flat:
            return np.zeros(len(places))
        distance = shapely.line_locate_point(self._lines[pieces], shapely.points(places))
        return np.interp(distance + self._starts[pieces], self._along, self._heights)


def _line_strings(lines: Sequence[Points]) -> Shapes:
    """Make line strings in the plane; one of a single point has it twice."""
    flat = [_at_least_two(line[:, :2]) for line in lines]
    owner = np.repeat(np.arange(len(flat)), [len(line) for line in flat])
    strings: Shapes = shapely.linestrings(np.concatenate(flat), indices=owner)
    return strings


def _at_least_two(line: Floats) -> Floats:
    return line if len(line) > 1 else np.repeat(line, 2, axis=0)
