"""Lanelet2: its own library reads every file without an error, and finds the network's connections."""

import xml.etree.ElementTree as ET
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from conftest import dojo_maps

from dojo_maps.description import Lane, LaneKind, RoadMap
from dojo_maps.drawing import draw
from dojo_maps.errors import ExportError
from dojo_maps.exports import EXPORTERS
from dojo_maps.input_files import read_bytes
from dojo_maps.sources.files import find_network
from dojo_maps.sources.sumo_net import read_network

lanelet2 = pytest.importorskip("lanelet2")


def _read(network: str | Path) -> RoadMap:
    path, name = find_network(str(network))
    return draw(read_network(read_bytes(path), path=path, name=name, sha256="")[0])[0]


def _export(road_map: RoadMap, folder: Path) -> Path:
    folder.mkdir()
    EXPORTERS["lanelet2"](road_map, folder)
    (written,) = folder.iterdir()
    return written


def _load(path: Path):
    """Read a file with Lanelet2's library, as metres around the map's origin; its errors fail the test."""
    node = ET.parse(path).getroot().find("node")  # noqa: S314 (our own)
    origin = lanelet2.io.Origin(float(node.get("lat")), float(node.get("lon")))
    loaded, errors = lanelet2.io.loadRobust(str(path), lanelet2.projection.UtmProjector(origin))
    assert list(errors) == []
    return loaded


def _by_id(loaded) -> dict:
    return {lanelet.attributes["sumo_id"]: lanelet for lanelet in loaded.laneletLayer}


def _routes(loaded, lanes: dict[str, Lane]) -> set[str]:
    """Which lanes of cars follow which, by the routing graph, each over one lanelet of a junction."""
    rules = lanelet2.traffic_rules.create(
        lanelet2.traffic_rules.Locations.Germany, lanelet2.traffic_rules.Participants.Vehicle
    )
    graph = lanelet2.routing.RoutingGraph(loaded, rules)
    found = set()
    for name, lanelet in _by_id(loaded).items():
        if name in lanes:
            for between in graph.following(lanelet):
                for last in graph.following(between):
                    found.add(f"{name}->{last.attributes['sumo_id']}")
    return found


