"""OpenStreetMap's PBF, through osmium."""

from collections.abc import Iterable
from pathlib import Path
from typing import Any

from dojo_maps.errors import SourceError, ToolMissingError
from dojo_maps.input_files import read_bytes
from dojo_maps.sources.osm.read.data import ELEMENTS, Elements, OsmMember


def read_pbf(path: Path, elements: Elements) -> None:
    """Read elements out of a PBF file; deleted ones are left out.

    Args:
        path: of the file.
        elements: what is read is added to them.

    Raises:
        SourceError: the file is missing, too large or broken, or `elements` refuses what it holds.
        ToolMissingError: the package osmium is not installed.
    """
    try:
        import osmium  # noqa: PLC0415 - needed for this format only
    except ImportError:
        raise ToolMissingError(f"{path}: reading PBF needs the package osmium: pip install osmium") from None
    data = read_bytes(path)
    try:
        things: Iterable[Any] = osmium.FileProcessor(osmium.io.FileBuffer(data, "pbf"))
        for thing in things:
            if thing.deleted:
                continue
            tags = {tag.k: tag.v for tag in thing.tags}
            if thing.is_node():
                elements.add_node(thing.id, thing.location.lon, thing.location.lat, tags)
            elif thing.is_way():
                elements.add_way(thing.id, (node.ref for node in thing.nodes), tags)
            elif thing.is_relation():
                members = (
                    OsmMember(kind=ELEMENTS["nwr".index(member.type)], ref=member.ref, role=member.role)
                    for member in thing.members
                )
                elements.add_relation(thing.id, members, tags)
    except (RuntimeError, ValueError, osmium.InvalidLocationError) as error:
        problem = f"broken or truncated PBF data ({' '.join(str(error).split())[:200]}); download it again"
        raise SourceError(path, problem) from error
