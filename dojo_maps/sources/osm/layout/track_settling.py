"""What of the tracks is built, when the roads' junctions have their outlines: it does not change those.

A track ends in the junction of a road that it meets, or at a node of its own. What lies inside a junction
vanishes, and is what its links follow. Where a tram runs in a street, the street's lane is taken instead.
"""

from collections.abc import Mapping
from collections.abc import Set as AbstractSet
from dataclasses import replace

import shapely

from dojo_maps.geometry.polylines import Floats
from dojo_maps.sources.osm.graph.road_graph import RoadGraph, Section, free_number
from dojo_maps.sources.osm.junctions.grouping import Groups
from dojo_maps.sources.osm.layout.arms import Layout
from dojo_maps.sources.osm.layout.track_layout import TrackLayout
from dojo_maps.sources.osm.layout.track_links import find_links
from dojo_maps.sources.osm.read.track_tags import CYCLEWAY

Grounds = Mapping[int, shapely.Geometry]
"""The ground of the roads' junctions."""


def settle_tracks(
    layout: Layout,
    outlines: Mapping[int, Floats],
    closed: AbstractSet[int] = frozenset(),
    absorbed: AbstractSet[str] = frozenset(),
) -> Layout:
    """Decide what of the tracks is built, and how they lead across junctions.

    Args:
        layout: with its tracks as they meet the roads.
        outlines: of the roads' junctions, as built without tracks, (n, 3) metres.
        closed: junctions that tracks lead over without a link.
        absorbed: tracks to make part of the junction at one of their ends.

    Returns:
        The layout with all of its tracks told; the same object where it has none.
    """
    if layout.tracks is None:
        return layout
    grounds = {
        node: shapely.make_valid(shapely.Polygon(outline[:, :2])) for node, outline in outlines.items()
    }
    graph = replace(layout.graph, sections=layout.tracks.graph.sections)
    tracks = replace(layout.tracks, graph=graph, closed=frozenset(closed))
    tracks = _part_from_closed(layout, replace(tracks, nodes=_group(tracks, grounds, absorbed)))
    layout, tracks = _split_loops(layout, tracks)
    built = {
        name: _cuts(grounds, tracks, section)
        for name, section in sorted(tracks.graph.sections.items())
        if name not in tracks.streets and tracks.nodes[section.start] != tracks.nodes[section.end]
    }
    links = find_links(layout, replace(tracks, built=built))
    entered = sorted({link.node for link in links} & outlines.keys())
    kept = {junction: outlines[junction] for junction in entered}
    return replace(layout, tracks=replace(tracks, built=built, links=links, outlines=kept))


def _group(tracks: TrackLayout, grounds: Grounds, absorbed: AbstractSet[str]) -> dict[int, int]:
    """Name the junction or the own node of each vertex; those with next to no track between them are one."""
    graph, rules = tracks.graph, tracks.graph.rules.tracks
    ends = sorted(graph.ends())
    groups = Groups({node: graph.places[node] for node in ends}, rules.widest)
    met = {node: tracks.meetings[node].junction for node in ends if node in tracks.meetings}
    of = {node: junction for node, junction in met.items() if junction not in tracks.closed}
    paved = {node: shapely.buffer(grounds[node], rules.pavement) for node in {*of.values()} & grounds.keys()}
    left = {
        name: 0.0
        if name in absorbed
        else _outside(
            graph, section, [paved[of[v]] for v in (section.start, section.end) if of.get(v) in paved]
        )
        for name, section in graph.sections.items()
        if name not in tracks.streets
    }
    for name in sorted(left, key=lambda name: (left[name], name)):
        section = graph.sections[name]
        pair = [groups.find(section.start), groups.find(section.end)]
        known = [of[node] for node in pair if node in of]
        shortest = rules.shortest if section.road.kind == CYCLEWAY else rules.shortest_rails
        if left[name] > shortest or (len(known) == 2 and known[0] != known[1]):
            continue
        if groups.join(*pair) and known:
            of[groups.find(section.start)] = known[0]
    return {node: of.get(groups.find(node), groups.find(node)) for node in ends}


def _outside(graph: RoadGraph, section: Section, grounds: list[shapely.Geometry]) -> float:
    """Measure what of a track lies outside of junctions, metres."""
    line = shapely.LineString(graph.line(section))
    for ground in grounds:
        line = line.difference(ground)
    return float(line.length)


def _part_from_closed(layout: Layout, tracks: TrackLayout) -> TrackLayout:
    """Give tracks over closed junctions nodes of their own, named as no vertex of a road is."""
    open_to = {meeting.junction for meeting in tracks.meetings.values()} - tracks.closed
    places = dict(tracks.graph.places)
    own: dict[int, int] = {}
    for home in sorted({home for home in tracks.nodes.values() if home in layout.junctions.of} - open_to):
        own[home] = free_number(places)
        places[own[home]] = places[home]
    return replace(
        tracks,
        graph=replace(tracks.graph, places=places),
        nodes={node: own.get(home, home) for node, home in tracks.nodes.items()},
    )


def _split_loops(layout: Layout, tracks: TrackLayout) -> tuple[Layout, TrackLayout]:
    """Split long tracks that lead back to their junction, for SUMO has no loops."""
    graph = tracks.graph
    loops = [
        name
        for name, section in sorted(graph.sections.items())
        if name not in tracks.streets
        and tracks.nodes[section.start] == tracks.nodes[section.end]
        and graph.length(section) > graph.rules.tracks.longest_inside
    ]
    graph, middles = graph.add_nodes((name, graph.length(graph.sections[name]) / 2) for name in loops)
    graph = graph.split_at_nodes({name: [node] for name, node in zip(loops, middles, strict=True)})
    ground = layout.ground
    for name in (name for name in loops if ground and name not in graph.sections):
        ground = ground and ground.split(name, graph.length(graph.sections[f"{name}a"]))
    own = {node: node for node in middles if node not in tracks.nodes}
    return replace(layout, ground=ground), replace(tracks, graph=graph, nodes={**tracks.nodes, **own})


def _cuts(grounds: Grounds, tracks: TrackLayout, section: Section) -> tuple[float, float]:
    """Measure how far a track is drawn back at both ends, to the border of the junctions there."""
    line, least = tracks.graph.line(section), tracks.graph.rules.tracks.beside_road
    room = max(tracks.graph.length(section) / 2 - 1.0, 0.0)
    found = []
    for ahead, vertex in ((line, section.start), (line[::-1], section.end)):
        path = shapely.LineString(ahead)
        outside = path.difference(grounds.get(tracks.nodes[vertex], shapely.Polygon()))
        pieces = [piece for piece in shapely.get_parts(outside) if piece.length > least]
        first = min((path.project(shapely.Point(piece.coords[0])) for piece in pieces), default=0.0)
        found.append(min(first, room))
    return found[0], found[1]
