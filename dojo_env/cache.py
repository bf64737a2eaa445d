"""Where things are kept that can be made again: converted maps, compiled kernels."""

import os
import sys
from pathlib import Path

from dojo_env.errors import ConfigError


def cache_folder() -> Path:
    """Find and make the user's cache: $DOJO_CACHE, or the platform's own place."""
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
        raise ConfigError(f"cache {folder}: {error.strerror}; name another folder in DOJO_CACHE") from error
    return folder
