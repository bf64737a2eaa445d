"""Tracks as plain XML: their edges and nodes, and the ways of trams and bicycles across junctions."""

from collections.abc import Iterator
from dataclasses import replace
from xml.sax.saxutils import quoteattr

import numpy as np

from dojo_maps.geometry.polylines import Floats
from dojo_maps.sources.osm.graph.edge_id import EdgeId
from dojo_maps.sources.osm.graph.road_graph import Section
from dojo_maps.sources.osm.layout.arms import Layout, trim
from dojo_maps.sources.osm.layout.heights import clear_by_nature, compute_heights
from dojo_maps.sources.osm.layout.track_layout import TrackEdge, TrackLayout
from dojo_maps.sources.osm.plain.rail_crossings import crossing_line, rail_crossings
from dojo_maps.sources.osm.read.track_tags import CYCLEWAY, RAIL, TRAM

_WHO = {
    CYCLEWAY: "pedestrian bicycle",
    TRAM: "pedestrian tram",
    RAIL: "rail_urban rail rail_electric rail_fast",
}
"""Vehicle classes of SUMO's. People are let onto all tracks of bicycles and trams, so that pavements lead
over them; netconvert knows a railway by nobody but trains using it."""
NO_WAIT_INSIDE = ' contPos="0"'
"""Of a connection: who waits on it does so before the junction, where it is in nobody's way."""
_PRIORITIES = {CYCLEWAY: 1, TRAM: 20, RAIL: 21}
"""Bicycles on tracks give way to roads, roads to rails."""


class TrackEdges:
    """Writes the tracks of a layout; none where they are not settled."""

    def __init__(self, layout: Layout) -> None:
        self._layout = layout
        self._tracks = layout.tracks or TrackLayout(graph=layout.graph, meetings={}, streets={})
        self._sections = {name: self._tracks.graph.sections[name] for name in sorted(self._tracks.built)}
        self._lines = self._lift() if self._sections else {}

    def _lift(self) -> dict[str, Floats]:
        """Give each track's line, (n, 3) metres, with the ground under it, bridges and tunnels."""
        layout, ground = self._layout, self._layout.ground
        both = replace(self._tracks.graph, sections={**layout.graph.sections, **self._sections})
        both, heights = compute_heights(both, clear_by_nature(both, ground) if ground else frozenset())
        heights |= layout.heights
        lines = {}
        for name in self._sections:
            nodes = both.sections[name].nodes
            line = np.array([(*both.places[node], heights.get(node, 0.0)) for node in nodes])
            lines[name] = ground.under(name, line) if ground else line
        return lines

    @property
    def junctions(self) -> set[int]:
        """The junctions of roads that tracks lead into."""
        return {link.node for link in self._tracks.links} & self._layout.junctions.of.keys()

    def rail_crossings(self) -> set[int]:
        """Find the junctions where trains cross a road, and nothing else meets."""
        trains = {
            self._tracks.nodes[vertex]
            for section in self._sections.values()
            if section.road.kind == RAIL
            for vertex in (section.start, section.end)
        }
        arms = self._layout.arms() if trains else {}
        return {node for node in trains & self.junctions if len(arms.get(node, ())) <= 2}

    def nodes(self) -> Iterator[str]:
        """Write the nodes that are no road's junction."""
        heights = {
            self._tracks.nodes[vertex]: float(line[end, 2])
            for name, line in self._lines.items()
            for end, vertex in ((0, self._sections[name].start), (-1, self._sections[name].end))
        }
        for node in sorted(heights.keys() - self._layout.junctions.of.keys()):
            (x, y), z = self._tracks.graph.places[node], heights[node]
            yield f'<node id="{node}" x="{x:.2f}" y="{y:.2f}" z="{z:.2f}" type="priority"/>'

    def edges(self) -> Iterator[str]:
        """Write the edges; the two directions of rails on the same ground."""
        for name, section in self._sections.items():
            line = trim(self._lines[name], *self._tracks.built[name])
            for edge in _directions(section):
                yield self._edge(edge, section, line if edge.forward else line[::-1])

    def _edge(self, edge: EdgeId, section: Section, line: Floats) -> str:
        road = section.road
        (lane,) = section.lanes_towards(end=edge.forward)
        ends = [self._tracks.nodes[vertex] for vertex in (section.start, section.end)]
        source, target = ends if edge.forward else ends[::-1]
        shape = " ".join(f"{x:.2f},{y:.2f},{z:.2f}" for x, y, z in line)
        name = f"name={quoteattr(road.name)} " if road.name.strip() else ""
        spread = "right" if road.kind == CYCLEWAY and not road.oneway else "center"
        return (
            f'<edge id="{edge}" from="{source}" to="{target}" {name}'
            f'type="{road.kind}" priority="{_PRIORITIES[road.kind]}" numLanes="1" speed="{road.speed:.2f}" '
            f'spreadType="{spread}" shape="{shape}" allow="{_WHO[road.kind]}" '
            f'width="{lane.width or road.width:.2f}"/>'
        )

    def connections(self) -> Iterator[str]:
        """Write the ways across junctions, and where people walk over railways."""
        for junction, tracks in rail_crossings(self._layout, self._tracks):
            found = [str(edge) for name in tracks for edge in _directions(self._sections[name])]
            yield crossing_line(self._layout, junction, found)
        for link in self._tracks.links:
            track = self._sections.get(link.source.edge.section)
            more = NO_WAIT_INSIDE if track is not None and track.road.kind == CYCLEWAY else ""
            yield (
                f'<connection from="{link.source.edge}" to="{link.target.edge}" '
                f'fromLane="{self._lane(link.source)}" toLane="{self._lane(link.target)}"{more}/>'
            )
        leading_on = {link.source.edge for link in self._tracks.links}
        for section in self._sections.values():
            for edge in _directions(section):
                if edge not in leading_on:
                    yield f'<connection from="{edge}"/>'

    def _lane(self, driven: TrackEdge) -> int:
        """Give the index of a lane, the sidewalk counted."""
        return driven.lane + bool(self._layout.walk(driven.edge)) if driven.lane >= 0 else 0


def _directions(section: Section) -> Iterator[EdgeId]:
    """List the edges that a track is driven on."""
    for forward in (True, False):
        if section.lanes_towards(end=forward):
            yield EdgeId(section.id, forward)
