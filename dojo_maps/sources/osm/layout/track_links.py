"""Ways across junctions: along tracks, and between cycle tracks and the roads that they lead onto."""

from collections.abc import Iterator, Mapping
from heapq import heappop, heappush

import numpy as np

from dojo_maps.geometry.polylines import Floats
from dojo_maps.sources.osm.graph.edge_id import EdgeId
from dojo_maps.sources.osm.graph.road_graph import RoadGraph
from dojo_maps.sources.osm.layout.arms import Arm, Layout
from dojo_maps.sources.osm.layout.track_layout import TrackEdge, TrackLayout, TrackLink
from dojo_maps.sources.osm.read.lane_tags import LaneUse
from dojo_maps.sources.osm.read.track_tags import CYCLEWAY, is_crossing_track

_NO_BICYCLES = ("motorway", "motorway_link")


def find_links(layout: Layout, tracks: TrackLayout) -> list[TrackLink]:
    """Follow tracks through the junctions that they end at.

    Args:
        layout: of the roads.
        tracks: with all but their links.

    Returns:
        The ways across junctions, each once, in order.
    """
    return sorted(set(_Links(layout, tracks).all()))


def _joined(layout: Layout, tracks: TrackLayout) -> dict[int, tuple[Arm, ...]]:
    """Find the arms of roads at the nodes where cycle tracks lead onto them: at ends, and at no crossing."""
    joined = {}
    for node, at in sorted(tracks.graph.ends().items()):
        if node not in tracks.meetings or tracks.meetings[node].junction in tracks.closed:
            continue
        sections = [tracks.graph.sections[name] for name in at]
        tags = layout.graph.tags.get(node, {})
        crossing = "crossing" in tags or tags.get("highway") in ("crossing", "traffic_signals")
        crossing |= any(
            is_crossing_track(layout.graph.track_ways[way].tags) for s in sections for way in s.ways
        )
        if sections[0].road.kind == CYCLEWAY and (len(at) == 1 or not crossing):
            joined[node] = tracks.meetings[node].arms
    return joined


class _Links:
    """Follows tracks through junctions, and between cycle tracks and the roads that they lead onto."""

    def __init__(self, layout: Layout, tracks: TrackLayout) -> None:
        self._layout = layout
        self._tracks = tracks
        self._joined: Mapping[int, tuple[Arm, ...]] = _joined(layout, tracks)
        self._ends = tracks.graph.ends()

    def all(self) -> Iterator[TrackLink]:
        """List the links of all junctions, some of them twice."""
        for name, section in self._tracks.graph.sections.items():
            if name not in self._tracks.built and name not in self._tracks.streets:
                continue
            for edge in (EdgeId(name, forward=True), EdgeId(name, forward=False)):
                source = self._driven(edge)
                vertex = section.end if edge.forward else section.start
                if source is not None and self._is_at(source, self._tracks.nodes[vertex], end=True):
                    yield from self._from(edge, source, vertex)
        for vertex, arms in self._joined.items():
            for source in self._roads(arms, arriving=True):
                yield from self._from(None, source, vertex)

    def _driven(self, track: EdgeId) -> TrackEdge | None:
        """Give the edge that a track is driven on in a direction; None where there is none."""
        part = self._tracks.streets.get(track.section)
        if part is None:
            lanes = self._tracks.graph.sections[track.section].lanes_towards(end=track.forward)
            return TrackEdge(track) if lanes else None
        forward = track.forward == part.same
        street = self._layout.graph.sections[part.street].lanes_towards(end=forward)
        shared = [k for k, lane in enumerate(street) if lane.tram]
        return TrackEdge(EdgeId(part.street, forward), shared[-1]) if shared else None

    def _roads(self, arms: tuple[Arm, ...], *, arriving: bool) -> Iterator[TrackEdge]:
        """List the roads that bicycles come from, or go on along, with their outermost open lane."""
        for arm in arms:
            lanes = self._layout.arriving(arm) if arriving else self._layout.leaving(arm)
            open_to = [k for k, lane in enumerate(lanes) if lane.use in (LaneUse.BICYCLE, LaneUse.DRIVING)]
            if open_to and self._layout.graph.sections[arm.section].road.kind not in _NO_BICYCLES:
                yield TrackEdge(arm.incoming if arriving else arm.outgoing, open_to[0])

    def _is_at(self, found: TrackEdge, node: int, *, end: bool) -> bool:
        """Tell whether an edge ends at a junction, or begins there."""
        if found.lane < 0:
            return True
        section = self._layout.graph.sections[found.edge.section]
        return self._layout.junctions.of[section.end if found.edge.forward == end else section.start] == node

    def _from(self, first: EdgeId | None, source: TrackEdge, vertex: int) -> Iterator[TrackLink]:
        """Follow the tracks on from an edge's end, the shortest way through the junction there."""
        node, sections = self._tracks.nodes[vertex], self._tracks.graph.sections
        waiting: list[tuple[float, tuple[EdgeId, ...], int]] = [(0.0, (), vertex)]
        seen: set[EdgeId | None] = set()
        while waiting:
            metres, through, here = heappop(waiting)
            last = through[-1] if through else first
            if last in seen:
                continue
            seen.add(last)
            if first is not None and self._joined.get(here):
                for target in self._roads(self._joined[here], arriving=False):
                    yield TrackLink(node=node, source=source, target=target)
            for onward in self._onward(last, here):
                if onward in seen:
                    continue
                section = sections[onward.section]
                if onward.section not in self._tracks.built and onward.section not in self._tracks.streets:
                    end = section.end if onward.forward else section.start
                    length = self._tracks.graph.length(section)
                    heappush(waiting, (metres + length, (*through, onward), end))
                    continue
                seen.add(onward)
                goal = self._driven(onward)
                leads_on = goal is not None and goal.edge.section != source.edge.section
                if goal is not None and leads_on and self._is_at(goal, node, end=False):
                    yield TrackLink(node=node, source=source, target=goal, through=through)

    def _onward(self, last: EdgeId | None, vertex: int) -> Iterator[EdgeId]:
        """List the tracks of the same kind that go on from a vertex; rails have no sharp turns."""
        graph = self._tracks.graph
        kind = graph.sections[last.section].road.kind if last else CYCLEWAY
        for name in self._ends[vertex]:
            other = graph.sections[name]
            if (last and name == last.section) or other.road.kind != kind:
                continue
            for edge in (EdgeId(name, forward=True), EdgeId(name, forward=False)):
                starts = (other.start if edge.forward else other.end) == vertex
                if starts and other.lanes_towards(end=edge.forward) and self._turns(last, edge, kind):
                    yield edge

    def _turns(self, last: EdgeId | None, onward: EdgeId, kind: str) -> bool:
        """Tell whether a turn is not too sharp for rails."""
        if last is None or kind == CYCLEWAY:
            return True
        graph = self._tracks.graph
        leaving = -_heading(graph, onward.section, at_end=not onward.forward)
        arriving = _heading(graph, last.section, at_end=last.forward)
        return float(arriving @ leaving) >= graph.rules.tracks.sharpest_rails


def _heading(graph: RoadGraph, name: str, *, at_end: bool) -> Floats:
    """Give the unit vector with which a section arrives at one of its ends."""
    line = graph.line(graph.sections[name])
    way = line[-1] - line[-2] if at_end else line[0] - line[1]
    return way / max(float(np.hypot(*way)), 1e-9)
