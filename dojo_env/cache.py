"""Where things are kept that can be made again: converted maps, compiled kernels."""

from pathlib import Path

import dojo_maps.cache
from dojo_env.errors import ConfigError
from dojo_maps.errors import UsageError


def cache_folder() -> Path:
    """Find and make the user's cache, which both packages share.

    Raises:
        ConfigError: the folder cannot be made.
    """
    try:
        return dojo_maps.cache.cache_folder()
    except UsageError as error:
        raise ConfigError(str(error)) from error
