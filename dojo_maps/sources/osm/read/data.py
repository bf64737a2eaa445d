"""Read OpenStreetMap data, as XML (plain, gzip or bzip2) or PBF, into plain records.

Everything is kept as it stands in the file, in id order, so that the same data gives the same records
however it was packed. What the records mean is told elsewhere.
"""

import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, TypeVar

from dojo_maps.errors import SourceError, ToolMissingError
from dojo_maps.input_files import read_bytes
from dojo_maps.safe_xml import Attributes, parse_xml

ATTRIBUTION = "© OpenStreetMap contributors, ODbL 1.0, https://www.openstreetmap.org/copyright"
SUFFIXES = (".osm.pbf", ".pbf", ".osm.xml", ".osm.gz", ".osm.bz2", ".osm")
MAX_ELEMENTS = 5_000_000
"""Nodes, ways and relations together: a city of several million people."""
_MAX_REFERENCES = 40_000
"""Nodes of a way or members of a relation; OpenStreetMap itself allows 2,000 and 32,000."""
_KINDS = ("node", "way", "relation")

Tags = dict[str, str]
T = TypeVar("T")


@dataclass(frozen=True, slots=True, kw_only=True)
class OsmNode:
    """A position in degrees, WGS 84, with its tags."""

    lon: float
    lat: float
    tags: Tags = field(default_factory=dict)


@dataclass(frozen=True, slots=True, kw_only=True)
class OsmWay:
    """A line or ring through nodes; an extract may lack some of them."""

    nodes: tuple[int, ...]
    tags: Tags = field(default_factory=dict)


@dataclass(frozen=True, slots=True, kw_only=True)
class OsmMember:
    """A relation's member: `kind` is node, way or relation."""

    kind: str
    ref: int
    role: str


@dataclass(frozen=True, slots=True, kw_only=True)
class OsmRelation:
    """A group of elements; an extract may lack some of them, and relations may contain each other."""

    members: tuple[OsmMember, ...]
    tags: Tags = field(default_factory=dict)


@dataclass(frozen=True, slots=True, kw_only=True)
class OsmData:
    """The elements of an extract by id, in id order."""

    nodes: dict[int, OsmNode]
    ways: dict[int, OsmWay]
    relations: dict[int, OsmRelation]
    attribution: str = ATTRIBUTION


def is_osm(path: Path | str) -> bool:
    """Tell by a file's name whether it holds OpenStreetMap data."""
    return str(path).lower().endswith(SUFFIXES)


def link_to(kind: str, element: int) -> str:
    """Give the page of an element on openstreetmap.org."""
    return f"https://www.openstreetmap.org/{kind}/{element}"


def read_osm(path: Path | str) -> OsmData:
    """Read a file of OpenStreetMap data.

    Args:
        path: .osm, .osm.xml, .osm.gz, .osm.bz2 or .osm.pbf.

    Returns:
        Its elements; deleted ones are left out, of several versions the last in the file is kept.

    Raises:
        SourceError: the file is missing, broken, unsafe, too large, or holds no nodes.
        ToolMissingError: a PBF file, and the package osmium is not installed.
    """
    path = Path(path)
    records = _Records(path)
    if path.name.lower().endswith(".pbf"):
        _read_pbf(path, records)
    else:
        reader = _XmlReader(records)
        parse_xml(read_bytes(path), path, root="osm", kind="OSM file", start=reader.start, end=reader.end)
    if not records.nodes:
        raise SourceError(path, "holds no nodes; download the area again, with its nodes")
    return records.data()


