"""Which vertices are one real junction.

Carriageways, slip lanes and stretched signals leave several vertices on one junction. Short sections are
contracted, shortest first, while the junction stays of a size that junctions have.
"""

import math
from collections.abc import Container, Iterable, Mapping, Sequence
from dataclasses import dataclass, field

import shapely

from dojo_maps.sources.osm.graph.road_graph import Places, RoadGraph, Section


@dataclass(frozen=True, slots=True, kw_only=True)
class Junctions:
    """Vertices grouped to junctions.

    Attributes:
        of: the junction of each vertex, named by its lowest vertex.
        signals: the OSM nodes that make each signalised junction so.
        controllers: the signal controller of each signalised junction.
        stray: signal nodes with no junction near.
    """

    of: Mapping[int, int]
    signals: Mapping[int, Sequence[int]]
    controllers: Mapping[int, int] = field(default_factory=dict)
    stray: Sequence[int] = ()

    def members(self) -> dict[int, list[int]]:
        """List the vertices of each junction."""
        found: dict[int, list[int]] = {}
        for vertex, junction in sorted(self.of.items()):
            found.setdefault(junction, []).append(vertex)
        return found


class Groups:
    """Union of things into groups no wider than a limit."""

    def __init__(self, places: Places, widest: float) -> None:
        self._widest = widest
        self._owner = {key: key for key in places}
        self._boxes = {key: (x, y, x, y) for key, (x, y) in places.items()}

    def find(self, key: int) -> int:
        """Name the group of a thing.

        Args:
            key: of the thing.

        Returns:
            The lowest key in its group.
        """
        while self._owner[key] != key:
            key = self._owner[key]
        return key

    def join(self, one: int, other: int, widest: float = 0.0) -> bool:
        """Join two groups unless the whole would be too wide.

        Args:
            one: key of a thing in the first group.
            other: key of a thing in the second.
            widest: metres across the whole's bounding box, where it may have more than the groups' limit.

        Returns:
            Whether they are one group now.
        """
        one, other = self.find(one), self.find(other)
        if one == other:
            return True
        a, b = self._boxes[one], self._boxes[other]
        box = (min(a[0], b[0]), min(a[1], b[1]), max(a[2], b[2]), max(a[3], b[3]))
        if math.hypot(box[2] - box[0], box[3] - box[1]) > max(self._widest, widest):
            return False
        low, high = sorted((one, other))
        self._owner[high] = low
        self._boxes[low] = box
        return True


def group_vertices(
    graph: RoadGraph, signalised: Container[int], joined: Iterable[tuple[int, int]] = ()
) -> dict[int, int]:
    """Group vertices to junctions.

    Args:
        graph: the roads.
        signalised: vertices with signals.
        joined: vertices to join besides.

    Returns:
        The junction of each vertex.
    """
    ends, rules = graph.ends(), graph.rules.junctions
    groups = Groups({vertex: graph.places[vertex] for vertex in ends}, rules.widest)
    lengths = {name: graph.length(section) for name, section in graph.sections.items()}
    for name in sorted(lengths, key=lambda name: (lengths[name], name)):
        section = graph.sections[name]
        if not section.road.roundabout and lengths[name] <= _reach(graph, ends, section, signalised):
            groups.join(section.start, section.end)
    for one, other in joined:
        if one in ends and other in ends and _leaves_no_void(graph, ends, groups, one, other):
            groups.join(one, other, widest=rules.widest_joined)
    return {vertex: groups.find(vertex) for vertex in sorted(ends)}


def around_road(graph: RoadGraph, section: Section) -> shapely.Geometry:
    """Give a road's carriageway and the ground near it, all that may be a junction's beside it.

    Args:
        graph: that has the section's nodes.
        section: a road or a track.

    Returns:
        A polygon, metres, map frame.
    """
    return shapely.LineString(graph.line(section)).buffer(
        section.road.drives / 2 + graph.rules.junctions.beside_road
    )


def _leaves_no_void(
    graph: RoadGraph, ends: dict[int, list[str]], groups: Groups, one: int, other: int
) -> bool:
    """Tell whether two groups of vertices joined would pave next to no ground that is far from all roads."""
    wanted = {groups.find(one), groups.find(other)}
    members = [vertex for vertex in ends if groups.find(vertex) in wanted]
    around = shapely.convex_hull(shapely.multipoints([graph.places[vertex] for vertex in members]))
    sections = [
        graph.sections[name] for name in sorted({name for vertex in members for name in ends[vertex]})
    ]
    roads = [around_road(graph, section) for section in sections]
    return float(around.difference(shapely.union_all(roads)).area) <= graph.rules.junctions.most_void


def _reach(
    graph: RoadGraph, ends: dict[int, list[str]], section: Section, signalised: Container[int]
) -> float:
    """Give the length up to which a section lies inside one junction."""
    rules = graph.rules.junctions
    busy = [len(ends[vertex]) > 2 for vertex in (section.start, section.end)]
    if not any(busy):
        return 0.0
    if not all(busy):
        return rules.short_section if min(len(ends[section.start]), len(ends[section.end])) == 2 else 0.0
    if section.start in signalised and section.end in signalised:
        return rules.between_signals
    return rules.carriageways_apart if joins_carriageways(graph, ends, section) else rules.short_section


def joins_carriageways(graph: RoadGraph, ends: dict[int, list[str]], section: Section) -> bool:
    """Tell whether a section leads over the median of a divided road.

    Args:
        graph: the roads.
        ends: ids of the sections at each vertex, as `RoadGraph.ends` lists them.
        section: the road.

    Returns:
        Whether two other roads or more at each of its ends are one-way.
    """
    return all(
        sum(graph.sections[name].road.oneway for name in ends[vertex] if name != section.id) >= 2
        for vertex in (section.start, section.end)
    )
