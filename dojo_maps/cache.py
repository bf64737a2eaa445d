"""Where things are kept that can be made or fetched again: downloads, converted maps, compiled kernels."""

import os
import sys
from pathlib import Path

from dojo_maps.errors import UsageError


def cache_folder() -> Path:
    """Find and make the user's cache: $DOJO_CACHE, or the platform's own place.

    Raises:
        UsageError: the folder cannot be made.
    """
    named = os.environ.get("DOJO_CACHE")
    if named:
        folder = Path(named)
    elif sys.platform == "darwin":
        folder = Path.home() / "Library/Caches/traffic-dojo"
    else:
        folder = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "traffic-dojo"
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise UsageError(f"cache {folder}: {error.strerror}; name another folder in DOJO_CACHE") from error
    return folder
