"""Paint as meshes: lifted off the ground it lies on, and bent with it where the map has heights."""

from collections.abc import Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import shapely

from dojo_maps.description import Points
from dojo_maps.geometry.arrangement import LEVEL_GAP
from dojo_maps.geometry.paint import LIFT, Paint
from dojo_maps.geometry.pieces import Layer, flat_polygons
from dojo_maps.geometry.polylines import Floats, HeightLines, Ints, Shapes
from dojo_maps.meshes.mesh import Mesh, compact
from dojo_maps.meshes.surfaces import Ground, fit_planes, triangulate

_PAINTED = (Layer.ROAD, Layer.JUNCTION, Layer.RAIL)
_LEAST_TRIANGLE = 2e-6
"""Square metres, doubled; thinner triangles show nothing and have no direction."""


def paint_meshes(
    paints: Sequence[Paint], ground: Ground, lines: Mapping[str, Points], *, jobs: int = 1
) -> list[Mesh]:
    """Build the mesh of each layer of paint.

    Args:
        paints: what to draw.
        ground: what it lies on.
        lines: the line (n, 3) along which each source id of the paint runs, metres, to tell levels apart.
        jobs: threads; the result is the same for any number.

    Returns:
        The meshes, a little above the ground, of those that paint something.
    """
    slopes = _Slopes(ground) if ground.vertices[:, 2].any() else None
    with ThreadPoolExecutor(max_workers=jobs) as pool:
        meshes = pool.map(lambda paint: _paint_mesh(paint, slopes, lines), paints)
        return [mesh for mesh in meshes if mesh is not None]


def _paint_mesh(paint: Paint, slopes: "_Slopes | None", lines: Mapping[str, Points]) -> Mesh | None:
    polygons, index = flat_polygons(paint.polygons)
    if slopes is not None:
        polygons, index, planes = slopes.drape(polygons, index, [lines[id_] for id_ in paint.ids])
    else:
        planes = np.zeros((len(polygons), 3))
    if not len(polygons):
        return None
    corners, polygon = triangulate(polygons)
    solid = np.abs(np.linalg.det(corners[:, 1:] - corners[:, :1])) > _LEAST_TRIANGLE
    corners, polygon = corners[solid], polygon[solid]
    places = corners.reshape(-1, 2)
    slope = np.repeat(planes[polygon], 3, axis=0)
    z = slope[:, 0] * places[:, 0] + slope[:, 1] * places[:, 1] + slope[:, 2] + LIFT[paint.layer]
    faces = np.arange(len(places)).reshape(-1, 3)
    ids = list(dict.fromkeys(paint.ids))
    number = {id_: k for k, id_ in enumerate(ids)}
    sources = np.array([number[id_] for id_ in paint.ids])[index[polygon]]
    return compact(paint.layer, np.column_stack([places, z]), faces, sources, ids)


class _Slopes:
    """The triangles of carriageways that are not flat."""

    def __init__(self, ground: Ground) -> None:
        faces = ground.faces[np.isin(ground.layers, [list(Layer).index(layer) for layer in _PAINTED])]
        self._corners = ground.vertices[faces]
        self._triangles = shapely.polygons(self._corners[:, :, :2])
        self._tree = shapely.STRtree(self._triangles)

    def drape(self, polygons: Shapes, index: Ints, lines: list[Points]) -> tuple[Shapes, Ints, Floats]:
        """Cut polygons along the triangles, so that each piece lies on one plane.

        Args:
            polygons: (n,) in the plane.
            index: (n,) the shape that each polygon is part of.
            lines: the line along which each shape runs.

        Returns:
            The pieces, the index of each one's shape, and (m, 3) planes a, b, c with z = a x + b y + c.
        """
        polygon, face = self._tree.query(polygons, predicate="intersects")
        middle = self._corners[face].mean(axis=1)
        line_height = HeightLines(lines).at(index[polygon], middle[:, :2])
        level = np.abs(line_height - middle[:, 2]) < LEVEL_GAP
        polygon, face = polygon[level], face[level]
        pieces, part = flat_polygons(shapely.intersection(polygons[polygon], self._triangles[face]))
        return pieces, index[polygon[part]], fit_planes(self._corners[face[part]])