@pytest.mark.sampled(5)
def test_write_lanelet2_is_read_back_with_the_network_s_connections(network, network_path, tmp_path):
    road_map = _read(network_path(network))
    loaded = _load(_export(road_map, tmp_path / "out"))
    found = _by_id(loaded)
    assert set(found) == {
        *(lane.id for lane in road_map.lanes),
        *(connection.id for connection in road_map.connections),
        *(crossing.id for crossing in road_map.crossings),
    }
    cars = {lane.id: lane for lane in road_map.lanes if lane.kind is LaneKind.DRIVING}
    expected = {c.id for c in road_map.connections if c.from_lane in cars and c.to_lane in cars}
    found_routes = _routes(loaded, cars)
    assert found_routes <= expected
    # The inner border of a hairpin that is tighter than half the lane's width has no place to lie.
    assert len(expected - found_routes) <= max(1, len(expected) // 500)
    wrong = [name for name, lanelet in found.items() if not _lies_right(lanelet)]
    assert len(wrong) <= max(1, len(found) // 500), wrong


def _lies_right(lanelet) -> bool:
    """Tell whether the left bound lies on the left: ahead on it and back on the other one is clockwise.

    Of what does not get far, nobody can tell.
    """
    left, right = (np.array([(p.x, p.y) for p in bound]) for bound in (lanelet.leftBound, lanelet.rightBound))
    ahead = (left[-1] - left[0] + right[-1] - right[0]) / 2
    x, y = np.vstack([left, right[::-1]]).T
    area = (x * np.roll(y, -1) - y * np.roll(x, -1)).sum() / 2
    return bool(np.hypot(*ahead) < 2 * np.hypot(*(left[0] - right[0])) or area < 0)


@pytest.mark.parametrize("name", ["right_hand", "left_hand"])
def test_write_lanelet2_lets_neighbours_share_the_line_between_them(network_path, tmp_path, name):
    road_map = _read(network_path(name))
    found = _by_id(_load(_export(road_map, tmp_path / "out")))
    roads = [road for road in road_map.roads if len(road.lanes) > 1]
    assert roads
    for road in roads:
        for outer, inner in zip(road.lanes, road.lanes[1:], strict=False):
            left, right = (outer, inner) if road_map.left_hand else (inner, outer)
            assert found[left].rightBound.id == found[right].leftBound.id


@pytest.mark.parametrize(
    ("name", "expected"),
    [
        ("free", "dashed"),
        ("closed", "solid"),
        ("half", "solid_dashed"),
    ],
)
def test_write_lanelet2_says_where_lanes_may_be_changed(network_path, tmp_path, name, expected):
    found = _by_id(_load(_export(_read(network_path("lane_changes")), tmp_path / "out")))
    line = found[f"{name}_1"].rightBound
    assert (line.attributes["type"], line.attributes["subtype"]) == ("line_thin", expected)


def test_write_lanelet2_has_lights_stop_lines_and_right_of_way(network_path, tmp_path):
    road_map = _read(network_path("right_hand"))
    found = _by_id(_load(_export(road_map, tmp_path / "out")))
    stops = {line.lane for line in road_map.stop_lines}
    signalled = [c for c in road_map.connections if c.signal is not None]
    assert signalled
    for connection in signalled:
        for name in (connection.id, connection.from_lane):
            lights = found[name].trafficLights()
            assert lights
            assert all(len(light.trafficLights) > 0 for light in lights)
            assert all((light.stopLine is not None) == (connection.from_lane in stops) for light in lights)
    for crossing in road_map.crossings:
        assert found[crossing.id].attributes["subtype"] == "crosswalk"
        assert found[crossing.id].trafficLights()
    yields = {
        (way.link, junction.right_of_way[k].link)
        for junction in road_map.junctions
        for way in junction.right_of_way
        for k in way.response
    }
    said = {
        (loser.attributes["sumo_id"], winner.attributes["sumo_id"])
        for lanelet in found.values()
        for rule in lanelet.rightOfWay()
        for loser in rule.yieldLanelets()
        for winner in rule.rightOfWayLanelets()
    }
    assert said == yields


def test_write_lanelet2_keeps_the_network_s_coordinates(tmp_path):
    road_map = _read("cologne1")
    root = ET.parse(_export(road_map, tmp_path / "out")).getroot()  # noqa: S314 (our own)
    places = [
        [float(node.find(f"tag[@k='{key}']").get("v")) for key in ("local_x", "local_y")]
        for node in root.iterfind("node")
    ]
    (west, south), (east, north) = road_map.bounds
    assert np.all(np.min(places, axis=0) > [west - 50, south - 50])
    assert np.all(np.max(places, axis=0) < [east + 50, north + 50])
    assert 50.9 < float(root.find("node").get("lat")) < 51.0
    numbers = [element.get("id") for element in root]
    assert len(set(numbers)) == len(numbers)


def test_write_lanelet2_writes_the_same_bytes_again(tmp_path):
    road_map = _read("cologne1")
    one, two = (_export(road_map, tmp_path / name).read_bytes() for name in ("one", "two"))
    assert one == two


def test_write_lanelet2_takes_lanes_without_length_and_without_width(tmp_path):
    road_map = _read("cologne1")
    first, second, *rest = road_map.lanes
    odd = (replace(first, shape=first.shape[:1]), replace(second, width=-1.0), *rest)
    _load(_export(replace(road_map, lanes=odd), tmp_path / "out"))


def test_write_lanelet2_refuses_a_projection_that_does_not_fit(tmp_path):
    road_map = _read("cologne1")
    odd = replace(road_map.projection, proj="+proj=nonsense")
    with pytest.raises(ExportError, match="projection"):
        _export(replace(road_map, projection=odd), tmp_path / "out")


def test_convert_exports_lanelet2(tmp_path):
    done = dojo_maps("convert", "cologne1", "-o", tmp_path / "out", "--export", "lanelet2")
    assert done.returncode in {0, 1}, done.stderr
    assert [path.name for path in (tmp_path / "out" / "exports" / "lanelet2").iterdir()] == ["cologne1.osm"]
