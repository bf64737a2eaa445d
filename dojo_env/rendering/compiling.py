"""How kernels are compiled: one thread, no fast-math, and kept on disk by the sources they were made from.

numba looks only at a function's own file to tell whether what it kept is still right. Kernels call each
other across files, so what is kept lies in a folder named after all of them: another version, another folder.
Arrays that follow from these sources alone, and take long to make, are kept beside the kernels.
"""

import hashlib
import importlib.util
from collections.abc import Callable, Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any, TypeVar

import numba
import numba.np.linalg
import numpy as np
from numpy.typing import NDArray

from dojo_env.cache import cache_folder
from dojo_env.errors import ConfigError
from dojo_maps.errors import SourceError, UsageError, WriteError
from dojo_maps.input_files import check_file
from dojo_maps.whole_file import added_files

Arrays = TypeVar("Arrays", bound=tuple[Any, ...])

_CONFIG: Any = numba.config
_MOST_BYTES = 1 << 28


def _load_arrays() -> None:
    """Load what numba knows of arrays without SciPy, of which no kernel needs anything.

    numba imports its linear algebra, 15 MB and a sixth of a second, only to see whether it is there. What a
    user compiles still imports it when it is needed.
    """
    imports = numba.np.linalg.ensure_blas

    def is_there() -> None:
        if importlib.util.find_spec("scipy") is None:
            raise ImportError("no SciPy")

    numba.np.linalg.ensure_blas = is_there
    try:
        importlib.import_module("numba.np.arraymath")
    finally:
        numba.np.linalg.ensure_blas = imports


_load_arrays()


def _fingerprint() -> str:
    package = Path(__file__).parents[1]
    rooms = (package / "rendering", package / "sensors")
    sources = (package / "snapshot.py", *(path for room in rooms for path in room.glob("*.py")))
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


def kept_arrays(
    name: str, kind: Callable[..., Arrays], kinds: Mapping[str, str], make: Callable[[], Arrays]
) -> Arrays:
    """Load what an earlier process made and kept, or make and keep it.

    Args:
        name: of the folder that keeps it.
        kind: of named tuple that holds the arrays.
        kinds: numpy's type of each of its fields, in order.
        make: gives the tuple; it follows from the sources alone.

    Returns:
        The tuple; its arrays may be mapped from files, which writing to them does not change.
    """
    folder = Path(_FOLDER) / name
    if _FOLDER:
        # What somebody has damaged is made anew.
        with suppress(SourceError):
            return kind(**{field: _mapped(folder / f"{field}.npy", kinds[field]) for field in kinds})
    made = make()
    if _FOLDER:
        with suppress(WriteError, UsageError), added_files(folder) as fresh:
            for field, array in zip(kinds, made, strict=True):
                np.save(fresh / f"{field}.npy", np.ascontiguousarray(array))
    return made


def _mapped(path: Path, kind: str) -> NDArray[Any]:
    """Map a kept array into memory, copied where it is written: processes share what they only read."""
    check_file(path, most=_MOST_BYTES)
    try:
        array = np.load(path, mmap_mode="c", allow_pickle=False)
    except (ValueError, OSError) as error:
        raise SourceError(path, f"cannot be read as an array ({error})") from error
    if array.dtype != np.dtype(kind):
        raise SourceError(path, f"is of kind {array.dtype.str}, expected {kind}")
    return array.view(np.ndarray)


def kernel(function: Callable[..., Any]) -> Any:
    """Compile a function when it is first called, or load what an earlier process compiled.

    Args:
        function: of numbers, arrays and named tuples of these; in what else it uses, numba must know its way.

    Returns:
        The compiled function, called as the plain one is; it lets other threads run meanwhile.
    """
    return _compiled(function, inside=False)


def inner(function: Callable[..., Any]) -> Any:
    """Compile a kernel into each that calls it, and count no references in it; it cannot make arrays.

    Handing arrays over and counting who holds them costs more than a small triangle.

    Args:
        function: see `kernel`; it writes what it finds into arrays that it is given.

    Returns:
        The compiled function, for kernels to call.
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
