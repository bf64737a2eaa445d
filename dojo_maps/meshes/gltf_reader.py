"""Reads scene.glb back, straight into arrays: only what `gltf.write_scene` writes, checked as it is read.

A separate reader keeps the environment small: every process that draws reads a scene, none writes one.
Source: the glTF 2.0 specification, sections 3.6 (accessors) and 4.4 (GLB).
"""

import struct
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from dojo_maps.errors import DescriptionError
from dojo_maps.input_files import read_bytes
from dojo_maps.meshes.mesh import Mesh
from dojo_maps.safe_json import parse_json

_MAGIC, _JSON, _BINARY = 0x46546C67, 0x4E4F534A, 0x004E4942
_INDICES = {5121: np.uint8, 5123: np.uint16, 5125: np.uint32}
_FLOATS = {5126: np.float32}
_FARTHEST = 1e7
"""Metres from the origin; ten times as wide as a map may be."""
_SHARED = 4
"""How many times the file's bytes may be used; meshes share only what happens to be equal."""

T = TypeVar("T")


def read_scene(path: Path) -> tuple[Mesh, ...]:
    """Read the meshes of a scene.

    Args:
        path: of the scene.glb in a bundle.

    Returns:
        The meshes in the file's order: metres, x east, y north, z up, around the map's origin.

    Raises:
        DescriptionError: the file is missing, no binary glTF, or no scene that `write_scene` wrote.
    """
    data = read_bytes(path, error=DescriptionError)
    try:
        text, binary = _parts(data)
        scene = _Scene(parse_json(text, path, error=DescriptionError), binary)
        return tuple(scene.meshes())
    except (ValueError, KeyError, IndexError, TypeError, AttributeError, struct.error) as error:
        raise DescriptionError(path, f"no scene that can be read ({error}); convert the map again") from error


def _parts(data: bytes) -> tuple[bytes, bytes]:
    if struct.unpack_from("<III", data) != (_MAGIC, 2, len(data)):
        raise ValueError("not a whole binary glTF 2.0 file")
    text = _chunk(data, 12, _JSON)
    return text, _chunk(data, 20 + len(text), _BINARY)


def _chunk(data: bytes, start: int, kind: int) -> bytes:
    length, found = struct.unpack_from("<II", data, start)
    if found != kind or start + 8 + length > len(data):
        raise ValueError("its parts are not where they should be")
    return data[start + 8 : start + 8 + length]


class _Scene:
    """A document and the bytes that it speaks of."""

    def __init__(self, document: Any, binary: bytes) -> None:
        self._document, self._binary = document, binary
        self._left = _SHARED * len(binary)

    def meshes(self) -> list[Mesh]:
        """Read every mesh."""
        nodes = _typed(self._document, "nodes", list)
        return [self._read_node(node) for node in nodes if "mesh" in node]

    def _read_node(self, node: dict[str, Any]) -> Mesh:
        name, mesh = _typed(node, "name", str), self._item("meshes", _number(node, "mesh"))
        (primitive,) = mesh["primitives"]
        if not np.array_equal(node.get("matrix", np.eye(4).ravel()), np.eye(4).ravel()):
            raise ValueError(f"node {name!r} is moved")
        place = _number(primitive["attributes"], "POSITION")
        x, up, back = self._values(place, "VEC3", 3, _FLOATS).astype(np.float64).T
        corners = self._values(_number(primitive, "indices"), "SCALAR", 1, _INDICES)
        faces = corners.reshape(-1, 3).astype(np.int64)
        runs = _typed(mesh["extras"], "sources", list)
        ids, counts = [_typed(run, 0, str) for run in runs], [_number(run, 2) for run in runs]
        if sum(counts) != len(faces) or faces.max(initial=-1) >= len(x):
            raise ValueError(f"node {name!r} is incomplete")
        if not (np.abs([x, up, back]) <= _FARTHEST).all():
            raise ValueError(f"node {name!r} has a corner that lies nowhere near the map")
        return Mesh(
            name=name,
            vertices=np.column_stack([x, -back, up]),
            faces=faces,
            sources=np.repeat(np.arange(len(runs)), counts),
            ids=tuple(ids),
        )

    def _values(self, index: int, kind: str, width: int, types: dict[int, Any]) -> NDArray[Any]:
        """Read an accessor's values: (count, width)."""
        accessor = self._item("accessors", index)
        view = self._item("bufferViews", _number(accessor, "bufferView"))
        if accessor["type"] != kind or accessor["componentType"] not in types or "byteStride" in view:
            raise ValueError(f"accessor {index} is of another kind than write_scene's")
        dtype = np.dtype(types[accessor["componentType"]])
        count = _number(accessor, "count") * width
        start = _number({"byteOffset": 0, **view}, "byteOffset")
        start += _number({"byteOffset": 0, **accessor}, "byteOffset")
        self._left -= count * dtype.itemsize
        if start + count * dtype.itemsize > len(self._binary) or self._left < 0:
            raise ValueError(f"accessor {index} asks for more than there is")
        return np.frombuffer(self._binary, dtype, count, start).reshape(-1, width)

    def _item(self, name: str, index: int) -> dict[str, Any]:
        return _typed(_typed(self._document, name, list), index, dict)


def _typed(container: Any, key: str | int, kind: type[T]) -> T:
    value = container[key]
    if type(value) is not kind:
        raise ValueError(f"its {key} is of type {type(value).__name__}, expected {kind.__name__}")
    return value


def _number(container: Any, key: str | int) -> int:
    value = _typed(container, key, int)
    if value < 0:
        raise ValueError(f"its {key} is {value}")
    return value
