"""Where things are kept that can be made again: converted maps, compiled kernels."""

import contextlib
import hashlib
from collections.abc import Callable, Iterator
from functools import cache
from pathlib import Path

import dojo_maps
import dojo_maps.cache
from dojo_env.errors import ConfigError, ScenarioError
from dojo_maps.errors import UsageError
from dojo_maps.file_locks import lock
from dojo_maps.input_files import sha256_of


def cache_folder() -> Path:
    """Find and make the user's cache, which both packages share.

    Returns:
        The folder.

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


def convert_once(source: Path, *, on_stage: Callable[[str], None] = lambda _stage: None) -> Path:
    """Convert a map into the cache, where the same one is not there yet.

    Args:
        source: what is converted.
        on_stage: told what begins.

    Returns:
        The bundle's folder.

    Raises:
        SourceError: a file cannot be read, or is no map.
        ConfigError: the cache cannot be written.
    """
    files = dojo_maps.list_files(source)
    digests = "".join(sha256_of(file, error=ScenarioError) for file in files)
    digest = hashlib.sha256(digests.encode() + _converter_fingerprint()).hexdigest()[:16]
    folder = cache_folder() / f"{files[0].name.split('.')[0][:80]}-{digest}.dojo"
    if not folder.is_dir():
        with writing_cache(), _locked(folder.with_suffix(".lock")):
            if not folder.is_dir():
                dojo_maps.convert(str(source), folder, on_stage=on_stage)
    return folder


@contextlib.contextmanager
def _locked(path: Path) -> Iterator[None]:
    with path.open("w") as handle:
        lock(handle.fileno())
        yield


@cache
def _converter_fingerprint() -> bytes:
    """Hash the converter's own code: a bundle made by another one is made again."""
    code = hashlib.sha256()
    for path in sorted(Path(dojo_maps.__file__).parent.rglob("*.py")):
        code.update(path.read_bytes())
    return code.digest()
