"""How far roads that part at a sharp angle are drawn back from their junction, until they lie side by side.

netconvert cuts roads where their borders meet, but gives up where they meet far away, and lets roads that
part before a junction's middle end there on one line: the junction has no ground then, or a twisted one.
"""

import itertools
import math
from collections.abc import Sequence

import numpy as np
import shapely

from dojo_maps.geometry.polylines import Floats, along
from dojo_maps.sources.osm_graph import RoadGraph

_SHARP = math.cos(math.radians(65.0))
_FARTHEST = 100.0
"""Metres from a junction within which roads that begin there must have parted."""
_HEADING = 25.0
_FLOOR = 3.0
"""Metres that the other roads are drawn back there, so that the junction has ground of its own."""
_LEAST = 1.0

Arm = tuple[str, bool]
"""A section's id, and whether its end is meant rather than its start."""


def sharp_corners(graph: RoadGraph, arms: Sequence[Arm]) -> dict[Arm, float]:
    """Measure how far a junction's roads lie on each other.

    Args:
        graph: the roads.
        arms: those of one junction.

    Returns:
        Metres from the vertex of each arm; empty where no two roads part at a sharp angle. A roundabout's
        ring stays as it is: it is enough to draw the other road back.
    """
    lines = {arm: _first_part(graph, arm) for arm in arms}
    found: dict[Arm, float] = {}
    for one, other in itertools.combinations(arms, 2):
        if one[0] == other[0] or float(_heading(lines[one]) @ _heading(lines[other])) < _SHARP:
            continue
        shared = _shared_ground(graph, one, other, lines)
        if shared is not None:
            for arm, metres in zip((one, other), shared, strict=True):
                found[arm] = max(found.get(arm, 0.0), metres)
    drawn = [arm for arm in arms if not graph.sections[arm[0]].road.roundabout]
    return {arm: max(found.get(arm, 0.0), _FLOOR) for arm in drawn} if found else {}


def _first_part(graph: RoadGraph, arm: Arm) -> Floats:
    """Follow an arm from its vertex as far as it matters."""
    line = graph.line(graph.sections[arm[0]])
    line = line[::-1] if arm[1] else line
    lengths = along(line)
    reach = min(_FARTHEST, float(lengths[-1]))
    inner = lengths < reach - 1e-6
    end = [np.interp(reach, lengths, values) for values in line.T]
    return np.vstack([line[inner], end])


def _heading(line: Floats) -> Floats:
    lengths = along(line)
    ahead = np.array([np.interp(_HEADING, lengths, values) for values in line.T]) - line[0]
    return ahead / max(float(np.hypot(*ahead)), 1e-6)


def _shared_ground(
    graph: RoadGraph, one: Arm, other: Arm, lines: dict[Arm, Floats]
) -> tuple[float, float] | None:
    """Measure along two arms until they part; None where they do not lie on each other, or never part."""
    paths = [shapely.LineString(lines[arm]) for arm in (one, other)]
    strips = [
        path.buffer(graph.sections[arm[0]].road.drives / 2, cap_style="flat", join_style="mitre")
        for path, arm in zip(paths, (one, other), strict=True)
    ]
    shared = shapely.intersection(*strips)
    if shared.area < _LEAST:
        return None
    corners = shapely.points(shapely.get_coordinates(shared))
    far = [float(path.project(corners).max()) for path in paths]
    ends = [metres > path.length - _LEAST for metres, path in zip(far, paths, strict=True)]
    return None if all(ends) else (far[0], far[1])
