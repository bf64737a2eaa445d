"""MetaDrive's format against sumolib and SUMO, and through MetaDrive's own reader where it is installed."""

import itertools
import pickle
import pickletools
import warnings
from dataclasses import replace
from pathlib import Path
from typing import Any

import libsumo
import numpy as np
import pytest
import shapely
import sumolib

from dojo_maps.description import LaneKind, Origin, RoadMap, Sidewalk, points
from dojo_maps.errors import ExportError
from dojo_maps.exports import EXPORTERS
from dojo_maps.exports.metadrive_features import build_features, lane_polygon
from dojo_maps.input_files import read_bytes
from dojo_maps.serialization import from_json, to_json
from dojo_maps.sources.files import find_network
from dojo_maps.sources.sumo_net import read_network

pytestmark = pytest.mark.sampled(3)

_FIRST_LEVEL = {"id", "version", "length", "metadata", "tracks", "dynamic_map_states", "map_features"}
_LANES = {"LANE_SURFACE_STREET", "LANE_SURFACE_UNSTRUCTURE", "LANE_BIKE_LANE", "LANE_UNKNOWN"}
_LINES = {"ROAD_LINE_BROKEN_SINGLE_WHITE", "ROAD_LINE_SOLID_SINGLE_WHITE", "ROAD_EDGE_BOUNDARY"}
_SURFACES = {"ROAD_EDGE_SIDEWALK", "CROSSWALK"}


def _read(network: str | Path) -> tuple[RoadMap, Path]:
    path, name = find_network(str(network))
    return read_network(read_bytes(path), path=path, name=name, sha256="")[0], path


def _export(road_map: RoadMap, folder: Path) -> dict[str, Any]:
    folder.mkdir(exist_ok=True)
    EXPORTERS["metadrive"](road_map, folder)
    with (folder / f"sd_dojo-map_v1_{road_map.name}.pkl").open("rb") as file:
        return pickle.load(file)  # noqa: S301 (our own)


@pytest.fixture(scope="module", params=["cologne1", "ingolstadt7", "left_hand", "bridge", "mixed_lanes"])
def exported(request, network_path, tmp_path_factory):
    """A description, its network and the scenario written from them."""
    name = request.param
    road_map, path = _read(name if name in ("cologne1", "ingolstadt7") else network_path(name))
    return road_map, path, _export(road_map, tmp_path_factory.mktemp("metadrive"))


def _lane_features(scenario):
    return {key: f for key, f in scenario["map_features"].items() if f["type"] in _LANES}


def test_write_metadrive_writes_a_data_set_of_one_scenario(tmp_path):
    road_map, _ = _read("cologne1")
    scenario = _export(road_map, tmp_path)
    name = "sd_dojo-map_v1_cologne1.pkl"
    assert {file.name for file in tmp_path.iterdir()} == {name, "dataset_summary.pkl", "dataset_mapping.pkl"}
    summary = pickle.loads((tmp_path / "dataset_summary.pkl").read_bytes())  # noqa: S301 (our own)
    assert pickle.loads((tmp_path / "dataset_mapping.pkl").read_bytes()) == {name: ""}  # noqa: S301 (our own)
    assert list(summary) == [name]
    assert summary[name]["scenario_id"] == "cologne1"
    assert set(scenario) == _FIRST_LEVEL
    assert scenario["metadata"]["map_origin"] == list(road_map.origin)
    assert scenario["metadata"]["ts"].shape == (scenario["length"],) == (900,)


def test_write_metadrive_writes_plain_values_only(exported):
    def check(value):
        if isinstance(value, dict):
            assert all(type(key) is str for key in value)
            for item in value.values():
                check(item)
        elif isinstance(value, list):
            for item in value:
                check(item)
        else:
            assert type(value) in (str, int, float, bool, type(None), np.ndarray)

    check(exported[2])


def test_write_metadrive_names_nothing_that_one_version_of_numpy_lacks(tmp_path):
    _export(_read("cologne1")[0], tmp_path)
    for path in tmp_path.iterdir():
        strings = [
            argument for _, argument, _ in pickletools.genops(path.read_bytes()) if isinstance(argument, str)
        ]
        assert not [text for text in strings if "numpy." in text or "_reconstruct" in text]


def test_write_metadrive_writes_the_same_bytes_for_the_same_map(tmp_path):
    road_map, _ = _read("ingolstadt7")
    _export(road_map, tmp_path / "one")
    _export(from_json(to_json(road_map)), tmp_path / "two")
    for first in (tmp_path / "one").iterdir():
        assert first.read_bytes() == (tmp_path / "two" / first.name).read_bytes()


