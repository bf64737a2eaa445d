"""Where things are kept that can be made or fetched again: downloads, converted maps, compiled kernels."""

import contextlib
import os
import sys
from collections.abc import Iterator
from pathlib import Path

from dojo_maps.errors import UsageError, WriteError

_ADVICE = "name a folder for it in DOJO_CACHE"


def cache_folder() -> Path:
    """Find and make the user's cache: $DOJO_CACHE, or the platform's own place.

    Returns:
        The folder.

    Raises:
        UsageError: the folder cannot be made, or no home is known where it would lie.
    """
    try:
        named = os.environ.get("DOJO_CACHE")
        if named:
            folder = Path(named)
        elif sys.platform == "darwin":
            folder = Path.home() / "Library/Caches/traffic-dojo"
        else:
            folder = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "traffic-dojo"
        folder.mkdir(parents=True, exist_ok=True)
    except RuntimeError as error:
        raise UsageError(f"cache: this user has no home where it could lie; {_ADVICE}") from error
    except OSError as error:
        raise UsageError(f"cache {folder}: {error.strerror}; {_ADVICE}") from error
    return folder


@contextlib.contextmanager
def writing_cache() -> Iterator[None]:
    """Write into the cache.

    Raises:
        UsageError: it cannot be written.
    """
    try:
        yield
    except WriteError as error:
        raise UsageError(f"cache: {error}; {_ADVICE}") from error
    except OSError as error:
        raise UsageError(f"cache {cache_folder()}: {error.strerror or error}; {_ADVICE}") from error
