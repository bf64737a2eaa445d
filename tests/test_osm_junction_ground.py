"""Junctions keep to their roads: no ground between roads far apart, nothing twisted, nothing parted."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import shapely
from osm_drawings import CROSSING, SIGNAL, SIGNAL_CROSSING, Drawing, parallel_ways

from dojo_maps.conversion import convert
from dojo_maps.description import LaneKind, RoadMap
from dojo_maps.geometry.pieces import lane_strips
from dojo_maps.sources.osm import read_osm
from dojo_maps.sources.osm.network.osm_network import OsmNetwork
from dojo_maps.sources.osm.pipeline import build_network

ONE_WAY = {"highway": "primary", "oneway": "yes", "lanes": "2"}


def network(drawing: Drawing, folder: Path) -> OsmNetwork:
    path = drawing.write(folder / "a.osm")
    return build_network(read_osm(path), path=path, name="a", sha256="0" * 64)


def side_streets(gap: float, out: float) -> Drawing:
    """Two streets that leave a main one to the same side, signals at both, crossings far out on both."""
    d = Drawing()
    d.way((0, -150), (0, 0), (0, gap), (0, 150), highway="secondary", lanes="2")
    for y in (0, gap):
        d.way((0, y), (out, y), (150, y), highway="tertiary", lanes="2")
        d.node(out, y, **SIGNAL_CROSSING)
        d.node(0, y, **SIGNAL)
    return d


def largest(road_map: RoadMap) -> shapely.Polygon:
    grounds = [shapely.Polygon(j.polygon[:, :2]) for j in road_map.junctions if len(j.polygon) > 3]
    return max(grounds, key=lambda ground: ground.area)


@pytest.mark.parametrize("out", [20.0, 25.0])
def test_ground_between_side_streets_is_not_paved(out: float, tmp_path: Path) -> None:
    built = network(side_streets(24.0, out), tmp_path)
    ground = largest(built.road_map)
    assert ground.is_valid
    # The carriageways as they are drawn, where the map has them: 6.5 m wide, and 6 m beside them.
    places = {node: np.array(built.layout.graph.places[node]) for node in (2, 3)}
    paths = [shapely.LineString([places[2] - [0, 150], places[3] + [0, 150]])]
    paths += [shapely.LineString([place, place + np.array([150, 0])]) for place in places.values()]
    around = shapely.union_all([path.buffer(3.25 + 6.0) for path in paths])
    assert ground.difference(around).area < 10.0
    driven = shapely.union_all(
        [
            shapely.LineString(c.shape[:, :2]).buffer(1.0)
            for c in built.road_map.connections
            if c.direction != "t"
        ]
    )
    assert driven.intersection(ground.convex_hull).difference(ground.buffer(0.3)).area < 0.5


def test_bundle_of_a_notched_junction_is_whole(tmp_path: Path) -> None:
    path = side_streets(24.0, 25.0).write(tmp_path / "a.osm")
    _, report = convert(str(path), tmp_path / "a.dojo")
    assert report["counts"]["error"] == 0
    assert not [
        i for i in report["issues"] if i["check"] in ("osm.junction_too_large", "geometry.junction_invalid")
    ]
    assert report["osm"]["road_metres"]["all"]["share"] == 1.0


def test_crossing_is_built_where_a_one_way_road_leaves_the_extract(tmp_path: Path) -> None:
    """Too near the junction ahead for a place of its own, and near the road's end."""
    d = Drawing()
    d.way((-150, 0), (0, 0), (150, 0), highway="secondary", lanes="2")
    d.way((0, 26), (0, 16), (0, 0), sidewalk="right", **ONE_WAY)
    d.node(0, 16, **SIGNAL_CROSSING)
    d.node(0, 0, **SIGNAL)
    (crossing,) = network(d, tmp_path).road_map.crossings
    assert any(road.startswith("1002") for road in crossing.roads)


def test_roads_cut_before_they_meet_do_not_lie_on_each_other(tmp_path: Path) -> None:
    """The extract ends between two crossings of a junction: what each road is led on by crosses the other."""
    d = Drawing()
    d.way((150, 20), (19, 3.6), (8.6, 1), (6.9, 0.6), highway="primary", oneway="yes", lanes="3")
    d.way((1, -1), (-7, 9.6), (-59, 78), highway="primary", oneway="yes", lanes="2")
    d.node(19, 3.6, **SIGNAL)
    for place in ((8.6, 1), (-7, 9.6)):
        d.node(*place, **SIGNAL_CROSSING)
    _, report = convert(str(d.write(tmp_path / "a.osm")), tmp_path / "a.dojo")
    assert not [i["message"] for i in report["issues"] if i["check"] == "geometry.lane_overlap"]


