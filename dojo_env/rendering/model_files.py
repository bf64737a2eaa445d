"""3D models out of files: triangles and what they show, from glTF, GLB and OBJ.

Such files come from anywhere, so all they say is held against bounds: only regular files of a stated size are
read, what a file refers to must lie in its own folder, and whatever does not fit is one error.
"""

import base64
import math
import struct
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from io import BytesIO
from pathlib import Path
from typing import Any, NoReturn
from urllib.parse import unquote

import numpy as np
from numpy.typing import NDArray

from dojo_env.errors import ModelError, PhotographError
from dojo_env.photographs import decode_photograph
from dojo_env.rendering.lighting import to_linear
from dojo_maps.input_files import read_bytes
from dojo_maps.safe_json import parse_json

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

MOST_TRIANGLES = 300_000
"""No model may have more; what is drawn is made simpler, but must be read first."""
_MAX_BYTES = 1 << 26
_MOST_NODES, _MOST_CORNERS, _MOST_PICTURES, _MOST_LIBRARIES = 10_000, 3 * MOST_TRIANGLES, 64, 4
_MOST_VALUES, _MOST_FETCHED = 30_000_000, 1 << 28
"""Numbers that are taken out of a file's buffers, and bytes of what it refers to, all together."""
_TEXTURE = 512
"""Pixels a side to which textures are averaged before colours are taken from them."""
_HEAD, _CHUNK = struct.Struct("<4sII"), struct.Struct("<I4s")
_TYPES: Mapping[int, type[np.generic]] = {
    5120: np.int8, 5121: np.uint8, 5122: np.int16, 5123: np.uint16, 5125: np.uint32, 5126: np.float32,
}  # fmt: skip
"""glTF's component types. Source: glTF 2.0, section 3.6.2.2."""
_WIDTHS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4}
_EXTENSIONS = ("KHR_materials_", "KHR_mesh_quantization", "KHR_texture_transform")
"""Extensions that a file may require: without them it looks a little different at most."""


@dataclass(frozen=True, slots=True, kw_only=True)
class RawModel:
    """The triangles of a file.

    Attributes:
        triangles: (n, 3, 3) in the file's own axes and units; counter-clockwise from outside.
        colours: (n, 3) linear, 0 to 1.
        materials: (n,) index into `names`.
        names: of materials.
    """

    triangles: Floats
    colours: Floats
    materials: Ints
    names: tuple[str, ...]


@dataclass(slots=True)
class _Pieces:
    """What has been read so far."""

    path: Path
    triangles: list[Floats] = field(default_factory=list)
    colours: list[Floats] = field(default_factory=list)
    names: list[str] = field(default_factory=list)
    count: int = 0

    def add(self, triangles: Floats, colours: Floats, name: str) -> None:
        """Add triangles of a material, (n, 3, 3), in colours that `np.broadcast_to` makes (n, 3)."""
        self.count += len(triangles)
        if self.count > MOST_TRIANGLES:
            raise ModelError(self.path, f"more than {MOST_TRIANGLES:,} triangles; simplify the model")
        self.triangles.append(np.asarray(triangles, np.float64))
        self.colours.append(np.broadcast_to(colours, (len(triangles), 3)))
        self.names.append(name)

    def join(self) -> RawModel:
        """Put them together."""
        triangles = np.concatenate([np.empty((0, 3, 3)), *self.triangles])
        if not len(triangles):
            raise ModelError(self.path, "has no triangles")
        if not np.isfinite(triangles).all():
            raise ModelError(self.path, "has corners that are nowhere (nan or infinite); export it again")
        counts = [len(each) for each in self.triangles]
        return RawModel(
            triangles=triangles,
            colours=np.clip(np.nan_to_num(np.concatenate(self.colours)), 0.0, 1.0),
            materials=np.repeat(np.arange(len(counts)), counts),
            names=tuple(self.names),
        )


