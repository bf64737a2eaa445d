"""Between degrees and the metres of a map: the UTM zone of an extract, moved to begin at its roads."""

import functools
import math
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pyproj
import shapely

from dojo_maps.description import Projection
from dojo_maps.errors import SourceError
from dojo_maps.geometry.polylines import Floats
from dojo_maps.sources.osm.read.data import OsmData, OsmWay


def project_nodes(
    data: OsmData, used: Sequence[int], path: Path | str, widest: float
) -> tuple[Projection, dict[int, tuple[float, float]]]:
    """Choose the projection of a map, and lay nodes into it.

    Args:
        data: the extract.
        used: the nodes of its roads.
        path: named in errors.
        widest: metres that they may spread.

    Returns:
        The projection; and where the nodes lie, metres.

    Raises:
        SourceError: they spread too far to be one map.
    """
    lon = np.array([data.nodes[node].lon for node in used])
    lat = np.array([data.nodes[node].lat for node in used])
    zone = min(60, int((float(np.median(lon)) + 180) // 6) + 1)
    south = " +south" if np.median(lat) < 0 else ""
    proj = f"+proj=utm +zone={zone}{south} +ellps=WGS84 +datum=WGS84 +units=m +no_defs"
    x, y = pyproj.Proj(proj)(lon, lat)
    if not (np.isfinite(x).all() and np.isfinite(y).all()) or max(np.ptp(x), np.ptp(y)) > widest:
        raise SourceError(
            path,
            f"its roads spread over more than {widest / 1000:.0f} km; cut out one place with osmium extract",
        )
    projection = Projection(proj=proj, net_offset=(-math.floor(x.min()), -math.floor(y.min())))
    return projection, _moved(projection, used, x, y)


def place_nodes(
    projection: Projection, data: OsmData, nodes: Sequence[int]
) -> dict[int, tuple[float, float]]:
    """Lay more nodes of an extract into the plane, metres.

    Args:
        projection: of the map, as `project_nodes` chose it.
        data: the extract.
        nodes: ids of nodes in it.

    Returns:
        By node, x and y, metres, map frame.
    """
    lon = np.array([data.nodes[node].lon for node in nodes])
    lat = np.array([data.nodes[node].lat for node in nodes])
    return _moved(projection, nodes, *_projected(projection.proj)(lon, lat))


def _moved(
    projection: Projection, nodes: Sequence[int], x: Floats, y: Floats
) -> dict[int, tuple[float, float]]:
    right, up = projection.net_offset
    return {
        node: (round(float(a) + right, 3), round(float(b) + up, 3))
        for node, a, b in zip(nodes, x, y, strict=True)
    }


def way_line(projection: Projection, data: OsmData, way: OsmWay) -> shapely.LineString | None:
    """Lay any way of the extract into the plane.

    Args:
        projection: of the map.
        data: the extract.
        way: any; nodes that the extract lacks are passed over.

    Returns:
        The line, metres, map frame; None where fewer than two nodes are there.
    """
    nodes = [data.nodes[node] for node in way.nodes if node in data.nodes]
    if len(nodes) < 2:
        return None
    x, y = _projected(projection.proj)(np.array([n.lon for n in nodes]), np.array([n.lat for n in nodes]))
    return shapely.LineString(np.column_stack([x, y]) + projection.net_offset)


@functools.cache
def _projected(proj: str | None) -> pyproj.Proj:
    return pyproj.Proj(proj)
