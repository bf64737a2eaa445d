"""Where things are kept that can be made again: converted maps, compiled kernels."""

import contextlib
from collections.abc import Iterator
from pathlib import Path

import dojo_maps.cache
from dojo_env.errors import ConfigError
from dojo_maps.errors import UsageError


def cache_folder() -> Path:
    """Find and make the user's cache, which both packages share.

    Raises:
        ConfigError: the folder cannot be made.
    """
    with writing_cache():
        return dojo_maps.cache.cache_folder()


@contextlib.contextmanager
def writing_cache() -> Iterator[None]:
    """Write into the cache.

    Raises:
        ConfigError: it cannot be written.
    """
    try:
        with dojo_maps.cache.writing_cache():
            yield
    except UsageError as error:
        raise ConfigError(str(error)) from error
