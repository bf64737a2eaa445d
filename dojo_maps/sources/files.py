"""Find an input and read its bytes, within bounds: paths, packaged scenarios and gzip."""

import bz2
import hashlib
import importlib.util
import zlib
from pathlib import Path

from dojo_maps.errors import SourceError, ToolMissingError

MAX_BYTES = 1 << 30
"""The largest network read, in bytes once unpacked: about twice the largest city in public use."""
MAX_EXPANSION = 200
"""How many times its own size a gzip file may unpack to; networks reach about 15."""

SCENARIO_NETWORKS = {
    "two-way": "nets/2way-single-intersection/single-intersection.net.xml",
    **{
        name: f"nets/RESCO/{name}/{name}.net.xml"
        for name in (
            "cologne1", "cologne3", "cologne8", "ingolstadt1", "ingolstadt7", "ingolstadt21",
            "grid4x4", "arterial4x4",
        )
    },
}  # fmt: skip
"""Networks by name, inside the installed `sumo_rl` package."""

_SUFFIXES = (
    *(".net.xml.gz", ".net.xml", ".osm.pbf", ".osm.xml", ".osm.gz", ".osm.bz2", ".osm", ".pbf"),
    *(".xml.gz", ".xml"),
)


def find_network(name: str) -> tuple[Path, str]:
    """Find a network by its path or by the name of a packaged scenario.

    Returns:
        The file's path and the map's name: the scenario's, or the file's without its suffixes.

    Raises:
        SourceError: there is no such file and no such scenario.
        ToolMissingError: the scenario's package is not installed.
    """
    path = Path(name)
    if path.exists():
        return path, map_name(path)
    if name not in SCENARIO_NETWORKS:
        known = ", ".join(SCENARIO_NETWORKS)
        raise SourceError(name, f"no such file; give a path, or a packaged scenario: {known}")
    # Importing sumo_rl itself fails where SUMO_HOME is not set.
    spec = importlib.util.find_spec("sumo_rl")
    if spec is None or not spec.submodule_search_locations:
        raise ToolMissingError(f"scenario {name} is part of the package sumo-rl: pip install sumo-rl")
    return Path(spec.submodule_search_locations[0]) / SCENARIO_NETWORKS[name], name


def map_name(path: Path) -> str:
    """Name a map after its file: `cologne.net.xml.gz` becomes `cologne`."""
    for suffix in _SUFFIXES:
        if path.name.endswith(suffix) and path.name != suffix:
            return path.name.removesuffix(suffix)
    return path.stem


def read_bytes(path: Path) -> bytes:
    """Read a file whole, unpacked if it is gzip or bzip2.

    Raises:
        SourceError: the file is missing, not a regular file, empty, too large, or broken as gzip or bzip2.
    """
    try:
        if not path.is_file():
            raise SourceError(path, "not a file" if path.exists() else "no such file")
        if path.stat().st_size > MAX_BYTES:
            raise SourceError(path, f"{path.stat().st_size} bytes; at most {MAX_BYTES} are read")
        data = path.read_bytes()
    except OSError as error:
        raise SourceError(path, f"cannot be read: {error.strerror}") from error
    if data.startswith(b"\x1f\x8b"):
        data = _unpack(path, data)
    elif path.name.endswith(".gz"):
        raise SourceError(path, "not a gzip file, though its name says so; rename or repack it")
    elif data.startswith(b"BZh"):
        data = _unpack_bzip2(path, data)
    if not data.strip():
        raise SourceError(path, "the file is empty")
    return data


def sha256_of(path: Path) -> str:
    """Hash a file as it lies on disk."""
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def _unpack_bzip2(path: Path, packed: bytes) -> bytes:
    limit = _limit(packed)
    data = bytearray()
    try:
        while packed:
            stream = bz2.BZ2Decompressor()
            data += stream.decompress(packed, limit + 1 - len(data))
            if len(data) > limit:
                raise SourceError(path, f"unpacks to more than {limit} bytes; refused as unsafe")
            if not stream.eof:
                raise SourceError(path, "the bzip2 data ends early; copy or download the file again")
            packed = stream.unused_data
    except OSError as error:
        raise SourceError(path, f"broken bzip2 data ({error}); copy or download the file again") from error
    return bytes(data)


def _limit(packed: bytes) -> int:
    return min(MAX_BYTES, max(MAX_EXPANSION * len(packed), 1 << 20))


def _unpack(path: Path, packed: bytes) -> bytes:
    limit = _limit(packed)
    data = bytearray()
    try:
        while packed:
            member = zlib.decompressobj(wbits=31)
            data += member.decompress(packed, limit + 1 - len(data))
            if len(data) > limit:
                raise SourceError(path, f"unpacks to more than {limit} bytes; refused as unsafe")
            if not member.eof:
                raise SourceError(path, "the gzip data ends early; copy or download the file again")
            packed = member.unused_data.lstrip(b"\0")
    except zlib.error as error:
        raise SourceError(path, f"broken gzip data ({error}); copy or download the file again") from error
    return bytes(data)
