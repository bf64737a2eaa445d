"""Traffic islands: the narrow ground that carriageways leave between them."""

import numpy as np
import shapely

from dojo_maps.description import CARRIAGEWAY, Prop, RoadMap, points
from dojo_maps.geometry.pieces import GRID, lane_strips
from dojo_maps.geometry.polylines import Flags, Floats, Shapes, lift_to_nearest

_WIDEST, _WIDEST_WHOLE = 5.0, 12.0
"""Wider gaps between carriageways are green, metres; the second where traffic drives all around."""
_NARROWEST = 0.04
_FLUSH = 0.6
"""Narrower gaps are no kerb to drive against but part of the pavement, metres."""
_LEAST_AREA = 0.2
_NEAR = 0.3
_ENCLOSED = 0.8
"""Share of an island's outline that lies along paved ground; less is a corner or a bay."""
_ALONG_PATHS = 0.5
"""Share of a gap's outline along ways on which no motor vehicle drives, from which on it is no island."""

ISLAND_HEIGHT = 0.12


def find_islands(road_map: RoadMap, paved: shapely.Geometry) -> tuple[Prop, ...]:
    """Find the gaps between carriageways that are narrower than 5 m, or 12 m all around, as props `island`.

    Slits of less than 0.6 m are flush with the road (height 0). Ground along a sidewalk is a verge and stays
    green, and so does ground between paths.

    Args:
        road_map: as a source describes it; its lanes say how high the ground is.
        paved: the network's own ground, metres, in the frame of `origin`.

    Returns:
        The islands, with polygons in the map frame.
    """
    shift = np.array(road_map.origin)
    walks = [sidewalk.polygon for sidewalk in road_map.sidewalks]
    walks += [area.polygon for area in road_map.walking_areas if len(area.polygon) > 2]
    beside = np.array([shapely.polygons(ring[:, :2] - shift) for ring in walks], dtype=object)
    lines = [lane.shape for lane in road_map.lanes]
    driven = {lane.road for lane in road_map.lanes if lane.kind in CARRIAGEWAY}
    strips = lane_strips(lane for lane in road_map.lanes if lane.road not in driven)
    gaps, flush = _gaps(paved, beside, shapely.transform(strips, lambda corners: corners - shift))
    rings = [shapely.get_coordinates(gap.exterior)[:-1] for gap in gaps]
    corners = np.concatenate([np.empty((0, 2)), *rings])
    lifted = lift_to_nearest(np.round(corners + shift, 4), lines)
    rings = np.split(lifted, np.cumsum([len(ring) for ring in rings])[:-1]) if rings else []
    return tuple(
        Prop(
            id=f"island_{k}",
            kind="island",
            height=0.0 if is_flush else ISLAND_HEIGHT,
            polygon=points(ring),
        )
        for k, (ring, is_flush) in enumerate(zip(rings, flush, strict=True))
    )


def _gaps(paved: shapely.Geometry, beside: Shapes, paths: Shapes) -> tuple[Shapes, Flags]:
    """Find the narrow gaps that paved ground encloses, and which of them are flush with it."""
    closed = _resized(paved, _WIDEST / 2, -_WIDEST / 2)
    gaps = shapely.get_parts(shapely.difference(closed, paved, grid_size=GRID))
    grounds = shapely.get_parts(paved)
    rings = [ring for ground in grounds for ring in ground.interiors]
    holes = np.array([shapely.Polygon(ring) for ring in rings], dtype=object)
    holes = holes[shapely.is_empty(shapely.buffer(holes, -_WIDEST_WHOLE / 2))]
    within, _ = shapely.STRtree(holes).query(shapely.point_on_surface(gaps), "within")
    gaps = np.concatenate([np.delete(gaps, within), holes])
    gaps = shapely.get_parts(_resized(gaps, -_NARROWEST / 2, _NARROWEST / 2 + 2 * GRID))
    gaps = gaps[shapely.area(gaps) > _LEAST_AREA]
    flush = shapely.is_empty(shapely.buffer(gaps, -_FLUSH / 2))
    outline = shapely.segmentize(shapely.get_exterior_ring(gaps), 0.5)
    places, gap = shapely.get_coordinates(outline, return_index=True)
    count = np.maximum(np.bincount(gap, minlength=len(gaps)), 1)

    def share(ground: Shapes) -> Floats:
        near = np.zeros(len(places), dtype=bool)
        near[shapely.STRtree(ground).query(shapely.points(places), "dwithin", distance=_NEAR)[0]] = True
        return np.bincount(gap, weights=near, minlength=len(gaps)) / count

    driven = (share(beside) < 1 - _ENCLOSED) & (share(paths) < _ALONG_PATHS)
    kept = (share(grounds) > _ENCLOSED) & (flush | driven)
    return gaps[kept], flush[kept]


def _resized(shape: shapely.Geometry, *distances: float) -> shapely.Geometry:
    for distance in distances:
        shape = shapely.buffer(shape, distance, join_style="mitre", mitre_limit=2.0)
    return shape
