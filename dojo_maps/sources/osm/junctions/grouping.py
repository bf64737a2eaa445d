"""Which vertices are one real junction, which junctions have signals, and which of these share a controller.

Carriageways, slip lanes and stretched signals leave several vertices on one junction. Short sections are
contracted, shortest first, while the junction stays of a size that junctions have.
"""

import itertools
import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace

import shapely

from dojo_maps.sources.osm.graph.road_graph import Places, RoadGraph, Section
from dojo_maps.sources.osm.graph.sign_direction import sign_direction
from dojo_maps.sources.osm.junctions.mapped_crossings import MappedCrossing


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
        """Name the group of a thing."""
        while self._owner[key] != key:
            key = self._owner[key]
        return key

    def join(self, one: int, other: int, widest: float = 0.0) -> bool:
        """Join two groups unless the whole would be too wide; tell whether they are one now."""
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


def group_junctions(
    graph: RoadGraph,
    crossings: Iterable[MappedCrossing],
    joined: Iterable[tuple[int, int]] = (),
) -> Junctions:
    """Group vertices to junctions and give signals to them.

    Args:
        graph: the roads.
        crossings: where people cross.
        joined: vertices to join besides.
    """
    ends, rules = graph.ends(), graph.rules.junctions
    strong, stray = _assign_signals(graph, ends)
    groups = Groups({vertex: graph.places[vertex] for vertex in ends}, rules.widest)
    lengths = {name: graph.length(section) for name, section in graph.sections.items()}
    for name in sorted(lengths, key=lambda name: (lengths[name], name)):
        section = graph.sections[name]
        if not section.road.roundabout and lengths[name] <= _reach(graph, ends, section, strong):
            groups.join(section.start, section.end)
    for one, other in joined:
        if one in ends and other in ends and _leaves_no_void(graph, ends, groups, one, other):
            groups.join(one, other, widest=rules.widest_joined)
    of = {vertex: groups.find(vertex) for vertex in sorted(ends)}
    signals: dict[int, list[int]] = {}
    for vertex, nodes in sorted(strong.items()):
        signals.setdefault(of[vertex], []).extend(nodes)
    for junction, nodes in _signalised_crossings(graph, of, crossings, ends).items():
        signals.setdefault(junction, nodes)
    return Junctions(of=of, signals=signals, stray=stray)


def around_road(graph: RoadGraph, section: Section) -> shapely.Geometry:
    """Give a road's carriageway and the ground near it, all that may be a junction's beside it."""
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
    graph: RoadGraph, ends: dict[int, list[str]], section: Section, strong: dict[int, list[int]]
) -> float:
    """Give the length up to which a section lies inside one junction."""
    rules = graph.rules.junctions
    busy = [len(ends[vertex]) > 2 for vertex in (section.start, section.end)]
    if not any(busy):
        return 0.0
    if not all(busy):
        return rules.short_section if min(len(ends[section.start]), len(ends[section.end])) == 2 else 0.0
    if section.start in strong and section.end in strong:
        return rules.between_signals
    return rules.carriageways_apart if _joins_carriageways(graph, ends, section) else rules.short_section


def _joins_carriageways(graph: RoadGraph, ends: dict[int, list[str]], section: Section) -> bool:
    """Tell whether a section leads over the median of a divided road."""
    return all(
        sum(graph.sections[name].road.oneway for name in ends[vertex] if name != section.id) >= 2
        for vertex in (section.start, section.end)
    )


def _is_dog_leg(
    graph: RoadGraph, junctions: Junctions, members: dict[int, list[int]], section: Section
) -> bool:
    """Tell whether a street goes on along a section: it leaves to one side at each end, not to the same."""
    ends = graph.ends()
    sides = [
        {
            side
            for member in members[junctions.of[vertex]]
            for name in ends[member]
            if (side := _side(graph, junctions, section, graph.sections[name], member)) is not None
        }
        for vertex in (section.start, section.end)
    ]
    return all(len(side) == 1 for side in sides) and sides[0] != sides[1]


def _side(
    graph: RoadGraph, junctions: Junctions, along: Section, section: Section, vertex: int
) -> bool | None:
    """Tell to which side of a section's line another leaves a vertex, left or not; None for neither."""
    if junctions.of[section.start] == junctions.of[section.end]:
        return None
    (x, y), (a, b) = (graph.places[node] for node in (along.start, along.end))
    line = graph.line(section)
    ahead, aside = line[1] - line[0] if section.start == vertex else line[-2] - line[-1]
    size = math.hypot(a - x, b - y) * math.hypot(ahead, aside)
    turn = ((a - x) * aside - (b - y) * ahead) / max(size, 1e-9)
    return turn > 0 if abs(turn) > graph.rules.signals.leaves_aside else None


