"""What a page is given: one JSON value and the arrays that it speaks of, packed into letters.

Nothing of a map reaches the page's markup or script as itself, so nothing of it can be taken for either.
"""

import base64
import json
import struct
import zlib
from typing import Any

import numpy as np
from numpy.typing import NDArray

_TYPES = {"int8", "uint8", "int16", "uint16", "int32", "uint32", "float32"}
_ALIGNED = 4


class Container:
    """Collects arrays; what it gives for each stands for it in the JSON value."""

    def __init__(self) -> None:
        """Begin with none."""
        self._data = bytearray()

    def add(self, values: NDArray[Any]) -> list[Any]:
        """Add an array of any shape; returns its type, its first byte and its number of values."""
        kind = values.dtype.name
        if kind not in _TYPES:
            raise TypeError(f"an array of {kind}, expected one of {sorted(_TYPES)}")
        start = len(self._data)
        self._data += np.ascontiguousarray(values).astype(values.dtype.newbyteorder("<")).tobytes()
        self._data += bytes(-len(self._data) % _ALIGNED)
        return [kind, start, values.size]

    def packed(self, value: Any) -> str:
        """Pack a JSON value and all arrays: zlib's format in base64."""
        text = json.dumps(value, ensure_ascii=False, separators=(",", ":"), allow_nan=False).encode()
        text += b" " * (-len(text) % _ALIGNED)
        whole = struct.pack("<I", len(text)) + text + bytes(self._data)
        return base64.b64encode(zlib.compress(whole, 6)).decode("ascii")
