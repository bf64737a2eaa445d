"""Where tracks meet roads: they are cut there, the roads drawn back, and signals near hold for both."""

import math
from collections import Counter, defaultdict
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace

import shapely

from dojo_maps.geometry.polylines import along
from dojo_maps.sources.osm.graph.road_graph import RoadGraph, Section
from dojo_maps.sources.osm.graph.street_tracks import StreetPart, Streets, tram_lanes
from dojo_maps.sources.osm.graph.track_encounters import find_encounters
from dojo_maps.sources.osm.layout.arms import Arm, Layout
from dojo_maps.sources.osm.layout.track_layout import Meeting, TrackLayout

Parts = Mapping[str, Sequence[StreetPart]]
"""By track: what of it runs in streets."""


def meet_roads(layout: Layout) -> Layout:
    """Cut tracks where they meet roads and each other, and draw the roads back for them.

    Args:
        layout: with its crossings at their arms.

    Returns:
        The layout with its tracks, these cuts, and signals where tracks cross; the same object where it has
        none.
    """
    if not layout.graph.tracks:
        return layout
    parts = _shared_parts(layout)
    graph, meetings = _with_part_ends(layout, parts)
    layout = replace(layout, graph=replace(layout.graph, places=graph.places))
    encounters = find_encounters(layout.graph, graph.sections.values())
    ends, cuts = layout.graph.ends(), dict(layout.cuts)
    uses = Counter(node for section in graph.sections.values() for node in section.nodes)
    cut_at: dict[str, list[int]] = {}
    for name, section in sorted(graph.sections.items()):
        cut_at[name] = list(meetings[name])
        for index in _outside(graph, section, parts[name]):
            node = section.nodes[index]
            meeting = _at_vertex(layout, ends, node) or _on_road(
                layout, cuts, section, encounters.get((name, index), ())
            )
            if meeting is not None:
                meetings[name][node] = meeting
            if meeting is not None or uses[node] > 1:
                cut_at[name].append(node)
    graph = graph.split_at_nodes(cut_at)
    streets = {piece: part for name, found in parts.items() for piece, part in _pieces_in(graph, name, found)}
    known = {node: meeting for found in meetings.values() for node, meeting in found.items()}
    tracks = TrackLayout(graph=graph, meetings=known, streets=streets)
    return _with_signals(replace(layout, cuts=cuts, tracks=tracks))


def _shared_parts(layout: Layout) -> dict[str, list[StreetPart]]:
    """Find the parts of tracks in streets with lanes for a tram in the directions of the track."""
    graph = layout.graph
    streets = Streets(graph, [s for name, s in graph.sections.items() if name not in layout.inner])

    def shares(track: Section, part: StreetPart) -> bool:
        street = graph.sections[part.street]
        lanes = tram_lanes(graph, track, part)
        return bool(lanes) and all(street.lanes_towards(end=forward)[k].tram for forward, k in lanes)

    return {
        name: [part for part in streets.parts(track) if shares(track, part)]
        for name, track in sorted(graph.tracks.items())
    }


def _with_part_ends(layout: Layout, parts: Parts) -> tuple[RoadGraph, dict[str, dict[int, Meeting]]]:
    """Give tracks nodes where they leave streets; by track and node, the junctions there."""
    wanted = [
        (name, part, metres)
        for name, found in parts.items()
        for part in found
        for metres in (part.start, part.end)
    ]
    graph, nodes = layout.graph.of_tracks().add_nodes((name, metres) for name, _, metres in wanted)
    meetings: dict[str, dict[int, Meeting]] = defaultdict(dict)
    for (name, part, _), node in zip(wanted, nodes, strict=True):
        street = layout.graph.sections[part.street]
        line = shapely.LineString(layout.graph.line(street))
        before = line.project(shapely.Point(graph.places[node])) < line.length / 2
        meetings[name][node] = Meeting(junction=layout.junctions.of[street.start if before else street.end])
    return graph, meetings


def _outside(graph: RoadGraph, section: Section, parts: Sequence[StreetPart]) -> list[int]:
    """Number the nodes of a track that lie in no street."""
    at = along(graph.line(section))
    return [
        index
        for index in range(len(section.nodes))
        if not any(part.start + 0.5 < at[index] < part.end - 0.5 for part in parts)
    ]


def _at_vertex(layout: Layout, ends: dict[int, list[str]], node: int) -> Meeting | None:
    if node not in layout.junctions.of:
        return None
    sections = [layout.graph.sections[name] for name in sorted(ends[node]) if name not in layout.inner]
    arms = tuple(Arm(section.id, section.end == node) for section in sections)
    return Meeting(junction=layout.junctions.of[node], arms=arms)


def _on_road(
    layout: Layout, cuts: dict[Arm, float], track: Section, found: Sequence[tuple[str, float]]
) -> Meeting | None:
    """Take the junction at the nearer end of the road that a track meets; the road is drawn back to there."""
    if not found:
        return None
    name, place = found[0]
    section = layout.graph.sections[name]
    if name in layout.inner:
        return Meeting(junction=layout.junctions.of[section.start])
    rules, rest = layout.rules.tracks, layout.graph.length(section) - place
    arm = Arm(name, rest < place)
    metres = min(place, rest) + track.road.drives / 2 + rules.beside_road
    cuts[arm] = max(cuts.get(arm, 0.0), min(metres, layout.room(arm, cuts, left=rules.road_left)))
    return Meeting(junction=layout.junction(arm), arms=(arm,))


def _pieces_in(graph: RoadGraph, name: str, parts: Sequence[StreetPart]) -> Iterator[tuple[str, StreetPart]]:
    """List the pieces of a track that was split, as far as they run in streets."""
    pieces = []
    while f"{name}a" in graph.sections:
        pieces.append(f"{name}a")
        name += "b"
    start = 0.0
    for piece in (*pieces, name):
        length = graph.length(graph.sections[piece])
        yield from ((piece, part) for part in parts if part.start < start + length / 2 < part.end)
        start += length


def _with_signals(layout: Layout) -> Layout:
    """Give signals to where tracks cross roads: their own, and those near that are of no junction."""
    junctions, graph = layout.junctions, layout.graph
    farthest = layout.rules.tracks.stray_signal
    signals = dict(junctions.signals)
    for node, meeting in sorted(layout.tracks.meetings.items() if layout.tracks else ()):
        near = [s for s in junctions.stray if math.dist(graph.places[s], graph.places[node]) < farthest]
        if graph.tags.get(node, {}).get("highway") == "traffic_signals":
            near.append(node)
        if near and meeting.junction not in signals:
            signals[meeting.junction] = near
    return replace(layout, junctions=replace(junctions, signals=signals))
