"""Keep the street clear: no building on pavement or road, no tree on a carriageway or in a building."""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import shapely

from dojo_maps.description import LaneKind, Prop, RoadMap, points
from dojo_maps.geometry.pieces import GRID, flat_polygons, lane_strips
from dojo_maps.geometry.polylines import Shapes

_BUILDING_GAP = 0.3
"""Metres between a wall and paved ground."""
_TREE_GAP = 0.6
_LEAST_BUILDING = 4.0
_STRAIGHTENED = 0.05
_NOT_DRIVEN = (LaneKind.SIDEWALK, LaneKind.WATERWAY)


def clear_street(road_map: RoadMap, paved: shapely.Geometry) -> RoadMap:
    """Cut buildings back from paved ground and leave out trees that stand in the way.

    Args:
        road_map: as a source describes it, with generated pavement where there is some.
        paved: the network's own ground, in the frame of `origin`.

    Returns:
        The map with the props that remain. A building that is cut in pieces becomes one for each.
    """
    kinds = {prop.kind for prop in road_map.props}
    if not kinds & {"building", "tree"}:
        return road_map
    buildings = tuple(_cut_buildings(road_map, paved))
    trees = _free_trees(road_map, buildings)
    others = tuple(prop for prop in road_map.props if prop.kind not in ("building", "tree"))
    return replace(road_map, props=buildings + trees + others)


def prop_shapes(props: tuple[Prop, ...]) -> Shapes:
    """Make the polygons of props.

    Args:
        props: of any kind; those without an outline are left out.

    Returns:
        (n,) polygons with their holes, metres, map frame.
    """
    return np.array(
        [
            shapely.Polygon(prop.polygon[:, :2], [hole[:, :2] for hole in prop.holes])
            for prop in props
            if prop.polygon is not None
        ],
        dtype=object,
    )


def _cut_buildings(road_map: RoadMap, paved: shapely.Geometry) -> Iterator[Prop]:
    buildings = tuple(p for p in road_map.props if p.kind == "building" and p.polygon is not None)
    generated = [shapely.Polygon(walk.polygon[:, :2]) for walk in road_map.sidewalks]
    shift = np.array(road_map.origin)
    ground = shapely.transform(paved, lambda xy: xy + shift)
    parts = np.array([*shapely.get_parts(ground), *shapely.make_valid(generated)], dtype=object)
    tree = shapely.STRtree(parts)
    for prop, shape in zip(buildings, prop_shapes(buildings), strict=True):
        near = parts[tree.query(shape, "dwithin", distance=_BUILDING_GAP)]
        if not len(near):
            yield prop
            continue
        here = shapely.clip_by_rect(shapely.make_valid(near), *shapely.buffer(shape, 5.0).bounds)
        clear = shapely.buffer(shapely.union_all(shapely.make_valid(here), grid_size=GRID), _BUILDING_GAP)
        rest = shapely.simplify(shapely.difference(shape, clear, grid_size=GRID), _STRAIGHTENED)
        rest = shapely.set_precision(shapely.make_valid(rest), GRID)
        pieces = flat_polygons(np.array([rest]), larger_than=_LEAST_BUILDING)[0]
        for number, piece in enumerate(sorted(pieces, key=lambda p: (-p.area, p.bounds))):
            yield replace(
                prop,
                id=f"{prop.id}+{number}" if number else prop.id,
                polygon=points(shapely.get_coordinates(piece.exterior)[:-1]),
                holes=tuple(points(shapely.get_coordinates(hole)[:-1]) for hole in piece.interiors),
            )


def _free_trees(road_map: RoadMap, buildings: tuple[Prop, ...]) -> tuple[Prop, ...]:
    trees = tuple(prop for prop in road_map.props if prop.kind == "tree" and prop.position is not None)
    if not trees:
        return ()
    places = shapely.points([prop.position[:2] for prop in trees if prop.position is not None])
    driven = lane_strips([lane for lane in road_map.lanes if lane.kind not in _NOT_DRIVEN])
    crossed = np.concatenate([driven, _paths(road_map), prop_shapes(buildings)])
    blocked = shapely.STRtree(crossed).query(places, "dwithin", distance=_TREE_GAP)[0]
    free = np.ones(len(trees), dtype=bool)
    free[blocked] = False
    return tuple(tree for tree, kept in zip(trees, free, strict=True) if kept)


def _paths(road_map: RoadMap) -> Shapes:
    """Outline what is driven on inside of junctions, 4 m wide; map frame."""
    lines = [shapely.linestrings(c.shape[:, :2]) for c in road_map.connections if len(c.shape) > 1]
    return shapely.buffer(np.array(lines, dtype=object), 2.0)
