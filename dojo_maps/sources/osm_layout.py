"""Where each crossing goes: at the arm of a junction, whose border moves out to it, or between junctions."""

import itertools
import math
from collections import defaultdict
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from types import MappingProxyType

import numpy as np

from dojo_maps.geometry.polylines import Floats, along
from dojo_maps.sources.osm import OsmData
from dojo_maps.sources.osm_corners import Arm, sharp_corners
from dojo_maps.sources.osm_crossings import MappedCrossing, find_crossings
from dojo_maps.sources.osm_graph import RoadGraph, Section
from dojo_maps.sources.osm_junctions import Junctions, group_junctions, share_controllers
from dojo_maps.sources.osm_loops import is_inner, split_loops
from dojo_maps.sources.osm_rings import widen_rings

CROSSING_WIDTH = 4.0
_REACH, _SIGNAL_REACH = 14.0, 30.0
"""Metres from a vertex up to which a crossing lies on the junction's border, without and with signals."""
_ROOM = 11.0
"""Metres between two crossings of a section that leave an edge of 5 m between them, and a little."""
_LEFT_OVER = 6.0
_ASIDE = 6.0
"""Metres by which roads that part at a sharp angle may move a crossing."""
_SIGNAL_NEAR = 20.0
_BOTH_CARRIAGEWAYS = 28.0
_BEYOND = 14.0


@dataclass(slots=True, kw_only=True)
class Layout:
    """What is to be built.

    Attributes:
        inner: sections that lie inside a junction and vanish.
        cuts: metres by which a section's end is drawn back from its vertex.
        hosted: the crossing at each arm.
        lost: crossings with no place, and why.
        asides: metres by which a section is moved to its left, because another lies too near.
    """

    graph: RoadGraph
    junctions: Junctions
    crossings: list[MappedCrossing]
    inner: set[str] = field(default_factory=set)
    cuts: dict[Arm, float] = field(default_factory=dict)
    hosted: dict[Arm, MappedCrossing] = field(default_factory=dict)
    lost: list[tuple[MappedCrossing, str]] = field(default_factory=list)
    asides: dict[str, float] = field(default_factory=dict)

    def trimmed(self, name: str) -> Floats:
        """Give a section's line, drawn back at its ends."""
        cuts = [self.cuts.get((name, at_end), 0.0) for at_end in (False, True)]
        return trim(self.graph.line(self.graph.sections[name]), *cuts)

    def junction(self, arm: Arm) -> int:
        """Name the junction that an arm ends at."""
        section = self.graph.sections[arm[0]]
        return self.junctions.of[section.end if arm[1] else section.start]

    def arms(self) -> dict[int, list[Arm]]:
        """List the arms of each junction."""
        found: dict[int, list[Arm]] = defaultdict(list)
        for name in sorted(self.graph.sections):
            if name not in self.inner:
                for at_end in (False, True):
                    found[self.junction((name, at_end))].append((name, at_end))
        return dict(found)


def lay_out(
    data: OsmData,
    graph: RoadGraph,
    joined: Iterable[tuple[int, int]] = (),
    moved: Mapping[int, tuple[int, float]] = MappingProxyType({}),
) -> Layout:
    """Group junctions and place crossings.

    Args:
        data: the extract.
        graph: its roads; sections are split where a crossing lies between junctions.
        joined: vertices to join because a section between them came out too short before.
        moved: crossings to move for the same reason, by node: towards which node, and how far.
    """
    widen_rings(graph)
    crossings = find_crossings(data, graph)
    if _extend_ends(graph, {crossing.node for crossing in crossings}):
        crossings = find_crossings(data, graph)
    junctions = group_junctions(data, graph, crossings)
    if _split_between(graph, junctions, crossings):
        crossings = find_crossings(data, graph)
    joined = [*joined, *_over_both_carriageways(graph, crossings)]
    junctions = group_junctions(data, graph, crossings, joined)
    while split_loops(graph, junctions):
        crossings = find_crossings(data, graph)
        junctions = group_junctions(data, graph, crossings, joined)
    layout = Layout(graph=graph, junctions=junctions, crossings=crossings)
    for name, section in graph.sections.items():
        if junctions.of[section.start] == junctions.of[section.end] and is_inner(graph, section):
            layout.inner.add(name)
    for node, (towards, metres) in moved.items():
        _move(graph, node, towards, metres)
    _host(layout)
    _draw_back(layout)
    _align_carriageways(layout)
    _signal_between(layout)
    return layout


def _move(graph: RoadGraph, node: int, towards: int, metres: float) -> None:
    (x, y), (a, b) = graph.places[node], graph.places[towards]
    share = min(metres / max(math.dist((x, y), (a, b)), 1e-3), 0.8)
    graph.places[node] = (x + (a - x) * share, y + (b - y) * share)


