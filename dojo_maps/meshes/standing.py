"""What stands beside the street, stood on the ground that has been built there."""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import shapely

from dojo_maps.description import Points, Prop, RoadMap, outline_of, points
from dojo_maps.geometry.polylines import Floats
from dojo_maps.meshes.surfaces import Ground, fit_planes


def stand_on_ground(road_map: RoadMap, ground: Ground) -> RoadMap:
    """Give props the heights of the ground under them; of several levels, the one nearest to their own.

    Poles reach up as high as before.

    Args:
        road_map: the description, furnished.
        ground: as `build_ground` makes it.

    Returns:
        The map with its props on the ground; on flat ground the same map.
    """
    if not road_map.props or not ground.vertices[:, 2].any():
        return road_map
    outlines = [outline_of(prop) for prop in road_map.props]
    shift = np.array([*road_map.origin, 0.0])
    heights = _heights_at(ground, np.concatenate(outlines) - shift)
    ends = np.cumsum([len(outline) for outline in outlines])
    return replace(road_map, props=tuple(_stood(road_map.props, outlines, np.split(heights, ends[:-1]))))


def _heights_at(ground: Ground, places: Floats) -> Floats:
    """Find the height of the ground at places (n, 3), the nearest to their own: (n,) metres."""
    corners = ground.vertices[ground.faces]
    triangles = shapely.polygons(corners[:, :, :2])
    wide = shapely.area(triangles) > 0.0
    place, face = shapely.STRtree(triangles[wide]).query(
        shapely.points(places[:, :2]), predicate="intersects"
    )
    corners = corners[wide][face]
    a, b, c = fit_planes(corners).T
    height = a * places[place, 0] + b * places[place, 1] + c
    height = height.clip(corners[:, :, 2].min(axis=1), corners[:, :, 2].max(axis=1))
    order = np.lexsort((np.abs(height - places[place, 2]), place))
    found, nearest = np.unique(place[order], return_index=True)
    heights: Floats = places[:, 2].copy()
    heights[found] = height[order][nearest]
    return heights


def _stood(props: tuple[Prop, ...], outlines: list[Points], heights: list[Floats]) -> Iterator[Prop]:
    for prop, outline, level in zip(props, outlines, heights, strict=True):
        stood = points(np.column_stack([outline[:, :2], np.round(level, 3)]))
        if prop.polygon is not None:
            yield replace(prop, polygon=stood)
        elif prop.position is not None:
            x, y, z = stood[0].tolist()
            higher = prop.position[2] - z if prop.kind == "pole" else 0.0
            yield replace(prop, position=(x, y, z), height=round(prop.height + higher, 3))
        else:
            yield prop
