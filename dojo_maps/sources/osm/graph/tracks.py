"""Tracks of trams, trains and bicycles: sections of their own beside the roads, and lanes of streets.

They are a graph beside that of the roads, on the same nodes. Where a track meets a road far from its ends,
or begins to run in it, the road is split, so that there is a junction.
"""

import itertools
from collections import defaultdict
from collections.abc import Iterable, Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np
import shapely

from dojo_maps.geometry.polylines import along
from dojo_maps.sources.osm.graph.crowding import check_crowding
from dojo_maps.sources.osm.graph.node_runs import known_runs
from dojo_maps.sources.osm.graph.projection import place_nodes
from dojo_maps.sources.osm.graph.road_graph import RoadGraph, Section, free_number
from dojo_maps.sources.osm.graph.sections import cut_sections, join_sections
from dojo_maps.sources.osm.graph.shared_nodes import Run, share_nodes
from dojo_maps.sources.osm.graph.street_tracks import StreetPart, Streets, tram_lanes
from dojo_maps.sources.osm.graph.track_encounters import find_encounters
from dojo_maps.sources.osm.read.data import OsmData
from dojo_maps.sources.osm.read.track_tags import CYCLEWAY, RAIL, read_track
from dojo_maps.sources.osm.read.way_tags import RoadTags


def add_tracks(data: OsmData, graph: RoadGraph, path: Path | str) -> RoadGraph:
    """Find an extract's tracks and split the roads for them.

    Trains are built where their track meets a road on the ground.

    Args:
        data: the extract.
        graph: its roads.
        path: named in errors.

    Returns:
        The graph with its tracks, and with the lanes that trams share; the same one where no track is near.

    Raises:
        SourceError: tracks lie on each other, or cross at far more places without a common node than streets
            do.
    """
    tags = _read_tracks(data, graph)
    runs, _ = known_runs(data, tags)
    new = sorted({node for _, run in runs for node in run} - graph.places.keys())
    places = {**graph.places, **place_nodes(graph.projection, data, new)}
    runs = _near_roads(graph, runs, places)
    if not runs:
        return graph
    check_crowding(runs, tags, places, path, graph.rules.crowding)
    runs = _with_common_nodes(graph, runs, tags, places, path)
    tracks: dict[str, Section] = {}
    for kind in sorted({road.kind for road in tags.values()}):
        cut = cut_sections([run for run in runs if tags[run[0]].kind == kind], tags)
        tracks |= join_sections({s.id: s for s in cut}, places, graph.rules.sections)
    graph = replace(
        graph,
        places=places,
        tracks=tracks,
        track_ways={way: data.ways[way] for way, _ in runs},
        tags={**graph.tags, **{node: data.nodes[node].tags for node in new if data.nodes[node].tags}},
    )
    return _split_roads(_share_streets(_orient_twins(graph)))


def neighbourhood(graph: RoadGraph) -> shapely.Polygon:
    """Outline the box around the roads within which tracks are built.

    Args:
        graph: the roads.

    Returns:
        A rectangle, metres, map frame, wider than the roads by `beyond_roads` of the rules for tracks.
    """
    at = np.array([graph.places[node] for section in graph.sections.values() for node in section.nodes])
    far = graph.rules.tracks.beyond_roads
    return shapely.box(*(at.min(axis=0) - far), *(at.max(axis=0) + far))


def _read_tracks(data: OsmData, graph: RoadGraph) -> dict[int, RoadTags]:
    """Read the ways that are tracks, and no roads."""
    on_roads = {node for section in graph.sections.values() for node in section.nodes}
    found = {
        way: road
        for way, record in data.ways.items()
        if way not in graph.ways and (road := read_track(record.tags)) is not None
    }
    return {
        way: road
        for way, road in found.items()
        if road.kind != RAIL or not on_roads.isdisjoint(data.ways[way].nodes)
    }


def _near_roads(graph: RoadGraph, runs: Iterable[Run], places: dict[int, tuple[float, float]]) -> list[Run]:
    """Cut tracks at the border of the roads' neighbourhood; nodes there are added to the places."""
    box = neighbourhood(graph)
    found: list[Run] = []
    for way, nodes in runs:
        inside = shapely.contains_xy(box, np.array([places[node] for node in nodes]))
        kept: list[int] = []
        for index, node in enumerate(nodes):
            if index and inside[index] != inside[index - 1]:
                border = shapely.LineString([places[n] for n in nodes[index - 1 : index + 1]])
                x, y = border.intersection(box.exterior).coords[0]
                kept.append(free_number(places))
                places[kept[-1]] = (round(x, 3), round(y, 3))
                found += [(way, tuple(kept))] if inside[index - 1] else []
                kept = kept if inside[index] else []
            kept += [node] if inside[index] else []
        found.append((way, tuple(kept)))
    return [run for run in found if len(run[1]) > 1]


def _with_common_nodes(
    graph: RoadGraph,
    runs: list[Run],
    tags: Mapping[int, RoadTags],
    places: dict[int, tuple[float, float]],
    path: Path | str,
) -> list[Run]:
    """Give tracks a node where they cross each other or a road on the ground; roads keep their own."""
    sections = [section for _, section in sorted(graph.sections.items())]
    roads = {section.ways[0]: section.road for section in sections}
    # Tracks count as two-way here: one-way roads that cross each other are left alone.
    roads |= {
        way: replace(road, forward=(*road.forward, *road.backward), backward=(*road.forward, *road.backward))
        for way, road in tags.items()
    }
    both = [*((section.ways[0], section.nodes) for section in sections), *runs]
    return share_nodes(both, roads, places, path, graph.rules.sections)[0][len(sections) :]