def test_write_metadrive_has_the_network_s_lanes_and_links(exported):
    road_map, path, scenario = exported
    network = sumolib.net.readNet(str(path))
    lanes = _lane_features(scenario)
    kinds = {lane.id: lane.kind for lane in road_map.lanes}
    left_out = (LaneKind.SIDEWALK, LaneKind.RAIL, LaneKind.WATERWAY, LaneKind.OTHER)
    expected = {key for key, kind in kinds.items() if kind not in left_out}
    assert {key for key in lanes if "->" not in key} == expected
    for key in expected:
        lane, feature = network.getLane(key), lanes[key]
        drawn = np.array(lane.getShape3D()) - [*road_map.origin, 0]
        np.testing.assert_allclose(feature["polyline"], drawn, atol=1e-9)
        assert feature["speed_limit_kmh"] == pytest.approx(lane.getSpeed() * 3.6)
        onward = {c.getToLane().getID() for c in lane.getOutgoing()} & expected
        assert {lanes[way]["exit_lanes"][0] for way in feature["exit_lanes"]} == onward
        assert (feature["type"] == "LANE_BIKE_LANE") == (kinds[key] is LaneKind.BICYCLE)


def test_write_metadrive_joins_lanes_end_to_end(exported):
    lanes = _lane_features(exported[2])
    for key, feature in lanes.items():
        for other in feature["exit_lanes"]:
            assert key in lanes[other]["entry_lanes"]
            gap = np.linalg.norm(feature["polyline"][-1] - lanes[other]["polyline"][0])
            assert gap < 1e-6
        for other in feature["entry_lanes"]:
            assert key in lanes[other]["exit_lanes"]


def test_write_metadrive_puts_neighbours_on_their_side(exported):
    road_map, _, scenario = exported
    lanes = _lane_features(scenario)
    inner_side = "right_neighbor" if road_map.left_hand else "left_neighbor"
    seen = 0
    for road in road_map.roads:
        row = [lane for lane in road.lanes if lanes.get(lane, {}).get("type") == "LANE_SURFACE_STREET"]
        for lane, inner in itertools.pairwise(row):
            assert lanes[lane][inner_side][0] == inner
            start, ahead, other = (*lanes[lane]["polyline"][:2], lanes[inner]["polyline"][0])
            (dx, dy), (ox, oy) = (ahead - start)[:2], (other - start)[:2]
            turn = dx * oy - dy * ox
            assert (turn < 0) == road_map.left_hand
            seen += 1
    assert seen


def test_write_metadrive_outlines_lanes_around_their_centre_lines(exported):
    for feature in _lane_features(exported[2]).values():
        line, ring = feature["polyline"], feature["polygon"]
        assert ring.ndim == 2
        assert ring.shape[1] == 2, "MetaDrive adds the third coordinate itself"
        polygon = shapely.Polygon(ring)
        assert polygon.is_valid
        if shapely.LineString(line).length < feature["width"]:
            continue
        strip = shapely.LineString(line[:, :2]).buffer(feature["width"] / 2, cap_style="flat")
        assert polygon.symmetric_difference(strip).area < 0.1 * strip.area + 0.5


def test_lane_polygon_keeps_the_line_s_mean_when_corners_crowd_at_one_end():
    bend = [(3000 + 40 * np.sin(a), 40 - 40 * np.cos(a), 0.0) for a in np.linspace(0, 1.5, 200)]
    line = points([(0.0, 0.0, 0.0), *bend])
    ring = lane_polygon(line, 3.2)
    np.testing.assert_allclose(ring.mean(axis=0), line[:, :2].mean(axis=0), atol=0.1)


def test_lane_polygon_is_valid_when_the_lane_turns_within_its_own_width():
    angles = np.linspace(0, np.pi, 9)
    line = points(np.column_stack([np.cos(angles), np.sin(angles)]))
    assert shapely.Polygon(lane_polygon(line, 3.2)).is_valid


def test_write_metadrive_knows_only_metadrive_s_types(exported):
    for key, feature in exported[2]["map_features"].items():
        assert feature["type"] in _LANES | _LINES | _SURFACES, key
        if feature["type"] in _LINES:
            assert feature["polyline"].shape[1] == 3
            assert len(feature["polyline"]) > 1
        elif feature["type"] in _SURFACES:
            assert feature["polygon"].shape[1] == 2
            assert len(feature["polygon"]) > 2


