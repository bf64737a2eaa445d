"""Traffic islands: the narrow ground that carriageways leave between them."""

import numpy as np
import shapely

from dojo_maps.description import Prop, RoadMap
from dojo_maps.geometry.pieces import GRID
from dojo_maps.geometry.polylines import Shapes, lift_to_nearest

_WIDEST = 5.0
"""Wider gaps between carriageways are green, metres."""
_NARROWEST = 0.3
_LEAST_AREA = 1.0
_ENCLOSED = 0.8
"""Share of an island's outline that lies along carriageways; less is a corner or a bay."""

ISLAND_HEIGHT = 0.12


def find_islands(road_map: RoadMap, paved: shapely.Geometry) -> tuple[Prop, ...]:
    """Find the gaps between carriageways that are narrower than 5 m, as props of kind `island`.

    Ground along a sidewalk is a verge and stays green.
    """
    shift = np.array(road_map.origin)
    walks = [sidewalk.polygon for sidewalk in road_map.sidewalks]
    walks += [area.polygon for area in road_map.walking_areas if len(area.polygon) > 2]
    beside = np.array([shapely.polygons(ring[:, :2] - shift) for ring in walks], dtype=object)
    lines = [lane.shape for lane in road_map.lanes]
    rings = [shapely.get_coordinates(gap.exterior)[:-1] for gap in _gaps(paved, beside)]
    return tuple(
        Prop(
            id=f"island_{k}",
            kind="island",
            height=ISLAND_HEIGHT,
            polygon=lift_to_nearest(np.round(ring + shift, 4), lines),
        )
        for k, ring in enumerate(rings)
    )


def _gaps(paved: shapely.Geometry, beside: Shapes) -> Shapes:
    """Find the narrow gaps in the paved ground that carriageways enclose and no walk runs along."""
    closed = paved
    for distance in (_WIDEST / 2, -_WIDEST / 2):
        closed = shapely.buffer(closed, distance, join_style="mitre", mitre_limit=2.0)
    gaps = shapely.difference(closed, paved, grid_size=GRID)
    for distance in (-_NARROWEST / 2, _NARROWEST / 2 - 0.05):
        gaps = shapely.buffer(gaps, distance, join_style="mitre", mitre_limit=2.0)
    gaps = shapely.get_parts(gaps)
    gaps = gaps[shapely.area(gaps) > _LEAST_AREA]
    outline = shapely.segmentize(shapely.get_exterior_ring(gaps), 0.5)
    places, gap = shapely.get_coordinates(outline, return_index=True)
    shapely.prepare(paved)
    enclosed = shapely.dwithin(paved, shapely.points(places), _NARROWEST)
    walked = np.zeros(len(places), dtype=bool)
    walked[shapely.STRtree(beside).query(shapely.points(places), "dwithin", distance=_NARROWEST)[0]] = True
    count = np.maximum(np.bincount(gap, minlength=len(gaps)), 1)
    share = [np.bincount(gap, weights=flags, minlength=len(gaps)) / count for flags in (enclosed, walked)]
    return gaps[(share[0] > _ENCLOSED) & (share[1] < 1 - _ENCLOSED)]
