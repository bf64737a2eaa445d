"""Photographs out of files: JPEG and PNG, within bounds, as pictures of the environment are."""

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from dojo_env.camera import LARGEST_SIDE
from dojo_env.errors import PhotographError
from dojo_maps.input_files import read_bytes

Image = NDArray[np.uint8]

_MAX_BYTES = 1 << 28
_PNG, _JPEG = b"\x89PNG\r\n\x1a\n", b"\xff\xd8"
_NO_FRAME = (0xC4, 0xC8, 0xCC)
"""Markers of JPEG among those of frames that begin none."""


def read_photograph(path: Path) -> Image:
    """Read a photograph.

    Args:
        path: a JPEG or PNG file.

    Returns:
        (h, w, 3) uint8 RGB.

    Raises:
        PhotographError: the file is missing, none of both, broken, or has too many pixels.
    """
    return decode_photograph(read_bytes(path, most=_MAX_BYTES, error=PhotographError), path)


def decode_photograph(data: bytes, path: Path) -> Image:
    """Read a photograph out of bytes; `path` is named in errors.

    Args:
        data: of a JPEG or PNG file.
        path: of the file, for errors.

    Returns:
        (h, w, 3) uint8 RGB.

    Raises:
        PhotographError: as `read_photograph`.
    """
    import cv2  # noqa: PLC0415 - OpenCV is large; few need it

    size = _read_size(data)
    if size is None:
        raise PhotographError(path, "not a JPEG or PNG picture; convert it first")
    if max(size) > LARGEST_SIDE:
        raise PhotographError(path, f"{size[0]} x {size[1]} pixels; at most {LARGEST_SIDE} a side are read")
    picture = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_COLOR_RGB)
    if picture is None:
        raise PhotographError(path, "the picture is broken; copy it again")
    return np.asarray(picture, np.uint8)


def _read_size(data: bytes) -> tuple[int, int] | None:
    """Read width and height where a file says them, before anything is unpacked."""
    if data.startswith(_PNG):
        return int.from_bytes(data[16:20]), int.from_bytes(data[20:24])
    at = 2 if data.startswith(_JPEG) else len(data)
    while at + 9 <= len(data) and data[at] == 0xFF:
        marker = data[at + 1]
        if marker == 0xFF:
            at += 1
        elif 0xC0 <= marker <= 0xCF and marker not in _NO_FRAME:
            return int.from_bytes(data[at + 7 : at + 9]), int.from_bytes(data[at + 5 : at + 7])
        else:
            at += 2 + int.from_bytes(data[at + 2 : at + 4])
    return None
