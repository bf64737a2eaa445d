"""Where a pole may stand: clear of everything that vehicles drive on."""

from collections.abc import Sequence

import numpy as np
import shapely
from shapely.ops import nearest_points

from dojo_maps.description import LaneKind, Points, RoadMap
from dojo_maps.geometry.pieces import lane_strips
from dojo_maps.geometry.polylines import Floats, Shapes

_CLEARANCE = 0.15
"""Metres from the middle of a pole to where vehicles drive."""


class PoleSites:
    """Knows the lanes and junction floors of a map, on all its levels; the map's own frame, metres."""

    def __init__(self, road_map: RoadMap) -> None:
        """Index the ground of every lane but sidewalks, and the floors without the pavement on them."""
        lanes = [lane for lane in road_map.lanes if lane.kind is not LaneKind.SIDEWALK]
        pavement = _areas([area.polygon for area in road_map.walking_areas])
        floors = _areas([junction.polygon for junction in road_map.junctions])
        floor, area = shapely.STRtree(pavement).query(floors, predicate="intersects")
        for k in np.unique(floor):
            floors[k] = shapely.difference(floors[k], shapely.union_all(pavement[area[floor == k]]))
        self._driven = shapely.STRtree(np.concatenate([lane_strips(lanes), floors]))

    def choose(self, spots: Sequence[Floats], area: shapely.Geometry) -> Floats | None:
        """Choose the first spot that is free, or else the free place nearest to the first spot.

        Args:
            spots: (2,) each, metres, at least one, in the order of preference.
            area: in which to look.

        Returns:
            The place (2,), or None where vehicles drive all over the area.
        """
        for spot, here in zip(spots, shapely.points(spots), strict=True):
            if not len(self._driven.query(here, "dwithin", distance=_CLEARANCE)):
                return spot
        start = shapely.Point(spots[0])
        near = self._driven.geometries[self._driven.query(area, predicate="intersects")]
        free = area.difference(shapely.union_all(near).buffer(_CLEARANCE))
        if free.is_empty:
            return None
        place: Floats = shapely.get_coordinates(nearest_points(free, start)[0])[0]
        return place


def _areas(rings: Sequence[Points]) -> Shapes:
    """Make valid areas of rings, however twisted; those of fewer than three points have none."""
    polygons = [shapely.Polygon(ring[:, :2]) for ring in rings if len(ring) > 2]
    areas: Shapes = shapely.make_valid(np.array(polygons, dtype=object))
    return areas
