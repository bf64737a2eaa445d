"""The roads of an extract as a graph: sections of way between vertices, in metres.

A section runs from vertex to vertex with the same lanes all along; a vertex is a node where ways meet,
end, or change. Sections that only a split of the way or an unseen change of tags divides are one.
"""

import itertools
from collections import defaultdict
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
import shapely

from dojo_maps.description import Projection
from dojo_maps.geometry.polylines import Floats, along
from dojo_maps.sources.osm.read.country import Country
from dojo_maps.sources.osm.read.data import OsmWay, Tags
from dojo_maps.sources.osm.read.lane_tags import LaneTags
from dojo_maps.sources.osm.read.way_tags import RoadTags
from dojo_maps.sources.osm.rules import ImportRules

_SAME = 1.0
"""Metres between a place on a section and a node within which the node is taken."""

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

    @property
    def pair(self) -> tuple[int, int]:
        """Both vertices, the lower one first."""
        return min(self.start, self.end), max(self.start, self.end)

    def lanes_towards(self, *, end: bool) -> tuple[LaneTags, ...]:
        """Give the lanes that lead to its end, or to its start.

        Args:
            end: to its end.

        Returns:
            The lanes, outermost first; none where nobody drives that way.
        """
        return self.road.forward if end else self.road.backward

    def flipped(self) -> "Section":
        """Give the same piece of road in the other direction."""
        left, right = self.road.sidewalks
        road = replace(
            self.road,
            forward=self.road.backward,
            backward=self.road.forward,
            sidewalks=(right, left),
            offset=-self.road.offset,
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
        tracks: ways of their own for trams, trains and bicycles, on the same nodes; sections, by id.
        tags: of the nodes on roads and tracks, where they have some.
        ways: the ways that are roads.
        track_ways: the ways that are tracks.
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
    tracks: Mapping[str, Section] = field(default_factory=dict)
    track_ways: Mapping[int, OsmWay] = field(default_factory=dict)

    @property
    def left_hand(self) -> bool:
        """Whether traffic keeps left."""
        return self.country.left_hand

    def ends(self) -> dict[int, list[str]]:
        """List the sections at each vertex, a loop twice."""
        return list_ends(self.sections)

    def line(self, section: Section) -> Floats:
        """Give a section's centre line, (n, 2) metres.

        Args:
            section: a road or a track, on nodes of this graph.

        Returns:
            (n, 2), metres, map frame, in the order of its nodes.
        """
        return np.array([self.places[node] for node in section.nodes])

    def length(self, section: Section) -> float:
        """Measure a section, metres.

        Args:
            section: a road or a track, on nodes of this graph.

        Returns:
            Metres along its line.
        """
        return float(along(self.line(section))[-1])

    def positions(self) -> dict[int, list[tuple[str, int]]]:
        """Find each node's sections and its place in their nodes."""
        found: dict[int, list[tuple[str, int]]] = defaultdict(list)
        for section in self.sections.values():
            for index, node in enumerate(section.nodes):
                found[node].append((section.id, index))
        return dict(found)

    def of_tracks(self) -> "RoadGraph":
        """Give the tracks as a graph of their own."""
        return replace(self, sections=self.tracks)

    def add_nodes(self, wanted: Iterable[tuple[str, float]]) -> tuple["RoadGraph", list[int]]:
        """Give sections nodes at places on them; one that is near is taken.

        Args:
            wanted: sections, and the metres along each.

        Returns:
            The graph with these nodes; and their numbers.
        """
        sections, places = dict(self.sections), dict(self.places)
        found = []
        for name, metres in wanted:
            section = sections[name]
            line = np.array([places[node] for node in section.nodes])
            lengths = along(line)
            index = int(np.argmin(np.abs(lengths - metres)))
            if abs(float(lengths[index]) - metres) >= _SAME:
                index = int(np.searchsorted(lengths, metres))
                x, y = (float(np.interp(metres, lengths, values)) for values in line.T)
                node = free_number(places)
                places[node] = (round(x, 3), round(y, 3))
                nodes = (*section.nodes[:index], node, *section.nodes[index:])
                ways = (*section.ways[:index], section.ways[index - 1], *section.ways[index:])
                section = sections[name] = replace(section, nodes=nodes, ways=ways)
            found.append(section.nodes[index])
        return replace(self, sections=sections, places=places), found

    def split_at_nodes(self, cuts: Mapping[str, Iterable[int]]) -> "RoadGraph":
        """Make vertices of nodes of sections, as far as they are no ends.

        Args:
            cuts: of each section that is split, some of its nodes.

        Returns:
            The graph with the pieces in place of these sections, named as `split` names them.
        """
        found = {}
        for name, nodes in cuts.items():
            inner = self.sections[name].nodes
            found[name] = sorted({inner.index(node) for node in nodes} - {0, len(inner) - 1})
        return self.split({name: places for name, places in found.items() if places})

    def split(self, cuts: Mapping[str, Sequence[int]]) -> "RoadGraph":
        """Make vertices of inner nodes of sections.

        Args:
            cuts: of each section that is split, places in its nodes, ascending.

        Returns:
            The graph with the pieces in place of these sections; to a section's id the first adds `a`, the
            second `ba`, and so on, the last only as many `b` as there are cuts.
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
    """List the sections at each vertex, a loop twice.

    Args:
        sections: by id.

    Returns:
        Their ids, by vertex.
    """
    found: dict[int, list[str]] = defaultdict(list)
    for section in sections.values():
        found[section.start].append(section.id)
        found[section.end].append(section.id)
    return dict(found)


def free_number(places: Iterable[int]) -> int:
    """Number a node that OpenStreetMap does not have: below 0, and below all that there are.

    Args:
        places: the numbers of the nodes that there are.

    Returns:
        The number.
    """
    return min(0, *places) - 1
