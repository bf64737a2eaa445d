"""Signal heads near and far, and their poles: the first free spot, the nearest free place, or none."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
import shapely
from conftest import Conversion

from dojo_maps import RoadMap, read_bundle
from dojo_maps.description import points
from dojo_maps.enrichment.pole_sites import PoleSites
from dojo_maps.enrichment.signals import place_signal_heads
from dojo_maps.geometry.pieces import lane_strips
from dojo_maps.meshes.furniture import signal_meshes


@pytest.fixture
def bare(converted: Callable[..., Conversion]) -> RoadMap:
    return replace(read_bundle(converted("bare").folder).road_map, props=())


def test_choose_takes_the_first_spot_that_is_free(bare: RoadMap) -> None:
    on_lane, free = bare.lanes[0].shape[0, :2], np.array([1000.0, 1000.0])
    assert PoleSites(bare).choose([on_lane, free, free + 1], shapely.Point(on_lane).buffer(30.0)) is free


def test_choose_looks_around_the_first_spot_when_none_is_free(bare: RoadMap) -> None:
    lane = bare.lanes[0]
    middle = lane.shape[[0, -1], :2].mean(axis=0)
    place = PoleSites(bare).choose([middle], shapely.Point(middle).buffer(30.0))
    assert place is not None
    clear = shapely.distance(lane_strips(bare.lanes), shapely.Point(place))
    assert clear.min() == pytest.approx(0.15, abs=1e-3)


def test_heads_hang_without_a_pole_when_vehicles_drive_everywhere(bare: RoadMap) -> None:
    square = points([(-500, -500), (500, -500), (500, 500), (-500, 500)])
    vast = replace(bare, junctions=tuple(replace(item, polygon=square) for item in bare.junctions))
    furnished = place_signal_heads(vast)
    assert not furnished.props
    assert [len(signal.heads) for signal in furnished.signals] == [len(s.heads) for s in bare.signals]
    assert {mesh.name for mesh in signal_meshes(furnished)} >= {"signal", "signal/red"}


def test_far_side_heads_face_the_same_traffic_from_across_the_junction(bare: RoadMap) -> None:
    near = place_signal_heads(bare).signals[0].heads
    furnished = place_signal_heads(bare, far_side=True)
    far = [head for head in furnished.signals[0].heads if head.far_side]
    assert not any(head.far_side for head in near)
    assert sorted(head.link_indices for head in far) == sorted(head.link_indices for head in near)
    junction = next(j for j in bare.junctions if j.id == furnished.signals[0].junctions[0])
    floor = shapely.Polygon(junction.polygon[:, :2])
    for head in far:
        twin = next(other for other in near if other.link_indices == head.link_indices)
        way = np.subtract(head.position, twin.position)[:2]
        assert head.heading == twin.heading
        # It hangs where the straight way of its traffic leaves the junction.
        assert 8 < -way @ [np.cos(head.heading), np.sin(head.heading)] < 45
        assert 0 < floor.distance(shapely.Point(head.position[:2])) < 5
    poles = [prop for prop in furnished.props if ("side", "far") in prop.tags]
    driven = shapely.union_all([*lane_strips(bare.lanes), floor])
    assert len(poles) == 4
    assert all(pole.position and driven.distance(shapely.Point(pole.position[:2])) > 0.1 for pole in poles)
