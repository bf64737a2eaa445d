"""Tracks as plain XML: their edges and nodes, and the ways of trams and bicycles across junctions."""

import re
from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import replace
from xml.sax.saxutils import quoteattr

import numpy as np

from dojo_maps.geometry.polylines import Floats
from dojo_maps.sources.osm.graph.heights import compute_heights
from dojo_maps.sources.osm.graph.road_graph import Section
from dojo_maps.sources.osm.layout.arms import Layout, trim
from dojo_maps.sources.osm.layout.track_layout import Edge, TrackLayout
from dojo_maps.sources.osm.plain.rail_crossings import crossing_line, rail_crossings
from dojo_maps.sources.osm.read.lane_tags import LaneUse
from dojo_maps.sources.osm.read.track_tags import CYCLEWAY, RAIL, TRAM

_WHO = {
    LaneUse.CYCLEWAY: "pedestrian bicycle",
    LaneUse.TRAM: "pedestrian tram",
    LaneUse.RAIL: "rail_urban rail rail_electric rail_fast",
}
"""Vehicle classes of SUMO's. People are let onto cycle tracks and trams', so that pavements lead over them;
netconvert knows a railway by nobody but trains using it."""
_PRIORITIES = {CYCLEWAY: 1, TRAM: 20, RAIL: 21}
"""Bicycles on tracks give way to roads, roads to rails."""


_ON_RAILS = re.compile(rb'allow="pedestrian tram"')
_PAVEMENT = re.compile(rb' *<edge id="(:[^"]*_w\d+)" function="walkingarea">.*?</edge>\n', re.DOTALL)
_RAIL_EDGE = re.compile(rb'<edge id="([^"]*)"[^>]*type="railway\.')
_FROM_PAVEMENT = re.compile(rb' *<connection from=":[^"]*_w\d+" to="([^"]*)"[^>]*/>\n')
_TO_PAVEMENT = re.compile(rb' *<connection from="([^"]*)" to=":[^"]*_w\d+"[^>]*/>\n')
_NAME = re.compile(rb'"(:[^"]*_w\d+)"')


def clear_rails(network: bytes) -> bytes:
    """Take people off the tracks of trams in a network of netconvert's; they cross them at junctions."""
    rails = set(_RAIL_EDGE.findall(network))
    for pattern in (_FROM_PAVEMENT, _TO_PAVEMENT):
        network = pattern.sub(lambda found: b"" if found[1] in rails else found[0], network)
    used = Counter(_NAME.findall(network))
    network = _PAVEMENT.sub(lambda found: found[0] if used[found[1]] > 1 else b"", network)
    return _ON_RAILS.sub(b'allow="tram"', network)


class TrackEdges:
    """Writes the tracks of a layout.

    Args:
        layout: of the roads.
        tracks: to be written.
        heights: of the roads' nodes, metres.
    """

    def __init__(self, layout: Layout, tracks: TrackLayout, heights: Mapping[int, float]) -> None:
        self._layout = layout
        self._tracks = tracks
        self.sections = {name: tracks.graph.sections[name] for name in sorted(tracks.built)}
        both = replace(layout.graph, sections={**layout.graph.sections, **self.sections})
        self._heights = {**compute_heights(both), **heights}
        self.sections = {name: both.sections[name] for name in self.sections}

    @property
    def junctions(self) -> set[int]:
        """The junctions of roads that tracks lead into."""
        return {
            node for link in self._tracks.links for node in (link.node,) if node in self._layout.junctions.of
        }

    def rail_crossings(self) -> set[int]:
        """Find the junctions where trains cross a road, and nothing else meets."""
        trains = {
            self._tracks.nodes[vertex]
            for section in self.sections.values()
            if section.road.kind == RAIL
            for vertex in (section.start, section.end)
        }
        arms = self._layout.arms()
        return {node for node in trains & self.junctions if len(arms.get(node, ())) <= 2}

    def nodes(self) -> Iterator[str]:
        """Write the nodes that are no road's junction."""
        for node, (x, y) in sorted(self._tracks.own.items()):
            z = self._heights.get(node, 0.0)
            yield f'<node id="{node}" x="{x:.2f}" y="{y:.2f}" z="{z:.2f}" type="priority"/>'

    def edges(self) -> Iterator[str]:
        """Write the edges; the two directions of rails on the same ground."""
        for name, section in self.sections.items():
            graph = self._tracks.graph
            heights = [[self._heights.get(node, 0.0)] for node in section.nodes]
            line = trim(np.hstack([graph.line(section), heights]), *self._tracks.built[name])
            for forward in _directions(section):
                yield from self._edge(section, line if forward else line[::-1], forward=forward)

    def _edge(self, section: Section, line: Floats, *, forward: bool) -> Iterator[str]:
        road = section.road
        lane = (road.forward if forward else road.backward)[0]
        ends = [self._tracks.nodes[vertex] for vertex in (section.start, section.end)]
        source, target = ends if forward else ends[::-1]
        shape = " ".join(f"{x:.2f},{y:.2f},{z:.2f}" for x, y, z in line)
        name = f"name={quoteattr(road.name)} " if road.name.strip() else ""
        spread = "right" if road.kind == CYCLEWAY and not road.oneway else "center"
        yield (
            f'<edge id="{_name(section.id, forward=forward)}" from="{source}" to="{target}" {name}'
            f'type="{road.kind}" priority="{_PRIORITIES[road.kind]}" numLanes="1" speed="{road.speed:.2f}" '
            f'spreadType="{spread}" shape="{shape}" allow="{_WHO[lane.use]}" '
            f'width="{lane.width or road.width:.2f}"/>'
        )

    def connections(self, walks: Mapping[str, tuple[float, float]]) -> Iterator[str]:
        """Write the ways across junctions, and where people walk over railways.

        Args:
            walks: widths of the sidewalks on the left and the right of each road, metres.
        """
        signals = self._layout.junctions.controllers
        for junction, tracks in rail_crossings(self._layout, self._tracks, walks):
            found = [
                _name(name, forward=forward)
                for name, _ in tracks
                for forward in _directions(self.sections[name])
            ]
            yield crossing_line(junction, found, signalised=junction in signals)
        seen = set()
        for link in self._tracks.links:
            seen.add((link.source.section, link.source.forward))
            (source, lane), (target, onto) = (self._place(edge, walks) for edge in (link.source, link.target))
            yield f'<connection from="{source}" to="{target}" fromLane="{lane}" toLane="{onto}"/>'
        for name, section in self.sections.items():
            for forward in _directions(section):
                if (name, forward) not in seen:
                    yield f'<connection from="{_name(name, forward=forward)}"/>'

    def _place(self, edge: Edge, walks: Mapping[str, tuple[float, float]]) -> tuple[str, int]:
        """Give the name of an edge and the index of its lane, the sidewalk counted."""
        name = _name(edge.section, forward=edge.forward)
        if edge.lane is None:
            return name, 0
        left, right = walks[edge.section]
        return name, edge.lane + bool(right if edge.forward != self._layout.graph.left_hand else left)


def _directions(section: Section) -> Iterator[bool]:
    """List the directions that a track is driven in."""
    for forward, lanes in ((True, section.road.forward), (False, section.road.backward)):
        if lanes:
            yield forward


def _name(section: str, *, forward: bool) -> str:
    return section if forward else f"-{section}"
