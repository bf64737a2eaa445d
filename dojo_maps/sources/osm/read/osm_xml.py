"""OpenStreetMap's XML, as editors, Overpass and planet extracts write it."""

from collections.abc import Callable
from pathlib import Path

from dojo_maps.errors import SourceError
from dojo_maps.safe_xml import Attributes, parse_xml
from dojo_maps.sources.osm.read.data import ELEMENTS, Elements, OsmMember, Tags


def read_xml(data: bytes, path: Path, elements: Elements) -> None:
    """Read elements out of XML; deleted ones are left out.

    Args:
        data: the file's bytes, unpacked.
        path: named in errors.
        elements: what is read is added to them.

    Raises:
        SourceError: it is broken, cut off, unsafe, or no OpenStreetMap data, or `elements` refuses what it
            holds.
    """
    events = _Events(elements)
    parse_xml(data, path, root="osm", kind="OSM file", start=events.start, end=events.end)


class _Events:
    """Turns XML events into elements."""

    def __init__(self, elements: Elements) -> None:
        self._elements = elements
        self._attributes: Attributes = {}
        self._tags: Tags = {}
        self._nodes: list[int] = []
        self._members: list[OsmMember] = []
        self._add: dict[str, Callable[[int], None]] = {
            "node": self._add_node,
            "way": lambda way: elements.add_way(way, self._nodes, self._tags),
            "relation": lambda relation: elements.add_relation(relation, self._members, self._tags),
        }

    def start(self, name: str, attributes: Attributes) -> None:
        if name in self._add:
            self._attributes, self._tags, self._nodes, self._members = attributes, {}, [], []
        elif name == "tag":
            self._tags[attributes.get("k", "")] = attributes.get("v", "")
        elif name == "nd":
            self._add_reference(attributes)
        elif name == "member":
            self._add_member(attributes)
        elif name == "remark":
            raise SourceError(
                self._elements.path,
                "the server stopped before the end of this answer; download the area again",
            )

    def end(self, name: str) -> None:
        if name not in self._add:
            return
        gone = self._attributes.get("action") == "delete" or self._attributes.get("visible") == "false"
        if not gone:
            self._add[name](self._integer(self._attributes, "id"))

    def _add_reference(self, attributes: Attributes) -> None:
        """Note a node of a way; after Overpass's `out geom` it says where it lies."""
        node = self._integer(attributes, "ref")
        self._nodes.append(node)
        if "lon" in attributes and node not in self._elements.nodes:
            lon, lat = (self._degrees(node, attributes, key) for key in ("lon", "lat"))
            self._elements.add_node(node, lon, lat, {})

    def _add_node(self, node: int) -> None:
        lon, lat = (self._degrees(node, self._attributes, key) for key in ("lon", "lat"))
        self._elements.add_node(node, lon, lat, self._tags)

    def _add_member(self, attributes: Attributes) -> None:
        kind = attributes.get("type", "")
        if kind not in ELEMENTS:
            relation = f"relation {self._attributes.get('id', '?')[:40]}"
            raise SourceError(
                self._elements.path, f"a member of type {kind[:40]!r}, expected {ELEMENTS}", element=relation
            )
        ref = self._integer(attributes, "ref")
        self._members.append(OsmMember(kind=kind, ref=ref, role=attributes.get("role", "")))

    def _degrees(self, node: int, attributes: Attributes, key: str) -> float:
        text = attributes.get(key, "")
        try:
            return float(text)
        except ValueError:
            problem = f"{key}={text[:40]!r}, expected degrees"
            raise SourceError(self._elements.path, problem, element=f"node {node}") from None

    def _integer(self, attributes: Attributes, key: str) -> int:
        text = attributes.get(key, "")
        try:
            value = int(text) if len(text) <= 20 else 0
        except ValueError:
            value = 0
        if not 0 < abs(value) < 1 << 63:
            raise SourceError(self._elements.path, f"{key}={text[:40]!r}, expected an id")
        return value
