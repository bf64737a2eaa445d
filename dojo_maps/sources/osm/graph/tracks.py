"""Tracks of trams, trains and bicycles: sections of their own beside the roads, and lanes of streets.

They are a graph beside that of the roads, on the same nodes. Where a track meets a road far from its ends,
or begins to run in it, the road is split, so that there is a junction.
"""

from collections import defaultdict
from collections.abc import Iterable, Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np
import pyproj
import shapely

from dojo_maps.geometry.polylines import Floats, along
from dojo_maps.sources.osm.graph.crowding import check_crowding
from dojo_maps.sources.osm.graph.node_runs import known_runs
from dojo_maps.sources.osm.graph.road_graph import RoadGraph, Section, cut_sections, join_sections
from dojo_maps.sources.osm.graph.shared_nodes import Run, share_nodes
from dojo_maps.sources.osm.graph.street_tracks import StreetPart, Streets, tram_lanes
from dojo_maps.sources.osm.read.data import OsmData
from dojo_maps.sources.osm.read.track_tags import CYCLEWAY, RAIL, read_track
from dojo_maps.sources.osm.read.way_tags import RoadTags

_FAR = 100.0
"""Metres beyond the roads' bounds up to which tracks are built."""
_BORDER = 30.0
"""Metres from a road's end within which a track that meets it is part of the junction there."""
_SHARE = 0.5
"""Of a road that a tram must run in so that it shares its lanes."""
_TWIN = 6.5
"""Metres between the two tracks of a line, at most."""
_CROSSING = 15.0
"""Metres between a track and people who cross the same road, within which they cross at one junction."""
_ON_ROAD = 0.6
"""Metres between a node of a track and the line of the road that it lies on."""
_AHEAD, _SAME = 5.0, 0.1
"""Metres over which the heading of a track or road is taken, and below which there is none."""
_ALONG = 0.93
"""Least cosine of the angle between a track and the road that it runs along."""


def add_tracks(data: OsmData, graph: RoadGraph, path: Path | str) -> None:
    """Find an extract's tracks and split the roads for them.

    Trains are built where their track meets a road on the ground.

    Raises:
        SourceError: tracks lie on each other.
    """
    on_roads = graph.positions()
    tags = {way: road for way, found in data.ways.items() if (road := read_track(found.tags)) is not None}
    tags = {
        way: road
        for way, road in tags.items()
        if way not in graph.ways
        and (road.kind != RAIL or any(node in on_roads for node in data.ways[way].nodes))
    }
    runs, _ = known_runs(data, tags)
    _project(data, graph, runs)
    runs = _near_roads(graph, runs)
    check_crowding(runs, tags, graph.places, path)
    runs = _with_common_nodes(graph, runs, tags, path)
    sections: dict[str, Section] = {}
    for kind in sorted({road.kind for road in tags.values()}):
        alone = replace(graph, sections={})
        cut_sections(alone, [run for run in runs if tags[run[0]].kind == kind], tags)
        while join_sections(alone):
            pass
        sections |= alone.sections
    graph.tracks = replace(graph, sections=sections, ways=frozenset(way for way, _ in runs))
    _orient_twins(graph, graph.tracks)
    _share_streets(graph, graph.tracks)
    _split_roads(data, graph, graph.tracks)


def _project(data: OsmData, graph: RoadGraph, runs: Iterable[Run]) -> None:
    """Lay the nodes that are no road's into the plane."""
    new = sorted({node for _, run in runs for node in run} - graph.places.keys())
    if not new:
        return
    lon, lat = (np.array([getattr(data.nodes[node], key) for node in new]) for key in ("lon", "lat"))
    x, y = pyproj.Proj(graph.proj)(lon, lat)
    for node, a, b in zip(new, x, y, strict=True):
        graph.places[node] = (
            round(float(a) + graph.offset[0], 3),
            round(float(b) + graph.offset[1], 3),
        )


def neighbourhood(graph: RoadGraph) -> shapely.Polygon:
    """Outline the box around the roads within which tracks are built."""
    at = np.array([graph.places[node] for section in graph.sections.values() for node in section.nodes])
    return shapely.box(*(at.min(axis=0) - _FAR), *(at.max(axis=0) + _FAR))


