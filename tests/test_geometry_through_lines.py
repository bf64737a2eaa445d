"""Lane lines through junctions: on where paths run side by side, none where another path crosses them."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import shapely
from networks import build_fork

from dojo_maps.description import RoadMap
from dojo_maps.geometry.polylines import offset_lines
from dojo_maps.geometry.through_lines import trace_through_lines
from dojo_maps.sources.sumo_net import read_network


def read(path: Path) -> RoadMap:
    return read_network(path.read_bytes(), path=path, name="map", sha256="")[0]


@pytest.mark.parametrize("left_hand", [False, True])
def test_lines_run_on_where_a_road_forks(left_hand: bool, tmp_path: Path) -> None:
    road_map = read(build_fork(tmp_path, left_hand=left_hand))
    lines, beside = trace_through_lines(road_map)
    assert [(path.from_lane, path.to_lane) for path in beside] == [("in_1", "straight_0")]
    lanes = {lane.id: lane for lane in road_map.lanes}
    side = -1.0 if left_hand else 1.0
    for lane_id, end, own in (("in_1", -1, 0), ("straight_0", 0, -1)):
        lane = lanes[lane_id]
        centre = shapely.linestrings(lane.shape[:, :2] - road_map.origin)
        border = offset_lines(np.array([centre]), np.array([side * lane.width / 2]))[0]
        gap = np.subtract(shapely.get_coordinates(border)[end], shapely.get_coordinates(lines[0])[own])
        assert np.hypot(*gap) < 0.2


@pytest.mark.parametrize("name", ["bare", "cologne8", "grid4x4"])
def test_no_line_crosses_a_path(name: str, network_path: Callable[[str], Path]) -> None:
    road_map = read(network_path(name))
    lines, _ = trace_through_lines(road_map)
    paths = [shapely.linestrings(path.shape[:, :2] - road_map.origin) for path in road_map.connections]
    assert not any(shapely.crosses(line, path) for line in lines for path in paths)
    if name != "cologne8":
        assert not len(lines)  # Each pair of paths is crossed by one from the side.
