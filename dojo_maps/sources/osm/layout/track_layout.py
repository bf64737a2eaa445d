"""Where tracks are built: cut at the junctions that they pass, drawn back to the border of those.

A track ends in the junction of a road that it meets, or at a node of its own. What lies inside a junction
vanishes, and is what its links follow. Where a tram runs in a street, the street's lane is taken instead.
Tracks are settled when the roads' junctions have their outlines, so that they do not change those.
"""

import math
from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field

import numpy as np
import shapely

from dojo_maps.geometry.polylines import Floats, along
from dojo_maps.sources.osm.graph.road_graph import RoadGraph, Section
from dojo_maps.sources.osm.graph.street_tracks import StreetPart, Streets, tram_lanes
from dojo_maps.sources.osm.graph.tracks import Roads
from dojo_maps.sources.osm.junctions.grouping import Groups
from dojo_maps.sources.osm.layout.arms import Arm, Layout
from dojo_maps.sources.osm.read.data import OsmData
from dojo_maps.sources.osm.read.lane_tags import LaneUse
from dojo_maps.sources.osm.read.track_tags import CYCLEWAY, is_crossing_track

_SHORTEST, _SHORTEST_RAILS = 5.0, 20.0
"""Metres up to which a track between two nodes vanishes: of bicycles, and of rails, with their switches."""
_PAVEMENT = 2.0
"""Metres around a junction that leave no room for a track."""
_LONGEST = 60.0
"""Metres of a track that may vanish inside a junction."""
_WIDEST = 40.0
"""Metres across the nodes of tracks that are one."""
_BESIDE = 1.0
"""Metres kept between the end of a track and a carriageway."""
_ROOM = 30.0
"""Metres of a road that are left when it is drawn back for a track."""

_STRAY_SIGNAL = 20.0
"""Metres from a signal of no junction to the place where a track crosses the road that it stops."""
_NO_BICYCLES = ("motorway", "motorway_link")

_SHARP = 0.3
"""Cosine of the sharpest turn of rails at a node."""


Outlines = Mapping[int, shapely.Geometry]
"""The ground of the roads' junctions."""


@dataclass(frozen=True, slots=True)
class Edge:
    """A section driven in one direction, or against it.

    Attributes:
        section: of the tracks, or of the roads.
        forward: whether in the section's own direction.
        lane: of a road, counted from the outermost; none of a track.
    """

    section: str
    forward: bool
    lane: int | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class TrackLink:
    """A way across the junction `node`, from edge to edge."""

    node: int
    source: Edge
    target: Edge


@dataclass(frozen=True, slots=True, kw_only=True)
class Meeting:
    """Where a track meets a road: the junction, and the arms that begin there."""

    junction: int
    arms: tuple[Arm, ...] = ()


@dataclass(slots=True, kw_only=True)
class TrackLayout:
    """What is to be built of tracks.

    Attributes:
        graph: the tracks, cut at their nodes.
        meetings: where they meet roads, by node.
        streets: the street that sections run in.
        nodes: the junction or the own node of each vertex.
        own: the nodes that are no road's junction, and their places.
        built: the sections that are edges of their own, and the metres they are drawn back at both ends.
        links: ways across junctions.
        closed: junctions that tracks lead over without a link, for their roads would have no room left.
    """

    graph: RoadGraph
    meetings: dict[int, Meeting] = field(default_factory=dict)
    streets: dict[str, StreetPart] = field(default_factory=dict)
    nodes: dict[int, int] = field(default_factory=dict)
    own: dict[int, tuple[float, float]] = field(default_factory=dict)
    built: dict[str, tuple[float, float]] = field(default_factory=dict)
    links: list[TrackLink] = field(default_factory=list)
    closed: set[int] = field(default_factory=set)


def meet_roads(data: OsmData, layout: Layout) -> TrackLayout | None:
    """Find where the tracks of a graph meet its roads; the roads are drawn back for them."""
    if layout.graph.tracks is None or not layout.graph.tracks.sections:
        return None
    tracks = TrackLayout(graph=layout.graph.tracks)
    _cut_at_roads(layout, tracks)
    _add_signals(data, layout, tracks.meetings)
    return tracks


def settle_tracks(data: OsmData, layout: Layout, tracks: TrackLayout, outlines: Outlines) -> None:
    """Decide what of the tracks is built, and how they lead across junctions.

    Args:
        data: the extract.
        layout: of the roads.
        tracks: as they meet the roads; completed here.
        outlines: of the roads' junctions.
    """
    tracks.built.clear()
    _group(tracks, outlines)
    _part_from_closed(layout, tracks)
    _split_loops(tracks)
    for name, section in sorted(tracks.graph.sections.items()):
        if name not in tracks.streets and tracks.nodes[section.start] != tracks.nodes[section.end]:
            tracks.built[name] = _cuts(outlines, tracks, section)
    tracks.own = {
        node: tracks.graph.places[node]
        for section in (tracks.graph.sections[name] for name in sorted(tracks.built))
        for node in (tracks.nodes[section.start], tracks.nodes[section.end])
        if node not in layout.junctions.of
    }
    tracks.links = _Links(layout, tracks, _joined(data, tracks)).all()


