"""Files that are there whole or not at all."""

import contextlib
import json
import os
import shutil
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any


@contextlib.contextmanager
def replaced(path: Path) -> Iterator[Path]:
    """Give a new file to write, and put it in the place of `path` only once it is whole.

    What a link names is replaced, not the link; a pipe or a device, as /dev/stdout, is written as it is.
    """
    if path.exists() and (path.parent == Path("/dev") or not path.is_file()):
        yield path
        return
    path = path.resolve()
    fresh = _beside(path.parent, f".{path.name}.")
    try:
        yield fresh
        fresh.replace(path)
    finally:
        fresh.unlink(missing_ok=True)


@contextlib.contextmanager
def work_folder(parent: Path | None = None, prefix: str = "dojo-") -> Iterator[Path]:
    """Make a folder to work in, and remove it with all that is in it.

    Args:
        parent: where it lies; None where temporary files lie.
        prefix: what its name begins with.
    """
    folder = _beside(Path(tempfile.gettempdir()) if parent is None else parent, prefix)
    try:
        try:
            folder.mkdir(mode=0o700)
            yield folder
        finally:
            shutil.rmtree(folder, ignore_errors=True)
    finally:
        # An interruption comes once: if it came in the removal above, this one is safe from it.
        shutil.rmtree(folder, ignore_errors=True)


def _beside(parent: Path, prefix: str) -> Path:
    """Choose a name that nobody can know of; so what has it is ours even before it is there."""
    return parent / f"{prefix}{os.urandom(6).hex()}"


def write_json(path: Path, value: Any) -> None:
    """Write a value as JSON that people can read, whole or not at all."""
    with replaced(path) as fresh:
        fresh.write_text(json.dumps(value, indent=1) + "\n", encoding="utf-8")
