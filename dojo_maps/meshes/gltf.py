"""The scene as binary glTF: +Y up, one node and one material per mesh, the sources of its faces beside it.

Normals are smooth over edges that bend little, and over all of a tree's. At others the corners are stored
once for each side, except those of pavement, whose solids stay closed for whoever joins corners by their
numbers: there the normals are those of the tops, which are lit as they lie, and the low kerbs softly.
"""

import json
import struct
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dojo_maps.geometry.polylines import Floats, Ints
from dojo_maps.meshes.mesh import Mesh
from dojo_maps.meshes.parked_cars import PAINTS, PREFIX

COLOURS = {
    "terrain": (116, 142, 92),
    "terrain/water": (92, 130, 158),
    "terrain/green": (102, 134, 76),
    "building": (196, 184, 168),
    "building/lamp": (120, 124, 128),
    "building/sign": (140, 142, 144),
    "building/sign/rim": (196, 40, 36),
    "building/sign/face": (240, 240, 238),
    "building/shelter": (86, 92, 98),
    "building/shelter/glass": (190, 206, 210),
    "building/car/black": (30, 31, 34),
    "building/car/blue": (36, 66, 124),
    "building/car/glass": (34, 40, 46),
    "building/car/grey": (92, 97, 104),
    "building/car/red": (150, 24, 28),
    "building/car/silver": (186, 190, 194),
    "building/car/tyre": (28, 28, 30),
    "building/car/white": (228, 230, 231),
    "tree": (70, 108, 56),
    "tree/hedge": (62, 98, 50),
    "tree/leaves": (82, 122, 62),
    "tree/trunk": (98, 78, 60),
    "road": (74, 77, 82),
    "road/parking": (92, 92, 94),
    "junction": (78, 81, 86),
    "rail": (112, 101, 90),
    "rail/track": (150, 152, 156),
    "sidewalk": (178, 172, 162),
    "walking_area": (188, 182, 172),
    "island": (150, 156, 140),
    "marking": (236, 236, 232),
    "crossing": (242, 242, 240),
    "stop_line": (242, 242, 240),
    "arrow": (240, 240, 236),
    "signal": (48, 50, 54),
    "signal/red": (214, 44, 36),
    "signal/yellow": (240, 186, 40),
    "signal/green": (44, 178, 92),
}
"""Colours by node name, sRGB."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Finish:
    """What a surface is like beside its colour, in glTF's terms: section 3.9 of the specification.

    Attributes:
        roughness: 0 as a mirror to 1.
        metallic: 0 or 1.
        glow: of its colour that it sends out by itself, 0 to 1.
        alpha: 1 where nothing shines through.
        two_sided: its faces are seen from behind, too.
    """

    roughness: float = 0.9
    metallic: float = 0.0
    glow: float = 0.0
    alpha: float = 1.0
    two_sided: bool = False


_GROUND = Finish(roughness=0.95, two_sided=True)
_METAL, _COATED, _PAINT = Finish(roughness=0.45, metallic=1.0), Finish(roughness=0.5), Finish(roughness=0.7)
_LAMP = Finish(roughness=0.3, glow=0.7)
_LEAVES = Finish(roughness=0.8, two_sided=True)
FINISHES = {
    "terrain": _GROUND, "road": _GROUND, "junction": _GROUND,
    "terrain/water": Finish(roughness=0.08, two_sided=True),
    "building/lamp": _METAL, "building/shelter": _METAL,
    "building/shelter/glass": Finish(roughness=0.05, alpha=0.3, two_sided=True),
    "building/sign": _METAL, "building/sign/rim": _COATED,
    "building/sign/face": _COATED, "building/car/glass": Finish(roughness=0.1),
    **{f"{PREFIX}{paint}": Finish(roughness=0.3) for paint in PAINTS},
    "rail/track": Finish(roughness=0.35, metallic=1.0),
    "marking": _PAINT, "crossing": _PAINT, "stop_line": _PAINT, "arrow": _PAINT,
    "signal": _COATED, "signal/red": _LAMP, "signal/yellow": _LAMP, "signal/green": _LAMP,
    "tree": _LEAVES, "tree/leaves": _LEAVES,
}  # fmt: skip
"""Finishes by node name, or by layer; others are dull."""

_JOINED = ("sidewalk", "walking_area", "island")
"""Layers whose faces share their corners whatever the angle."""
_CREASE = np.cos(np.radians(30.0))
_TOPS_FIRST = 1000.0
"""How much more than its walls the top of pavement counts for the normals of its edge."""

_LEAFY = ("tree", "tree/leaves")
"""Meshes that are smooth all over."""
_NORMALS = 2048
"""More than the steps of a part of a normal, by which corners are told apart."""

_VERTICES, _INDICES = 34962, 34963
"""glTF's numbers for what a buffer view holds."""
_TYPES = {np.uint16: 5123, np.uint32: 5125, np.float32: 5126}
_MOST_SHORT = 65535
"""Vertices that can be counted in two bytes; the last number is kept for breaks."""