def _extend_ends(graph: RoadGraph, crossed: set[int]) -> bool:
    """Lead roads that end at a crossing a little farther, as they do beyond the extract's border."""
    ends = [(vertex, at[0]) for vertex, at in sorted(graph.ends().items()) if len(at) == 1]
    found = [(vertex, name) for vertex, name in ends if vertex in crossed]
    for vertex, name in found:
        section = graph.sections[name]
        at_end = section.end == vertex
        (x, y), (a, b) = (graph.places[n] for n in (section.nodes[-2:] if at_end else section.nodes[1::-1]))
        share = _BEYOND / max(math.dist((x, y), (a, b)), 1e-3)
        node = min(0, *graph.places) - 1
        graph.places[node] = (round(a + (a - x) * share, 3), round(b + (b - y) * share, 3))
        nodes = (*section.nodes, node) if at_end else (node, *section.nodes)
        ways = (*section.ways, section.ways[-1]) if at_end else (section.ways[0], *section.ways)
        graph.sections[name] = replace(section, nodes=nodes, ways=ways)
    return bool(found)


def _over_both_carriageways(graph: RoadGraph, crossings: list[MappedCrossing]) -> list[tuple[int, int]]:
    """Pair the crossings between junctions that lead over both carriageways of a divided road."""
    ends = graph.ends()
    alone = []
    for crossing in crossings:
        at = ends.get(crossing.node, [])
        if len(at) == 2 and all(graph.sections[name].road.oneway for name in at):
            line = graph.line(graph.sections[at[0]])
            alone.append((crossing, math.atan2(line[-1][1] - line[0][1], line[-1][0] - line[0][0])))
    return [
        (one.node, other.node)
        for (one, way), (other, back) in itertools.combinations(alone, 2)
        if math.dist(one.place, other.place) < _BOTH_CARRIAGEWAYS and math.cos(way - back) < -0.8
    ]


def _split_between(graph: RoadGraph, junctions: Junctions, crossings: list[MappedCrossing]) -> bool:
    """Split sections at crossings too far from both ends; tell whether any were."""
    by_section: dict[str, list[MappedCrossing]] = defaultdict(list)
    for crossing in crossings:
        by_section[crossing.section].append(crossing)
    degree = {vertex: len(at) for vertex, at in graph.ends().items()}
    changed = False
    for name, found in sorted(by_section.items()):
        section = graph.sections[name]
        if junctions.of[section.start] == junctions.of[section.end]:
            continue
        rest = name
        for node in _between(graph, junctions, degree, section, found):
            index = graph.sections[rest].nodes.index(node)
            if 0 < index < len(graph.sections[rest].nodes) - 1:
                graph.split(rest, index)
                rest += "b"
                changed = True
    return changed


def _between(
    graph: RoadGraph,
    junctions: Junctions,
    degree: dict[int, int],
    section: Section,
    found: list[MappedCrossing],
) -> list[int]:
    length = graph.length(section)
    taken: list[float] = []

    def border(vertex: int) -> float:
        if degree[vertex] <= 2 and junctions.of[vertex] == vertex and vertex not in junctions.signals:
            return 4.0
        return _SIGNAL_REACH if junctions.of[vertex] in junctions.signals else _REACH

    low, high = border(section.start), length - border(section.end)
    near = min((c.along for c in found if c.along <= low), default=None)
    far = max((c.along for c in found if c.along >= high), default=None)
    taken += [near] if near is not None else []
    taken += [far] if far is not None else []
    nodes = []
    for crossing in found:
        if crossing.along in (near, far) or any(abs(crossing.along - other) < _ROOM for other in taken):
            continue
        taken.append(crossing.along)
        nodes.append(crossing.node)
    return nodes


def _signal_between(layout: Layout) -> None:
    """Give signals to crossings between junctions that have them; near ones share a controller."""
    graph, junctions = layout.graph, layout.junctions
    degree = {vertex: len(at) for vertex, at in graph.ends().items()}
    members = junctions.members()
    stray = [graph.places[node] for node in junctions.stray]
    for arm, crossing in layout.hosted.items():
        junction = layout.junction(arm)
        if junction in junctions.signals or any(degree[vertex] != 2 for vertex in members[junction]):
            continue
        near = any(math.dist(place, crossing.place) < _SIGNAL_NEAR for place in stray)
        if crossing.signalised or near:
            junctions.signals[junction] = [crossing.node]
    share_controllers(graph, junctions)


