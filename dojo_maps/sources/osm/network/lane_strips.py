"""The ground that the lanes of a built network take, road by road."""

from collections import defaultdict
from collections.abc import Iterable

import shapely

from dojo_maps.description import RoadMap
from dojo_maps.geometry.pieces import lane_strips


def strips(road_map: RoadMap, kinds: Iterable[str]) -> dict[str, shapely.Geometry]:
    """Outline each road's lanes of some kinds.

    Args:
        road_map: the network.
        kinds: of lanes, as `Lane.kind` has them.

    Returns:
        Their ground by the road's id, metres, map frame; without roads that have no such lane.
    """
    lanes = [lane for lane in road_map.lanes if lane.kind in kinds]
    roads: dict[str, list[shapely.Geometry]] = defaultdict(list)
    for lane, strip in zip(lanes, lane_strips(lanes), strict=True):
        roads[lane.road].append(strip)
    return {road: shapely.union_all(shapely.make_valid(found)) for road, found in roads.items()}