def write_scene(meshes: Sequence[Mesh], path: Path) -> None:
    """Write scene.glb.

    Each mesh carries `extras.sources`: a list of [id, first face, number of faces], in the order of its
    faces, so that every face can be traced to the thing of the description it belongs to.

    Args:
        meshes: with faces, and with names in `COLOURS`.
        path: of the file to write; replaced whole.

    Raises:
        OSError: the file cannot be written.
    """
    shaded = [shade(mesh) for mesh in meshes]
    binary = _Binary()
    for mesh, (vertices, faces, normals) in zip(meshes, shaded, strict=True):
        binary.add_mesh(mesh, vertices, faces, normals)
    path.write_bytes(binary.to_bytes())


class _Binary:
    """A glTF document and the bytes that it speaks of. Source: glTF 2.0, sections 3.6 and 4.4."""

    def __init__(self) -> None:
        self._data = bytearray()
        self._views: dict[tuple[bytes, int], int] = {}
        self._document: dict[str, Any] = {
            "asset": {"version": "2.0", "generator": "TrafficDojo"},
            "scene": 0,
            "scenes": [{"nodes": []}],
        }
        self._document |= {name: [] for name in ("nodes", "meshes", "materials", "accessors", "bufferViews")}

    def add_mesh(self, mesh: Mesh, vertices: Floats, faces: Ints, normals: Floats) -> None:
        """Add a node with its mesh and its material, all of one number."""
        places = _y_up(vertices).astype(np.float32)
        small = len(places) <= _MOST_SHORT
        indices = faces.ravel().astype(np.uint16 if small else np.uint32)
        corners = self._add_values(indices, _INDICES)
        attributes = {
            "POSITION": self._add_values(places, _VERTICES),
            "NORMAL": self._add_values(_y_up(normals).astype(np.float32), _VERTICES),
        }
        # Only of positions are bounds needed.
        bounds = {"min": places.min(axis=0).tolist(), "max": places.max(axis=0).tolist()}
        self._document["accessors"][attributes["POSITION"]] |= bounds
        number = len(self._document["nodes"])
        primitive = {"attributes": attributes, "indices": corners, "mode": 4, "material": number}
        extras = {"sources": source_runs(mesh)}
        finish = FINISHES.get(mesh.name) or FINISHES.get(mesh.layer, Finish())
        colour = _linear(COLOURS[mesh.name])
        self._document["nodes"].append({"name": mesh.name, "mesh": number})
        self._document["scenes"][0]["nodes"].append(number)
        self._document["meshes"].append({"name": mesh.name, "primitives": [primitive], "extras": extras})
        self._document["materials"].append(
            {
                "name": mesh.name,
                "pbrMetallicRoughness": {
                    "baseColorFactor": [*colour, finish.alpha],
                    "metallicFactor": finish.metallic,
                    "roughnessFactor": finish.roughness,
                },
                "doubleSided": finish.two_sided,
                **({"emissiveFactor": [finish.glow * c for c in colour]} if finish.glow else {}),
                **({"alphaMode": "BLEND"} if finish.alpha < 1.0 else {}),
            }
        )

    def _add_values(self, values: NDArray[Any], target: int) -> int:
        """Add an accessor of (n,) or (n, 3) values; what is there in these bytes already is used again."""
        data = values.tobytes()
        if (data, target) not in self._views:
            self._data += bytes(-len(self._data) % 4)
            view = {"buffer": 0, "byteOffset": len(self._data), "byteLength": len(data), "target": target}
            self._views[data, target] = len(self._document["bufferViews"])
            self._document["bufferViews"].append(view)
            self._data += data
        accessor = {
            "bufferView": self._views[data, target],
            "componentType": _TYPES[values.dtype.type],
            "count": len(values),
            "type": "VEC3" if values.ndim > 1 else "SCALAR",
        }
        self._document["accessors"].append(accessor)
        return len(self._document["accessors"]) - 1

    def to_bytes(self) -> bytes:
        """Put the file together."""
        self._data += bytes(-len(self._data) % 4)
        whole = {**self._document, "buffers": [{"byteLength": len(self._data)}]}
        document = json.dumps(whole, ensure_ascii=False, separators=(",", ":")).encode()
        document += b" " * (-len(document) % 4)
        length = 12 + 8 + len(document) + 8 + len(self._data)
        return b"".join(
            [
                struct.pack("<4sII", b"glTF", 2, length),
                struct.pack("<I4s", len(document), b"JSON"),
                document,
                struct.pack("<I4s", len(self._data), b"BIN\0"),
                bytes(self._data),
            ]
        )


