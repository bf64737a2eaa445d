"""The divided ground as meshes: one per layer, neighbours joined corner to corner, pavement raised."""

from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import manifold3d
import numpy as np
import shapely

from dojo_maps.geometry.arrangement import TERRAIN, Parts
from dojo_maps.geometry.pieces import GRID, RAISED, Layer, Pieces
from dojo_maps.geometry.polylines import Flags, Floats, HeightLines, Ints, Shapes
from dojo_maps.meshes.mesh import Mesh, compact
from dojo_maps.meshes.solids import extrude

KERB = 0.12
"""Height of a kerb, metres."""
_LOWERED_KERB = 0.02
_FOOTING = 0.3
"""How far pavement reaches below the ground, metres, so that no gap shows under a kerb."""
_SAME_HEIGHT = 1.0
"""Corners on one place within this height, metres, are one corner; farther apart is another level."""

_MANY_CORNERS = 1_000


@dataclass(frozen=True, slots=True, kw_only=True)
class Ground:
    """The triangulated ground before anything is raised.

    Attributes:
        vertices: (n, 3) metres.
        faces: (m, 3), counter-clockwise from above.
        owners: (m,) index of the owning piece, or `TERRAIN`.
        layers: (m,) the layer's index in `Layer`.
        ramps: (m,) whether a kerb is lowered there.
        lowest: (m,) whether no other face lies under it.
        places: (n,) number of each vertex's place on the plane; levels share it.
    """

    vertices: Floats
    faces: Ints
    owners: Ints
    layers: Ints
    ramps: Flags
    lowest: Flags
    places: Ints


def build_ground(pieces: Pieces, parts: Parts, *, jobs: int = 1) -> Ground:
    """Triangulate every part; corners that meet on one level become one vertex.

    Args:
        pieces: the claims, which say where heights come from.
        parts: the ground divided among them.
        jobs: threads for cutting triangles; the result is the same for any number.

    Returns:
        The ground, metres, in the frame of the map's origin, nothing raised.
    """
    corners, part = triangulate(parts.polygons, jobs=jobs)
    owner = parts.owners[part]
    vertices, faces, places = _join_corners(corners.reshape(-1, 2), np.repeat(owner, 3), pieces)
    solid = (faces != np.roll(faces, 1, axis=1)).all(axis=1)
    layer_of = np.array(
        [list(Layer).index(layer) for layer in pieces.layers] + [list(Layer).index(Layer.TERRAIN)]
    )
    return Ground(
        vertices=vertices,
        faces=faces[solid],
        owners=owner[solid],
        layers=layer_of[owner][solid],
        ramps=parts.ramps[part][solid],
        lowest=parts.lowest[part][solid],
        places=places,
    )


