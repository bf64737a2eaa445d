"""Checks on what real networks hardly have: the smallest failing maps, and maps that are fine."""

from dataclasses import replace

import networks
import numpy as np
import pytest

from dojo_maps.description import RoadMap, Signal, points
from dojo_maps.issue import Issue
from dojo_maps.sources.sumo_net import read_network
from dojo_maps.validation.runner import find_issues


def read(name: str) -> RoadMap:
    path = networks.installed_networks()[name]
    data = networks.read_network_bytes(path)
    return read_network(data, path=path, name=name, sha256="")[0]


def issues_of(road_map: RoadMap, check: str) -> list[Issue]:
    return [issue for issue in find_issues(road_map, None, ())[0] if issue.check == check]


@pytest.fixture(scope="module")
def grid() -> RoadMap:
    return read("grid4x4")


def joined(grid: RoadMap) -> RoadMap:
    """Let one signal control the junctions A0 and B0."""
    parts = [signal for signal in grid.signals if signal.id in ("A0", "B0")]
    whole = replace(
        parts[0],
        junctions=tuple(junction for part in parts for junction in part.junctions),
        links=tuple(link for part in parts for link in part.links),
    )
    rest: list[Signal] = [signal for signal in grid.signals if signal not in parts]
    return replace(grid, signals=(*rest, whole))


def test_unreachable_edge_in_tls_names_the_road_that_nothing_enters(grid: RoadMap) -> None:
    road_map = joined(grid)
    assert not issues_of(road_map, "topology.unreachable_edge_in_tls")
    cut = tuple(c for c in road_map.connections if not c.to_lane.startswith("A0B0_"))
    found = issues_of(replace(road_map, connections=cut), "topology.unreachable_edge_in_tls")
    assert [issue.elements[0].id for issue in found] == ["A0B0"]


def lifted(road_map: RoadMap, road: str, height: float) -> RoadMap:
    lanes = tuple(
        replace(lane, shape=points(lane.shape + np.array([0, 0, height]))) if lane.road == road else lane
        for lane in road_map.lanes
    )
    return replace(road_map, lanes=lanes)


def test_lane_overlap_is_silent_when_one_road_is_a_bridge() -> None:
    road_map = read("A10KW-osm")
    bridge = "240042212"
    before = issues_of(road_map, "geometry.lane_overlap")
    assert [i for i in before if ("road", bridge) in {(e.kind, e.id) for e in i.elements}]
    after = issues_of(lifted(road_map, bridge, 6.0), "geometry.lane_overlap")
    assert not [i for i in after if ("road", bridge) in {(e.kind, e.id) for e in i.elements}]


def test_junction_invalid_is_silent_when_the_outline_has_no_area(grid: RoadMap) -> None:
    first, *rest = grid.junctions
    x, y, z = first.position
    line = points(np.array([(x, y, z), (x + 9, y, z), (x + 3, y, z)]))
    flat = replace(grid, junctions=(replace(first, polygon=line), *rest))
    assert not issues_of(flat, "geometry.junction_invalid")


def test_dead_ends_at_the_edge_of_the_map_are_no_defects(grid: RoadMap) -> None:
    edges = [j for j in grid.junctions if j.kind == "dead_end" and j.incoming]
    assert edges
    found = [issue for issue in find_issues(grid, None, ())[0] if issue.check.startswith("topology.")]
    assert not found