def _cut_at_roads(layout: Layout, tracks: TrackLayout) -> None:
    """Cut tracks where they meet roads and each other, and where they begin to run in a street."""
    graph = tracks.graph
    roads = {name: s for name, s in layout.graph.sections.items() if name not in layout.inner}
    finder = Streets(layout.graph, roads)
    meets, ends = Roads(layout.graph), layout.graph.ends()
    uses = Counter(node for section in graph.sections.values() for node in section.nodes)
    for name in sorted(graph.sections):
        parts = [p for p in finder.parts(graph.sections[name]) if _shares(layout, graph.sections[name], p)]
        found = dict(
            _part_end(layout, graph, name, part, at_end) for part in parts for at_end in (False, True)
        )
        section = graph.sections[name]
        at = along(graph.line(section))
        outside = [
            index
            for index in range(len(section.nodes))
            if not any(part.start + 0.5 < at[index] < part.end - 0.5 for part in parts)
        ]
        for index in outside:
            node = section.nodes[index]
            meeting = _meeting(layout, ends, meets, section, index)
            found |= {node: meeting} if meeting is not None else {}
        cuts = [*found, *(section.nodes[index] for index in outside if uses[section.nodes[index]] > 1)]
        tracks.meetings |= found
        for piece, middle in _split(graph, name, cuts).items():
            for part in parts:
                if part.start < middle < part.end:
                    tracks.streets[piece] = part


def _shares(layout: Layout, track: Section, part: StreetPart) -> bool:
    """Tell whether a street has lanes for a tram in the directions of its track."""
    road = layout.graph.sections[part.street].road
    lanes = tram_lanes(road, track.road, part, left_hand=layout.graph.left_hand)
    return bool(lanes) and all((road.forward if forward else road.backward)[k].tram for forward, k in lanes)


def _part_end(
    layout: Layout,
    graph: RoadGraph,
    name: str,
    part: StreetPart,
    at_end: bool,
) -> tuple[int, Meeting]:
    """Give a track a node where it leaves a street; and the junction there."""
    place = part.end if at_end else part.start
    node = graph.sections[name].nodes[graph.insert_node(name, place)]
    street = layout.graph.sections[part.street]
    line = shapely.LineString(layout.graph.line(street))
    before = line.project(shapely.Point(graph.places[node])) < line.length / 2
    return node, Meeting(junction=layout.junctions.of[street.start if before else street.end])


def _meeting(
    layout: Layout, ends: dict[int, list[str]], roads: Roads, track: Section, index: int
) -> Meeting | None:
    """Find the junction of a road that a track meets at a node; the road is drawn back to there."""
    node = track.nodes[index]
    if node in layout.junctions.of:
        arms = [
            (name, layout.graph.sections[name].end == node)
            for name in sorted(ends[node])
            if name not in layout.inner
        ]
        return Meeting(junction=layout.junctions.of[node], arms=tuple(arms))
    for name, place in roads.met_by(track, index):
        section = layout.graph.sections[name]
        if name in layout.inner:
            return Meeting(junction=layout.junctions.of[section.start])
        rest = layout.graph.length(section) - place
        arm = (name, rest < place)
        metres = min(place, rest) + track.road.drives / 2 + _BESIDE
        layout.cuts[arm] = max(layout.cuts.get(arm, 0.0), min(metres, layout.room(arm, left=_ROOM)))
        return Meeting(junction=layout.junction(arm), arms=(arm,))
    return None


def _add_signals(data: OsmData, layout: Layout, meetings: dict[int, Meeting]) -> None:
    """Give signals to where tracks cross roads: their own, and those near that are of no junction."""
    junctions, places = layout.junctions, layout.graph.places
    for node, meeting in sorted(meetings.items()):
        near = [s for s in junctions.stray if math.dist(places[s], places[node]) < _STRAY_SIGNAL]
        if node in data.nodes and data.nodes[node].tags.get("highway") == "traffic_signals":
            near.append(node)
        if near and meeting.junction not in junctions.signals:
            junctions.signals[meeting.junction] = near