def _near_roads(graph: RoadGraph, runs: Iterable[Run]) -> list[Run]:
    """Cut tracks at the border of the roads' neighbourhood."""
    box = neighbourhood(graph)
    found: list[Run] = []
    for way, nodes in runs:
        inside = shapely.contains_xy(box, np.array([graph.places[node] for node in nodes]))
        kept: list[int] = []
        for index, node in enumerate(nodes):
            if index and inside[index] != inside[index - 1]:
                border = shapely.LineString([graph.places[n] for n in nodes[index - 1 : index + 1]])
                x, y = border.intersection(box.exterior).coords[0]
                kept.append(graph.add_node((round(x, 3), round(y, 3))))
                found += [(way, tuple(kept))] if inside[index - 1] else []
                kept = kept if inside[index] else []
            kept += [node] if inside[index] else []
        found.append((way, tuple(kept)))
    return [run for run in found if len(run[1]) > 1]


def _with_common_nodes(
    graph: RoadGraph, runs: list[Run], tags: Mapping[int, RoadTags], path: Path | str
) -> list[Run]:
    """Give tracks a node where they cross each other or a road on the ground; roads keep their own."""
    names = sorted(graph.sections)
    both = [(number, graph.sections[name].nodes) for number, name in enumerate(names)]
    both += [(len(names) + number, nodes) for number, (_, nodes) in enumerate(runs)]
    roads = {number: graph.sections[name].road for number, name in enumerate(names)}
    # Tracks count as two-way here: one-way roads that cross each other are left alone.
    roads |= {
        len(names) + number: replace(tags[way], forward=tags[way].forward or tags[way].backward,
                                     backward=tags[way].backward or tags[way].forward)
        for number, (way, _) in enumerate(runs)
    }  # fmt: skip
    shared, _ = share_nodes(both, roads, graph.places, path)
    return [(way, nodes) for (way, _), (_, nodes) in zip(runs, shared[len(names) :], strict=True)]


def _orient_twins(graph: RoadGraph, tracks: RoadGraph) -> None:
    """Make the two rails of a line one-way, as its traffic keeps to a side, where nothing is said."""
    names = [name for name in sorted(tracks.sections) if tracks.sections[name].road.kind != CYCLEWAY]
    lines = [shapely.LineString(tracks.line(tracks.sections[name])) for name in names]
    tree = shapely.STRtree(lines)
    for number, name in enumerate(names):
        section = tracks.sections[name]
        if section.road.oneway:
            continue
        side = _twin_side(lines, tree, number)
        if side:
            along_it = (side > 0) != graph.left_hand
            driven = section if along_it else section.flipped()
            tracks.sections[name] = replace(driven, road=replace(driven.road, backward=()))


def _twin_side(lines: list[shapely.LineString], tree: shapely.STRtree, number: int) -> int:
    """Tell on which side of a track another runs along most of it: 1 left, -1 right, 0 none."""
    line = lines[number]
    count = max(3, int(line.length / 10))
    at = (np.arange(count) + 0.5) / count * line.length
    ahead = shapely.get_coordinates(line.interpolate(np.minimum(at + 0.5, line.length)))
    behind = shapely.get_coordinates(line.interpolate(np.maximum(at - 0.5, 0.0)))
    way = (ahead - behind) / np.maximum(np.hypot(*(ahead - behind).T), 1e-9)[:, None]
    sides = [0]
    for place, heading in zip((ahead + behind) / 2, way, strict=True):
        aside = np.array([-heading[1], heading[0]])
        ray = {
            side: shapely.LineString([place + side * aside, place + side * _TWIN * aside]) for side in (1, -1)
        }
        sides += [
            side for side, reach in ray.items() if any(k != number for k in tree.query(reach, "intersects"))
        ]
    best = max((1, -1), key=sides.count)
    return best if sides.count(best) * 2 > count and sides.count(-best) * 2 <= count else 0


def _share_streets(graph: RoadGraph, tracks: RoadGraph) -> None:
    """Split streets where a tram begins to run in them, and let it share their lanes."""
    cuts: dict[str, list[float]] = defaultdict(list)
    for _, track, part in _street_parts(graph, tracks):
        line = shapely.LineString(graph.line(graph.sections[part.street]))
        own = shapely.LineString(tracks.line(track))
        cuts[part.street] += [line.project(own.interpolate(at)) for at in (part.start, part.end)]
    for name, places in sorted(cuts.items()):
        _split_at(graph, name, places)
    covered: dict[tuple[str, bool, int], float] = defaultdict(float)
    for _, track, part in _street_parts(graph, tracks):
        street = graph.sections[part.street].road
        for lane in tram_lanes(street, track.road, part, left_hand=graph.left_hand):
            covered[part.street, *lane] += part.end - part.start
    for (name, forward, number), metres in sorted(covered.items()):
        section = graph.sections[name]
        if metres >= _SHARE * graph.length(section):
            graph.sections[name] = replace(section, road=_with_tram(section.road, number, forward=forward))