class _Records:
    """Collects elements within bounds."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self.nodes: dict[int, OsmNode] = {}
        self.ways: dict[int, OsmWay] = {}
        self.relations: dict[int, OsmRelation] = {}
        self._count = 0

    def add_node(self, node: int, lon: float, lat: float, tags: Tags) -> None:
        if not (math.isfinite(lon) and math.isfinite(lat) and abs(lon) <= 180 and abs(lat) <= 90):
            raise SourceError(
                self.path,
                f"lies at lon {lon:g}, lat {lat:g}, which is not on the earth",
                element=f"node {node}",
            )
        self._count_one()
        self.nodes[node] = OsmNode(lon=lon, lat=lat, tags=tags)

    def add_way(self, way: int, nodes: Iterable[int], tags: Tags) -> None:
        self._count_one()
        self.ways[way] = OsmWay(nodes=self._bounded(nodes, f"way {way}"), tags=tags)

    def add_relation(self, relation: int, members: Iterable[OsmMember], tags: Tags) -> None:
        self._count_one()
        kept = self._bounded(members, f"relation {relation}")
        self.relations[relation] = OsmRelation(members=kept, tags=tags)

    def data(self) -> OsmData:
        return OsmData(
            nodes=dict(sorted(self.nodes.items())),
            ways=dict(sorted(self.ways.items())),
            relations=dict(sorted(self.relations.items())),
        )

    def _bounded(self, references: Iterable[T], element: str) -> tuple[T, ...]:
        kept = tuple(references)
        if len(kept) > _MAX_REFERENCES:
            raise SourceError(
                self.path,
                f"refers to {len(kept)} elements, at most {_MAX_REFERENCES} are read",
                element=element,
            )
        return kept

    def _count_one(self) -> None:
        self._count += 1
        if self._count > MAX_ELEMENTS:
            raise SourceError(
                self.path, f"holds more than {MAX_ELEMENTS} elements; cut a smaller part with osmium extract"
            )


class _XmlReader:
    """Turns XML events into records."""

    def __init__(self, records: _Records) -> None:
        self._records = records
        self._attributes: Attributes = {}
        self._tags: Tags = {}
        self._nodes: list[int] = []
        self._members: list[OsmMember] = []
        self._add: dict[str, Callable[[int], None]] = {
            "node": self._add_node,
            "way": lambda way: records.add_way(way, self._nodes, self._tags),
            "relation": lambda relation: records.add_relation(relation, self._members, self._tags),
        }

    def start(self, name: str, attributes: Attributes) -> None:
        if name in self._add:
            self._attributes, self._tags, self._nodes, self._members = attributes, {}, [], []
        elif name == "tag":
            self._tags[attributes.get("k", "")] = attributes.get("v", "")
        elif name == "nd":
            self._nodes.append(self._integer(attributes, "ref"))
        elif name == "member":
            self._add_member(attributes)
        elif name == "remark":
            raise SourceError(
                self._records.path,
                "the server stopped before the end of this answer; download the area again",
            )

    def end(self, name: str) -> None:
        if name not in self._add:
            return
        gone = self._attributes.get("action") == "delete" or self._attributes.get("visible") == "false"
        if not gone:
            self._add[name](self._integer(self._attributes, "id"))

    def _add_node(self, node: int) -> None:
        lon, lat = (self._degrees(node, key) for key in ("lon", "lat"))
        self._records.add_node(node, lon, lat, self._tags)

    def _add_member(self, attributes: Attributes) -> None:
        kind = attributes.get("type", "")
        if kind not in _KINDS:
            relation = f"relation {self._attributes.get('id', '?')[:40]}"
            raise SourceError(
                self._records.path, f"a member of type {kind[:40]!r}, expected {_KINDS}", element=relation
            )
        ref = self._integer(attributes, "ref")
        self._members.append(OsmMember(kind=kind, ref=ref, role=attributes.get("role", "")))

    def _degrees(self, node: int, key: str) -> float:
        text = self._attributes.get(key, "")
        try:
            return float(text)
        except ValueError:
            problem = f"{key}={text[:40]!r}, expected degrees"
            raise SourceError(self._records.path, problem, element=f"node {node}") from None

    def _integer(self, attributes: Attributes, key: str) -> int:
        text = attributes.get(key, "")
        try:
            value = int(text) if len(text) <= 20 else 0
        except ValueError:
            value = 0
        if not 0 < abs(value) < 1 << 63:
            raise SourceError(self._records.path, f"{key}={text[:40]!r}, expected an id")
        return value


def _read_pbf(path: Path, records: _Records) -> None:
    try:
        import osmium  # noqa: PLC0415 - needed for this format only
    except ImportError:
        raise ToolMissingError(f"{path}: reading PBF needs the package osmium: pip install osmium") from None
    data = read_bytes(path)
    try:
        elements: Iterable[Any] = osmium.FileProcessor(osmium.io.FileBuffer(data, "pbf"))
        for thing in elements:
            if thing.deleted:
                continue
            tags = {tag.k: tag.v for tag in thing.tags}
            if thing.is_node():
                records.add_node(thing.id, thing.location.lon, thing.location.lat, tags)
            elif thing.is_way():
                records.add_way(thing.id, (node.ref for node in thing.nodes), tags)
            elif thing.is_relation():
                members = (
                    OsmMember(kind=_KINDS["nwr".index(member.type)], ref=member.ref, role=member.role)
                    for member in thing.members
                )
                records.add_relation(thing.id, members, tags)
    except (RuntimeError, ValueError, osmium.InvalidLocationError) as error:
        problem = f"broken or truncated PBF data ({' '.join(str(error).split())[:200]}); download it again"
        raise SourceError(path, problem) from error
