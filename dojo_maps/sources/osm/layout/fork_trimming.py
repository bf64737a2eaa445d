"""Draw back the roads of a junction that lie on each other, until they have parted.

netconvert cuts roads where their borders meet, but gives up where they meet far away, and lets roads that
part before a junction's middle end there on one line: the junction has no ground then, or a twisted one.
OpenStreetMap lets ramps start in the middle of the road they leave: lanes as wide as they are would lie on
each other there.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
import shapely

from dojo_maps.geometry.polylines import Floats, along
from dojo_maps.sources.osm.layout.arms import Arm, Layout, outward, ray

_FARTHEST, _FARTHEST_OF_FORK = 45.0, 80.0
"""Metres from a junction within which its roads must have parted, and long ones that begin at one
vertex.

netconvert gives a junction no ground when its roads are drawn back much farther.
"""
_GAP = 0.3
_PARTING = 1.5
"""Metres that a fork's roads must draw apart over that way; carriageways do not."""
_FLOOR = 3.0
"""Metres that the other roads are drawn back there, so that the junction has ground of its own."""
_PAST_CROSSING = 2.0
"""Metres by which a crossing may be moved out."""
_LEFT, _LEFT_OF_FORK = 14.0, 40.0
"""Metres of a road that is drawn back which are left, and of one that is drawn back very far."""


def part_roads(layout: Layout) -> Layout:
    """Draw back the arms of each junction to where they lie beside each other, no crossing from its place.

    A roundabout's ring stays as it is: it is enough to draw the other road back.
    """
    cuts = dict(layout.cuts)
    for arms in layout.arms().values():
        drawn = [arm for arm in arms if not layout.graph.sections[arm.section].road.roundabout]
        wanted = {arm: _parted_after(layout, arm, arms) for arm in drawn}
        farthest = {arm: _nearest_crossing(layout, cuts, arm, arms) for arm in drawn}
        for arm in drawn if any(wanted.values()) else ():
            metres = min(max(wanted[arm], _FLOOR), farthest[arm], layout.room(arm, cuts, left=_LEFT))
            cuts[arm] = max(cuts.get(arm, 0.0), metres)
    return replace(layout, cuts=cuts)


def _parted_after(layout: Layout, arm: Arm, arms: Sequence[Arm]) -> float:
    """Measure along an arm to where it has left the others' ground; 0 where they only run side by side."""
    line = outward(layout.graph, arm)
    lengths = along(line)
    at = np.arange(0.0, min(_FARTHEST_OF_FORK, float(lengths[-1])) + 0.5, 1.0)
    places = shapely.points(np.column_stack([np.interp(at, lengths, values) for values in line.T]))
    found = 0.0
    for other in arms:
        if other.section != arm.section:
            beside = outward(layout.graph, other)
            shorter = min(float(lengths[-1]), float(along(beside)[-1]))
            forks = (beside[0] == line[0]).all()
            begins = _begins_on(line, beside[0], layout.half(arm.section))
            reach = max(shorter - _LEFT_OF_FORK, _FARTHEST) if forks else _FARTHEST + begins
            reach = min(_FARTHEST_OF_FORK, reach)
            distances = shapely.distance(places[at <= reach], shapely.LineString(beside))
            free = distances >= layout.half(arm.section) + layout.half(other.section) + _GAP
            free = np.flatnonzero(free & (at[at <= reach] >= begins))
            reached = int(free[0]) if len(free) else len(distances) - 1
            if distances[reached] >= distances[int(begins)] + _PARTING:
                found = max(found, float(at[reached]))
    return found


def _begins_on(line: Floats, place: Floats, half: float) -> float:
    """Measure along a road to where another begins on its ground; 0 where that is far or elsewhere."""
    path, start = shapely.LineString(line), shapely.Point(place)
    at = float(path.project(start))
    return at if at <= _FARTHEST and path.distance(start) < 2 * half else 0.0


def _nearest_crossing(layout: Layout, cuts: Mapping[Arm, float], arm: Arm, arms: Sequence[Arm]) -> float:
    """Measure how far an arm may be drawn back before it would lead a crossing of the junction astray."""
    place, way = ray(layout.graph, arm)
    found = _FARTHEST_OF_FORK
    for crossed in arms:
        if crossed in layout.hosted:
            start, _ = ray(layout.graph, crossed)
            found = min(found, cuts[crossed] + float((start - place) @ way) + _PAST_CROSSING)
    return found
