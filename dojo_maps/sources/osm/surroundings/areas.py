"""Polygons of OpenStreetMap ways and multipolygon relations, in map coordinates, whatever their state.

Rings are put together by the even-odd rule, so roles may be missing. What would take long to untangle is
left out: buildings and parks do not scribble over themselves.
"""

from collections.abc import Iterable, Iterator

import numpy as np
import pyproj
import shapely

from dojo_maps.description import Projection
from dojo_maps.geometry.pieces import flat_polygons
from dojo_maps.geometry.polylines import Floats, Shapes
from dojo_maps.sources.osm.read.data import OsmData, OsmWay

_GRID = 1e-3
_MOST_CORNERS = 20_000
_MOST_WORK = 1_000_000
"""Corners of a shape times those of the shapes that it lies over: what cutting them may take."""
_MOST_TANGLED = 500
"""Corners of a shape that may cross itself."""


class MapShapes:
    """Where an extract's nodes, lines and areas lie in a map's own coordinates."""

    def __init__(self, data: OsmData, projection: Projection) -> None:
        """Take an extract and the projection of the map that was made of it."""
        self._data = data
        nodes = sorted(data.nodes)
        lon, lat = (np.array([getattr(data.nodes[node], axis) for node in nodes]) for axis in ("lon", "lat"))
        x, y = pyproj.Proj(projection.proj)(lon, lat)
        places = np.round(np.column_stack([x, y]) + projection.net_offset, 3)
        self._places = places
        self._index = {node: index for index, node in enumerate(nodes) if np.isfinite(places[index]).all()}

    def place(self, node: int) -> Floats | None:
        """Find a node.

        Args:
            node: its id.

        Returns:
            (2,), metres, map frame; None where the extract lacks it, or the projection has no place for it.
        """
        index = self._index.get(node)
        return None if index is None else self._places[index]

    def line(self, way: OsmWay) -> Floats:
        """Follow a way through the nodes that the extract has.

        Args:
            way: any; nodes without a place are passed over.

        Returns:
            (n, 2), metres, map frame; n may be 0.
        """
        return self._places[[self._index[node] for node in way.nodes if node in self._index]]

    def area(self, kind: str, element: int) -> shapely.Geometry | None:
        """Put the area of a closed way or of a multipolygon's members together.

        Args:
            kind: way or relation.
            element: its id, which the extract must have.

        Returns:
            A multipolygon, metres, map frame; None where the rings are not whole, cannot be told apart, or
            would take long to untangle.
        """
        rings = list(self._rings(kind, element))
        corners = sum(len(ring) for ring in rings)
        if not rings or corners > _MOST_CORNERS:
            return None
        lines = shapely.multilinestrings([shapely.linestrings(ring) for ring in rings])
        if corners > _MOST_TANGLED and not lines.is_simple:
            return None
        area = areas_of(shapely.build_area(shapely.node(lines)))
        return None if area.is_empty else area

    def _rings(self, kind: str, element: int) -> Iterator[Floats]:
        if kind == "way":
            way = self._data.ways[element]
            line = self.line(way)
            if way.nodes[:1] == way.nodes[-1:] and len(line) > 2:
                # An extract may lack nodes at its edge; the ring closes over the rest.
                yield np.vstack([line, line[:1]])
            return
        for member in self._data.relations[element].members:
            if member.kind == "way" and member.ref in self._data.ways:
                line = self.line(self._data.ways[member.ref])
                if len(line) > 1:
                    yield line


def areas_of(shape: shapely.Geometry) -> shapely.Geometry:
    """Keep what a shape has of areas, valid and on the raster; operations leave lines and points.

    Args:
        shape: any, metres.

    Returns:
        A multipolygon with corners on whole millimetres; empty where the shape has hardly any area.
    """
    valid = shapely.set_precision(shapely.make_valid(shape), _GRID)
    return shapely.multipolygons(flat_polygons(np.array([valid]))[0])


def polygons_of(shape: shapely.Geometry, *, larger_than: float) -> list[shapely.Polygon]:
    """List the polygons of a shape that are larger than some square metres, in a fixed order.

    Args:
        shape: a polygon or multipolygon, metres.
        larger_than: square metres.

    Returns:
        The polygons, largest first.
    """
    kept = [part for part in shapely.get_parts(shape) if part.area > larger_than]
    return sorted(kept, key=lambda part: (-round(part.area, 3), part.bounds))


def without_overlaps(shapes: Shapes, order: Iterable[int], *, most: int) -> dict[int, shapely.Geometry]:
    """Cut each shape by those before it in an order.

    Args:
        shapes: (n,) valid polygons or multipolygons.
        order: indices, those that keep their ground first.
        most: a shape that lies over more others than this is left out.

    Returns:
        What is left of each shape, by its index; without those that nothing is left of.
    """
    tree = shapely.STRtree(shapes)
    left: dict[int, shapely.Geometry] = {}
    for index in order:
        others = [int(k) for k in tree.query(shapes[index], predicate="intersects") if int(k) in left]
        corners = shapely.get_num_coordinates(shapes[index])
        if (
            len(others) > most
            or corners * sum(shapely.get_num_coordinates(left[k]) for k in others) > _MOST_WORK
        ):
            continue
        rest = shapes[index]
        if others:
            ground = shapely.union_all([left[k] for k in sorted(others)], grid_size=_GRID)
            rest = areas_of(shapely.difference(rest, areas_of(ground), grid_size=_GRID))
        if not rest.is_empty:
            left[index] = rest
    return left
