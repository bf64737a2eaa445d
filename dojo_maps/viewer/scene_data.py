"""The scene's meshes as a page draws them: tiles of small whole numbers, by what they are made of.

Positions are counted in steps of 8 mm on the map and 4 mm up, from a corner that is a whole number of steps
from the map's origin: so corners that two meshes share stay one place.
"""

from collections.abc import Iterator, Sequence
from typing import Any
from zlib import crc32

import numpy as np
from numpy.typing import NDArray

from dojo_maps.geometry.polylines import Floats, Ints
from dojo_maps.meshes.gltf import COLOURS, shade
from dojo_maps.meshes.mesh import Mesh, used_vertices
from dojo_maps.viewer.container import Container

_STEPS = np.array([128.0, 128.0, 256.0])
"""How many steps a metre has, along x, y and z."""
_ALONG = 64.0
"""Steps of a metre along a wall."""
_TILE = 256.0
"""Metres; triangles go to the tile that their middle lies in."""
_LARGEST = 32767
_LEFT_OUT = ("signal/red", "signal/yellow", "signal/green")
"""Lamps, which the page draws as they are lit."""
_SURFACES = {
    "terrain": "grass", "terrain/green": "grass", "terrain/water": "water", "island": "grass",
    "road": "asphalt", "road/parking": "asphalt", "junction": "asphalt", "rail": "ballast",
    "sidewalk": "paving", "walking_area": "paving", "marking": "paint", "crossing": "paint",
    "stop_line": "paint", "arrow": "paint", "building": "facade", "building/shelter/glass": "glass",
    "tree": "foliage", "tree/hedge": "foliage", "tree/leaves": "foliage",
}  # fmt: skip
"""What a mesh is made of, by its name; others are plain."""


def pack_meshes(meshes: Sequence[Mesh], container: Container) -> list[dict[str, Any]]:
    """Add the meshes of a scene to a page's data.

    Args:
        meshes: metres, x east, y north, z up, around the map's origin.
        container: takes the arrays.

    Returns:
        A record for each mesh and tile: `name`, `surface`, `colour` (sRGB), `origin` and `scale` (metres),
        and its arrays: `positions` (x, y, z and the thing's own number), `normals` (three and a zero),
        `faces`, and of buildings and plants `spans` (foot and top, in steps as z; how far along its wall the
        corner is, in 1/64 m; a zero).
    """
    return [
        record
        for mesh in meshes
        if mesh.name not in _LEFT_OUT and len(mesh.faces)
        for record in _pack(mesh, container)
    ]


def _pack(mesh: Mesh, container: Container) -> Iterator[dict[str, Any]]:
    surface = _SURFACES.get(mesh.name, "plain")
    corners, faces, normals = _face_by_face(mesh) if surface == "facade" else shade(mesh)
    things = _measure(mesh, corners, faces)
    middles = corners[faces].mean(axis=1)[:, :2]
    _, tiles = np.unique(np.floor(middles / _TILE).astype(np.int64), axis=0, return_inverse=True)
    for tile in range(int(tiles.max()) + 1):
        used, numbered = used_vertices(faces[tiles.ravel() == tile], len(corners))
        places, values = corners[used], things[used]
        middle = (places.min(axis=0) + places.max(axis=0)) / 2
        origin = np.floor(middle * _STEPS) / _STEPS
        steps = np.rint((places - origin) * _STEPS)
        record: dict[str, Any] = {"name": mesh.name, "surface": surface, "colour": COLOURS[mesh.name]}
        kind: Any = np.int16 if np.abs(steps).max() <= _LARGEST else np.float32
        record |= {"origin": origin.tolist(), "scale": (1 / _STEPS).tolist()}
        small = len(places) <= _LARGEST
        record |= {
            "positions": container.add(np.column_stack([steps, values[:, 2]]).astype(kind)),
            "normals": container.add(_pad(np.rint(normals[used] * 127).astype(np.int8))),
            "faces": container.add(numbered.ravel().astype(np.uint16 if small else np.uint32)),
        }
        if surface in {"facade", "foliage"}:
            record["spans"] = container.add(_spans(places - origin, values[:, :2] - origin[2], normals[used]))
        yield record


def _spans(places: Floats, heights: Floats, normals: Floats) -> NDArray[np.int16]:
    """Tell what windows and leaves are drawn by; a normal in eight bits would slant them."""
    along = (places[:, 1] * normals[:, 0] - places[:, 0] * normals[:, 1]) * _ALONG
    spans = np.column_stack([heights * _STEPS[2], along, np.zeros(len(along))])
    found: NDArray[np.int16] = np.clip(np.rint(spans), -_LARGEST, _LARGEST).astype(np.int16)
    return found


def _face_by_face(mesh: Mesh) -> tuple[Floats, Ints, Floats]:
    """Give corners the normal of their own face, as windows need it; faces of one plane share corners."""
    a, b, c = np.moveaxis(mesh.vertices[mesh.faces], 1, 0)
    across = np.cross(b - a, c - a)
    normals = across / np.maximum(np.linalg.norm(across, axis=1, keepdims=True), 1e-12)
    keys = np.column_stack([mesh.faces.ravel(), np.repeat(np.rint(normals * 1000), 3, axis=0)])
    _, first, numbered = np.unique(keys, axis=0, return_index=True, return_inverse=True)
    return mesh.vertices[mesh.faces.ravel()[first]], numbered.reshape(-1, 3), normals[first // 3]


def _measure(mesh: Mesh, corners: Floats, faces: Ints) -> Floats:
    """Find of the thing that each corner belongs to its foot and top and a number of its own: (n, 3)."""
    low, high = np.full(len(mesh.ids), np.inf), np.full(len(mesh.ids), -np.inf)
    heights = corners[faces, 2]
    np.minimum.at(low, mesh.sources, heights.min(axis=1))
    np.maximum.at(high, mesh.sources, heights.max(axis=1))
    own = [crc32(name.encode()) & _LARGEST for name in mesh.ids]
    things = np.zeros((len(corners), 3))
    things[faces] = np.column_stack([low, high, own])[mesh.sources][:, None]
    return things


def _pad(normals: NDArray[np.int8]) -> NDArray[np.int8]:
    return np.column_stack([normals, np.zeros(len(normals), np.int8)])
