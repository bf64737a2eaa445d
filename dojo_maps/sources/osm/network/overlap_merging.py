"""Short roads that lie on a neighbour all along: they become part of the junction that both begin at.

Lanes that part at a flat angle are drawn back to where they have parted; a road that ends before has no
ground of its own.
"""

from collections.abc import Iterator

import shapely

from dojo_maps.description import CARRIAGEWAY, RoadMap
from dojo_maps.geometry.polylines import Floats
from dojo_maps.sources.osm.graph.edge_id import EdgeId
from dojo_maps.sources.osm.layout.arms import Layout
from dojo_maps.sources.osm.network.lane_strips import strips
from dojo_maps.sources.osm.plain.plain_xml import Plain
from dojo_maps.sources.osm.rules import NetworkRules


def lying_on_neighbours(road_map: RoadMap, layout: Layout, plain: Plain) -> list[tuple[int, int]]:
    """Find the ends of short sections that still lie on another road of their junction when built.

    Args:
        road_map: the network as built.
        layout: what it was built from.
        plain: what was written of that.

    Returns:
        The two vertices of each such section, the lower first.
    """
    graph, rules = layout.graph, layout.rules.network
    found = set()
    for one, other in _overlapping(road_map, rules):
        edges = [EdgeId.read(name) for name in (one, other)]
        sections = [plain.sections[edge] for edge in edges if edge in plain.sections]
        if len(sections) < 2:
            continue
        drawn = [section for section in sections if not section.road.roundabout]
        short = min(drawn, key=lambda section: (graph.length(section), section.id), default=None)
        if short is not None and graph.length(short) <= rules.longest_merged:
            found.add(short.pair)
    return sorted(found)


def _overlapping(road_map: RoadMap, rules: NetworkRules) -> Iterator[tuple[str, str]]:
    """Pair the roads that meet at a junction and lie on each other beyond it, not counting directions."""
    ground = strips(road_map, CARRIAGEWAY)
    names = sorted(ground)
    ends = {road.id: {road.from_junction, road.to_junction} for road in road_map.roads}
    outlines = {junction.id: junction.polygon[:, :2] for junction in road_map.junctions}
    shapes = [ground[name] for name in names]
    for a, b in sorted(map(tuple, shapely.STRtree(shapes).query(shapes, predicate="overlaps").T.tolist())):
        common = ends[names[a]] & ends[names[b]]
        if a >= b or not common:
            continue
        border = shapely.union_all([_surround(outlines[each], rules.junction_border) for each in common])
        if shapes[a].intersection(shapes[b]).difference(border).area > rules.least_overlap:
            yield names[a], names[b]


def _surround(outline: Floats, metres: float) -> shapely.Geometry:
    """Give a junction's ground and what lies near it, where its roads may touch."""
    area = shapely.make_valid(shapely.Polygon(outline)) if len(outline) > 2 else shapely.Point()
    return shapely.union(area, shapely.multipoints(outline)).buffer(metres)