def _joined(data: OsmData, tracks: TrackLayout) -> dict[int, tuple[Arm, ...]]:
    """Find the arms of roads at the nodes where cycle tracks lead onto them: at ends, and at no crossing."""
    ends = tracks.graph.ends()
    joined = {}
    for node, at in sorted(ends.items()):
        if node not in tracks.meetings or tracks.meetings[node].junction in tracks.closed:
            continue
        sections = [tracks.graph.sections[name] for name in at]
        tags = data.nodes[node].tags if node in data.nodes else {}
        crossing = "crossing" in tags or tags.get("highway") in ("crossing", "traffic_signals")
        crossing |= any(is_crossing_track(data.ways[way].tags) for s in sections for way in s.ways)
        if sections[0].road.kind == CYCLEWAY and (len(at) == 1 or not crossing):
            joined[node] = tracks.meetings[node].arms
    return joined


def _split(graph: RoadGraph, name: str, cuts: list[int]) -> dict[str, float]:
    """Split a section at nodes; its pieces with the metres along it where their middles are."""
    section = graph.sections[name]
    at = along(graph.line(section))
    pieces: dict[str, float] = {}
    rest, low, start = name, 0.0, 0
    for index in sorted({section.nodes.index(node) for node in cuts} - {0, len(section.nodes) - 1}):
        graph.split(rest, index - start)
        pieces[f"{rest}a"] = (low + float(at[index])) / 2
        rest, low, start = f"{rest}b", float(at[index]), index
    return {**pieces, rest: (low + float(at[-1])) / 2}


def _group(tracks: TrackLayout, outlines: Outlines) -> None:
    """Name the junction or the own node of each vertex; those with next to no track between them are one."""
    graph = tracks.graph
    ends = {node for section in graph.sections.values() for node in (section.start, section.end)}
    groups = Groups({node: graph.places[node] for node in sorted(ends)}, _WIDEST)
    met = {node: tracks.meetings[node].junction for node in sorted(ends) if node in tracks.meetings}
    of = {node: junction for node, junction in met.items() if junction not in tracks.closed}
    left = {
        name: _outside(
            graph, section, [outlines[of[v]] for v in (section.start, section.end) if of.get(v) in outlines]
        )
        for name, section in graph.sections.items()
        if name not in tracks.streets
    }
    for name in sorted(left, key=lambda name: (left[name], name)):
        section = graph.sections[name]
        pair = [groups.find(section.start), groups.find(section.end)]
        known = [of[node] for node in pair if node in of]
        shortest = _SHORTEST if section.road.kind == CYCLEWAY else _SHORTEST_RAILS
        if left[name] > shortest or (len(known) == 2 and known[0] != known[1]):
            continue
        if groups.join(*pair) and known:
            of[groups.find(section.start)] = known[0]
    tracks.nodes = {node: of.get(groups.find(node), groups.find(node)) for node in sorted(ends)}


def _part_from_closed(layout: Layout, tracks: TrackLayout) -> None:
    """Give tracks over closed junctions nodes of their own, named as no vertex of a road is."""
    open_to = {meeting.junction for meeting in tracks.meetings.values()} - tracks.closed
    names = {home for home in tracks.nodes.values() if home in layout.junctions.of} - open_to
    own = {home: tracks.graph.add_node(tracks.graph.places[home]) for home in sorted(names)}
    tracks.nodes = {node: own.get(home, home) for node, home in tracks.nodes.items()}


def _outside(graph: RoadGraph, section: Section, grounds: list[shapely.Geometry]) -> float:
    """Measure what of a track lies outside of junctions, metres."""
    line = shapely.LineString(graph.line(section))
    return float(line.difference(shapely.buffer(shapely.union_all(grounds), _PAVEMENT)).length)


def _split_loops(tracks: TrackLayout) -> None:
    """Split long tracks that lead back to their junction, for SUMO has no loops."""
    graph = tracks.graph
    for name, section in sorted(graph.sections.items()):
        length = graph.length(section)
        if (
            name in tracks.streets
            or tracks.nodes[section.start] != tracks.nodes[section.end]
            or length <= _LONGEST
        ):
            continue
        index = graph.insert_node(name, length / 2)
        if 0 < index < len(graph.sections[name].nodes) - 1:
            node = graph.sections[name].nodes[index]
            graph.split(name, index)
            tracks.nodes[node] = node


def _cuts(outlines: Outlines, tracks: TrackLayout, section: Section) -> tuple[float, float]:
    """Measure how far a track is drawn back at both ends, to the border of the junctions there."""
    line = tracks.graph.line(section)
    room = max(tracks.graph.length(section) / 2 - 1.0, 0.0)
    found = []
    for ahead, vertex in ((line, section.start), (line[::-1], section.end)):
        path = shapely.LineString(ahead)
        outside = path.difference(outlines.get(tracks.nodes[vertex], shapely.Polygon()))
        pieces = [piece for piece in shapely.get_parts(outside) if piece.length > _BESIDE]
        first = min((path.project(shapely.Point(piece.coords[0])) for piece in pieces), default=0.0)
        found.append(min(first, room))
    return found[0], found[1]


