"""Reads scene.glb back, straight into arrays: only what `gltf.write_scene` writes, checked as it is read.

A separate reader keeps the environment small: every process that draws reads a scene, none writes one.
Source: the glTF 2.0 specification, sections 3.6 (accessors) and 4.4 (GLB).
"""

import json
import struct
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dojo_maps.errors import DescriptionError
from dojo_maps.meshes.mesh import Mesh

_MAGIC, _JSON, _BINARY = 0x46546C67, 0x4E4F534A, 0x004E4942
_COMPONENTS = {5121: np.uint8, 5123: np.uint16, 5125: np.uint32, 5126: np.float32}
_COUNTS = {"SCALAR": 1, "VEC3": 3}


def read_scene(path: Path) -> tuple[Mesh, ...]:
    """Read the meshes of a scene: metres, x east, y north, z up, around the map's origin.

    Raises:
        DescriptionError: the file is missing, no binary glTF, or no scene that `write_scene` wrote.
    """
    try:
        data = path.read_bytes()
        document, binary = _parts(data)
        return tuple(_read_node(node, document, binary) for node in document["nodes"] if "mesh" in node)
    except (OSError, ValueError, KeyError, IndexError, TypeError, struct.error, RecursionError) as error:
        raise DescriptionError(path, f"no scene that can be read ({error}); convert the map again") from error


def _parts(data: bytes) -> tuple[dict[str, Any], bytes]:
    if struct.unpack_from("<III", data) != (_MAGIC, 2, len(data)):
        raise ValueError("not a whole binary glTF 2.0 file")
    text = _chunk(data, 12, _JSON)
    return json.loads(text), _chunk(data, 20 + len(text), _BINARY)


def _chunk(data: bytes, start: int, kind: int) -> bytes:
    length, found = struct.unpack_from("<II", data, start)
    if found != kind or start + 8 + length > len(data):
        raise ValueError("its parts are not where they should be")
    return data[start + 8 : start + 8 + length]


def _read_node(node: dict[str, Any], document: dict[str, Any], binary: bytes) -> Mesh:
    mesh = document["meshes"][node["mesh"]]
    (primitive,) = mesh["primitives"]
    if not np.array_equal(node.get("matrix", np.eye(4).ravel()), np.eye(4).ravel()):
        raise ValueError(f"node {node['name']!r} is moved")
    x, up, back = _accessor(primitive["attributes"]["POSITION"], document, binary).astype(np.float64).T
    faces = _accessor(primitive["indices"], document, binary).reshape(-1, 3).astype(np.int64)
    runs = mesh["extras"]["sources"]
    sources = np.repeat(np.arange(len(runs)), [int(count) for _, _, count in runs])
    if len(sources) != len(faces) or faces.max(initial=-1) >= len(x) or not np.isfinite([x, up, back]).all():
        raise ValueError(f"node {node['name']!r} is incomplete")
    return Mesh(
        name=str(node["name"]),
        vertices=np.column_stack([x, -back, up]),
        faces=faces,
        sources=sources,
        ids=tuple(str(run[0]) for run in runs),
    )


def _accessor(index: int, document: dict[str, Any], binary: bytes) -> NDArray[Any]:
    accessor = document["accessors"][index]
    view = document["bufferViews"][accessor["bufferView"]]
    width = _COUNTS[accessor["type"]]
    start = view.get("byteOffset", 0) + accessor.get("byteOffset", 0)
    values = np.frombuffer(binary, _COMPONENTS[accessor["componentType"]], accessor["count"] * width, start)
    return values.reshape(-1, width)