def _orient_twins(graph: RoadGraph) -> RoadGraph:
    """Make the two rails of a line one-way, as its traffic keeps to a side, where nothing is said."""
    tracks = dict(graph.tracks)
    names = [name for name in sorted(tracks) if tracks[name].road.kind != CYCLEWAY]
    lines = [shapely.LineString(graph.line(tracks[name])) for name in names]
    tree = shapely.STRtree(lines)
    for number, name in enumerate(names):
        section = tracks[name]
        side = 0 if section.road.oneway else _twin_side(tree, number, graph.rules.tracks.twin)
        if side:
            driven = section if (side > 0) != graph.left_hand else section.flipped()
            tracks[name] = replace(driven, road=replace(driven.road, backward=()))
    return replace(graph, tracks=tracks)


def _twin_side(tree: shapely.STRtree, number: int, farthest: float) -> int:
    """Tell on which side of a track another runs along most of it: 1 left, -1 right, 0 none."""
    line = tree.geometries[number]
    count = max(3, int(line.length / 10))
    at = (np.arange(count) + 0.5) / count * line.length
    ahead = shapely.get_coordinates(line.interpolate(np.minimum(at + 0.5, line.length)))
    behind = shapely.get_coordinates(line.interpolate(np.maximum(at - 0.5, 0.0)))
    way = (ahead - behind) / np.maximum(np.hypot(*(ahead - behind).T), 1e-9)[:, None]
    aside = np.column_stack([-way[:, 1], way[:, 0]])
    beside = {}
    for side in (1, -1):
        places = [(ahead + behind) / 2 + side * reach * aside for reach in (1.0, farthest)]
        rays = shapely.linestrings(np.stack(places, axis=1))
        ray, other = tree.query(rays, predicate="intersects")
        beside[side] = len(np.unique(ray[other != number]))
    best = max((1, -1), key=beside.__getitem__)
    return best if beside[best] * 2 > count and beside[-best] * 2 <= count else 0


def _share_streets(graph: RoadGraph) -> RoadGraph:
    """Split streets where a tram begins to run in them, and let it share their lanes."""
    cuts: dict[str, list[float]] = defaultdict(list)
    for track, part in _street_parts(graph):
        street, own = (shapely.LineString(graph.line(s)) for s in (graph.sections[part.street], track))
        cuts[part.street] += [street.project(own.interpolate(at)) for at in (part.start, part.end)]
    graph = _split_at(graph, cuts)
    covered: dict[tuple[str, bool, int], float] = defaultdict(float)
    for track, part in _street_parts(graph):
        for forward, number in tram_lanes(graph, track, part):
            covered[part.street, forward, number] += part.end - part.start
    sections = dict(graph.sections)
    for (name, forward, number), metres in sorted(covered.items()):
        section = sections[name]
        if metres >= graph.rules.tracks.street_share * graph.length(section):
            sections[name] = replace(section, road=_with_tram(section.road, number, forward=forward))
    return replace(graph, sections=sections)


def _street_parts(graph: RoadGraph) -> list[tuple[Section, StreetPart]]:
    streets = Streets(graph, graph.sections.values())
    return [(track, part) for _, track in sorted(graph.tracks.items()) for part in streets.parts(track)]


def _with_tram(road: RoadTags, number: int, *, forward: bool) -> RoadTags:
    lanes = list(road.forward if forward else road.backward)
    lanes[number] = replace(lanes[number], tram=True)
    return replace(road, forward=tuple(lanes)) if forward else replace(road, backward=tuple(lanes))


def _split_at(graph: RoadGraph, wanted: Mapping[str, Iterable[float]]) -> RoadGraph:
    """Split roads at places along them that are far from their ends and from each other."""
    least = graph.rules.tracks.from_road_end
    chosen = []
    for name, places in sorted(wanted.items()):
        length, last = graph.length(graph.sections[name]), 0.0
        for place in sorted(places):
            if place - last > least and length - place > least:
                chosen.append((name, place))
                last = place
    graph, nodes = graph.add_nodes(chosen)
    cuts: dict[str, list[int]] = defaultdict(list)
    for (name, _), node in zip(chosen, nodes, strict=True):
        cuts[name].append(node)
    return graph.split_at_nodes(cuts)


def _split_roads(graph: RoadGraph) -> RoadGraph:
    """Split roads where a track meets them, far from their ends and from where people cross."""
    met: dict[str, list[float]] = defaultdict(list)
    encounters = find_encounters(graph, graph.tracks.values())
    for street, place in itertools.chain.from_iterable(encounters.values()):
        if not _is_near_crossing(graph, street, place):
            met[street].append(place)
    return _split_at(graph, met)


def _is_near_crossing(graph: RoadGraph, name: str, place: float) -> bool:
    """Tell whether people cross a road near a place: there is a junction there then, or one reaches there."""
    section, least = graph.sections[name], graph.rules.tracks.from_crossing
    at = along(graph.line(section))
    near = (n for n, metres in zip(section.nodes, at, strict=True) if abs(metres - place) < least)
    tags = [graph.tags.get(node, {}) for node in near]
    return any(found.get("highway") == "crossing" or "crossing" in found for found in tags)
