"""The roads of an extract as a graph: sections of way between vertices, in metres.

A section runs from vertex to vertex with the same lanes all along; a vertex is a node where ways meet,
end, or change. Sections that only a split of the way or an unseen change of tags divides are one.
"""

import itertools
from collections import defaultdict
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
import shapely

from dojo_maps.description import Projection
from dojo_maps.geometry.polylines import Floats, along
from dojo_maps.sources.osm.read.country import Country
from dojo_maps.sources.osm.read.data import OsmWay, Tags
from dojo_maps.sources.osm.read.lane_tags import LaneTags
from dojo_maps.sources.osm.read.way_tags import RoadTags
from dojo_maps.sources.osm.rules import ImportRules

Places = Mapping[int, tuple[float, float]]
"""Where nodes lie, metres."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Section:
    """A piece of road between two vertices.

    Attributes:
        nodes: OSM nodes, or negative numbers where a section was cut between two.
        ways: the way of each straight piece; one less than nodes.
        road: in the direction of the nodes; `forward` is never empty.
    """

    id: str
    nodes: tuple[int, ...]
    ways: tuple[int, ...]
    road: RoadTags

    @property
    def start(self) -> int:
        """The vertex that it starts from."""
        return self.nodes[0]

    @property
    def end(self) -> int:
        """The vertex that it leads to."""
        return self.nodes[-1]

    def lanes_towards(self, *, end: bool) -> tuple[LaneTags, ...]:
        """Give the lanes that lead to its end, or to its start."""
        return self.road.forward if end else self.road.backward

    def flipped(self) -> "Section":
        """Give the same piece of road in the other direction."""
        left, right = self.road.sidewalks
        road = replace(
            self.road, forward=self.road.backward, backward=self.road.forward, sidewalks=(right, left)
        )
        return replace(self, nodes=self.nodes[::-1], ways=self.ways[::-1], road=road)


@dataclass(frozen=True, slots=True, kw_only=True)
class Footway:
    """A way of people beside a road or across it.

    Attributes:
        way: its id.
        nodes: that it runs through.
        line: in metres; None where the extract has fewer than two of its nodes.
    """

    way: int
    nodes: tuple[int, ...]
    tags: Tags
    line: shapely.LineString | None


@dataclass(frozen=True, slots=True, kw_only=True)
class Unread:
    """What of an extract's roads the graph does not show as it is mapped.

    Attributes:
        not_kept: what tags say and no road shows, in words, with the ways.
        doubled: ways over which another road is drawn.
        unshared: nodes added where two roads cross, and a way that each lies on.
        missing: nodes that roads name and the extract lacks.
        barriers: nodes at which roads are closed.
    """

    not_kept: Mapping[str, Sequence[int]]
    doubled: Sequence[int]
    unshared: Sequence[tuple[int, int]]
    missing: Sequence[int]
    barriers: Sequence[int]


@dataclass(frozen=True, slots=True, kw_only=True)
class RoadGraph:
    """The roads, and all that later stages ask of the extract that they were read from.

    Attributes:
        places: where nodes lie, metres; numbers below 0 are nodes that OpenStreetMap does not have.
        sections: by id.
        tags: of the nodes on roads, where they have some.
        ways: the ways that are roads.
        footways: mapped sidewalks and crossings, in the order of their ids.
        country: whose rules hold.
        projection: from degrees to metres.
        unread: what is not shown.
        rules: that it is built by, and what is made of it.
    """

    places: Places
    sections: Mapping[str, Section]
    tags: Mapping[int, Tags]
    ways: Mapping[int, OsmWay]
    footways: tuple[Footway, ...]
    country: Country
    projection: Projection
    unread: Unread
    rules: ImportRules

    @property
    def left_hand(self) -> bool:
        """Whether traffic keeps left."""
        return self.country.left_hand

    def ends(self) -> dict[int, list[str]]:
        """List the sections at each vertex, a loop twice."""
        return list_ends(self.sections)

    def line(self, section: Section) -> Floats:
        """Give a section's centre line, (n, 2) metres."""
        return np.array([self.places[node] for node in section.nodes])

    def length(self, section: Section) -> float:
        """Measure a section, metres."""
        return float(along(self.line(section))[-1])

    def positions(self) -> dict[int, list[tuple[str, int]]]:
        """Find each node's sections and its place in their nodes."""
        found: dict[int, list[tuple[str, int]]] = defaultdict(list)
        for section in self.sections.values():
            for index, node in enumerate(section.nodes):
                found[node].append((section.id, index))
        return dict(found)

    def split(self, cuts: Mapping[str, Sequence[int]]) -> "RoadGraph":
        """Make vertices of inner nodes of sections.

        Args:
            cuts: of each section that is split, places in its nodes, ascending.
        """
        sections = dict(self.sections)
        for name, places in cuts.items():
            section = sections.pop(name)
            bounds = [0, *places, len(section.nodes) - 1]
            for number, (first, last) in enumerate(itertools.pairwise(bounds)):
                part = name + "b" * number + ("a" if number < len(places) else "")
                nodes, ways = section.nodes[first : last + 1], section.ways[first:last]
                sections[part] = replace(section, id=part, nodes=nodes, ways=ways)
        return replace(self, sections=sections)


def list_ends(sections: Mapping[str, Section]) -> dict[int, list[str]]:
    """List the sections at each vertex, a loop twice."""
    found: dict[int, list[str]] = defaultdict(list)
    for section in sections.values():
        found[section.start].append(section.id)
        found[section.end].append(section.id)
    return dict(found)


def free_number(places: Iterable[int]) -> int:
    """Number a node that OpenStreetMap does not have: below 0, and below all that there are."""
    return min(0, *places) - 1
