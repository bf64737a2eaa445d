"""The map from above, drawn from its meshes."""

from collections.abc import Sequence
from pathlib import Path

import cv2
import numpy as np

from dojo_maps.description import RoadMap
from dojo_maps.errors import GeometryError
from dojo_maps.geometry.polylines import Floats
from dojo_maps.meshes.gltf import COLOURS
from dojo_maps.meshes.mesh import Mesh

LONGER_SIDE = 1600
_OVERSAMPLING = 2
_MARGIN = 0.02
_FRACTION_BITS = 4


def draw_overview(road_map: RoadMap, meshes: Sequence[Mesh], path: Path) -> None:
    """Draw the map's rectangle, north up, 1600 pixels on its longer side, as PNG."""
    low, high = (np.array(corner) - road_map.origin for corner in road_map.bounds)
    margin = max(5.0, _MARGIN * float((high - low).max()))
    low, high = low - margin, high + margin
    scale = LONGER_SIDE / float((high - low).max())
    width, height = (round(float(side)) for side in np.maximum((high - low) * scale, 1))
    canvas = np.full(
        (height * _OVERSAMPLING, width * _OVERSAMPLING, 3), COLOURS["terrain"][::-1], dtype=np.uint8
    )
    corners, colours = _painters_order(meshes)
    pixels = (corners[:, :, :2] - [low[0], high[1]]) * [scale, -scale] * _OVERSAMPLING
    fixed = np.round((pixels - 0.5) * (1 << _FRACTION_BITS)).astype(np.int32)
    for triangle, colour in zip(fixed, colours, strict=True):
        cv2.fillConvexPoly(canvas, triangle, colour, cv2.LINE_8, _FRACTION_BITS)
    picture = cv2.resize(canvas, (width, height), interpolation=cv2.INTER_AREA)
    encoded, png = cv2.imencode(".png", picture)
    if not encoded:
        raise GeometryError(f"{path.name}: the picture cannot be written as PNG")
    path.write_bytes(png.tobytes())


def _painters_order(meshes: Sequence[Mesh]) -> tuple[Floats, list[tuple[int, int, int]]]:
    """List every upward triangle (n, 3, 3) with its colour in BGR, lowest first."""
    corners = [mesh.vertices[mesh.faces] for mesh in meshes if _is_drawn(mesh)]
    colours = [COLOURS[mesh.name][::-1] for mesh in meshes if _is_drawn(mesh)]
    which = np.repeat(np.arange(len(corners)), [len(c) for c in corners])
    every = np.concatenate([np.empty((0, 3, 3)), *corners])
    edge, other = every[:, 1] - every[:, 0], every[:, 2] - every[:, 0]
    upward = edge[:, 0] * other[:, 1] - edge[:, 1] * other[:, 0] > 0
    every, which = every[upward], which[upward]
    order = np.argsort(every[:, :, 2].max(axis=1), kind="stable")
    return every[order], [colours[k] for k in which[order]]


def _is_drawn(mesh: Mesh) -> bool:
    """Tell whether a mesh is drawn; bare ground is the canvas, and signals hang over what matters."""
    return mesh.name != "terrain" and mesh.layer != "signal"
