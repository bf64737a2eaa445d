"""Paint on the ground: flat shapes with a layer, a source and a level, and the ground they lie on."""

from collections.abc import Iterable
from dataclasses import dataclass
from enum import StrEnum

import numpy as np
import shapely

from dojo_maps.geometry.arrangement import Parts, join_coverage
from dojo_maps.geometry.pieces import GRID, Layer, Pieces
from dojo_maps.geometry.polylines import Ints, Shapes


class PaintLayer(StrEnum):
    """What is painted, in the words of scene.glb's node names."""

    MARKING = "marking"
    TRACK = "rail/track"
    CROSSING = "crossing"
    STOP_LINE = "stop_line"
    ARROW = "arrow"


LIFT = {
    PaintLayer.MARKING: 0.010,
    PaintLayer.TRACK: 0.011,
    PaintLayer.CROSSING: 0.012,
    PaintLayer.STOP_LINE: 0.014,
    PaintLayer.ARROW: 0.016,
}
"""How far each kind of paint lies above the ground, metres, so that no two faces share a plane."""

KERB_GAP = 0.003
"""Metres between paint and the carriageway's border. Paint that ends right there crosses it by what single
precision moves corners, up to half a millimetre, and lies inside of a kerb then."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Paint:
    """Shapes of one layer.

    Attributes:
        layer: what they are.
        polygons: (n,) in the frame of the map's origin; some may be empty.
        ids: (n,) ids of the lane, road or crossing each belongs to.
    """

    layer: PaintLayer
    polygons: Shapes
    ids: tuple[str, ...]


class Canvas:
    """The divided ground by what it belongs to, for cutting paint to it."""

    def __init__(self, pieces: Pieces, parts: Parts) -> None:
        """Index the parts of lanes and junction floors."""
        paved = (Layer.ROAD, Layer.JUNCTION)
        owned = [(int(owner), polygon) for owner, polygon in zip(parts.owners, parts.polygons, strict=True)]
        owned = [(owner, polygon) for owner, polygon in owned if owner >= 0 and pieces.layers[owner] in paved]
        self._carriageway = np.array([polygon for _, polygon in owned], dtype=object)
        self._border = shapely.STRtree(_outer_edges(self._carriageway))
        self._of: dict[str, list[shapely.Polygon]] = {}
        for owner, polygon in owned:
            if pieces.layers[owner] is Layer.ROAD:
                self._of.setdefault(pieces.ids[owner], []).append(polygon)

    def area_of(self, lanes: Iterable[str]) -> shapely.Geometry:
        """Join the ground that some lanes own.

        Args:
            lanes: their ids.

        Returns:
            The ground, in the frame of the map's origin; empty where they own none.
        """
        polygons = [polygon for lane in lanes for polygon in self._of.get(lane, ())]
        return polygons[0] if len(polygons) == 1 else join_coverage(polygons)

    def cut(self, polygons: Shapes) -> tuple[Shapes, Ints]:
        """Cut polygons to the carriageway.

        Args:
            polygons: (n,), metres, in the frame of the map's origin.

        Returns:
            (m,) pieces, and (m,) the index of each one's polygon; polygons off the carriageway have none.
        """
        index, part = shapely.STRtree(self._carriageway).query(polygons, predicate="intersects")
        pieces = self.keep_off_border(shapely.intersection(polygons[index], self._carriageway[part]))
        kept = shapely.area(pieces) > 1e-3
        return pieces[kept], index[kept]

    def keep_off_border(self, shapes: Shapes) -> Shapes:
        """Take off what lies within a few millimetres of the carriageway's border.

        Args:
            shapes: (n,), metres, in the frame of the map's origin; they stay as they are.

        Returns:
            (n,) what is left of each.
        """
        shape, edge = self._border.query(shapes, predicate="dwithin", distance=KERB_GAP)
        order = np.argsort(shape, kind="stable")
        near, number = np.unique(shape[order], return_inverse=True)
        borders = shapely.multilinestrings(self._border.geometries[edge[order]], indices=number)
        trimmed = shapes.copy()
        trimmed[near] = shapely.difference(shapes[near], shapely.buffer(borders, KERB_GAP, quad_segs=2))
        return trimmed


def _outer_edges(polygons: Shapes) -> Shapes:
    """Find the edges that have one of some adjoining polygons on one side and none on the other."""
    corners, ring = shapely.get_coordinates(shapely.get_rings(polygons), return_index=True)
    edges = np.stack([corners[:-1], corners[1:]], axis=1)[ring[:-1] == ring[1:]]
    raster = np.round(edges / GRID).astype(np.int64)
    ends = np.sort((raster[:, :, 0] << 32) + raster[:, :, 1], axis=1)
    _, first, count = np.unique(ends, axis=0, return_index=True, return_counts=True)
    # Polygons on another level may have the same edge, on both sides or on one.
    return shapely.linestrings(edges[first[count % 2 == 1]])
