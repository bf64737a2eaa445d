"""Keep junctions off ground that no road leads to: what lies between roads far apart is not paved.

netconvert draws a junction's outline from arm to arm, straight over medians and corners of grass.
"""

import shapely

from dojo_maps.description import RoadMap
from dojo_maps.geometry.polylines import Floats
from dojo_maps.sources.osm.graph.road_graph import RoadGraph
from dojo_maps.sources.osm.junctions.grouping import around_road
from dojo_maps.sources.osm.network.junction_outlines import outline_of, replace_outlines

_LANE = 3.2
"""Metres across a path of vehicles."""
_LEFT_OVER = 5.0
"""Square metres that a notch may cut off beside itself."""
_SMOOTH = 0.2
"""Metres by which the corners of a notch are simplified."""


class MappedGround:
    """The mapped carriageways and tracks with all ground that may be a junction's beside them."""

    def __init__(self, graph: RoadGraph) -> None:
        mapped = {**graph.sections, **graph.tracks}
        self._roads = [around_road(graph, section) for _, section in sorted(mapped.items())]
        self._tree = shapely.STRtree(self._roads)

    def beyond(self, ground: shapely.Geometry) -> shapely.Geometry:
        """Give the part of some ground that is far from every mapped road.

        Args:
            ground: valid, metres, map frame.

        Returns:
            Ground of any shape, empty where none is far.
        """
        near = [self._roads[k] for k in sorted(self._tree.query(ground))]
        return ground.difference(shapely.union_all(near))


def trim_outlines(data: bytes, road_map: RoadMap, graph: RoadGraph) -> bytes:
    """Take ground that is far from all roads out of the outlines of a network's junctions.

    Args:
        data: the network.
        road_map: what it holds.
        graph: the mapped roads.

    Returns:
        The network; where vehicles drive and people walk stays in the outlines, and so do pieces in a
        junction's midst, for an outline has no holes.
    """
    mapped, rules = MappedGround(graph), graph.rules.network
    used = _used_ground(road_map, rules.verge)
    tree = shapely.STRtree(used)

    def trim(_: str, corners: Floats) -> Floats | None:
        ground = shapely.Polygon(corners[:, :2]) if len(corners) > 3 else shapely.Polygon()
        if ground.area < rules.least_notch or not ground.is_valid:
            return None
        far = [piece for piece in shapely.get_parts(mapped.beyond(ground)) if piece.area >= rules.least_notch]
        if not far:
            return None
        kept = shapely.union_all([used[k] for k in sorted(tree.query(ground))])
        trimmed = ground
        for piece in far:
            trimmed = _cut(trimmed, piece.buffer(rules.shoulder).difference(kept))
        return None if trimmed is ground else outline_of(shapely.simplify(trimmed, _SMOOTH), corners)

    return replace_outlines(data, trim)


def _used_ground(road_map: RoadMap, verge: float) -> list[shapely.Geometry]:
    """List the ground that vehicles drive on at junctions, where lanes end, and where people cross.

    Walking areas are ground of their own.
    """
    across = _LANE / 2 + verge
    lines = (
        *(connection.shape for connection in road_map.connections),
        *(lane.shape[ends] for lane in road_map.lanes for ends in (slice(None, 2), slice(-2, None))),
    )
    crossings = (crossing.polygon for crossing in road_map.crossings)
    return [
        *(shapely.LineString(line[:, :2]).buffer(across) for line in lines if len(line) > 1),
        *(shapely.Polygon(outline[:, :2]).buffer(verge) for outline in crossings if len(outline) > 3),
    ]


def _cut(ground: shapely.Polygon, notch: shapely.Geometry) -> shapely.Polygon:
    """Take a notch out of some ground, unless it parts the ground or lies in its midst."""
    parts = shapely.get_parts(ground.difference(notch))
    largest = max(parts, key=shapely.area, default=ground)
    parted = float(shapely.area(parts).sum()) - largest.area > _LEFT_OVER
    whole = largest.geom_type == "Polygon" and not largest.is_empty and not largest.interiors
    return largest if whole and not parted else ground
