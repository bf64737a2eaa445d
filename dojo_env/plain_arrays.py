"""Read a numpy archive (.npz) of plain numbers and texts that anyone may have made: no objects, no surprises.

Source: numpy.lib.format, version 1.0; APPNOTE 6.3.10 of the ZIP format, section 4.3.
"""

import io
import math
import re
import struct
import zipfile
import zlib
from collections.abc import Mapping
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dojo_maps.errors import SourceError
from dojo_maps.input_files import opened

TEXT = "<U"
"""The kind of arrays of texts, whatever their length."""
_MAGIC = b"\x93NUMPY\x01\x00"
_HEADER = re.compile(
    rb"\{'descr': '([<|]\w{2,9})', 'fortran_order': False, 'shape': \(([\d, ]{0,60})\), \} *\n"
)
_END, _ZIP64 = b"PK\x05\x06", b"PK\x06\x07"
_LARGEST_DIRECTORY = 1 << 16
"""Bytes that name what an archive holds; a few dozen arrays need some thousand."""


def read_arrays(
    path: Path,
    kinds: Mapping[str, str],
    *,
    optional: Mapping[str, str] = MappingProxyType({}),
    most: int,
    error: type[SourceError],
    what: str = "arrays",
) -> dict[str, NDArray[Any]]:
    """Read the arrays of an archive.

    Args:
        path: the file.
        kinds: numpy's type of every array that it must hold, by name: `<f8`, `|u1`, `TEXT`...
        optional: the same of those that it may hold.
        most: bytes of all arrays together.
        error: raised for whatever is wrong.
        what: the file should be, for errors.

    Returns:
        The arrays, by name.

    Raises:
        SourceError: of the class `error`: missing, damaged, too large, other arrays, or of other kinds.
    """
    with opened(path, most=most, error=error) as file:
        try:
            return _read(file, kinds, optional, most)
        except (ValueError, EOFError, zipfile.BadZipFile, NotImplementedError, RuntimeError, struct.error,
                zlib.error) as problem:  # fmt: skip
            raise error(path, f"cannot be read as {what} ({problem})") from problem


def _read(
    file: io.BufferedReader, kinds: Mapping[str, str], optional: Mapping[str, str], most: int
) -> dict[str, NDArray[Any]]:
    _check_directory(file)
    with zipfile.ZipFile(file) as archive:
        entries = {entry.filename: entry for entry in archive.infolist()}
        kinds = {**kinds, **{name: kind for name, kind in optional.items() if f"{name}.npy" in entries}}
        if set(entries) != {f"{name}.npy" for name in kinds}:
            raise ValueError("it holds other arrays")
        if sum(entry.file_size for entry in entries.values()) > most:
            raise ValueError(f"it unpacks to more than {most} bytes; refused as unsafe")
        if {entry.compress_type for entry in entries.values()} - {zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED}:
            raise ValueError("it is packed as numpy packs nothing")
        return {name: _read_array(archive, entries[f"{name}.npy"], kind) for name, kind in kinds.items()}


def _check_directory(file: io.BufferedReader) -> None:
    """See that an archive ends as numpy's do, before all that it says it holds is listed."""
    end = file.seek(0, io.SEEK_END)
    file.seek(max(0, end - 42))
    last = file.read(42)[-42:]
    if last[-22:-18] != _END or last[:4] == _ZIP64:
        raise ValueError("it is no whole archive")
    if struct.unpack("<I", last[-10:-6])[0] > _LARGEST_DIRECTORY:
        raise ValueError("it holds other arrays")


def _read_array(archive: zipfile.ZipFile, entry: zipfile.ZipInfo, kind: str) -> NDArray[Any]:
    """Read plain numbers or texts, as many bytes as the archive says there are."""
    name = entry.filename
    with archive.open(entry) as member:
        if member.read(len(_MAGIC)) != _MAGIC:
            raise ValueError(f"{name} is no array")
        (length,) = struct.unpack("<H", member.read(2))
        header = _HEADER.fullmatch(member.read(length))
        if not header:
            raise ValueError(f"{name} is no plain array")
        found = header[1].decode()
        if found != kind and not (kind == TEXT and re.fullmatch(r"<U\d+", found)):
            raise ValueError(f"{name} is of kind {found}, expected {kind}")
        dtype = np.dtype(found)
        shape = tuple(int(part) for part in header[2].decode().replace(" ", "").split(",") if part)
        wanted = math.prod(shape) * dtype.itemsize
        if entry.file_size != len(_MAGIC) + 2 + length + wanted:
            raise ValueError(f"{name} is not as long as it says")
        data = member.read()
    if len(data) != wanted:
        raise ValueError(f"{name} ends early")
    array = np.frombuffer(data, dtype=dtype).reshape(shape)
    if kind == TEXT and data:
        _check_texts(array, name)
    return array


def _check_texts(array: NDArray[Any], name: str) -> None:
    """Refuse what is no Unicode, and characters that no id has: controls, and zeros before the end."""
    codes = array.reshape(-1).view(np.uint32).reshape(-1, array.dtype.itemsize // 4)
    ended = np.maximum.accumulate(codes == 0, axis=1)
    wrong = (codes > 0x10FFFF) | ((codes >= 0xD800) & (codes < 0xE000)) | ((codes < 0x20) != ended)
    if wrong.any():
        raise ValueError(f"{name} holds what is no text")
