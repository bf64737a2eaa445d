"""Lane lines that run on through a junction: at forks, merges, and where lanes begin or end."""

from collections import defaultdict
from itertools import pairwise

import numpy as np
import shapely

from dojo_maps.description import CARRIAGEWAY, Connection, Lane, RoadMap
from dojo_maps.geometry.polylines import Floats, Shapes, along, drop_repeats, places_on
from dojo_maps.index import MapIndex

_PLACES = 17
"""Of a line, evenly apart."""


def trace_through_lines(road_map: RoadMap) -> tuple[Shapes, list[Connection]]:
    """Draw the border between each two neighbouring paths through a junction that no other path crosses.

    Args:
        road_map: its connections are the paths.

    Returns:
        (n,) lines, metres, in the frame of the map's origin, and the outer path beside each.
    """
    index, shift = MapIndex(road_map), np.array(road_map.origin)
    through: dict[str, list[Connection]] = defaultdict(list)
    for connection in road_map.connections:
        if len(drop_repeats(connection.shape)) > 1:
            through[index.roads[index.lanes[connection.from_lane].road].to_junction].append(connection)
    lines: list[shapely.LineString] = []
    beside: list[Connection] = []
    for paths in through.values():
        pairs = _list_neighbours(paths, index.lanes)
        if not pairs:
            continue
        tree = shapely.STRtree([shapely.linestrings(path.shape[:, :2] - shift) for path in paths])
        borders = np.array([_draw_border(*pair, index.lanes, shift) for pair in pairs], dtype=object)
        crossed = set(tree.query(borders, predicate="intersects")[0])
        kept = [number for number in range(len(pairs)) if number not in crossed]
        lines += [borders[number] for number in kept]
        beside += [pairs[number][0] for number in kept]
    return np.array(lines, dtype=object), beside


def _list_neighbours(paths: list[Connection], lanes: dict[str, Lane]) -> list[tuple[Connection, Connection]]:
    """List pairs of paths that come from two neighbouring lanes and lead to two neighbouring ones."""
    found: dict[tuple[str, str], list[tuple[int, int, Connection]]] = defaultdict(list)
    for path in paths:
        start, end = lanes[path.from_lane], lanes[path.to_lane]
        if start.kind in CARRIAGEWAY and end.kind in CARRIAGEWAY:
            found[start.road, end.road].append((start.index, end.index, path))
    return [
        (outer[2], inner[2])
        for group in found.values()
        for outer, inner in pairwise(sorted(group, key=lambda each: each[:2]))
        if inner[0] - outer[0] == inner[1] - outer[1] == 1
    ]


def _draw_border(
    outer: Connection, inner: Connection, lanes: dict[str, Lane], shift: Floats
) -> shapely.LineString:
    """Draw a line between two paths, as far from each as its lane is wide."""
    share = lanes[outer.from_lane].width / (lanes[outer.from_lane].width + lanes[inner.from_lane].width)
    sides = []
    for path in (outer, inner):
        shape = drop_repeats(path.shape)
        sides.append(places_on(shape, np.linspace(0.0, along(shape)[-1], _PLACES))[0][:, :2])
    return shapely.linestrings(sides[0] + (sides[1] - sides[0]) * share - shift)
