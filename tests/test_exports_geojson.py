"""GeoJSON: coordinates against sumolib's, rings and closure by RFC 7946, and clear refusals."""

import json
from collections import Counter
from dataclasses import replace
from pathlib import Path
from typing import Any

import networks
import numpy as np
import pyproj
import pytest
import shapely
import sumolib

from dojo_maps.description import Origin, Projection, Prop, RoadMap, Sidewalk, SignalHead, StopLine, points
from dojo_maps.errors import ExportError
from dojo_maps.exports import EXPORTERS
from dojo_maps.input_files import read_bytes
from dojo_maps.sources.files import find_network
from dojo_maps.sources.sumo_net import read_network

_EARTH = pyproj.Geod(ellps="WGS84")


def _read(name: str) -> tuple[RoadMap, Path]:
    path, map_name = find_network(str(networks.installed_networks().get(name, name)))
    return read_network(read_bytes(path), path=path, name=map_name, sha256="")[0], path


def _export(road_map: RoadMap, folder: Path) -> dict[str, Any]:
    EXPORTERS["geojson"](road_map, folder)
    return json.loads((folder / f"{road_map.name}.geojson").read_text(encoding="utf-8"))


def _of_kind(collection: dict[str, Any], kind: str) -> dict[str, dict[str, Any]]:
    found = [f for f in collection["features"] if f["properties"]["kind"] == kind]
    return {f["properties"]["id"]: f for f in found}


@pytest.mark.slow
@pytest.mark.parametrize("name", ["cologne1", "ingolstadt7", "DRT-osm"])
def test_write_geojson_places_lanes_where_sumolib_does(tmp_path, name):
    road_map, path = _read(name)
    lanes = _of_kind(_export(road_map, tmp_path), "lane")
    network = sumolib.net.readNet(str(path))
    expected, written = [], []
    for lane in road_map.lanes:
        shape = network.getLane(lane.id).getShape()
        expected += [network.convertXY2LonLat(*position[:2]) for position in shape]
        written += [place[:2] for place in lanes[lane.id]["geometry"]["coordinates"]]
    (x1, y1), (x2, y2) = np.transpose(expected), np.transpose(written)
    assert np.max(_EARTH.inv(x1, y1, x2, y2)[2]) < 0.002, "more than 2 mm off"


@pytest.mark.slow
def test_write_geojson_has_a_feature_for_everything_on_the_map(tmp_path):
    road_map, _ = _read("DRT-osm")
    kinds = Counter(f["properties"]["kind"] for f in _export(road_map, tmp_path)["features"])
    assert kinds == {
        "road": len(road_map.roads),
        "lane": len(road_map.lanes),
        "junction": len(road_map.junctions),
        "sidewalk": len(road_map.sidewalks),
        "crossing": len(road_map.crossings),
        "walking_area": len(road_map.walking_areas),
    }


@pytest.mark.slow
def test_write_geojson_closes_rings_and_winds_them_by_the_right_hand_rule(tmp_path):
    road_map, _ = _read("DRT-osm")
    polygons = 0
    for feature in _export(road_map, tmp_path)["features"]:
        geometry = feature["geometry"]
        if geometry["type"] == "Polygon":
            ring = shapely.LinearRing(geometry["coordinates"][0])
            assert geometry["coordinates"][0][0] == geometry["coordinates"][0][-1]
            assert ring.is_ccw or not ring.is_simple
            polygons += 1
    assert polygons > 1000


def test_write_geojson_draws_props_stop_lines_signal_heads_and_holes(tmp_path):
    road_map, _ = _read("cologne1")
    x, y = road_map.origin
    ring = points([(x, y), (x, y + 20), (x + 20, y + 20), (x + 20, y)])
    hole = points([(x + 5, y + 5), (x + 9, y + 5), (x + 9, y + 9), (x + 5, y + 9)])
    head = SignalHead(link_indices=(0, 1), position=(x, y, 5.0), heading=1.5)
    lane = road_map.lanes[0].id
    road_map = replace(
        road_map,
        sidewalks=(Sidewalk(id="s", origin=Origin.GENERATED, road=None, polygon=ring, holes=(hole,)),),
        stop_lines=(StopLine(lane=lane, shape=points([(x, y), (x + 3, y)])),),
        signals=tuple(replace(signal, heads=(head,)) for signal in road_map.signals),
        props=(
            Prop(id="tree", kind="tree", height=8.0, position=(x, y, 0.0), tags=(("species", "Tilia"),)),
            Prop(id="house", kind="building", height=9.0, polygon=ring),
        ),
    )
    collection = _export(road_map, tmp_path)
    outer, inner = _of_kind(collection, "sidewalk")["s"]["geometry"]["coordinates"]
    assert shapely.LinearRing(outer).is_ccw
    assert not shapely.LinearRing(inner).is_ccw
    assert _of_kind(collection, "stop_line")[lane]["geometry"]["type"] == "LineString"
    (signal,) = road_map.signals
    shown = _of_kind(collection, "signal_head")[f"{signal.id}/0"]
    assert shown["geometry"]["type"] == "Point"
    assert shown["properties"]["link_indices"] == [0, 1]
    assert shown["properties"]["signal"] == signal.id
    props = _of_kind(collection, "prop")
    assert props["tree"]["geometry"]["type"] == "Point"
    assert props["tree"]["properties"]["prop_kind"] == "tree"
    assert props["tree"]["properties"]["tags"] == {"species": "Tilia"}
    assert props["house"]["geometry"]["type"] == "Polygon"


