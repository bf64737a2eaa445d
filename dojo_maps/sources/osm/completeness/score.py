"""How well a built network keeps what its extract says: figures for the report, and what was lost."""

from typing import Any

import shapely

from dojo_maps.description import CARRIAGEWAY
from dojo_maps.index import MapIndex
from dojo_maps.issue import Element, Issue, Severity
from dojo_maps.sources.osm.completeness.assumptions import tell_driving_side, tell_ground
from dojo_maps.sources.osm.completeness.junction_ground import check_junction_ground
from dojo_maps.sources.osm.completeness.losses import (
    check_crossings,
    check_restrictions,
    check_signals,
    check_turn_lanes,
    loss,
    share_of,
    tell_guesses,
)
from dojo_maps.sources.osm.completeness.road_length import measure_road_length
from dojo_maps.sources.osm.completeness.track_length import measure_tracks
from dojo_maps.sources.osm.graph.edge_id import EdgeId
from dojo_maps.sources.osm.graph.projection import way_line
from dojo_maps.sources.osm.network.lane_strips import strips
from dojo_maps.sources.osm.network.osm_network import OsmNetwork
from dojo_maps.sources.osm.read.data import OsmData
from dojo_maps.sources.osm.read.foot_tags import is_sidewalk
from dojo_maps.sources.osm.read.restrictions import find_conditional
from dojo_maps.wording import counted


def score_network(data: OsmData, network: OsmNetwork) -> tuple[dict[str, Any], tuple[Issue, ...]]:
    """Measure a network against its source.

    Args:
        data: the extract.
        network: as it was built from it.

    Returns:
        The figures as JSON values, and the losses.
    """
    figures: dict[str, Any] = {"attribution": data.attribution}
    issues: list[Issue] = []
    for name, check in (
        ("crossings", check_crossings),
        ("signalised_junctions", check_signals),
        ("turn_lanes", check_turn_lanes),
        ("restrictions", check_restrictions),
    ):
        share, found = check(network)
        figures[name] = share_of(share)
        issues += found
    kept, total, found = _check_sidewalks(data, network)
    figures["sidewalk_metres"] = share_of((round(kept), round(total)))
    lengths, missing = measure_road_length(data, network)
    figures |= lengths
    tracks, torn = measure_tracks(data, network)
    figures |= tracks
    figures["overlap_square_metres"] = _overlap(network)
    short = _check_short(network)
    figures["edges"] = len(network.road_map.roads)
    figures["edges_under_5_m"] = len(short)
    country = network.layout.graph.country
    figures["country"], figures["driving_side"] = country.code, "left" if country.left_hand else "right"
    return figures, (
        tell_driving_side(network),
        tell_ground(network),
        *issues,
        *found,
        *missing,
        *torn,
        *short,
        *check_junction_ground(network),
        *tell_guesses(network),
        *_unread(data, network),
    )


def _check_sidewalks(data: OsmData, network: OsmNetwork) -> tuple[float, float, list[Issue]]:
    """Measure the mapped sidewalks beside roads that have built pavement near them."""
    road_map, graph = network.road_map, network.layout.graph
    rules = graph.rules.completeness
    pavement = [
        *strips(road_map, ("sidewalk",)).values(),
        *(shapely.Polygon(a.polygon[:, :2]).buffer(0) for a in road_map.walking_areas if len(a.polygon) > 2),
        *(shapely.Polygon(c.polygon[:, :2]).buffer(0) for c in road_map.crossings if len(c.polygon) > 2),
    ]
    reached = shapely.union_all([shape.buffer(rules.sidewalk_found) for shape in pavement])
    roads = [shapely.LineString(graph.line(section)) for section in graph.sections.values()]
    beside = shapely.union_all([road.buffer(rules.sidewalk_of_road) for road in roads])
    kept = total = 0.0
    issues = []
    for way, record in data.ways.items():
        whole = way_line(graph.projection, data, record) if is_sidewalk(record.tags) else None
        if whole is None:
            continue
        line = whole.intersection(beside)
        lost = line.difference(reached)
        total += line.length
        kept += line.length - lost.length
        if lost.length > max(rules.sidewalk_lost, line.length / 2):
            place = lost.representative_point()
            issues.append(
                loss(
                    "osm.sidewalk_lost", f"{lost.length:.0f} m of a mapped sidewalk have no pavement",
                    ("way", way), (place.x, place.y), "correct the road's sidewalk tags",
                    severity=Severity.NOTE, measured=round(lost.length, 1), limit=rules.sidewalk_lost,
                )
            )  # fmt: skip
    return kept, total, issues


