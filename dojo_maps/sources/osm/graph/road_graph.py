"""The roads of an extract as a graph: sections of way between vertices, in metres.

A section runs from vertex to vertex with the same lanes all along; a vertex is a node where ways meet,
end, or change. Sections that only a split of the way or an unseen change of tags divides are one.
"""

import functools
import math
from collections import defaultdict
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
import pyproj
import shapely

from dojo_maps.errors import SourceError
from dojo_maps.geometry.polylines import Floats, along
from dojo_maps.sources.osm.graph.barriers import cut_at_barriers
from dojo_maps.sources.osm.graph.crowding import check_crowding
from dojo_maps.sources.osm.graph.node_runs import known_runs
from dojo_maps.sources.osm.graph.service_roads import find_signalised_service_roads
from dojo_maps.sources.osm.graph.shared_nodes import free_number, share_nodes
from dojo_maps.sources.osm.read.country import Country
from dojo_maps.sources.osm.read.data import OsmData, OsmWay
from dojo_maps.sources.osm.read.way_tags import KINDS, RoadTags, read_road, why_not_a_road

_LEAST_SECTION = 12.0
"""Metres: a shorter section between two changes of lanes takes its neighbour's."""
_WIDEST = 100_000.0


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

    def flipped(self) -> "Section":
        """Give the same piece of road in the other direction."""
        left, right = self.road.sidewalks
        road = replace(
            self.road, forward=self.road.backward, backward=self.road.forward, sidewalks=(right, left)
        )
        return replace(self, nodes=self.nodes[::-1], ways=self.ways[::-1], road=road)


@dataclass(slots=True, kw_only=True)
class RoadGraph:
    """Sections by id and where their nodes lie, metres; `proj` and `offset` lead back to degrees."""

    places: dict[int, tuple[float, float]]
    sections: dict[str, Section]
    country: Country
    proj: str
    offset: tuple[float, float]
    not_kept: dict[str, list[int]] = field(default_factory=dict)
    """What tags say and no road shows, in words, with the ways."""
    ways: frozenset[int] = frozenset()
    """The ways that are roads."""
    doubled: list[int] = field(default_factory=list)
    unshared: list[tuple[int, int]] = field(default_factory=list)
    missing: list[int] = field(default_factory=list)
    barriers: list[int] = field(default_factory=list)
    """Nodes at which roads are closed."""

    @property
    def left_hand(self) -> bool:
        """Whether traffic keeps left."""
        return self.country.left_hand

    def ends(self) -> dict[int, list[str]]:
        """List the sections at each vertex, a loop twice."""
        found: dict[int, list[str]] = defaultdict(list)
        for section in self.sections.values():
            found[section.start].append(section.id)
            found[section.end].append(section.id)
        return dict(found)

    def add_node(self, place: tuple[float, float]) -> int:
        """Add a node that OpenStreetMap does not have."""
        node = free_number(self.places)
        self.places[node] = place
        return node

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

    def split(self, section_id: str, index: int) -> None:
        """Make a vertex of an inner node of a section."""
        section = self.sections.pop(section_id)
        parts = (slice(0, index + 1), slice(index, None))
        for part, suffix in zip(parts, ("a", "b"), strict=True):
            nodes = section.nodes[part]
            ways = section.ways[:index] if suffix == "a" else section.ways[index:]
            name = section.id + suffix
            self.sections[name] = replace(section, id=name, nodes=nodes, ways=ways)

    def way_line(self, data: OsmData, way: OsmWay) -> shapely.LineString | None:
        """Lay any way of the extract into the plane, None where fewer than two nodes are there."""
        nodes = [data.nodes[node] for node in way.nodes if node in data.nodes]
        if len(nodes) < 2:
            return None
        x, y = _projection(self.proj)(np.array([n.lon for n in nodes]), np.array([n.lat for n in nodes]))
        return shapely.LineString(np.column_stack([x, y]) + self.offset)


@functools.cache
def _projection(proj: str) -> pyproj.Proj:
    return pyproj.Proj(proj)


def build_graph(data: OsmData, path: Path | str, country: Country) -> RoadGraph:
    """Find an extract's roads.

    Args:
        data: the extract.
        path: where it came from, for errors.
        country: whose rules hold.

    Raises:
        SourceError: it has no roads, they spread too far to be one map, or lie on each other.
    """
    roads, not_kept = _read_roads(data, country)
    pieces, missing = known_runs(data, roads)
    used = sorted({node for _, run in pieces for node in run})
    if not used:
        raise SourceError(path, "has no roads for cars or buses; choose a larger area")
    proj, offset, places = _project(data, used, path)
    check_crowding(pieces, roads, places, path)
    pieces, barriers = cut_at_barriers(data, pieces, places)
    pieces, unshared = share_nodes(pieces, roads, places, path)
    graph = RoadGraph(
        places=places, sections={}, country=country, proj=proj, offset=offset,
        not_kept=not_kept, ways=frozenset(roads), unshared=unshared, missing=missing, barriers=barriers,
    )  # fmt: skip
    _cut_sections(graph, pieces, roads)
    _drop_doubles(graph)
    while _join_sections(graph):
        pass
    return graph


