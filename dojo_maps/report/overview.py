"""The map from above, drawn from its meshes, with its streets' names, its signals, a scale and north."""

import unicodedata
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from dojo_maps.description import Lane, RoadMap, Signal
from dojo_maps.errors import GeometryError
from dojo_maps.geometry.polylines import Floats
from dojo_maps.meshes.gltf import COLOURS
from dojo_maps.meshes.mesh import Mesh

LONGER_SIDE = 1600
_OVERSAMPLING = 2
_MARGIN = 0.02
_FRACTION_BITS = 4
_FONT, _LETTER = cv2.FONT_HERSHEY_SIMPLEX, 0.5
_DARK, _LIGHT = (52, 40, 30), (255, 255, 255)
_LEAST_SIDE = 200
"""Pixels; on a smaller picture there is no room for words."""


def draw_overview(road_map: RoadMap, meshes: Sequence[Mesh], path: Path) -> None:
    """Draw the map's rectangle, north up, 1600 pixels on its longer side, as PNG.

    Args:
        road_map: whose bounds, names and signals are drawn.
        meshes: its scene, metres, around the map's origin; bare ground and signals are not drawn from it.
        path: of the picture; an older one is written over.

    Raises:
        GeometryError: OpenCV cannot write the picture as PNG.
        OSError: the file cannot be written.
    """
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
    _Lettering(road_map, picture, low, scale).write_all()
    encoded, png = cv2.imencode(".png", picture)
    if not encoded:
        raise GeometryError(f"{path.name}: the picture cannot be written as PNG")
    path.write_bytes(png.tobytes())


class _Lettering:
    """Writes onto the picture, where nothing is written yet.

    Args:
        road_map: the map.
        picture: (height, width, 3) BGR.
        low: (2,) metres around the map's origin of the picture's lower left corner.
        scale: pixels of a metre.
    """

    def __init__(self, road_map: RoadMap, picture: NDArray[Any], low: Floats, scale: float) -> None:
        self._map, self._picture, self._low, self._scale = road_map, picture, low, scale
        self._taken: list[tuple[float, float, float, float]] = []

    def write_all(self) -> None:
        """Write what matters most first."""
        if min(self._picture.shape[:2]) < _LEAST_SIDE:
            return
        self._draw_scale()
        for signal in self._map.signals:
            self._mark_signal(signal)
        names: dict[str, Lane] = {}
        roads = {road.id: road for road in self._map.roads}
        for lane in self._map.lanes:
            name = _in_plain_letters(roads[lane.road].name)
            if name and lane.length > names.get(name, lane).length - 1e-9:
                names[name] = lane
        for name, lane in sorted(names.items(), key=lambda item: (-item[1].length, item[0])):
            self._write_name(
                name, lane.shape[len(lane.shape) // 2 - 1 : len(lane.shape) // 2 + 1].mean(axis=0)
            )

    def _pixel(self, place: Floats) -> tuple[int, int]:
        x, y = (place[:2] - self._map.origin - self._low) * self._scale
        return round(float(x)), self._picture.shape[0] - 1 - round(float(y))

    def _draw_scale(self) -> None:
        height, width = self._picture.shape[:2]
        metres = max(m * 10**k for k in range(6) for m in (1, 2, 5) if m * 10**k * self._scale < 0.2 * width)
        left, foot, length = 24, height - 24, round(metres * self._scale)
        for colour, wide in ((_DARK, 5), (_LIGHT, 2)):
            corners = [(left, foot - 8), (left, foot), (left + length, foot), (left + length, foot - 8)]
            cv2.polylines(self._picture, [np.array(corners)], False, colour, wide, cv2.LINE_AA)
        self._put(f"{metres} m", left + 6, foot - 10)
        self._taken.append((left, foot - 34, left + max(90, length), height))
        arrow = np.array([(width - 40, 22), (width - 50, 52), (width - 40, 45), (width - 30, 52)])
        cv2.fillPoly(self._picture, [arrow], _DARK, cv2.LINE_AA)
        cv2.polylines(self._picture, [arrow], True, _LIGHT, 2, cv2.LINE_AA)
        self._put("N", width - 47, 74)
        self._taken.append((width - 60, 0, width, 84))

    def _mark_signal(self, signal: Signal) -> None:
        places = [j.position for j in self._map.junctions if j.id in signal.junctions]
        if not places:
            return
        x, y = self._pixel(np.array(places).mean(axis=0))
        cv2.rectangle(self._picture, (x - 6, y - 14), (x + 6, y + 14), _DARK, -1, cv2.LINE_AA)
        cv2.rectangle(self._picture, (x - 6, y - 14), (x + 6, y + 14), _LIGHT, 1, cv2.LINE_AA)
        for k, name in enumerate(("red", "yellow", "green")):
            cv2.circle(self._picture, (x, y - 9 + 9 * k), 3, COLOURS[f"signal/{name}"][::-1], -1, cv2.LINE_AA)
        self._taken.append((x - 8, y - 16, x + 8, y + 16))

    def _write_name(self, name: str, place: Floats) -> None:
        (wide, tall), _ = cv2.getTextSize(name, _FONT, _LETTER, 1)
        x, y = self._pixel(place)
        box = (x - wide / 2 - 4, y - tall, x + wide / 2 + 4, y + tall)
        height, width = self._picture.shape[:2]
        inside = box[0] > 0 and box[1] > 0 and box[2] < width and box[3] < height
        if inside and not any(
            a < box[2] and c > box[0] and b < box[3] and d > box[1] for a, b, c, d in self._taken
        ):
            self._taken.append(box)
            self._put(name, x - wide // 2, y + tall // 2)

    def _put(self, text: str, x: int, y: int) -> None:
        around = [(i, j) for i in (-1, 0, 1) for j in (-1, 0, 1) if i or j]
        for dx, dy, colour in [*((i, j, _DARK) for i, j in around), (0, 0, _LIGHT)]:
            cv2.putText(self._picture, text, (x + dx, y + dy), _FONT, _LETTER, colour, 1, cv2.LINE_AA)


def _in_plain_letters(name: str) -> str:
    """Write a name in the letters that OpenCV's fonts have; one in another alphabet is left out."""
    plain = unicodedata.normalize("NFKD", name.replace("ß", "ss")).encode("ascii", "ignore").decode().strip()
    return plain if len(plain) > len(name) / 2 and plain.isprintable() else ""


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
