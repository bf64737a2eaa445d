"""Read a file of OpenStreetMap data, whatever its format and however it is packed."""

from pathlib import Path

from dojo_maps.errors import SourceError
from dojo_maps.input_files import read_bytes
from dojo_maps.sources.osm.read.data import Elements, OsmData
from dojo_maps.sources.osm.read.osm_pbf import read_pbf
from dojo_maps.sources.osm.read.osm_xml import read_xml
from dojo_maps.sources.osm.read.overpass_json import is_overpass_json, read_overpass_json

SUFFIXES = (
    ".osm", ".osm.xml", ".osm.gz", ".osm.bz2", ".osm.xz", ".zip", ".osm.json", ".osm.pbf", ".pbf",
)  # fmt: skip
"""Names of files that hold OpenStreetMap data."""


def is_osm(path: Path | str) -> bool:
    """Tell by a file's name whether it holds OpenStreetMap data; of other JSON, by how it begins.

    Args:
        path: of the file; only one whose name ends in .json, and not in .osm.json, is opened.

    Returns:
        Whether it does; False for JSON that cannot be read.
    """
    name = str(path).lower()
    return name.endswith(SUFFIXES) or (name.endswith(".json") and is_overpass_json(Path(path)))


def read_osm(path: Path | str) -> OsmData:
    """Read a file of OpenStreetMap data.

    Args:
        path: XML (.osm, .osm.xml), Overpass's JSON (.json), both as they are or packed by gzip, bzip2, xz or
            zip; or PBF (.osm.pbf).

    Returns:
        Its elements; deleted ones are left out, of several versions the last in the file is kept.

    Raises:
        SourceError: the file is missing, broken, unsafe, too large, or holds no nodes.
        ToolMissingError: a PBF file, and the package osmium is not installed.
    """
    path = Path(path)
    elements = Elements(path)
    if path.name.lower().endswith(".pbf"):
        read_pbf(path, elements)
    else:
        data = read_bytes(path)
        read = read_overpass_json if data.lstrip()[:1] == b"{" else read_xml
        read(data, path, elements)
    if not elements.nodes:
        raise SourceError(path, "holds no nodes; download the area again, with its nodes")
    return elements.data()