def triangulate(polygons: Shapes, *, jobs: int = 1) -> tuple[Floats, Ints]:
    """Cut polygons into triangles without adding corners.

    Constrained Delaunay triangles are the best shaped, but take time by the square of a polygon's corners;
    polygons with very many are cut by sweeping instead.

    Args:
        polygons: (n,), metres.
        jobs: threads; the result is the same for any number.

    Returns:
        (m, 3, 2) corners, counter-clockwise, metres, and (m,) the index of each triangle's polygon.
    """
    large = shapely.get_num_coordinates(polygons) > _MANY_CORNERS
    small = np.flatnonzero(~large)
    chunks = np.array_split(polygons[small], max(1, min(jobs, len(small) // 256)))
    with ThreadPoolExecutor(max_workers=jobs) as pool:
        cut = np.concatenate(list(pool.map(shapely.constrained_delaunay_triangles, chunks)))
    triangles, index = shapely.get_parts(cut, return_index=True)
    corners = [shapely.get_coordinates(triangles).reshape(-1, 4, 2)[:, :3]]
    polygon = [small[index]]
    for k in np.flatnonzero(large):
        corners.append(_sweep(polygons[k]))
        polygon.append(np.full(len(corners[-1]), k))
    return _turned(np.concatenate(corners)), np.concatenate(polygon)


def _sweep(polygon: shapely.Polygon) -> Floats:
    """Cut one polygon into triangles (m, 3, 2) in about the time it takes to sort its corners."""
    turned = shapely.orient_polygons(polygon)
    rings = [shapely.get_coordinates(ring)[:-1] for ring in (turned.exterior, *turned.interiors)]
    corners: Floats = np.concatenate(rings)[manifold3d.triangulate(rings)]
    return corners


def _turned(corners: Floats) -> Floats:
    """Turn triangles counter-clockwise."""
    edge, other = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    clockwise = edge[:, 0] * other[:, 1] < edge[:, 1] * other[:, 0]
    corners[clockwise] = corners[clockwise][:, ::-1]
    return corners


def fit_planes(corners: Floats) -> Floats:
    """Fit the plane z = a x + b y + c through each triangle.

    Args:
        corners: (n, 3, 3) of triangles that have an area from above, metres.

    Returns:
        (n, 3) a, b and c.
    """
    edge, other = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    normal = np.cross(edge, other)
    slope = -normal[:, :2] / normal[:, 2:]
    offset = corners[:, 0, 2] - (slope * corners[:, 0, :2]).sum(axis=1)
    return np.column_stack([slope, offset])


def surface_meshes(ground: Ground, pieces: Pieces) -> Iterator[Mesh]:
    """Build the mesh of each layer that has ground; raised layers are watertight solids.

    Args:
        ground: as `build_ground` makes it.
        pieces: that own it.

    Yields:
        A mesh named as its layer, in the order of `Layer`.
    """
    rise = np.concatenate([_kerb_heights(ground), np.zeros(len(ground.vertices))])
    ids = [*pieces.ids, "terrain"]
    for index, layer in enumerate(Layer):
        chosen = ground.layers == index
        if not chosen.any():
            continue
        faces, owners = ground.faces[chosen], ground.owners[chosen]
        if layer is Layer.TERRAIN:
            faces = np.concatenate([faces, _abutments(ground)])
            owners = np.full(len(faces), TERRAIN)
        sources = np.where(owners == TERRAIN, len(pieces.ids), owners)
        if layer in RAISED:
            # What is flush gets vertices of its own, which stay on the ground.
            corners = faces + len(ground.vertices) * np.array(pieces.flush)[owners][:, None]
            vertices = np.concatenate([ground.vertices, ground.vertices])
            vertices, faces, origin = extrude(vertices, corners, rise, _FOOTING)
            yield compact(layer, vertices, faces, sources[origin], ids)
        else:
            yield compact(layer, ground.vertices, faces, sources, ids)


def _abutments(ground: Ground) -> Ints:
    """Close the ground where its lowest surface steps to another level: walls under the ends of bridges."""
    faces = ground.faces[ground.lowest]
    start, end = faces.ravel(), faces[:, [1, 2, 0]].ravel()
    count = int(ground.places.max()) + 1
    keys = ground.places[start] * count + ground.places[end]
    twins = ground.places[end] * count + ground.places[start]
    order = np.argsort(keys)
    found = np.minimum(np.searchsorted(keys[order], twins), len(keys) - 1)
    other = order[found]
    paired = keys[other] == twins
    step = paired & ((start != end[other]) | (end != start[other]))
    step &= ground.vertices[start, 2] + ground.vertices[end, 2] > (
        ground.vertices[start[other], 2] + ground.vertices[end[other], 2]
    )
    a, b, below_b, below_a = start[step], end[step], start[other][step], end[other][step]
    walls = np.concatenate([np.column_stack([b, a, below_a]), np.column_stack([b, below_a, below_b])])
    return walls[(walls != np.roll(walls, 1, axis=1)).all(axis=1)]


def _kerb_heights(ground: Ground) -> Floats:
    """Height of the pavement over each vertex: a kerb's, lowered where a ramp meets the carriageway."""
    carriageway = [list(Layer).index(layer) for layer in (Layer.ROAD, Layer.JUNCTION)]
    at_road = ground.faces[np.isin(ground.layers, carriageway)].ravel()
    at_ramp = ground.faces[ground.ramps].ravel()
    rise = np.full(len(ground.vertices), KERB)
    rise[np.intersect1d(at_road, at_ramp)] = _LOWERED_KERB
    return rise


def _join_corners(corners: Floats, owners: Ints, pieces: Pieces) -> tuple[Floats, Ints, Ints]:
    """Make one vertex of all corners on one place and level; its height is the mean of the lanes' there.

    Junctions and pavement, whose heights are known at their outlines only, follow the lanes they touch. Lawns
    lie as the ground around them, water as low as its banks.

    Args:
        corners: (3 m, 2) metres.
        owners: (3 m,) owning piece of each corner, or `TERRAIN`.
        pieces: where heights come from.

    Returns:
        Vertices (n, 3), faces (m, 3), and the number of each vertex's place (n,).
    """
    raster = np.round(corners / GRID).astype(np.int64)
    place = np.unique((raster[:, 0] << 32) + raster[:, 1], return_inverse=True)[1]
    known = HeightLines(pieces.lines)
    heights = np.zeros(len(corners))
    if not known.flat:
        layers = np.array([*pieces.layers, Layer.TERRAIN])[owners]
        claimed = ~np.isin(layers, (Layer.TERRAIN, Layer.GREEN, Layer.WATER))
        heights[claimed] = known.at(owners[claimed], corners[claimed])
        heights[~claimed] = np.inf
        _lay_terrain(heights, place, corners)
        _level_water(heights, place, np.where(layers == Layer.WATER, owners, TERRAIN), ~claimed)
    order = np.lexsort((heights, place))
    starts = np.ones(len(order), dtype=bool)
    starts[1:] = (np.diff(place[order]) > 0) | (np.diff(heights[order]) > _SAME_HEIGHT)
    vertex = np.empty(len(order), dtype=np.int64)
    vertex[order] = np.cumsum(starts) - 1
    first = order[starts]
    on_road = np.append([layer is Layer.ROAD for layer in pieces.layers], False)[owners]
    weight = np.where(on_road, 1.0, 1e-9)
    mean = np.bincount(vertex, weights=heights * weight) / np.bincount(vertex, weights=weight)
    return np.column_stack([raster[first] * GRID, mean]), vertex.reshape(-1, 3), place[first]


def _level_water(heights: Floats, place: Ints, water: Ints, free: Flags) -> None:
    """Lower each water, told by its number, to its lowest corner, and `free` corners on its rim with it."""
    wet = np.flatnonzero(water != TERRAIN)
    if not len(wet):
        return
    banks = np.full(water.max() + 1, np.inf)
    np.minimum.at(banks, water[wet], heights[wet])
    level = np.full(place.max() + 1, np.inf)
    np.minimum.at(level, place[wet], banks[water[wet]])
    low = free & np.isfinite(level[place])
    heights[low] = level[place[low]]


def _lay_terrain(heights: Floats, place: Ints, corners: Floats) -> None:
    """Give corners of infinite height the lowest height claimed on their place, or nearby; without any, 0."""
    lowest = np.full(place.max() + 1, np.inf)
    np.minimum.at(lowest, place, heights)
    terrain = np.isinf(heights)
    heights[terrain] = lowest[place[terrain]]
    alone = np.flatnonzero(np.isinf(heights))
    known = np.flatnonzero(~np.isinf(heights))
    if not len(known):
        heights[alone] = 0.0
    elif len(alone):
        nearest = shapely.STRtree(shapely.points(corners[known])).nearest(shapely.points(corners[alone]))
        heights[alone] = heights[known[nearest]]