def _host(layout: Layout) -> None:
    """Give each crossing the arm nearest to it, nearest crossings first."""
    graph = layout.graph
    arms = layout.arms()
    wishes = []
    for number, crossing in enumerate(layout.crossings):
        for arm in _candidates(layout, arms, crossing):
            distance, cut = _reach_of(graph, arm, crossing)
            back = _faces_back(graph, arms[layout.junction(arm)][0], arm)
            wishes.append((round(distance, 1), back, number, arm, cut))
    placed: set[int] = set()
    lengths = {name: graph.length(graph.sections[name]) for name in graph.sections}
    for distance, _, number, arm, cut in sorted(wishes):
        if number in placed or arm in layout.hosted or distance > _SIGNAL_REACH:
            continue
        used = layout.cuts.get((arm[0], not arm[1]), 6.0)
        room = lengths[arm[0]] - used - _LEFT_OVER
        if cut > 4.0 and cut > room + 4.0:
            continue
        layout.hosted[arm] = layout.crossings[number]
        layout.cuts[arm] = max(min(cut, room), 0.0)
        placed.add(number)
    for number, crossing in enumerate(layout.crossings):
        if number not in placed:
            layout.lost.append((crossing, "another crossing or the road's end is too near"))


def _draw_back(layout: Layout) -> None:
    """Draw roads back that part at a sharp angle, but no crossing out of its place."""
    graph = layout.graph
    wanted: dict[Arm, float] = {}
    for arms in layout.arms().values():
        wanted |= sharp_corners(graph, arms)
    for arm, metres in sorted(wanted.items()):
        farthest = layout.cuts[arm] + _ASIDE if arm in layout.hosted else metres
        layout.cuts[arm] = max(layout.cuts.get(arm, 0.0), min(metres, farthest))
    for arm in sorted(wanted.keys() - layout.hosted.keys()):
        room = graph.length(graph.sections[arm[0]]) - layout.cuts.get((arm[0], not arm[1]), 0.0)
        layout.cuts[arm] = max(0.0, min(layout.cuts[arm], room - _LEFT_OVER))


def _align_carriageways(layout: Layout) -> None:
    """Draw both carriageways of an arm back to one line; netconvert would pull the one to the other."""
    graph = layout.graph
    for arms in layout.arms().values():
        rays = {arm: ray(graph, arm) for arm in arms}
        for arm, other in itertools.permutations(arms, 2):
            (place, way), (twin, back) = rays[arm], rays[other]
            apart = twin - place
            ahead = float(apart @ way)
            aside = abs(float(apart[0] * way[1] - apart[1] * way[0]))
            if arm not in layout.hosted or float(way @ back) < 0.94 or not 0 < aside < _BOTH_CARRIAGEWAYS:
                continue
            wanted = layout.cuts[arm] - ahead
            used = layout.cuts.get((other[0], not other[1]), 6.0)
            room = graph.length(graph.sections[other[0]]) - used - _LEFT_OVER
            if layout.cuts.get(other, 0.0) < wanted < room:
                layout.cuts[other] = wanted


def trim(line: Floats, start: float, end: float) -> Floats:
    """Draw a line back at its ends, as far as a metre of it is left."""
    lengths = along(line)
    total = float(lengths[-1])
    if start + end > max(total - 1.0, 0.0):
        share = max(total - 1.0, 0.0) / max(start + end, 1e-9)
        start, end = start * share, end * share
    inner = (lengths > start + 0.3) & (lengths < total - end - 0.3)
    wanted = np.concatenate([[start], lengths[inner], [total - end]])
    return np.column_stack([np.interp(wanted, lengths, values) for values in line.T])


def ray(graph: RoadGraph, arm: Arm) -> tuple[Floats, Floats]:
    """Give an arm's vertex and the unit vector away from it, along its first 20 m."""
    line = graph.line(graph.sections[arm[0]])
    line = line[::-1] if arm[1] else line
    lengths = along(line)
    ahead = np.array([np.interp(min(20.0, float(lengths[-1])), lengths, values) for values in line.T])
    way = ahead - line[0]
    return line[0], way / max(float(np.hypot(*way)), 1e-6)


def _candidates(layout: Layout, arms: dict[int, list[Arm]], crossing: MappedCrossing) -> list[Arm]:
    """List the arms where a crossing may be built."""
    section = layout.graph.sections[crossing.section]
    if crossing.section not in layout.inner and crossing.node not in (section.start, section.end):
        return [(crossing.section, False), (crossing.section, True)]
    if crossing.section in layout.inner:
        return arms.get(layout.junctions.of[section.start], [])
    return arms.get(layout.junctions.of[crossing.node], [])


def _reach_of(graph: RoadGraph, arm: Arm, crossing: MappedCrossing) -> tuple[float, float]:
    """Measure from an arm's vertex to a crossing, and how far the arm must be drawn back for it."""
    section = graph.sections[arm[0]]
    if crossing.section == arm[0]:
        distance = graph.length(section) - crossing.along if arm[1] else crossing.along
        return distance, distance + CROSSING_WIDTH / 2
    vertex = section.end if arm[1] else section.start
    distance = math.dist(graph.places[vertex], crossing.place)
    return distance + 0.01, CROSSING_WIDTH / 2


def _faces_back(graph: RoadGraph, first: Arm, arm: Arm) -> bool:
    """Tell whether an arm leads to the other side than the first, so that crossings line up on one side."""
    return float(ray(graph, first)[1] @ ray(graph, arm)[1]) < 0
