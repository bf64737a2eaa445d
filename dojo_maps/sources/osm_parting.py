"""Draw back the roads of a junction that lie on each other, until they have parted.

netconvert cuts roads where their borders meet, but gives up where they meet far away, and lets roads that
part before a junction's middle end there on one line: the junction has no ground then, or a twisted one.
OpenStreetMap lets ramps start in the middle of the road they leave: lanes as wide as they are would lie on
each other there.
"""

import itertools
import math
from collections.abc import Sequence

import numpy as np
import shapely

from dojo_maps.geometry.polylines import along
from dojo_maps.sources.osm_arms import Arm, Layout, outward, ray, trim

_SHARP = math.cos(math.radians(65.0))
_FARTHEST = 100.0
"""Metres from a junction within which roads that begin there must have parted."""
_GAP = 0.3
_MEETS_AGAIN = 10.0
"""Metres after roads have parted beyond which it is another place where they lie on each other."""
_FLOOR = 3.0
"""Metres that the other roads are drawn back there, so that the junction has ground of its own."""
_LEAST = 1.0
"""Square metres of shared ground, and metres from a road's end."""
_PAST_CROSSING = 6.0
"""Metres by which a crossing may be moved out."""
_LEFT = 14.0
"""Metres of a road that is drawn back which are left."""


def part_roads(layout: Layout) -> None:
    """Draw back the arms of each junction that part at a sharp angle, but no crossing out of its place.

    A roundabout's ring stays as it is: it is enough to draw the other road back.
    """
    for arms in layout.arms().values():
        for arm, metres in sorted(_parted_after(layout, arms).items()):
            cut = layout.cuts.get(arm, 0.0)
            farthest = cut + _PAST_CROSSING if arm in layout.hosted else _FARTHEST
            layout.cuts[arm] = max(cut, min(metres, farthest, layout.room(arm, left=_LEFT)))


def _parted_after(layout: Layout, arms: Sequence[Arm]) -> dict[Arm, float]:
    """Measure how far from their vertices a junction's roads lie on each other; empty where none do."""
    graph = layout.graph
    paths, strips, ways = {}, {}, {}
    for arm in arms:
        line = outward(graph, arm)
        line = trim(line, 0.0, max(float(along(line)[-1]) - _FARTHEST, 0.0))
        half = (graph.sections[arm[0]].road.drives + _GAP) / 2
        paths[arm] = shapely.LineString(line)
        strips[arm] = paths[arm].buffer(half, cap_style="flat", join_style="mitre")
        ways[arm] = ray(graph, arm)[1]
    found: dict[Arm, float] = {}
    for one, other in itertools.combinations(arms, 2):
        if one[0] == other[0] or float(ways[one] @ ways[other]) < _SHARP:
            continue
        shared = shapely.intersection(strips[one], strips[other])
        reached = [_reached(shared, paths[arm]) for arm in (one, other)]
        if all(
            metres > paths[arm].length - _LEAST for arm, metres in zip((one, other), reached, strict=True)
        ):
            continue
        for arm, metres in zip((one, other), reached, strict=True):
            found[arm] = max(found.get(arm, 0.0), metres)
    found = {arm: metres for arm, metres in found.items() if metres}
    drawn = [arm for arm in arms if not graph.sections[arm[0]].road.roundabout]
    return {arm: max(found.get(arm, 0.0), _FLOOR) for arm in drawn} if found else {}


def _reached(shared: shapely.Geometry, path: shapely.LineString) -> float:
    """Measure along a path to where the ground that it shares from its beginning ends; 0 without any."""
    reached = 0.0
    parts = []
    for part in shapely.get_parts(shared):
        if part.area >= _LEAST:
            along_path = shapely.line_locate_point(path, shapely.points(shapely.get_coordinates(part)))
            parts.append((float(np.min(along_path)), float(np.max(along_path))))
    for first, last in sorted(parts):
        if first < reached + _MEETS_AGAIN:
            reached = max(reached, last)
    return reached