def test_crossing_inside_a_junction_goes_to_the_street_that_leads_to_it(tmp_path: Path) -> None:
    """Between a street's end and the junction's middle, nearer to the middle, where two roads begin."""
    d = Drawing()
    d.way((-150, 0), (0, 0), (150, 0), highway="secondary", lanes="2", name="Main")
    d.way((0, 0), (3, 6), (6, 13), highway="residential", name="Inside")
    d.way((6, 13), (20, 150), highway="residential", oneway="yes", name="Beyond")
    d.node(0, 0, **SIGNAL)
    d.node(3, 6, **CROSSING)
    road_map = network(d, tmp_path).road_map
    (crossing,) = road_map.crossings
    names = {road.id: road.name for road in road_map.roads}
    assert {names[road] for road in crossing.roads} == {"Beyond"}


def test_ramp_that_ends_with_a_bridge_does_not_lie_on_the_road_it_joins(tmp_path: Path) -> None:
    d = Drawing()
    road, ramp = {"highway": "motorway", "lanes": "4"}, {"highway": "motorway_link", "oneway": "yes"}
    up = {"bridge": "yes", "layer": "1"}
    d.way((0, -200), (0, -30), **road, **up)
    d.way((0, -30), (0, 0), **road)
    d.way((0, 0), (0, 200), **(road | {"lanes": "5"}))
    d.way((9, -200), (7, -25), **ramp, **up)
    d.way((7, -25), (0, 0), **ramp)
    _, report = convert(str(d.write(tmp_path / "a.osm")), tmp_path / "a.dojo")
    assert not [issue["message"] for issue in report["issues"] if issue["severity"] == "error"]


def test_slip_lane_inside_a_junction_is_paved_around_its_island(tmp_path: Path) -> None:
    drawing = Drawing()
    drawing.way((-150, 0), (-22, 0), (0, 0), (150, 0), highway="secondary", lanes="2")
    drawing.way((0, -150), (0, -22), (0, 0), (0, 150), highway="secondary", lanes="2")
    drawing.way((-22, 0), (-19, -13), (-13, -19), (0, -22), highway="secondary_link", oneway="yes")
    for place in ((0, 0), (-22, 0), (0, -22)):
        drawing.node(*place, **SIGNAL)
    built = network(drawing, tmp_path)
    places = built.layout.graph.places
    slip = shapely.LineString([places[node] for node in built.layout.graph.ways[1003].nodes])
    ground = largest(built.road_map)
    assert ground.is_valid
    assert slip.difference(ground.buffer(0.5)).length < 0.5
    island = shapely.Polygon([*slip.coords, places[3]]).difference(ground)
    assert 20.0 < island.area < 200.0


def acute_corner() -> Drawing:
    """A street that joins a main one at an acute angle, pavement around the corner."""
    d = Drawing()
    d.way((-150, 0), (0, 0), (150, 0), highway="primary", lanes="4", sidewalk="both")
    d.way((-300, -120), (0, 0), highway="secondary", oneway="yes", lanes="2", sidewalk="both")
    d.node(0, 0, **SIGNAL)
    return d


def touching_street() -> Drawing:
    """A one-way street that touches another one from below, and leads away again."""
    d = Drawing()
    d.way((-150, 0), (0, 0), (150, 0), highway="secondary", lanes="2", sidewalk="both")
    d.way((-150, -60), (0, 0), (150, -60), highway="tertiary", oneway="yes", sidewalk="both")
    return d


@pytest.mark.parametrize("drawn", [acute_corner, parallel_ways, touching_street])
def test_motor_vehicles_drive_on_no_pavement(drawn: Callable[[], Drawing], tmp_path: Path) -> None:
    road_map = network(drawn(), tmp_path).road_map
    pavement = shapely.union_all([shapely.Polygon(area.polygon[:, :2]) for area in road_map.walking_areas])
    floors = [shapely.Polygon(j.polygon[:, :2]) for j in road_map.junctions if len(j.polygon) > 3]
    strips = lane_strips(lane for lane in road_map.lanes if lane.kind is not LaneKind.SIDEWALK)
    ground = shapely.union_all([*floors, *strips, pavement]).buffer(0.05)
    cars = {lane.id for lane in road_map.lanes if lane.kind is LaneKind.DRIVING}
    ways = [
        shapely.LineString(connection.shape[:, :2]).buffer(0.9, cap_style="flat")
        for connection in road_map.connections
        if {connection.from_lane, connection.to_lane} <= cars and connection.direction != "t"
    ]
    assert len(ways) > 4
    for way in ways:
        assert way.intersection(pavement).area < 0.5
        assert way.difference(ground).area < 0.5  # What was cut is the junction's.
