"""Read JSON that anyone may have written: bounded in size and depth, strict, and one kind of error."""

import json
import re
from collections import Counter
from itertools import chain
from pathlib import Path
from typing import Any

from dojo_maps.errors import SourceError
from dojo_maps.input_files import read_bytes

MAX_BYTES = 1 << 29
"""The largest file read: the description of a city."""
MAX_VALUES = 20_000_000
"""Numbers, texts, lists and objects of one file together; each takes some 100 bytes of memory."""
_DEEPEST = 32
_SURROGATE = re.compile(rb"\\u[dD][89a-fA-F]")


def read_json(path: Path, *, error: type[SourceError] = SourceError) -> Any:
    """Read a file of JSON.

    Args:
        path: the file.
        error: raised for whatever is wrong with it.

    Returns:
        The value.

    Raises:
        SourceError: of the class `error`: missing, no regular file, too large or too deeply nested, not
            UTF-8, not JSON as its standard has it (NaN, Infinity, a name twice in one object), or text that
            cannot be written again.
    """
    return parse_json(read_bytes(path, most=MAX_BYTES, error=error), path, error=error)


def parse_json(data: bytes, path: Path, *, error: type[SourceError] = SourceError) -> Any:
    """Read JSON out of bytes; `path` is named in errors.

    Args:
        data: the file's bytes.
        path: of the file.
        error: raised for whatever is wrong.

    Returns:
        The value.

    Raises:
        SourceError: as `read_json`.
    """
    if sum(map(data.count, (b",", b"[", b"{"))) > MAX_VALUES:
        raise error(path, f"holds more than {MAX_VALUES} values; refused as unsafe")
    try:
        value = json.loads(data.decode("utf-8-sig"), parse_constant=_refuse, object_pairs_hook=_unique)
        _check_depth(value)
        if _SURROGATE.search(data):
            json.dumps(value, ensure_ascii=False).encode()
    except (ValueError, RecursionError) as problem:
        raise error(path, f"not readable as JSON ({problem})") from problem
    return value


def _refuse(constant: str) -> None:
    raise ValueError(f"{constant} is no number")


def _unique(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    found = dict(pairs)
    if len(found) < len(pairs):
        ((twice, _),) = Counter(name for name, _ in pairs).most_common(1)
        raise ValueError(f"{twice[:80]!r} stands twice in one object")
    return found


def _check_depth(value: Any) -> None:
    level: list[Any] = [[value]]
    for _ in range(_DEEPEST):
        parts = (each.values() if isinstance(each, dict) else each for each in level)
        level = [part for part in chain.from_iterable(parts) if isinstance(part, dict | list)]
        if not level:
            return
    raise ValueError(f"nested more than {_DEEPEST} deep")