def _y_up(vectors: Floats) -> Floats:
    x, y, z = vectors.T
    return np.column_stack([x, z, -y])


def shade(mesh: Mesh) -> tuple[Floats, Ints, Floats]:
    """Find a mesh's normals, with the corners at sharp edges stored once for each side.

    Args:
        mesh: corners of pavement and of trees stay as they are, with one normal each.

    Returns:
        Vertices (n, 3), faces (m, 3) in the same order at the same places, and unit normals (n, 3).
    """
    a, b, c = np.moveaxis(mesh.vertices[mesh.faces], 1, 0)
    across = np.cross(b - a, c - a)
    corners, facing = mesh.faces.ravel(), _unit(across)
    if mesh.layer in _JOINED or mesh.name in _LEAFY:
        if mesh.layer in _JOINED:
            across *= np.where(facing[:, 2:] > _CREASE, _TOPS_FIRST, 1.0)
        return mesh.vertices, mesh.faces, _unit(_sums(corners, across, len(mesh.vertices)))
    groups = _smooth_groups(mesh.faces, facing)
    normals = _unit(_sums(groups, across, len(corners)))[groups]
    keys = corners
    for axis in range(3):
        keys = keys * _NORMALS + np.round((normals[:, axis] + 1.0) * 1000.0).astype(np.int64)
    _, first, places = np.unique(keys, return_index=True, return_inverse=True)
    return mesh.vertices[corners[first]], places.reshape(-1, 3), normals[first]


def _sums(groups: Ints, across: Floats, count: int) -> Floats:
    """Add up what the faces (m, 3) give to the groups (3 m,) of their corners: (count, 3)."""
    given = np.repeat(across, 3, axis=0)
    return np.column_stack([np.bincount(groups, weights=axis, minlength=count) for axis in given.T])


def _unit(vectors: Floats) -> Floats:
    """Scale vectors to unit length; those without length point up."""
    length = np.linalg.norm(vectors, axis=1, keepdims=True)
    return np.where(length > 1e-12, vectors / np.maximum(length, 1e-12), [0.0, 0.0, 1.0])


def _smooth_groups(faces: Ints, normals: Floats) -> Ints:
    """Group the corners of faces that meet without a crease: (3 m,) the number of a corner of the group."""
    starts, ends = faces.ravel(), faces[:, [1, 2, 0]].ravel()
    number = np.arange(len(starts))
    following = number.reshape(-1, 3)[:, [1, 2, 0]].ravel()
    keys = np.minimum(starts, ends) * (faces.max(initial=0) + 1) + np.maximum(starts, ends)
    order = np.argsort(keys, kind="stable")
    one, other = order[:-1], order[1:]
    flat = (normals[one // 3] * normals[other // 3]).sum(axis=1) > _CREASE
    met = (keys[one] == keys[other]) & (starts[one] == ends[other]) & flat
    one, other = one[met], other[met]
    # An edge runs from its own corner to the following one, and back along its neighbour.
    pairs = np.concatenate([[one, following[other]], [following[one], other]], axis=1)
    groups = number
    while True:
        least = np.minimum(groups[pairs[0]], groups[pairs[1]])
        joined = groups.copy()
        np.minimum.at(joined, pairs[0], least)
        np.minimum.at(joined, pairs[1], least)
        joined = joined[joined]
        if np.array_equal(joined, groups):
            return groups
        groups = joined


def _linear(colour: tuple[int, int, int]) -> list[float]:
    """Turn sRGB into the linear colour that glTF keeps. Source: IEC 61966-2-1."""
    return [c / 12.92 if c <= 0.04045 else ((c + 0.055) / 1.055) ** 2.4 for c in np.array(colour) / 255]


def source_runs(mesh: Mesh) -> list[tuple[str, int, int]]:
    """List the sources of a mesh, in the order of its faces.

    Args:
        mesh: faces of one source lie together.

    Returns:
        Of each source its id, the index of its first face, and how many faces it has.
    """
    starts = np.flatnonzero(np.diff(mesh.sources, prepend=-1))
    ends = np.append(starts[1:], len(mesh.sources))
    return [(mesh.ids[mesh.sources[a]], int(a), int(b - a)) for a, b in zip(starts, ends, strict=True)]
