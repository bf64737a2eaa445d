"""Keep pavement off the ground that vehicles drive on.

netconvert draws walking areas from sidewalk to sidewalk, straight over the ways of vehicles between them.
"""

from collections import defaultdict

import shapely

from dojo_maps.description import CARRIAGEWAY, RoadMap
from dojo_maps.geometry.polylines import Floats
from dojo_maps.sources.osm.network.junction_outlines import outline_of, replace_outlines

Ground = dict[str, list[shapely.Geometry]]
"""Polygons by the id of a junction, metres, map frame."""
_CAR, _LEAST_DRIVEN = 1.0, 0.5
"""Half the metres that a car takes, and square metres of pavement under its way from which that is cut."""
_THIN, _LEAST_PAVEMENT = 0.2, 1.0
"""Half the metres of pavement that is too narrow, and square metres of it that are too few."""
_FINE, _GRID = 0.05, 0.01
"""Metres by which corners are simplified, and to which a network rounds."""


def trim_pavement(data: bytes, road_map: RoadMap) -> tuple[bytes, Ground]:
    """Take the ways of vehicles across a junction out of its walking areas.

    Args:
        data: the network.
        road_map: what it holds.

    Returns:
        The network, and what was cut off. Of pavement that is parted the largest piece stays; where the
        others are larger than the ground that is driven on, all of it does.
    """
    ways = _list_ways(road_map)
    junctions = {area.id: area.junction for area in road_map.walking_areas}
    cut: Ground = defaultdict(list)

    def trim(name: str, corners: Floats) -> Floats | None:
        ground = shapely.Polygon(corners[:, :2]) if len(corners) > 2 else shapely.Polygon()
        if name not in junctions or not ground.is_valid:
            return None
        left = ground.difference(shapely.union_all(ways[junctions[name]]))
        driven = ground.area - left.area
        if driven < _LEAST_DRIVEN:
            return None
        parts = shapely.get_parts(shapely.buffer(left, -_THIN, join_style="mitre"))
        largest = max(shapely.buffer(parts, _THIN, join_style="mitre"), key=shapely.area, default=left)
        kept = shapely.set_precision(shapely.simplify(largest, _FINE), _GRID)
        if kept.geom_type != "Polygon" or kept.interiors or kept.area < _LEAST_PAVEMENT:
            return None
        if left.area - kept.area > driven:
            return None
        cut[junctions[name]].append(ground.difference(kept))
        return outline_of(kept, corners)

    return replace_outlines(data, trim, of_pavement=True), cut


def _list_ways(road_map: RoadMap) -> Ground:
    """List the ground of the ways of motor vehicles across each junction."""
    lanes = {lane.id: lane for lane in road_map.lanes}
    ends = {road.id: road.to_junction for road in road_map.roads}
    ways: Ground = defaultdict(list)
    for connection in road_map.connections:
        source, target = lanes[connection.from_lane], lanes[connection.to_lane]
        if {source.kind, target.kind} <= {*CARRIAGEWAY} and len(connection.shape) > 1:
            way = shapely.LineString(connection.shape[:, :2]).buffer(_CAR, cap_style="flat")
            ways[ends[source.road]].append(way)
    return ways
