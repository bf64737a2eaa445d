"""Elements of an extract as plain records: nodes, ways and relations, as they stand in the file.

They are kept in id order, so that the same data gives the same records however it was packed. What they mean
is told elsewhere.
"""

import math
from collections.abc import Iterable
from dataclasses import dataclass, field
from pathlib import Path
from typing import TypeVar

from dojo_maps.errors import SourceError

ATTRIBUTION = "© OpenStreetMap contributors, ODbL 1.0, https://www.openstreetmap.org/copyright"
MAX_ELEMENTS = 5_000_000
"""Nodes, ways and relations together: a city of several million people."""
_MAX_REFERENCES = 40_000
"""Nodes of a way or members of a relation; OpenStreetMap itself allows 2,000 and 32,000."""
ELEMENTS = ("node", "way", "relation")
"""What there is."""

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


def link_to(kind: str, element: int) -> str:
    """Give the page of an element on openstreetmap.org.

    Args:
        kind: node, way or relation.
        element: its id.

    Returns:
        The address of the page.
    """
    return f"https://www.openstreetmap.org/{kind}/{element}"


class Elements:
    """Collects the elements of a file, within bounds."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self.nodes: dict[int, OsmNode] = {}
        self.ways: dict[int, OsmWay] = {}
        self.relations: dict[int, OsmRelation] = {}
        self._count = 0

    def add_node(self, node: int, lon: float, lat: float, tags: Tags) -> None:
        """Add a node; one of the same id before it is forgotten.

        Args:
            node: its id.
            lon: degrees east, WGS 84.
            lat: degrees north.
            tags: of the node; empty for none.

        Raises:
            SourceError: it lies nowhere on the earth, or there are too many elements.
        """
        if not (math.isfinite(lon) and math.isfinite(lat) and abs(lon) <= 180 and abs(lat) <= 90):
            raise SourceError(
                self.path,
                f"lies at lon {lon:g}, lat {lat:g}, which is not on the earth",
                element=f"node {node}",
            )
        self._count_one()
        self.nodes[node] = OsmNode(lon=lon, lat=lat, tags=tags)

    def add_way(self, way: int, nodes: Iterable[int], tags: Tags) -> None:
        """Add a way; one of the same id before it is forgotten.

        Args:
            way: its id.
            nodes: ids in the way's order; they need not be known.
            tags: of the way; empty for none.

        Raises:
            SourceError: it has too many nodes, or there are too many elements.
        """
        self._count_one()
        self.ways[way] = OsmWay(nodes=self._bounded(nodes, f"way {way}"), tags=tags)

    def add_relation(self, relation: int, members: Iterable[OsmMember], tags: Tags) -> None:
        """Add a relation; one of the same id before it is forgotten.

        Args:
            relation: its id.
            members: in the relation's order; they need not be known.
            tags: of the relation; empty for none.

        Raises:
            SourceError: it has too many members, or there are too many elements.
        """
        self._count_one()
        kept = self._bounded(members, f"relation {relation}")
        self.relations[relation] = OsmRelation(members=kept, tags=tags)

    def data(self) -> OsmData:
        """Give what was collected, in id order."""
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