def test_write_metadrive_keeps_lane_changes_in_the_lines(network_path, tmp_path):
    features = _export(_read(network_path("lane_changes"))[0], tmp_path)["map_features"]
    assert features["line/free/1"]["type"] == "ROAD_LINE_BROKEN_SINGLE_WHITE"
    assert features["line/closed/1"]["type"] == "ROAD_LINE_SOLID_SINGLE_WHITE"
    assert features["line/half/1"]["type"] == "ROAD_LINE_BROKEN_SINGLE_WHITE"
    for side in (0, 2):
        assert features[f"line/free/{side}"]["type"] == "ROAD_EDGE_BOUNDARY"


@pytest.mark.parametrize("name", ["bare", "left_hand_bare"])
def test_write_metadrive_draws_one_centre_line_between_opposite_roads(network_path, tmp_path, name):
    features = _export(_read(network_path(name))[0], tmp_path)["map_features"]
    for leg in "nesw":
        inner = [features.get(f"line/{road}/2") for road in (leg, f"-{leg}")]
        drawn = [line for line in inner if line]
        assert [line["type"] for line in drawn] == ["ROAD_LINE_SOLID_SINGLE_WHITE"]


@pytest.mark.parametrize("name", ["ingolstadt7", "right_hand"])
def test_write_metadrive_keeps_pavements_off_the_lanes(network_path, tmp_path, name):
    road_map, _ = _read(name if name == "ingolstadt7" else network_path(name))
    scenario = _export(road_map, tmp_path)
    lanes = [f["polygon"] for key, f in _lane_features(scenario).items() if "->" not in key]
    roadway = shapely.union_all([shapely.Polygon(ring) for ring in lanes])
    pavements = [f["polygon"] for f in scenario["map_features"].values() if f["type"] == "ROAD_EDGE_SIDEWALK"]
    pavement = shapely.union_all([shapely.Polygon(ring).buffer(0) for ring in pavements])
    assert pavement.area > 1000
    assert pavement.intersection(roadway).area < 0.01


def test_build_features_splits_a_pavement_with_a_hole():
    road_map, _ = _read("cologne1")
    x, y = road_map.bounds[1][0] + 50, road_map.bounds[1][1] + 50
    ring = points([(x, y), (x + 20, y), (x + 20, y + 20), (x, y + 20)])
    hole = points([(x + 5, y + 5), (x + 5, y + 9), (x + 9, y + 9), (x + 9, y + 5)])
    walk = Sidewalk(id="plaza", origin=Origin.GENERATED, road=None, polygon=ring, holes=(hole,))
    features = build_features(replace(road_map, sidewalks=(walk,)))
    parts = [shapely.Polygon(f["polygon"]) for key, f in features.items() if key.startswith("sidewalk/plaza")]
    assert sum(part.area for part in parts) == pytest.approx(400 - 16)
    assert shapely.union_all(parts).area == pytest.approx(400 - 16)


def test_write_metadrive_cuts_no_pavement_by_a_road_on_another_level(network_path, tmp_path):
    road_map, _ = _read(network_path("bridge"))
    features = _export(road_map, tmp_path)["map_features"]
    for walk in road_map.sidewalks:
        if walk.road == "deck":
            drawn = sum(
                shapely.Polygon(f["polygon"]).area
                for key, f in features.items()
                if key == f"sidewalk/{walk.id}" or key.startswith(f"sidewalk/{walk.id}/")
            )
            assert drawn == pytest.approx(shapely.Polygon(walk.polygon[:, :2]).area, rel=1e-3)


@pytest.mark.parametrize("name", ["cologne3", "grid4x4"])
def test_write_metadrive_shows_the_lights_that_sumo_shows(tmp_path, name):
    road_map, path = _read(name)
    states = _export(road_map, tmp_path)["dynamic_map_states"]
    colours = {"r": "STOP", "y": "CAUTION", "g": "GO", "G": "GO", "u": "STOP", "s": "FLASHING_STOP"}
    assert states
    libsumo.start(["sumo", "-n", str(path), "--no-step-log", "--no-warnings", "--step-length", "1"])
    try:
        for second in range(60):
            libsumo.simulationStep()
            for key, light in states.items():
                state = libsumo.trafficlight.getRedYellowGreenState(light["metadata"]["signal"])
                expected = f"LANE_STATE_{colours[state[light['metadata']['link_index']]]}"
                assert light["state"]["object_state"][second * 10] == expected, (key, second)
    finally:
        libsumo.close()


