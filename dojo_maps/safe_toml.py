"""Read TOML that anyone may have written: bounded in size, and one kind of error."""

import tomllib
from pathlib import Path
from typing import Any

from dojo_maps.errors import SourceError
from dojo_maps.input_files import read_bytes


def read_toml(path: Path, *, most: int, error: type[SourceError] = SourceError) -> dict[str, Any]:
    """Read a file of TOML.

    Args:
        path: the file.
        most: bytes of the largest file read.
        error: raised for whatever is wrong with it.

    Returns:
        The table that the file is.

    Raises:
        SourceError: of the class `error`: missing, no regular file, too large or too deeply nested, not
            UTF-8, or not TOML.
    """
    data = read_bytes(path, most=most, error=error)
    try:
        return tomllib.loads(data.decode())
    except (ValueError, RecursionError) as problem:
        raise error(path, f"not readable as TOML ({problem}); it is damaged, or not TOML") from problem
