"""From an extract to the graph of its roads, in this order; what later stages need of the data is in it."""

from collections import defaultdict
from pathlib import Path

from dojo_maps.errors import SourceError
from dojo_maps.sources.osm.graph.barriers import cut_at_barriers
from dojo_maps.sources.osm.graph.centre_turn_lanes import add_centre_turn_lanes
from dojo_maps.sources.osm.graph.crowding import check_crowding
from dojo_maps.sources.osm.graph.node_runs import known_runs
from dojo_maps.sources.osm.graph.projection import project_nodes, way_line
from dojo_maps.sources.osm.graph.road_graph import Footway, RoadGraph, Unread
from dojo_maps.sources.osm.graph.roundabouts import recognise_rings, widen_rings
from dojo_maps.sources.osm.graph.sections import cut_sections, drop_doubles, join_sections
from dojo_maps.sources.osm.graph.service_roads import find_signalised_service_roads
from dojo_maps.sources.osm.graph.shared_nodes import share_nodes
from dojo_maps.sources.osm.graph.tracks import add_tracks
from dojo_maps.sources.osm.read.country import Country, read_country
from dojo_maps.sources.osm.read.data import OsmData
from dojo_maps.sources.osm.read.foot_tags import is_crossing_way, is_sidewalk
from dojo_maps.sources.osm.read.way_tags import RoadTags, read_road, why_not_a_road
from dojo_maps.sources.osm.rules import RULES, ImportRules, LaneRules


def build_graph(
    data: OsmData, path: Path | str, rules: ImportRules = RULES, country: Country | None = None
) -> RoadGraph:
    """Find an extract's roads.

    Args:
        data: the extract.
        path: named in errors.
        rules: the limits to go by, in this stage and in those after it.
        country: whose rules hold; None for the one that the extract lies in.

    Returns:
        The roads, and the tracks on the same nodes.

    Raises:
        SourceError: it has no roads, they spread too far to be one map, or they or tracks lie on each other,
            or cross at far more places without a common node than streets do.
    """
    country = country or read_country(data)
    roads, not_kept = _read_roads(data, rules.lanes, country)
    pieces, missing = known_runs(data, roads)
    used = sorted({node for _, run in pieces for node in run})
    if not used:
        raise SourceError(path, "has no roads for cars or buses; choose a larger area")
    projection, places = project_nodes(data, used, path, rules.sections.widest_map)
    check_crowding(pieces, roads, places, path, rules.crowding)
    pieces, barriers = cut_at_barriers(data, pieces, places, rules.sections.barrier_gap)
    pieces, unshared = share_nodes(pieces, roads, places, path, rules.sections)
    sections, doubled = drop_doubles(cut_sections(pieces, roads))
    graph = RoadGraph(
        places=places,
        sections=join_sections(sections, places, rules.sections),
        tags={node: data.nodes[node].tags for node in used if data.nodes[node].tags},
        ways={way: data.ways[way] for way in roads},
        footways=tuple(
            Footway(way=way, nodes=found.nodes, tags=found.tags, line=way_line(projection, data, found))
            for way, found in data.ways.items()
            if is_crossing_way(found.tags) or is_sidewalk(found.tags)
        ),
        country=country,
        projection=projection,
        unread=Unread(
            not_kept=not_kept, doubled=doubled, unshared=unshared, missing=missing, barriers=barriers
        ),
        rules=rules,
    )
    return add_tracks(data, add_centre_turn_lanes(widen_rings(recognise_rings(graph))), path)


def _read_roads(
    data: OsmData, rules: LaneRules, country: Country
) -> tuple[dict[int, RoadTags], dict[str, list[int]]]:
    """Read the ways that are built, and what of their tags is not kept."""
    ways = [way for way, found in data.ways.items() if why_not_a_road(found.tags) is None]
    ways = sorted({*ways, *find_signalised_service_roads(data, ways)})
    roads: dict[int, RoadTags] = {}
    not_kept: dict[str, list[int]] = defaultdict(list)
    for way in ways:
        road, unkept = read_road(data.ways[way].tags, country, service=True, rules=rules)
        if road is not None:
            roads[way] = road
        for words in unkept:
            not_kept[words].append(way)
    return roads, dict(not_kept)
