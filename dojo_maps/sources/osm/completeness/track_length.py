"""How much of the source's tracks and lanes was built, by kind: rails, cycle tracks, lanes of roads."""

import itertools
import math
from collections import Counter, defaultdict
from typing import Any

import numpy as np
import shapely

from dojo_maps.description import LaneKind
from dojo_maps.geometry.pieces import lane_strips
from dojo_maps.issue import Issue, Severity
from dojo_maps.sources.osm.completeness.losses import Left, loss, share_of
from dojo_maps.sources.osm.graph.projection import way_line
from dojo_maps.sources.osm.graph.tracks import neighbourhood
from dojo_maps.sources.osm.network.osm_network import OsmNetwork
from dojo_maps.sources.osm.read.data import OsmData
from dojo_maps.sources.osm.read.track_tags import CYCLEWAY, RAIL, TRAM, track_kind
from dojo_maps.sources.osm.read.way_tags import RoadTags, read_road

_NAMES = {TRAM: "tram", RAIL: "rail", CYCLEWAY: "cycleway"}


def measure_tracks(data: OsmData, network: OsmNetwork) -> tuple[dict[str, Any], list[Issue]]:
    """Measure the mapped tracks against the built ones, and the lanes that roads are tagged with.

    Args:
        data: the extract.
        network: as it was built from it.

    Returns:
        Metres kept, of how many, by kind; and an issue for each kind of track that lacks some.
    """
    graph, rules = network.layout.graph, network.layout.rules.completeness
    floors = {kind: _floor(network, kind) for kind in _NAMES}
    kept: dict[str, float] = defaultdict(float)
    total: dict[str, float] = defaultdict(float)
    lost: dict[str, Left] = defaultdict(Left)
    far: dict[str, Left] = defaultdict(Left)
    near = neighbourhood(graph)
    for way, record in sorted(graph.track_ways.items()):
        kind, whole = track_kind(record.tags), way_line(graph.projection, data, record)
        if kind is None or whole is None:
            continue
        line = whole.intersection(near)
        if line.length < whole.length - rules.road_lost:
            far[kind].add(way, whole.difference(near))
        shapes, tree = floors[kind]
        rest = line.difference(shapely.union_all(shapes[tree.query(line)]))
        total[kind] += line.length
        kept[kind] += line.length - rest.length
        if rest.length > rules.road_lost:
            lost[kind].add(way, rest)
    issues = [
        loss(
            "osm.track_lost", f"{left.metres:.0f} m of {kind} are not built, most of them here",
            ("way", left.way), left.place,
            "look whether it vanished in a junction; draw it in netedit if it is missing",
            severity=Severity.WARNING if left.metres > rules.class_lost else Severity.NOTE,
            measured=round(left.metres, 1), limit=rules.class_lost,
        )
        for kind, left in sorted(lost.items())
    ]  # fmt: skip
    issues += [
        loss(
            "osm.track_lost", f"{left.metres:.0f} m of {kind} lead far beyond the roads, and are left out",
            ("way", left.way), left.place, "choose a larger area", severity=Severity.NOTE,
            measured=round(left.metres, 1),
        )
        for kind, left in sorted(far.items())
    ]  # fmt: skip
    issues += [
        loss(
            "osm.track_lost", "tracks lead over a junction without a link to it: its roads are too short",
            ("node", junction), graph.places[junction], "join them in netedit", severity=Severity.NOTE,
        )
        for junction in sorted(network.layout.tracks.closed if network.layout.tracks is not None else ())
    ]  # fmt: skip
    tracks = {_NAMES[kind]: share_of((round(kept[kind]), round(total[kind]))) for kind in sorted(total)}
    return {"track_metres": tracks, "lane_metres": _measure_lanes(network)}, issues


def _floor(network: OsmNetwork, kind: str) -> tuple[np.ndarray, shapely.STRtree]:
    """Find the ground of the lanes that a kind of track may be built as, and of junctions."""
    road_map = network.road_map
    fitting = {
        TRAM: lambda lane: "tram" in lane.allow,
        RAIL: lambda lane: "rail" in lane.allow,
        CYCLEWAY: lambda lane: lane.kind is LaneKind.BICYCLE,
    }
    lanes = [lane for lane in road_map.lanes if fitting[kind](lane)]
    junctions = [
        shapely.make_valid(shapely.Polygon(junction.polygon[:, :2]))
        for junction in road_map.junctions
        if len(junction.polygon) > 2
    ]
    beside = network.layout.rules.completeness.track_found
    shapes = shapely.buffer(np.array([*lane_strips(lanes), *junctions], dtype=object), beside)
    return shapes, shapely.STRtree(shapes)


def _measure_lanes(network: OsmNetwork) -> dict[str, Any]:
    """Measure the lanes of roads, as tagged and as their sections have them, by who they are for."""
    graph = network.layout.graph
    tagged: dict[int, Counter[str]] = {}
    kept: dict[str, float] = defaultdict(float)
    total: dict[str, float] = defaultdict(float)
    for section in graph.sections.values():
        built = _count(section.road)
        for way, pair in zip(section.ways, itertools.pairwise(section.nodes), strict=True):
            if way not in tagged:
                road, _ = read_road(
                    graph.ways[way].tags, graph.country, service=True, rules=graph.rules.lanes
                )
                tagged[way] = Counter() if road is None else _count(road)
            metres = math.dist(*(graph.places[node] for node in pair))
            for use, count in tagged[way].items():
                total[use] += count * metres
                kept[use] += min(count, built[use]) * metres
    return {use: share_of((round(kept[use]), round(total[use]))) for use in sorted(total)}


def _count(road: RoadTags) -> Counter[str]:
    return Counter(str(lane.use) for lane in (*road.forward, *road.backward))