def _overlap(network: OsmNetwork) -> float:
    """Measure the ground that the lanes of two roads both cover."""
    roads = strips(network.road_map, CARRIAGEWAY)
    height = {
        lane.road: float(lane.shape[:, 2].mean())
        for lane in network.road_map.lanes
        if lane.kind in CARRIAGEWAY
    }
    names = sorted(roads)
    tree = shapely.STRtree([roads[name] for name in names])
    total = 0.0
    for number, name in enumerate(names):
        for other in tree.query(roads[name], predicate="intersects"):
            if other > number and abs(height[name] - height[names[other]]) < 2:
                total += roads[name].intersection(roads[names[other]]).area
    return round(total, 1)


def _check_short(network: OsmNetwork) -> list[Issue]:
    lanes, shortest = MapIndex(network.road_map).lanes, network.layout.rules.network.shortest_edge
    issues = []
    for road in network.road_map.roads:
        length = min(lanes[lane].length for lane in road.lanes)
        section = network.plain.sections.get(EdgeId.read(road.id))
        if length < shortest and section is not None:
            x, y, _ = lanes[road.lanes[0]].shape[0]
            issues.append(
                loss(
                    "osm.short_edge", f"the road {road.id} is {length:.1f} m long between its junctions",
                    ("way", section.ways[0]), (float(x), float(y)), "join the junctions at its ends",
                    near=Element(kind="road", id=road.id), measured=length, limit=shortest,
                    severity=Severity.NOTE,
                )
            )  # fmt: skip
    return issues


def _unread(data: OsmData, network: OsmNetwork) -> list[Issue]:
    """Report what of the extract could not be used as it stands."""
    graph = network.layout.graph
    issues = []
    for words, ways in sorted(graph.unread.not_kept.items()):
        nodes = [node for node in data.ways[ways[0]].nodes if node in graph.places]
        place = graph.places[nodes[0]] if nodes else network.road_map.origin
        what, _, lost = words.partition(": ")
        issues.append(
            loss(
                "osm.tag_not_kept", f"{counted(len(ways), 'way')} with {what}, not kept: {lost}; the first",
                ("way", ways[0]), place, "correct the lanes in netedit, or the tags",
                severity=Severity.NOTE, measured=len(ways),
            )
        )  # fmt: skip
    for way in sorted(set(graph.unread.doubled)):
        place = next(graph.places[node] for node in data.ways[way].nodes if node in graph.places)
        issues.append(
            loss(
                "osm.parallel_ways", "another road is drawn over the same nodes, and was kept",
                ("way", way), place, "remove one of the two",
            )
        )  # fmt: skip
    for node, way in graph.unread.unshared:
        issues.append(
            loss(
                "osm.unshared_node", "another road crosses here without a common node; they meet",
                ("way", way), graph.places[node], "add the node, or the bridge or tunnel, in OpenStreetMap",
            )
        )  # fmt: skip
    for node in graph.unread.barriers:
        x, y = graph.places[node]
        kind = data.nodes[node].tags["barrier"]
        issues.append(
            loss(
                "osm.road_closed", f"a road is closed to all by a {kind}, also to those who may pass it",
                ("node", node), (x, y), "join the two ends in netedit if your traffic passes there",
                severity=Severity.NOTE,
            )
        )  # fmt: skip
    for relation, node in find_conditional(data).items():
        if node in graph.places:
            issues.append(
                loss(
                    "osm.restriction_conditional", "a turn that is forbidden at some times is always open",
                    ("relation", relation), graph.places[node],
                    "remove the connection in netedit if your hours are among them", severity=Severity.NOTE,
                )
            )  # fmt: skip
    if missing := graph.unread.missing:
        what = (
            f"roads name {counted(len(missing), 'node')} that the extract lacks, and end there, the first at"
        )
        issues.append(
            loss(
                "osm.missing_node", what, ("node", missing[0]), network.road_map.origin,
                "cut extracts with complete ways", severity=Severity.NOTE,
            )
        )  # fmt: skip
    return issues
