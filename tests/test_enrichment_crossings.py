"""Generated crossings: past the ends of the lanes where vehicles wait, and clear of each other."""

from collections.abc import Callable
from dataclasses import replace
from itertools import combinations
from pathlib import Path

import numpy as np
import pytest
import shapely

from dojo_maps import RoadMap
from dojo_maps.description import Crossing
from dojo_maps.enrichment.crossings import generate_crossings
from dojo_maps.geometry.pieces import lane_strips
from dojo_maps.sources.sumo_net import read_network

NETWORKS = [
    "left_hand_bare",
    "2way-single-intersection-single-intersection",
    "cologne1",
    "cologne3",
    "cologne8",
]


@pytest.fixture(params=NETWORKS)
def road_map(request: pytest.FixtureRequest, network_path: Callable[[str], Path]) -> RoadMap:
    path = network_path(request.param)
    bare, _ = read_network(path.read_bytes(), path=path, name=request.param, sha256="")
    return replace(bare, crossings=generate_crossings(bare))


def area(crossing: Crossing) -> shapely.Polygon:
    return shapely.Polygon(crossing.polygon[:, :2])


def arriving(road_map: RoadMap, crossing: Crossing) -> list[shapely.Polygon]:
    """The ground of the lanes of a crossing's roads on which vehicles wait at its junction."""
    junction = next(junction for junction in road_map.junctions if junction.id == crossing.junction)
    roads = set(junction.incoming) & set(crossing.roads)
    return list(lane_strips(lane for lane in road_map.lanes if lane.road in roads))


def test_every_arm_has_a_crossing_where_vehicles_do_not_wait(road_map: RoadMap) -> None:
    waiting = [strip for c in road_map.crossings for strip in arriving(road_map, c)]
    ground = shapely.union_all(waiting)
    crossed = {road for crossing in road_map.crossings for road in crossing.roads}
    junctions = [j for j in road_map.junctions if j.kind == "traffic_light" and len(j.incoming) > 2]
    assert crossed.issuperset(road for junction in junctions for road in junction.incoming)
    for crossing in road_map.crossings:
        assert area(crossing).intersection(ground).area < 0.05, crossing.id
        for strip in arriving(road_map, crossing):
            # Past the lane's end, and no farther than an oblique arm needs.
            assert 0.3 < area(crossing).distance(strip) < 6.0, crossing.id


def test_crossings_do_not_lie_on_each_other_and_span_their_lanes(road_map: RoadMap) -> None:
    for a, b in combinations(road_map.crossings, 2):
        assert area(a).intersection(area(b)).area < 0.05, (a.id, b.id)
    for crossing in road_map.crossings:
        assert 2.0 <= crossing.width <= 3.0
        start, end = crossing.shape[:, :2][[0, -1]]
        across = (end - start) / np.hypot(*(end - start))
        for lane in road_map.lanes:
            if lane.road in crossing.roads:
                ends = lane.shape[[0, -1], :2]
                near = ends[np.argmin(np.hypot(*(ends - crossing.shape[:, :2].mean(axis=0)).T))]
                # From kerb to kerb, or up to a neighbour that covers the rest of the outermost lane.
                assert start @ across - 0.5 < near @ across < end @ across + 0.5, (crossing.id, lane.id)