def test_write_metadrive_runs_the_last_program_from_its_offset(network_path, tmp_path):
    road_map, _ = _read(network_path("two_programs"))
    states = _export(road_map, tmp_path)["dynamic_map_states"]
    first = next(key for key, light in states.items() if light["metadata"]["link_index"] == 0)
    lights = states[first]["state"]["object_state"]
    # 31.5 s of green, 3 s of yellow and 42 s of red, begun 12.5 s late: red, then green at 12.5 s.
    assert [lights[t] for t in (0, 124, 125, 439, 440, 469, 470)] == [
        "LANE_STATE_STOP", "LANE_STATE_STOP", "LANE_STATE_GO", "LANE_STATE_GO",
        "LANE_STATE_CAUTION", "LANE_STATE_CAUTION", "LANE_STATE_STOP",
    ]  # fmt: skip


def test_write_metadrive_places_lights_at_the_end_of_the_lane_before(exported):
    road_map, _, scenario = exported
    lanes = _lane_features(scenario)
    signalled = {c.id for c in road_map.connections if c.signal is not None and c.id in lanes}
    assert set(scenario["dynamic_map_states"]) == signalled
    for key, light in scenario["dynamic_map_states"].items():
        assert light["type"] == "TRAFFIC_LIGHT"
        assert len(light["state"]["object_state"]) == scenario["length"]
        assert np.linalg.norm(light["stop_point"] - lanes[key]["polyline"][0]) < 1e-6


def test_write_metadrive_drives_the_ego_car_along_linked_lanes(exported):
    scenario = exported[2]
    track, lanes = scenario["tracks"]["ego"], _lane_features(scenario)
    way = track["metadata"]["route"]
    for one, following in itertools.pairwise(way):
        assert following in lanes[one]["exit_lanes"]
    line = shapely.LineString(np.concatenate([lanes[name]["polyline"][:, :2] for name in way]))
    position, velocity = track["state"]["position"], track["state"]["velocity"]
    assert shapely.distance(line, shapely.points(position[:, :2])).max() < 1e-6
    steps = np.linalg.norm(np.diff(position[:, :2], axis=0), axis=1)
    fastest = max(lanes[name]["speed_limit_kmh"] for name in way) / 3.6
    assert steps.sum() > 50
    assert steps.max() <= fastest * 0.1 + 1e-9
    assert np.linalg.norm(velocity, axis=1).max() <= fastest + 1e-9
    for values in track["state"].values():
        assert len(values) == scenario["length"]


def test_write_metadrive_refuses_a_map_without_lanes_for_cars(tmp_path):
    road_map, _ = _read("ingolstadt1")
    walks = tuple(lane for lane in road_map.lanes if lane.kind is LaneKind.SIDEWALK)
    with pytest.raises(ExportError, match="lane for cars"):
        EXPORTERS["metadrive"](replace(road_map, lanes=walks), tmp_path)


@pytest.mark.filterwarnings("ignore")
def test_write_metadrive_is_read_by_metadrive_itself(exported, tmp_path):
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        reader = pytest.importorskip("metadrive.scenario.utils", exc_type=ImportError)
        from metadrive.component.lane.scenario_lane import ScenarioLane  # noqa: PLC0415
        from metadrive.component.road_network.edge_road_network import EdgeRoadNetwork  # noqa: PLC0415
        from metadrive.scenario import ScenarioDescription  # noqa: PLC0415
    road_map, _, _ = exported
    EXPORTERS["metadrive"](road_map, tmp_path)
    _, files, mapping = reader.read_dataset_summary(tmp_path)
    scenario = reader.read_scenario_data(tmp_path / mapping[files[0]] / files[0])
    ScenarioDescription.sanity_check(scenario.to_dict(), check_self_type=True, valid_check=True)
    written = dict(scenario["metadata"]["number_summary"])
    counted = ScenarioDescription.update_summaries(scenario)["metadata"]["number_summary"]
    for key in ("num_objects", "num_moving_objects", "num_traffic_lights", "num_map_features"):
        assert written[key] == counted[key]
    scenario = ScenarioDescription.centralize_to_ego_car_initial_position(scenario)
    network = EdgeRoadNetwork()
    for key in _lane_features(scenario):
        network.add_lane(ScenarioLane(key, scenario["map_features"], need_lane_localization=False))
    way = scenario["tracks"]["ego"]["metadata"]["route"]
    assert len(way) < 2 or network.shortest_path(way[0], way[-1])