def read_model_file(path: Path) -> RawModel:
    """Read a model.

    Args:
        path: OBJ by its suffix, else glTF or GLB; files that it refers to must lie in its folder or below.

    Returns:
        Its triangles.

    Raises:
        ModelError: the file is missing, broken, too large, or needs what is not read.
    """
    data = read_bytes(path, most=_MAX_BYTES, error=ModelError)
    pieces = _Pieces(path)
    try:
        with np.errstate(all="ignore"):
            if path.suffix.lower() == ".obj":
                _read_obj(data, pieces)
            else:
                _Gltf(data, path).read(pieces)
            return pieces.join()
    except ModelError:
        raise
    except (LookupError, TypeError, ValueError, AttributeError, ArithmeticError, struct.error) as error:
        raise ModelError(path, f"broken, or no 3D model ({type(error).__name__}: {error})") from error


def _read_beside(path: Path, name: str) -> bytes:
    """Read a file that a model refers to; it must lie in the model's folder or below."""
    folder = path.parent.resolve()
    found = (folder / name).resolve()
    if "://" in name or not found.is_relative_to(folder):
        raise ModelError(path, f"refers to {name[:80]!r} outside of its own folder; put all into one")
    return read_bytes(found, most=_MAX_BYTES, error=ModelError)


class _Gltf:
    """A glTF document and its buffers."""

    def __init__(self, data: bytes, path: Path) -> None:
        self._path, self._binary = path, b""
        if data.startswith(b"glTF"):
            data = self._unwrap(data)
        self._document: dict[str, Any] = parse_json(data, path, error=ModelError)
        self._buffers: dict[int, bytes] = {}
        self._pictures: dict[int, NDArray[np.uint8]] = {}
        self._values_left, self._bytes_left = _MOST_VALUES, _MOST_FETCHED

    def _unwrap(self, data: bytes) -> bytes:
        """Take a GLB apart: returns the document, and keeps the bytes behind it."""
        _, version, _ = _HEAD.unpack_from(data)
        if version != 2:
            self._refuse(f"glTF {version}; only glTF 2 is read")
        length, kind = _CHUNK.unpack_from(data, _HEAD.size)
        begin = _HEAD.size + _CHUNK.size
        if kind != b"JSON" or begin + length > len(data):
            self._refuse("broken: it does not begin with its document")
        if len(data) >= begin + length + _CHUNK.size:
            size, _ = _CHUNK.unpack_from(data, begin + length)
            start = begin + length + _CHUNK.size
            self._binary = data[start : start + size]
        return data[begin : begin + length]

    def _refuse(self, what: str) -> NoReturn:
        raise ModelError(self._path, what)

    def read(self, pieces: _Pieces) -> None:
        """Walk through the scene's nodes."""
        needed = [
            name
            for name in self._document.get("extensionsRequired", ())
            if not str(name).startswith(_EXTENSIONS)
        ]
        if needed:
            self._refuse(f"needs {str(needed[0])[:60]}, which is not read; export it without")
        scene = self._item("scenes", self._document.get("scene", 0))
        left = [(node, np.eye(4)) for node in scene["nodes"]]
        seen: set[int] = set()
        while left:
            number, frame = left.pop()
            if number in seen or len(seen) > _MOST_NODES:
                self._refuse(f"node {number!r} hangs in two places, or there are more than {_MOST_NODES:,}")
            seen.add(number)
            node = self._item("nodes", number)
            frame = frame @ _matrix(node)
            left += [(child, frame) for child in node.get("children", ())]
            if "mesh" in node:
                for primitive in self._item("meshes", node["mesh"])["primitives"]:
                    self._add(primitive, frame, pieces)

    def _item(self, kind: str, number: Any) -> dict[str, Any]:
        if not isinstance(number, int) or number < 0:
            self._refuse(f"broken: {kind} {number!r}")
        found: dict[str, Any] = self._document[kind][number]
        return found

    def _add(self, primitive: dict[str, Any], frame: Floats, pieces: _Pieces) -> None:
        if primitive.get("mode", 4) != 4:  # Points and lines have no surface.
            return
        attributes = primitive["attributes"]
        corners = self._values(attributes["POSITION"]) @ frame[:3, :3].T + frame[:3, 3]
        indices = (
            self._values(primitive["indices"])[:, 0].astype(np.int64)
            if "indices" in primitive
            else np.arange(len(corners))
        )
        faces = indices[: len(indices) // 3 * 3].reshape(-1, 3)
        if np.linalg.det(frame[:3, :3]) < 0.0:
            faces = faces[:, ::-1]
        material = self._item("materials", primitive["material"]) if "material" in primitive else {}
        look = material.get("pbrMetallicRoughness", {})
        colours = np.ones((len(faces), 3)) * np.asarray(look.get("baseColorFactor", [1.0] * 4)[:3], float)
        if "COLOR_0" in attributes:
            colours *= self._values(attributes["COLOR_0"])[faces, :3].mean(axis=1)
        if "baseColorTexture" in look:
            place = look["baseColorTexture"]
            spots = self._values(attributes[f"TEXCOORD_{place.get('texCoord', 0)}"])[faces].mean(axis=1)
            colours *= self._sample(place["index"], spots)
        clear = material.get("alphaMode") == "BLEND" and look.get("baseColorFactor", [1.0] * 4)[3] < 0.9
        name = str(material.get("name", "")) + (" glass" if clear else "")
        pieces.add(corners[faces], colours, name)
        if material.get("doubleSided"):
            pieces.add(corners[faces[:, ::-1]], colours, name)

    def _values(self, number: Any) -> Floats:
        """Read an accessor: (n, width)."""
        accessor = self._item("accessors", number)
        if "bufferView" not in accessor or "sparse" in accessor:
            self._refuse("has sparse values, which are not read; export it without")
        view = self._item("bufferViews", accessor["bufferView"])
        kind, width = np.dtype(_TYPES[accessor["componentType"]]), _WIDTHS[accessor["type"]]
        stride = int(view.get("byteStride", kind.itemsize * width))
        count, start = (
            int(accessor["count"]),
            int(view.get("byteOffset", 0)) + int(accessor.get("byteOffset", 0)),
        )
        data = self._buffer(view["buffer"])
        last = start + (count - 1) * stride + kind.itemsize * width
        self._values_left -= count * width
        if self._values_left < 0:
            self._refuse(f"holds more than {_MOST_VALUES:,} numbers; simplify the model")
        if min(count, start) < 0 or stride < kind.itemsize * width or last > len(data):
            self._refuse(f"broken: accessor {number} reaches beyond its buffer")
        shape, steps = (count, width), (stride, kind.itemsize)
        values = np.ndarray(shape, kind, data, start, steps).astype(np.float64)
        return values / np.iinfo(kind).max if accessor.get("normalized") and kind.kind in "iu" else values

    def _buffer(self, number: Any) -> bytes:
        buffer = self._item("buffers", number)
        if number not in self._buffers:
            self._buffers[number] = self._fetch(buffer["uri"]) if "uri" in buffer else self._binary
        return self._buffers[number]

    def _fetch(self, uri: str) -> bytes:
        if uri.startswith("data:"):
            data = base64.b64decode(uri.partition(",")[2], validate=True)
        else:
            data = _read_beside(self._path, unquote(uri))
        self._bytes_left -= len(data)
        if self._bytes_left < 0:
            self._refuse(f"refers to more than {_MOST_FETCHED} bytes; simplify the model")
        return data

    def _sample(self, number: Any, spots: Floats) -> Floats:
        """Take the linear colours of a texture at places, (n, 2)."""
        source = self._item("textures", number)["source"]
        if source not in self._pictures:
            if len(self._pictures) == _MOST_PICTURES:
                self._refuse(f"has more than {_MOST_PICTURES} textures; bake them into fewer")
            image = self._item("images", source)
            if "uri" in image:
                data = self._fetch(image["uri"])
            else:
                view = self._item("bufferViews", image["bufferView"])
                start = int(view.get("byteOffset", 0))
                data = self._buffer(view["buffer"])[start : start + int(view["byteLength"])]
            try:
                self._pictures[source] = _averaged(decode_photograph(data, self._path))
            except PhotographError as error:
                raise ModelError(self._path, f"has a picture that is not read: {error}") from error
        picture = self._pictures[source]
        height, width = picture.shape[:2]
        u, v = np.nan_to_num(spots % 1.0).T
        rows, columns = (v * height).astype(np.intp), (u * width).astype(np.intp)
        return to_linear(picture[np.minimum(rows, height - 1), np.minimum(columns, width - 1)])


def _averaged(picture: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """Shrink a picture, so that the colour taken at a place is that of its surroundings."""
    import cv2  # noqa: PLC0415 - OpenCV is large; few need it

    height, width = (min(side, _TEXTURE) for side in picture.shape[:2])
    return np.asarray(cv2.resize(picture, (width, height), interpolation=cv2.INTER_AREA), np.uint8)


def _matrix(node: dict[str, Any]) -> Floats:
    """Where a node lies in the one that it hangs in: (4, 4)."""
    if "matrix" in node:
        return np.array(node["matrix"], float).reshape(4, 4).T
    frame = np.eye(4)
    x, y, z, w = (float(value) for value in node.get("rotation", (0.0, 0.0, 0.0, 1.0)))
    size = math.sqrt(x * x + y * y + z * z + w * w)
    x, y, z, w = x / size, y / size, z / size, w / size
    frame[:3, :3] = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
        [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
        [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
    ]
    frame[:3, :3] *= np.array(node.get("scale", (1.0, 1.0, 1.0)), float)
    frame[:3, 3] = np.array(node.get("translation", (0.0, 0.0, 0.0)), float)
    return frame


def _read_obj(data: bytes, pieces: _Pieces) -> None:
    """Read an OBJ file: corners with or without colours, faces, and the colours of materials."""
    corners: list[list[float]] = []
    faces: dict[str, list[tuple[int, int, int]]] = {}
    colours: dict[str, Floats] = {}
    current, count, libraries = faces.setdefault("", []), 0, 0
    for words in _lines(data):
        if words[0] == "v" and len(corners) < _MOST_CORNERS:
            corners.append([float(word) for word in words[1:7]])
        elif words[0] == "f":
            polygon = [_number(word, len(corners)) for word in words[1:]]
            current += [(polygon[0], polygon[k], polygon[k + 1]) for k in range(1, len(polygon) - 1)]
            count += max(0, len(polygon) - 2)
            if count > MOST_TRIANGLES:
                raise ModelError(pieces.path, f"more than {MOST_TRIANGLES:,} triangles; simplify the model")
        elif words[0] == "usemtl":
            current = faces.setdefault(" ".join(words[1:]), [])
        elif words[0] == "mtllib" and libraries < _MOST_LIBRARIES:
            libraries += 1
            colours |= _read_mtl(_read_beside(pieces.path, " ".join(words[1:])))
    places = np.array([corner[:3] for corner in corners], float).reshape(-1, 3)
    painted = np.array([corner[3:6] if len(corner) == 6 else (1.0, 1.0, 1.0) for corner in corners], float)
    for name, found in faces.items():
        if found:
            numbers = np.array(found)
            own = colours.get(name, np.full(3, 0.6)) * painted[numbers].mean(axis=1)
            pieces.add(places[numbers], own, name)


def _lines(data: bytes) -> Iterator[list[str]]:
    """Give the words of each line that has any."""
    for line in BytesIO(data):
        if words := line.decode("utf-8", "replace").split():
            yield words


def _number(word: str, known: int) -> int:
    """Read which corner a face means: from 1, or from the last one backwards."""
    number = int(word.partition("/")[0])
    number = number - 1 if number > 0 else known + number
    if not 0 <= number < known:
        raise ValueError(f"a face has corner {word!r} of {known}")
    return number


def _read_mtl(data: bytes) -> dict[str, Floats]:
    """Read the diffuse colour of each material, which OBJ files have linear."""
    colours: dict[str, Floats] = {}
    name = ""
    for words in _lines(data):
        if words[:1] == ["newmtl"]:
            name = " ".join(words[1:])
        elif words[:1] == ["Kd"] and len(words) == 4:
            colours[name] = np.array([float(word) for word in words[1:]])
    return colours
