"""The ground that the lanes of a built network take, road by road."""

from collections import defaultdict
from collections.abc import Iterable

import shapely

from dojo_maps.description import RoadMap


def strips(road_map: RoadMap, kinds: Iterable[str]) -> dict[str, shapely.Geometry]:
    """Outline each road's lanes of some kinds."""
    lanes: dict[str, list[shapely.Geometry]] = defaultdict(list)
    for lane in road_map.lanes:
        if lane.kind in kinds:
            line = shapely.LineString(lane.shape[:, :2])
            lanes[lane.road].append(line.buffer(lane.width / 2, cap_style="flat", join_style="mitre"))
    return {road: shapely.union_all(shapely.make_valid(shapes)) for road, shapes in lanes.items()}