def test_write_geojson_keeps_what_is_known_of_a_lane_and_a_road(tmp_path):
    road_map, _ = _read("ingolstadt7")
    collection = _export(road_map, tmp_path)
    lane, road = road_map.lanes[0], road_map.roads[0]
    assert _of_kind(collection, "lane")[lane.id]["properties"] == {
        "kind": "lane", "id": lane.id, "road": lane.road, "index": lane.index, "lane_kind": lane.kind.value,
        "width": lane.width, "speed": lane.speed, "length": lane.length, "allow": list(lane.allow),
        "change_inward": lane.change_inward, "change_outward": lane.change_outward, "opposite": lane.opposite,
    }  # fmt: skip
    properties = _of_kind(collection, "road")[road.id]["properties"]
    assert properties["from"] == road.from_junction
    assert properties["road_kind"] == road.kind
    assert properties["lanes"] == list(road.lanes)


def test_write_geojson_writes_heights_only_where_the_map_has_some(tmp_path):
    road_map, _ = _read("cologne1")
    flat = _of_kind(_export(road_map, tmp_path), "lane")
    lanes = tuple(replace(lane, shape=points(np.add(lane.shape, (0, 0, 62.5)))) for lane in road_map.lanes)
    raised = _of_kind(_export(replace(road_map, lanes=lanes), tmp_path), "lane")
    for lane in road_map.lanes:
        level, high = (set_[lane.id]["geometry"]["coordinates"] for set_ in (flat, raised))
        assert high == [[*place, 62.5] for place in level]


def test_write_geojson_writes_a_point_for_a_junction_without_area(network_path, tmp_path):
    path = network_path("rough_shapes")
    road_map = read_network(read_bytes(path), path=path, name="rough", sha256="")[0]
    projection = Projection(proj="+proj=utm +zone=32 +ellps=WGS84", net_offset=(-500000.0, -5600000.0))
    junctions = _of_kind(_export(replace(road_map, projection=projection), tmp_path), "junction")
    assert junctions["w"]["geometry"]["type"] == "Point"
    assert junctions["c"]["geometry"]["type"] == "MultiPolygon"  # its outline is twisted


@pytest.mark.parametrize("name", ["grid4x4", "two-way"])
def test_write_geojson_writes_a_network_without_a_projection_in_its_own_coordinates(tmp_path, name):
    road_map, _ = _read(name)
    collection = _export(road_map, tmp_path)
    assert collection["coordinates"].startswith("metres")
    lanes = _of_kind(collection, "lane")
    for lane in road_map.lanes:
        assert np.allclose(lanes[lane.id]["geometry"]["coordinates"], lane.shape[:, :2], atol=1e-3)


@pytest.mark.parametrize("name", ["cologne8", "ingolstadt7", "two-way"])
def test_write_geojson_writes_valid_geometries_only(tmp_path, name):
    road_map, _ = _read(name)
    for feature in _export(road_map, tmp_path)["features"]:
        shape = shapely.geometry.shape(feature["geometry"])
        assert shape.is_valid, (feature["properties"]["id"], shapely.is_valid_reason(shape))
        assert not shape.is_empty


@pytest.mark.parametrize(
    ("proj", "offset", "words"),
    [
        ("+proj=nonsense", (0.0, 0.0), "not one that PROJ knows"),
        ("+proj=utm +zone=32", (1e12, 1e12), "lie outside its projection"),
    ],
)
def test_write_geojson_refuses_a_projection_that_does_not_work(tmp_path, proj, offset, words):
    road_map, _ = _read("cologne1")
    broken = replace(road_map, projection=Projection(proj=proj, net_offset=offset))
    with pytest.raises(ExportError, match=words):
        _export(broken, tmp_path)
    assert not list(tmp_path.iterdir())
