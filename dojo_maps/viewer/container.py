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
        """Add an array.

        Args:
            values: of any shape, of 8, 16 or 32 bit integers or 32 bit floats.

        Returns:
            What stands for it in the JSON value: its type, its first byte among all arrays, and its number of
            values.

        Raises:
            TypeError: its values are of another type.
        """
        kind = values.dtype.name
        if kind not in _TYPES:
            raise TypeError(f"an array of {kind}, expected one of {sorted(_TYPES)}")
        start = len(self._data)
        self._data += np.ascontiguousarray(values).astype(values.dtype.newbyteorder("<")).tobytes()
        self._data += bytes(-len(self._data) % _ALIGNED)
        return [kind, start, values.size]

    def packed(self, value: Any) -> str:
        """Pack a JSON value and all arrays.

        Args:
            value: with what `add` gave in the places of the arrays.

        Returns:
            zlib's format in base64: the length of the JSON text in four bytes, the text, the arrays;
            little-endian.

        Raises:
            ValueError: the value holds a number that is not finite.
        """
        text = json.dumps(value, ensure_ascii=False, separators=(",", ":"), allow_nan=False).encode()
        text += b" " * (-len(text) % _ALIGNED)
        whole = struct.pack("<I", len(text)) + text + bytes(self._data)
        return base64.b64encode(zlib.compress(whole, 6)).decode("ascii")
