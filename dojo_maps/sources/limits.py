"""Bounds on shapes, beyond which cutting them along each other takes time and memory without end.

Cutting costs as much as there are outlines that come near each other. In a street network that is a few for
each piece of an outline, however large the network; where one lane is scribbled over itself, or thousands
lie on one place, it is all of them for each. So the average over the network is bounded.
"""

from collections.abc import Collection
from pathlib import Path

import numpy as np
import shapely

from dojo_maps.description import Crossing, Junction, Lane, Points, WalkingArea
from dojo_maps.errors import SourceError
from dojo_maps.geometry.polylines import Floats, Ints, Shapes, along

MAX_NEARBY = 100.0
"""Metres of outlines that may lie near the average piece; in the networks that come with SUMO up to 32 do."""
MAX_LENGTH = 2e7
"""Metres of all lanes and crossings together, as in a few of the largest cities at once."""
WIDEST = 1e6
"""Metres; a larger network has a misplaced shape."""
HIGHEST = 1e5
"""Metres above or below zero; ten times the highest mountain."""
_REACH = 2.5
"""Metres: pieces closer than twice this meet when the gaps between them are closed."""
MAX_WIDTH = 1_000.0
_LEAST, _MOST = 0.05, 1.0
"""Bounds on how much a piece counts for, metres. Short ones count for less, so that finely drawn shapes do
not count for more, though not for nothing: there is work for each."""
_PAIRS_AT_ONCE = 20_000_000


def measure_bounds(shapes: list[Points], path: Path) -> tuple[tuple[float, float], tuple[float, float]]:
    """Measure the rectangle around all shapes.

    Args:
        shapes: (n, 3) each, metres, map frame; at least one of them has a position.
        path: where they came from, for errors.

    Returns:
        Its low and its high corner, (x, y), metres.

    Raises:
        SourceError: a shape lies too far away, or too high for the single precision of meshes.
    """
    every = np.concatenate(shapes)
    low, high = every[:, :2].min(axis=0), every[:, :2].max(axis=0)
    if (high - low).max() > WIDEST:
        size = f"{high[0] - low[0]:.0f} by {high[1] - low[1]:.0f} m"
        raise SourceError(path, f"the network spans {size}; at most {WIDEST:.0f} m are converted")
    height = float(np.abs(every[:, 2]).max())
    if height > HIGHEST:
        raise SourceError(path, f"a shape lies {height:.0f} m high; at most {HIGHEST:.0f} m are converted")
    return (float(low[0]), float(low[1])), (float(high[0]), float(high[1]))


def check_limits(
    strips: Collection[Lane | Crossing], areas: Collection[Junction | WalkingArea], path: Path
) -> None:
    """Refuse a network whose shapes would hold the converter for hours.

    Args:
        strips: all lanes and crossings, at least one.
        areas: all junctions and walking areas; those without an outline may be among them.
        path: where they came from, for errors.

    Raises:
        SourceError: a lane or crossing is too wide, or the network is too long or too crowded.
    """
    for strip in strips:
        if strip.width > MAX_WIDTH:
            raise SourceError(
                path, f"width={strip.width:g}, expected at most {MAX_WIDTH:g} m", element=_name(strip)
            )
    length = sum(float(along(strip.shape)[-1]) for strip in strips)
    if length > MAX_LENGTH:
        raise SourceError(
            path,
            f"its lanes are {length / 1000:.0f} km long together, at most {MAX_LENGTH / 1000:.0f} km are "
            "converted; cut out a part with netconvert --keep-edges.in-boundary",
        )
    names = [_name(thing) for thing in (*strips, *areas)]
    rings = [np.concatenate([area.polygon, area.polygon[:1]]) for area in areas]
    lines = [line[:, :2] for line in (*(strip.shape for strip in strips), *rings)]
    reaches = [_REACH + strip.width / 2 for strip in strips] + [_REACH] * len(rings)
    _check_crowding(names, lines, np.array(reaches), path)


def _name(thing: Lane | Crossing | Junction | WalkingArea) -> str:
    kind = "walking area" if isinstance(thing, WalkingArea) else type(thing).__name__.lower()
    return f"{kind} {thing.id}"


def _check_crowding(names: list[str], lines: list[Floats], reaches: Floats, path: Path) -> None:
    boxes, weights, owners = _pieces(lines, reaches)
    tree = shapely.STRtree(boxes)
    rows = max(1, _PAIRS_AT_ONCE // len(boxes))
    total, worst, crowded = 0.0, 0.0, 0
    for first in range(0, len(boxes), rows):
        piece, other = tree.query(boxes[first : first + rows])
        near = np.bincount(piece, weights=weights[other])
        total += float(near.sum())
        if near.max() > worst:
            worst, crowded = float(near.max()), first + int(near.argmax())
        if total > MAX_NEARBY * len(boxes):
            raise SourceError(
                path,
                f"shapes run over each other: {worst:.0f} m of them lie near a piece of this one, and the "
                f"average is above {MAX_NEARBY:.0f} m where streets have up to 32; remove what is drawn over "
                "itself or many times on one place",
                element=names[owners[crowded]],
            )


def _pieces(lines: list[Floats], reaches: Floats) -> tuple[Shapes, Floats, Ints]:
    """Box each straight piece of each line with what it reaches; with its weight, and the line's index."""
    counts = np.array([len(line) for line in lines])
    places = np.concatenate(lines)
    line = np.repeat(np.arange(len(lines)), counts)
    inner = line[1:] == line[:-1]
    start, end, line = places[:-1][inner], places[1:][inner], line[1:][inner]
    reach = reaches[line][:, None]
    low, high = np.minimum(start, end) - reach, np.maximum(start, end) + reach
    weights = np.clip(np.hypot(*(end - start).T), _LEAST, _MOST)
    return shapely.box(*low.T, *high.T), weights, line
