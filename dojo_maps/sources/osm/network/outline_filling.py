"""Give junctions the ground of the mapped roads inside them: slip lanes, links, ends of roads, cut pavement.

netconvert draws a junction's outline from arm to arm, and leaves out what lies beyond: a slip lane that leads
around a corner, where drivers see an island, not grass.
"""

from collections import defaultdict

import numpy as np
import shapely

from dojo_maps.description import LaneKind, RoadMap
from dojo_maps.geometry.pieces import lane_strips
from dojo_maps.geometry.polylines import Floats, along
from dojo_maps.sources.osm.layout.arms import Arm, Layout, outward, trim
from dojo_maps.sources.osm.network.junction_outlines import outline_of, replace_outlines
from dojo_maps.sources.osm.network.pavement_trimming import Ground

_SLIT = 0.02
"""Half the metres across the slit that leads an outline around an island; meshes close it."""
_LEVEL = 2.0
"""Metres of height from which a lane is above or below a junction."""
_SMOOTH = 0.05
"""Metres by which corners are simplified."""
_GRID = 0.01
"""Metres that a network rounds to."""
_LAP = 0.05
"""Metres by which the ground of a drawn back road reaches over its lanes' ends, to be one with theirs."""


def fill_outlines(data: bytes, road_map: RoadMap, layout: Layout, cut: Ground) -> bytes:
    """Add the ground of mapped roads, and pavement that was cut, to the junctions that they lie in.

    Args:
        data: the network.
        road_map: what it holds.
        layout: what was to be built.
        cut: what vehicles drive on of the junctions' pavement.

    Returns:
        The network; islands between a junction and a road around its corner are kept.
    """
    least = layout.rules.network.least_island
    inside = _roads_inside(layout)
    others = _Others(road_map)

    def fill(name: str, corners: Floats) -> Floats | None:
        roads = [*inside.get(name, ()), *cut.get(name, ())]
        ground = shapely.Polygon(corners[:, :2]) if len(corners) > 2 else shapely.Polygon()
        if not roads or ground.is_empty or not ground.is_valid:
            return None
        height = float(corners[:, 2].mean()) if corners.shape[1] > 2 else 0.0
        added = others.free(shapely.union_all(roads), name, height)
        whole = _largest(shapely.union_all([ground, added]))
        islands = [hole for ring in whole.interiors if (hole := shapely.Polygon(ring)).area >= least]
        filled = shapely.Polygon(whole.exterior)
        for island in islands:
            filled = _largest(filled.difference(_with_slit(island, filled)))
        filled = _largest(shapely.set_precision(shapely.simplify(filled, _SMOOTH), _GRID))
        return None if filled.is_empty or filled.interiors else outline_of(filled, corners)

    return replace_outlines(data, fill)


def _roads_inside(layout: Layout) -> dict[str, list[shapely.Geometry]]:
    """List the carriageways that lie in each junction: sections that vanish, and what arms are drawn back."""
    graph, of = layout.graph, layout.junctions.of
    found: dict[str, list[shapely.Geometry]] = defaultdict(list)
    for name in sorted(layout.inner):
        line = shapely.LineString(graph.line(graph.sections[name]))
        found[str(of[graph.sections[name].start])].append(line.buffer(layout.half(name)))
    for arm, cut in sorted(layout.cuts.items()):
        if arm.section not in layout.inner and cut > 0:
            found[str(layout.junction(arm))].append(_end(layout, arm, cut))
    return found


def _end(layout: Layout, arm: Arm, cut: float) -> shapely.Geometry:
    """Give the carriageway that an arm is drawn back by."""
    line = outward(layout.graph, arm)
    end = trim(line, 0.0, float(along(line)[-1]) - cut - _LAP)
    return shapely.LineString(end).buffer(layout.half(arm.section), cap_style="flat")


class _Others:
    """The ground of lanes and junctions, which no other junction gets; roads lead through pavement."""

    def __init__(self, road_map: RoadMap) -> None:
        lanes = [lane for lane in road_map.lanes if lane.kind is not LaneKind.SIDEWALK]
        junctions = [junction for junction in road_map.junctions if len(junction.polygon) > 2]
        shapes = [
            *lane_strips(lanes),
            *(shapely.make_valid(shapely.Polygon(junction.polygon[:, :2])) for junction in junctions),
        ]
        self._shapes = np.array(shapes, dtype=object)
        self._names = [*("" for _ in lanes), *(junction.id for junction in junctions)]
        lines = (*(lane.shape for lane in lanes), *(junction.polygon for junction in junctions))
        self._heights = np.array([float(line[:, 2].mean()) for line in lines])
        self._tree = shapely.STRtree(self._shapes)

    def free(self, ground: shapely.Geometry, name: str, height: float) -> shapely.Geometry:
        """Give the part of a junction's ground that nothing else takes at its height."""
        taken = [
            self._shapes[k]
            for k in sorted(self._tree.query(ground))
            if self._names[k] != name and abs(self._heights[k] - height) < _LEVEL
        ]
        return ground.difference(shapely.union_all(taken))


def _largest(ground: shapely.Geometry) -> shapely.Polygon:
    areas = [part for part in shapely.get_parts(ground) if part.geom_type == "Polygon"]
    return max(areas, key=shapely.area, default=shapely.Polygon())


def _with_slit(island: shapely.Polygon, ground: shapely.Polygon) -> shapely.Geometry:
    """Join an island to the border of the ground around it, where that is nearest, by a slit."""
    slit = shapely.shortest_line(island.exterior, ground.exterior)
    return shapely.union_all([island, slit.buffer(_SLIT, cap_style="square")])