class _Links:
    """Follows tracks through junctions, and between cycle tracks and the roads that they lead onto."""

    def __init__(
        self,
        layout: Layout,
        tracks: TrackLayout,
        joined: dict[int, tuple[Arm, ...]],
    ) -> None:
        self._layout = layout
        self._tracks = tracks
        self._streets = tracks.streets
        self._joined = joined
        self._ends = tracks.graph.ends()

    def all(self) -> list[TrackLink]:
        """List the links of all junctions."""
        found: set[TrackLink] = set()
        for name, section in self._tracks.graph.sections.items():
            if name not in self._tracks.built and name not in self._streets:
                continue
            for forward in (True, False):
                source = self._edge(name, forward=forward)
                vertex = section.end if forward else section.start
                if source is not None and self._is_at(source, self._tracks.nodes[vertex], end=True):
                    found.update(self._from((name, forward), source, vertex))
        for vertex, arms in self._joined.items():
            for source in self._roads(arms, arriving=True):
                found.update(self._from(None, source, vertex))
        return sorted(found, key=_order)

    def _edge(self, name: str, *, forward: bool) -> Edge | None:
        """Give the edge that a track's section is driven on in a direction; None where there is none."""
        part = self._streets.get(name)
        if part is None:
            road = self._tracks.graph.sections[name].road
            return Edge(name, forward) if (road.forward if forward else road.backward) else None
        way = forward == part.same
        road = self._layout.graph.sections[part.street].road
        lanes = [k for k, lane in enumerate(road.forward if way else road.backward) if lane.tram]
        return Edge(part.street, way, lanes[-1]) if lanes else None

    def _roads(self, arms: tuple[Arm, ...], *, arriving: bool) -> Iterator[Edge]:
        """List the roads that bicycles come from, or go on along, with their outermost open lane."""
        for name, at_end in arms:
            road = self._layout.graph.sections[name].road
            forward = at_end == arriving
            lanes = road.forward if forward else road.backward
            open_to = [k for k, lane in enumerate(lanes) if lane.use in (LaneUse.BICYCLE, LaneUse.DRIVING)]
            if open_to and road.kind not in _NO_BICYCLES:
                yield Edge(name, forward, open_to[0])

    def _is_at(self, edge: Edge, node: int, *, end: bool) -> bool:
        """Tell whether an edge ends at a junction, or begins there."""
        if edge.lane is None:
            return True
        section = self._layout.graph.sections[edge.section]
        return self._layout.junctions.of[section.end if edge.forward == end else section.start] == node

    def _from(self, first: tuple[str, bool] | None, source: Edge, vertex: int) -> Iterator[TrackLink]:
        """Follow the tracks on from an edge's end, through the junction there."""
        node = self._tracks.nodes[vertex]
        waiting, seen = [(first, vertex)], {first}
        while waiting:
            last, here = waiting.pop()
            if first is not None and self._joined.get(here):
                for target in self._roads(self._joined[here], arriving=False):
                    yield TrackLink(node=node, source=source, target=target)
            for onward in self._onward(last, here):
                if onward in seen:
                    continue
                seen.add(onward)
                name, forward = onward
                if name not in self._tracks.built and name not in self._streets:
                    section = self._tracks.graph.sections[name]
                    waiting.append((onward, section.end if forward else section.start))
                    continue
                edge = self._edge(name, forward=forward)
                if edge is not None and edge.section != source.section and self._is_at(edge, node, end=False):
                    yield TrackLink(node=node, source=source, target=edge)

    def _onward(self, last: tuple[str, bool] | None, vertex: int) -> Iterator[tuple[str, bool]]:
        """List the tracks of the same kind that go on from a vertex; rails have no sharp turns."""
        graph = self._tracks.graph
        kind = graph.sections[last[0]].road.kind if last else CYCLEWAY
        for name in self._ends[vertex]:
            other = graph.sections[name]
            if (last and name == last[0]) or other.road.kind != kind:
                continue
            for forward in (True, False):
                open_to = other.road.forward if forward else other.road.backward
                if (other.start if forward else other.end) != vertex or not open_to:
                    continue
                if last and kind != CYCLEWAY:
                    arriving = _heading(graph, graph.sections[last[0]], at_end=last[1])
                    if float(arriving @ -_heading(graph, other, at_end=not forward)) < _SHARP:
                        continue
                yield name, forward


def _order(link: TrackLink) -> tuple[int, str, bool, str, bool]:
    return link.node, link.source.section, link.source.forward, link.target.section, link.target.forward


def _heading(graph: RoadGraph, section: Section, *, at_end: bool) -> Floats:
    """Give the unit vector with which a section arrives at one of its ends."""
    line = graph.line(section)
    way = line[-1] - line[-2] if at_end else line[0] - line[1]
    return way / max(float(np.hypot(*way)), 1e-9)