def _assign_signals(graph: RoadGraph, ends: dict[int, list[str]]) -> tuple[dict[int, list[int]], list[int]]:
    """Find the vertex that each signal node is for; those with none near are stray."""
    strong: dict[int, list[int]] = {}
    stray = []
    for node, places in sorted(graph.positions().items()):
        if graph.tags.get(node, {}).get("highway") != "traffic_signals":
            continue
        if len(ends.get(node, ())) > 2:
            strong.setdefault(node, []).append(node)
            continue
        found = [
            hit
            for name, index in places
            for hit in _downstream(
                graph, ends, graph.sections[name], index, sign_direction(graph, graph.sections[name], node)
            )
        ]
        if found:
            strong.setdefault(min(found)[1], []).append(node)
        else:
            stray.append(node)
    return strong, stray


def _downstream(
    graph: RoadGraph, ends: dict[int, list[str]], section: Section, index: int, heading: int
) -> list[tuple[float, int]]:
    """Find the next vertices where roads meet, with the metres to them, in the given direction or both."""
    found, farthest = [], graph.rules.signals.before_junction
    for way in (1, -1):
        if heading not in (0, way):
            continue
        here, at, walked, seen = section, index, 0.0, {section.id}
        forward = way > 0
        while walked <= farthest:
            for one, other in itertools.pairwise(here.nodes[at:] if forward else here.nodes[at::-1]):
                walked += math.dist(graph.places[one], graph.places[other])
                if walked > farthest:
                    break
            vertex = here.end if forward else here.start
            if walked > farthest:
                break
            if len(ends[vertex]) > 2:
                found.append((walked, vertex))
                break
            onward = [name for name in ends[vertex] if name not in seen]
            if not onward:
                break
            here = graph.sections[onward[0]]
            seen.add(here.id)
            forward = here.start == vertex
            at = 0 if forward else len(here.nodes) - 1
    return found


def _signalised_crossings(
    graph: RoadGraph, of: Mapping[int, int], crossings: Iterable[MappedCrossing], ends: dict[int, list[str]]
) -> dict[int, list[int]]:
    """List the nodes of signalised crossings where two of them make a signalised junction."""
    near: dict[int, list[int]] = {}
    for crossing in crossings:
        if not crossing.signalised:
            continue
        section = graph.sections[crossing.section]
        rest = graph.length(section) - crossing.along
        distance, vertex = min((crossing.along, section.start), (rest, section.end))
        if distance <= graph.rules.signals.crossing_at_junction and len(ends[vertex]) > 2:
            near.setdefault(of[vertex], []).append(crossing.node)
    return {junction: nodes for junction, nodes in sorted(near.items()) if len(nodes) > 1}


def share_controllers(graph: RoadGraph, junctions: Junctions) -> Junctions:
    """Give one controller to signalised junctions with little room between them."""
    rules = graph.rules.signals
    groups = Groups(
        {junction: graph.places[junction] for junction in junctions.signals}, rules.widest_controller
    )
    ends, members = graph.ends(), junctions.members()
    pairs = [
        (
            graph.length(section),
            junctions.of[section.start],
            junctions.of[section.end],
            rules.one_place
            if _joins_carriageways(graph, ends, section) or _is_dog_leg(graph, junctions, members, section)
            else rules.one_controller,
        )
        for section in graph.sections.values()
        if {junctions.of[section.start], junctions.of[section.end]} <= junctions.signals.keys()
        and graph.length(section) <= rules.one_place
    ]
    vertices = [vertex for vertex, junction in junctions.of.items() if junction in junctions.signals]
    pairs += [
        (
            math.dist(graph.places[one], graph.places[other]),
            junctions.of[one],
            junctions.of[other],
            rules.side_by_side,
        )
        for one, other in itertools.combinations(vertices, 2)
    ]
    for length, one, other, farthest in sorted(pairs):
        if length <= farthest and one in junctions.signals and other in junctions.signals:
            groups.join(one, other)
    controllers = {junction: groups.find(junction) for junction in sorted(junctions.signals)}
    return replace(junctions, controllers=controllers)