def _read_roads(data: OsmData, country: Country) -> tuple[dict[int, RoadTags], dict[str, list[int]]]:
    """Read the ways that are built, and what of their tags is not kept."""
    ways = [way for way, found in data.ways.items() if why_not_a_road(found.tags) is None]
    ways = sorted({*ways, *find_signalised_service_roads(data, ways)})
    roads: dict[int, RoadTags] = {}
    not_kept: dict[str, list[int]] = defaultdict(list)
    for way in ways:
        road, unkept = read_road(data.ways[way].tags, country, service=True)
        if road is not None:
            roads[way] = road
        for words in unkept:
            not_kept[words].append(way)
    return roads, dict(not_kept)


def _project(
    data: OsmData, used: Sequence[int], path: object
) -> tuple[str, tuple[float, float], dict[int, tuple[float, float]]]:
    lon = np.array([data.nodes[node].lon for node in used])
    lat = np.array([data.nodes[node].lat for node in used])
    zone = min(60, int((float(np.median(lon)) + 180) // 6) + 1)
    south = " +south" if np.median(lat) < 0 else ""
    proj = f"+proj=utm +zone={zone}{south} +ellps=WGS84 +datum=WGS84 +units=m +no_defs"
    x, y = pyproj.Proj(proj)(lon, lat)
    if not (np.isfinite(x).all() and np.isfinite(y).all()) or max(np.ptp(x), np.ptp(y)) > _WIDEST:
        raise SourceError(
            path,
            f"its roads spread over more than {_WIDEST / 1000:.0f} km; cut out one place with osmium extract",
        )
    offset = (-math.floor(x.min()), -math.floor(y.min()))
    places = {
        node: (round(float(a) + offset[0], 3), round(float(b) + offset[1], 3))
        for node, a, b in zip(used, x, y, strict=True)
    }
    return proj, offset, places


def _cut_sections(
    graph: RoadGraph, pieces: Iterable[tuple[int, tuple[int, ...]]], roads: dict[int, RoadTags]
) -> None:
    """Cut ways where they meet; each one-way section runs in its traffic's direction."""
    pieces = list(pieces)
    uses: dict[int, int] = defaultdict(int)
    for _, run in pieces:
        for node in run:
            uses[node] += 1
        for before, node, after in zip(run, run[1:], run[2:], strict=False):
            uses[node] += before == after
        uses[run[0]] += 1
        uses[run[-1]] += 1
    count: dict[int, int] = defaultdict(int)
    for way, run in pieces:
        first = 0
        for index in range(1, len(run)):
            if uses[run[index]] > 1:
                nodes = run[first : index + 1]
                section = Section(
                    id=f"{_way_name(way)}#{count[way]}",
                    nodes=nodes,
                    ways=(way,) * (len(nodes) - 1),
                    road=roads[way],
                )
                count[way] += 1
                graph.sections[section.id] = section if section.road.forward else section.flipped()
                first = index


def _drop_doubles(graph: RoadGraph) -> None:
    """Keep one of the sections drawn over the same nodes; one-ways against each other make a two-way road."""
    kept: dict[tuple[int, ...], Section] = {}
    for section in graph.sections.values():
        key = (section.road.layer, *min(section.nodes, section.nodes[::-1]))
        twin = kept.get(key)
        if twin is None:
            kept[key] = section
        elif twin.road.oneway and section.road.oneway and twin.nodes != section.nodes:
            kept[key] = replace(twin, road=replace(twin.road, backward=section.road.forward))
        else:
            kept[key], other = sorted((twin, section), key=_importance, reverse=True)
            graph.doubled.append(other.ways[0])
    graph.sections = {section.id: section for section in kept.values()}


def _importance(section: Section) -> tuple[int, float]:
    return KINDS[section.road.kind], section.road.drives


def _join_sections(graph: RoadGraph) -> bool:
    """Join sections across vertices that only part them; tell whether any were."""
    changed = False
    for vertex, at in sorted(graph.ends().items()):
        if len(at) != 2 or at[0] == at[1] or any(name not in graph.sections for name in at):
            continue
        before, after = _in_line(graph.sections[at[0]], graph.sections[at[1]], vertex)
        if before is None or after is None or before.start == after.end:
            continue
        road = _common_road(graph, before, after)
        if road is None:
            continue
        del graph.sections[at[0]], graph.sections[at[1]]
        graph.sections[before.id] = replace(
            before, nodes=before.nodes + after.nodes[1:], ways=before.ways + after.ways, road=road
        )
        changed = True
    return changed


def _in_line(one: Section, other: Section, vertex: int) -> tuple[Section | None, Section | None]:
    """Order two sections so that the first leads to the vertex and the second leaves it."""
    if one.end != vertex:
        one, other = other, one
    if one.end != vertex:
        return (one.flipped(), other) if not one.road.oneway else (None, None)
    if other.start != vertex:
        if not other.road.oneway:
            return one, other.flipped()
        return (other, one.flipped()) if not one.road.oneway else (None, None)
    return one, other


def _common_road(graph: RoadGraph, before: Section, after: Section) -> RoadTags | None:
    """Give what both sections are, or what a very short one of them may be taken for."""
    one, other = before.road, after.road
    if one.oneway != other.oneway or one.layer != other.layer or one.roundabout != other.roundabout:
        return None
    if _essence(one) == _essence(other):
        return one
    lengths = graph.length(before), graph.length(after)
    if min(lengths) >= _LEAST_SECTION:
        return None
    return one if lengths[0] >= lengths[1] else other


def _essence(road: RoadTags) -> RoadTags:
    return replace(road, name="", width=0.0, kind="", speed=round(road.speed))


def _way_name(way: int) -> str:
    """Name a way; editors number new ones below 0, and a minus stands for the way back."""
    return str(way) if way >= 0 else f"new{-way}"