def _street_parts(graph: RoadGraph, tracks: RoadGraph) -> list[tuple[str, Section, StreetPart]]:
    streets = Streets(graph, graph.sections)
    return [
        (name, tracks.sections[name], part)
        for name in sorted(tracks.sections)
        for part in streets.parts(tracks.sections[name])
    ]


def _with_tram(road: RoadTags, number: int, *, forward: bool) -> RoadTags:
    lanes = list(road.forward if forward else road.backward)
    lanes[number] = replace(lanes[number], tram=True)
    return replace(road, forward=tuple(lanes)) if forward else replace(road, backward=tuple(lanes))


def _split_at(graph: RoadGraph, name: str, places: Iterable[float]) -> None:
    """Split a road at places along it that are far from its ends and from each other."""
    length = graph.length(graph.sections[name])
    taken = [0.0, length]
    rest, start = name, 0.0
    for place in sorted(places):
        if place - taken[-2] > _BORDER and length - place > _BORDER:
            taken.insert(-1, place)
            index = graph.insert_node(rest, place - start)
            graph.split(rest, index)
            rest, start = f"{rest}b", place


def _split_roads(data: OsmData, graph: RoadGraph, tracks: RoadGraph) -> None:
    """Split roads where a track meets them, far from their ends and from where people cross."""
    met: dict[str, list[float]] = defaultdict(list)
    roads = Roads(graph)
    for name in sorted(tracks.sections):
        track = tracks.sections[name]
        for index in range(len(track.nodes)):
            for street, place in roads.met_by(track, index):
                if not _is_near_crossing(data, graph, street, place):
                    met[street].append(place)
    for street, places in sorted(met.items()):
        _split_at(graph, street, places)


def _is_near_crossing(data: OsmData, graph: RoadGraph, name: str, place: float) -> bool:
    """Tell whether people cross a road near a place: there is a junction there then, or one reaches there."""
    section = graph.sections[name]
    at = along(graph.line(section))
    near = (n for n, metres in zip(section.nodes, at, strict=True) if abs(metres - place) < _CROSSING)
    tags = [data.nodes[node].tags for node in near if node in data.nodes]
    return any(found.get("highway") == "crossing" or "crossing" in found for found in tags)


class Roads:
    """Finds the roads that tracks meet."""

    def __init__(self, graph: RoadGraph) -> None:
        self._graph = graph
        self._names = sorted(graph.sections)
        self._lines = [shapely.LineString(graph.line(graph.sections[name])) for name in self._names]
        self._tree = shapely.STRtree(self._lines)

    def met_by(self, track: Section, index: int) -> list[tuple[str, float]]:
        """List the roads that a track meets at a node and leaves to a side; and the metres along each."""
        node = track.nodes[index]
        point = shapely.Point(self._graph.places[node])
        found = []
        for number in sorted(self._tree.query(point, "dwithin", distance=_ON_ROAD)):
            section = self._graph.sections[self._names[number]]
            if node not in section.nodes and section.road.layer != track.road.layer:
                continue
            place = float(self._lines[number].project(point))
            if self._leaves(track, index, number, place):
                found.append((section.id, place))
        return found

    def _leaves(self, track: Section, index: int, number: int, place: float) -> bool:
        path = shapely.LineString(self._graph.line(track))
        at = float(along(self._graph.line(track))[index])
        roads = _headings(self._lines[number], place)
        return any(all(float(a @ b) < _ALONG for b in roads) for a in _headings(path, at))


def _headings(line: shapely.LineString, place: float) -> list[Floats]:
    """Give the unit vectors from a place on a line to where it comes from and goes."""
    here = shapely.get_coordinates(line.interpolate(place))[0]
    others = [max(place - _AHEAD, 0.0), min(place + _AHEAD, line.length)]
    ways = [shapely.get_coordinates(line.interpolate(other))[0] - here for other in others]
    return [way / float(np.hypot(*way)) for way in ways if float(np.hypot(*way)) > _SAME]
