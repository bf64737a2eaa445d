"""How kernels are compiled: one thread, no fast-math, and kept on disk by the sources they were made from.

numba looks only at a function's own file to tell whether what it kept is still right. Kernels call each
other across files, so what is kept lies in a folder named after all of them: another version, another folder.
"""

import hashlib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numba

from dojo_env.cache import cache_folder
from dojo_env.errors import ConfigError

_CONFIG: Any = numba.config


def _fingerprint() -> str:
    package = Path(__file__).parents[1]
    sources = (*(package / "rendering").glob("*.py"), *(package / "sensors").glob("*.py"))
    digest = hashlib.sha256(numba.__version__.encode())
    for path in sorted(sources):
        digest.update(path.read_bytes())
    return digest.hexdigest()[:16]


def _folder() -> str:
    try:
        return str(Path(_CONFIG.CACHE_DIR or cache_folder() / "kernels") / _fingerprint())
    except ConfigError:
        return ""  # No place to keep anything; numba tries beside the sources.


_FOLDER = _folder()


def kernel(function: Callable[..., Any]) -> Any:
    """Compile a function when it is first called, or load what an earlier process compiled."""
    return _compiled(function, inside=False)


def inner(function: Callable[..., Any]) -> Any:
    """Compile a kernel into each that calls it, and count no references in it; it cannot make arrays.

    Handing arrays over and counting who holds them costs more than a small triangle.
    """
    return _compiled(function, inside=True)


def _compiled(function: Callable[..., Any], *, inside: bool) -> Any:
    theirs, _CONFIG.CACHE_DIR = _CONFIG.CACHE_DIR, _FOLDER
    try:
        # Both always: a kernel that does not say takes its caller's.
        options: dict[str, Any] = {"forceinline": inside, "_nrt": not inside}
        options |= {"nogil": True, "error_model": "numpy"}
        try:
            return numba.njit(cache=True, **options)(function)
        except RuntimeError:  # There is no place to keep anything, not even beside the sources.
            return numba.njit(**options)(function)
    finally:
        _CONFIG.CACHE_DIR = theirs
