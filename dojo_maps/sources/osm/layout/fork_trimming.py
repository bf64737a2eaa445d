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


def trim_forks(layout: Layout) -> Layout:
    """Draw back the arms of each junction to where they lie beside each other, no crossing from its place.

    A roundabout's ring stays as it is: it is enough to draw the other road back.

    Args:
        layout: with its crossings at their arms.

    Returns:
        The layout with larger cuts, as far as its roads are long enough.
    """
    cuts, rules = dict(layout.cuts), layout.rules.forks
    for arms in layout.arms().values():
        drawn = [arm for arm in arms if not layout.graph.sections[arm.section].road.roundabout]
        lines = {arm: outward(layout.graph, arm) for arm in arms}
        wanted = {arm: _parted_after(layout, arm, lines) for arm in drawn}
        if not any(wanted.values()):
            continue
        farthest = {arm: _nearest_crossing(layout, cuts, arm, arms) for arm in drawn}
        for arm in drawn:
            metres = min(
                max(wanted[arm], rules.others), farthest[arm], layout.room(arm, cuts, left=rules.road_left)
            )
            cuts[arm] = max(cuts.get(arm, 0.0), metres)
    return replace(layout, cuts=cuts)


def _parted_after(layout: Layout, arm: Arm, lines: Mapping[Arm, Floats]) -> float:
    """Measure along an arm to where it has left the others' ground; 0 where they only run side by side.

    Args:
        layout: with its crossings at their arms.
        arm: one of a junction.
        lines: of all its arms, outward.
    """
    line, rules = lines[arm], layout.rules.forks
    lengths = along(line)
    at = np.arange(0.0, min(rules.farthest_of_fork, float(lengths[-1])) + 0.5, 1.0)
    places = shapely.points(np.column_stack([np.interp(at, lengths, values) for values in line.T]))
    found = 0.0
    for other, beside in lines.items():
        if other.section != arm.section:
            shorter = min(float(lengths[-1]), float(along(beside)[-1]))
            forks = (beside[0] == line[0]).all()
            begins = _begins_on(line, beside[0], layout.half(arm.section), rules.farthest)
            reach = (
                max(shorter - rules.road_left_of_fork, rules.farthest) if forks else rules.farthest + begins
            )
            reach = min(rules.farthest_of_fork, reach)
            distances = shapely.distance(places[at <= reach], shapely.LineString(beside))
            free = distances >= layout.half(arm.section) + layout.half(other.section) + rules.gap
            free = np.flatnonzero(free & (at[at <= reach] >= begins))
            reached = int(free[0]) if len(free) else len(distances) - 1
            if distances[reached] >= distances[int(begins)] + rules.parting:
                found = max(found, float(at[reached]))
    return found


def _begins_on(line: Floats, place: Floats, half: float, farthest: float) -> float:
    """Measure along a road to where another begins on its ground; 0 where that is far or elsewhere."""
    path, start = shapely.LineString(line), shapely.Point(place)
    at = float(path.project(start))
    return at if at <= farthest and path.distance(start) < 2 * half else 0.0


def _nearest_crossing(layout: Layout, cuts: Mapping[Arm, float], arm: Arm, arms: Sequence[Arm]) -> float:
    """Measure how far an arm may be drawn back before it would lead a crossing of the junction astray."""
    place, way = ray(layout.graph, arm)
    rules = layout.rules.forks
    found = rules.farthest_of_fork
    for crossed in arms:
        if crossed in layout.hosted:
            start, _ = ray(layout.graph, crossed)
            found = min(found, cuts[crossed] + float((start - place) @ way) + rules.past_crossing)
    return found
