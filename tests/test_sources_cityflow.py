"""CityFlow's road networks and traffic: what they say is in the network, what is lost is told."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

import dojo_env
from dojo_env.errors import ConfigError, ScenarioError
from dojo_env.scenario import find_scenario, packaged_scenario
from dojo_env.scenario_folders import first_departure
from dojo_maps import cli
from dojo_maps.bundle import open_bundle
from dojo_maps.errors import SourceError
from dojo_maps.sources.cityflow import build_network
from dojo_maps.sources.cityflow_files import find_files

SIDES = ((1, 0), (0, 1), (-1, 0), (0, -1))
"""Directions of driving: east, north, west, south."""
TURNS = ("turn_left", "go_straight", "turn_right")
VEHICLE = {
    "length": 6.0, "width": 1.9, "maxPosAcc": 2.0, "maxNegAcc": 5.0, "usualPosAcc": 1.5, "usualNegAcc": 4.0,
    "minGap": 3.0, "maxSpeed": 15.0, "headwayTime": 1.2,
}  # fmt: skip


def draw_crossing(*, permissive: bool = False) -> dict[str, Any]:
    """One signalised junction with lanes for left, straight and right; lane 0 lies at the road's middle."""
    places = {"middle": (0, 0)} | {f"end{k}": (-200 * x, -200 * y) for k, (x, y) in enumerate(SIDES)}
    roads = []
    for k in range(4):
        for name, start, end in ((f"in{k}", f"end{k}", "middle"), (f"out{k}", "middle", f"end{(k + 2) % 4}")):
            points = [dict(zip("xy", places[place], strict=True)) for place in (start, end)]
            roads.append({
                "id": name, "points": points, "startIntersection": start, "endIntersection": end,
                "lanes": [{"width": 3.5, "maxSpeed": 10 + lane} for lane in range(3)],
            })  # fmt: skip
    links = [
        {
            "type": turn, "startRoad": f"in{k}", "endRoad": f"out{(k + shift) % 4}", "direction": k,
            "laneLinks": [{"startLaneIndex": lane, "endLaneIndex": end, "points": []} for end in range(3)],
        }
        for k in range(4)
        for lane, (turn, shift) in enumerate(zip(TURNS, (1, 0, -1), strict=True))
    ]  # fmt: skip

    def pick(*turns: str, axis: int) -> list[int]:
        return [n for n, link in enumerate(links) if link["direction"] % 2 == axis and link["type"] in turns]

    rights = [n for n, link in enumerate(links) if link["type"] == "turn_right"]
    phases = [{"time": 5, "availableRoadLinks": rights}]
    for axis in (0, 1):
        groups = (TURNS,) if permissive else (("go_straight", "turn_right"), ("turn_left",))
        phases += [{"time": 20, "availableRoadLinks": pick(*turns, axis=axis)} for turns in groups]
    middle = {"roadLinks": links, "trafficLight": {"roadLinkIndices": [], "lightphases": phases}}
    bare = {"roadLinks": [], "trafficLight": {"roadLinkIndices": [], "lightphases": []}}
    return {
        "roads": roads,
        "intersections": [
            {"id": name, "point": {"x": x, "y": y}, "width": 20, "virtual": name != "middle", "roads": []}
            | (middle if name == "middle" else bare)
            for name, (x, y) in places.items()
        ],
    }


FLOWS = [
    {"vehicle": VEHICLE, "route": ["in0", "out0"], "interval": 10.0, "startTime": 0, "endTime": 290},
    {"vehicle": VEHICLE, "route": ["in1", "out2"], "interval": 1.0, "startTime": 20, "endTime": 20},
]


@pytest.fixture
def write(tmp_path: Path) -> Callable[..., Path]:
    def write(name: str, value: Any) -> Path:
        path = tmp_path / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(json.dumps(value), encoding="utf-8")
        return path

    return write


def convert(source: Path, folder: Path) -> tuple[Any, dict[str, Any]]:
    assert cli.main(["convert", str(source), "-o", str(folder), "--quiet"]) == 0
    return open_bundle(folder).road_map, json.loads((folder / "report.json").read_text(encoding="utf-8"))


def test_lanes_turns_and_phases_are_those_of_the_file(write: Any, tmp_path: Path) -> None:
    road_map, report = convert(write("roadnet.json", draw_crossing()), tmp_path / "x.dojo")
    assert road_map.source.kind == "cityflow"
    assert {lane.id: lane.speed for lane in road_map.lanes if lane.road == "in0"} == {
        "in0_0": 12, "in0_1": 11, "in0_2": 10,
    }  # fmt: skip
    ways = {c.from_lane: (c.to_lane, c.direction) for c in road_map.connections if c.from_lane[:3] == "in0"}
    assert ways == {"in0_2": ("out1_2", "l"), "in0_1": ("out0_1", "s"), "in0_0": ("out3_0", "r")}
    (signal,) = road_map.signals
    phases = signal.programs[0].phases
    assert sum(phase.duration for phase in phases) == 5 + 4 * 20
    links = {link.index: (link.from_id[:3], link.direction) for link in signal.links}
    green = [
        {links[k] for k, letter in enumerate(phase.state) if letter in "Gg"}
        for phase in phases
        if "y" not in phase.state
    ]
    assert green[1] == {(f"in{k}", turn) for k in (0, 2) for turn in "sr"}
    assert green[2] == {(f"in{k}", "l") for k in (0, 2)}
    assert all(phase.duration == 3 for phase in phases if "y" in phase.state)
    told = [issue for issue in report["issues"] if issue["check"] == "sumo.cityflow_lost"]
    assert "24 of 36 lane links" in told[0]["message"]
    assert told[1]["elements"] == [{"kind": "signal", "id": "middle"}]
    assert not report["counts"]["error"]


def test_who_turns_left_beside_oncoming_traffic_yields(write: Any, tmp_path: Path) -> None:
    road_map, report = convert(write("roadnet.json", draw_crossing(permissive=True)), tmp_path / "x.dojo")
    (signal,) = road_map.signals
    left = [
        link.index for link in signal.links if link.direction == "l" and link.from_id[:3] in ("in0", "in2")
    ]
    state = signal.programs[0].phases[2].state
    assert [state[k] for k in left] == ["g", "g"]
    assert any("yield" in issue["message"] for issue in report["issues"])


def test_traffic_drives_as_the_file_says(write: Any, tmp_path: Path) -> None:
    write("net/roadnet.json", draw_crossing())
    write("net/flow.json", [*FLOWS, {**FLOWS[0], "route": ["nowhere"]}])
    road_map, report = convert(tmp_path / "net", tmp_path / "x.dojo")
    assert road_map.name == "net"
    assert any("1 of 3 flows" in issue["message"] for issue in report["issues"])
    env = dojo_env.TrafficSignalEnv(scenario=tmp_path / "x.dojo", num_seconds=900, action_mode="next_or_keep")
    env.reset(seed=1)
    ended = False
    while not ended:
        ended = env.step(1)[3]
    figures = env.metrics()
    kind = env.world.traffic.simulation.interface.vehicletype
    assert (kind.getLength("vehicle_0"), kind.getTau("vehicle_0")) == (6.0, 1.2)
    env.close()
    assert figures["departed"] == figures["arrived"] == 31
    assert set(figures["movements"]["middle"]) == {"in0->out0", "in1->out2"}


def test_configurations_name_files_from_above_their_folder(write: Any, tmp_path: Path) -> None:
    roads = write("data/raw_data/one/roadnet.json", draw_crossing())
    flows = write("data/raw_data/one/flow.json", FLOWS)
    settings = {
        "dir": "data/",
        "roadnetFile": "raw_data/one/roadnet.json",
        "flowFile": "raw_data/one/flow.json",
    }
    path = write("configs/sim/cityflow_one.cfg", settings)
    assert find_files(path) == (roads, flows)
    scenario = find_scenario(path)
    assert scenario.name == "cityflow_one"
    assert (scenario.begin, scenario.end) == (0, 3600)
    assert scenario.routes[0].parent == scenario.map
    files = packaged_scenario("cologne1")
    for name in (files.map, files.routes[0]):
        (tmp_path / "data" / name.name).symlink_to(name)
    settings = {"dir": "data/", "roadnetFile": files.map.name, "flowFile": files.routes[0].name}
    scenario = find_scenario(write("configs/sim/sumo_one.cfg", settings))
    assert (scenario.map.name, scenario.begin, scenario.end) == (files.map.name, 25200, 28800)
    with pytest.raises(ScenarioError, match="combined_file"):
        find_scenario(write("configs/sim/half.cfg", {"dir": "data/", "roadnetFile": files.map.name}))


def test_folders_of_resco_and_libsignal_open_by_path(tmp_path: Path) -> None:
    packaged = packaged_scenario("grid4x4")
    found = find_scenario(packaged.map.parent)
    assert (found.map, found.routes, found.begin) == (packaged.map, packaged.routes, 0)
    folder = tmp_path / "grid"
    folder.mkdir()
    (folder / "grid.net.xml").symlink_to(packaged.map)
    with pytest.raises(ScenarioError, match="no routes"):
        find_scenario(folder)
    for number in (10, 2, 1):
        (folder / f"grid_{number}.rou.xml").symlink_to(packaged.routes[0])
    assert find_scenario(folder).routes == (folder / "grid_1.rou.xml",)
    (folder / "other.net.xml").symlink_to(packaged.map)
    with pytest.raises(ScenarioError, match="more than one SUMO network"):
        find_scenario(folder)
    assert first_departure(packaged_scenario("ingolstadt1").routes[0]) >= 57600
    with pytest.raises(ConfigError, match="no scenario"):
        find_scenario(tmp_path)


def change(name: str, value: Any) -> dict[str, Any]:
    network = draw_crossing()
    place, road, link = (
        network["intersections"][0],
        network["roads"][0],
        network["intersections"][0]["roadLinks"][0],
    )
    owner = {"roads": network, "intersections": network}.get(name)
    for part in (place, road, link, link["laneLinks"][0], road["lanes"][0], road["points"][0],
                 place["trafficLight"]["lightphases"][0]):  # fmt: skip
        owner = part if owner is None and name in part else owner
    owner[name] = value
    return network


@pytest.mark.parametrize(
    ("name", "value", "words"),
    [
        ("roads", {}, "roads is {}; expected a list"),
        ("roads", [7], "roads.0..lanes is missing"),
        ("intersections", [], "is not there"),
        ("point", "here", "expected an object"),
        ("roadLinks", 3, "expected a list"),
        ("startIntersection", "gone", "is not there"),
        ("startRoad", "gone", "'gone'"),
        ("startLaneIndex", 3, "below 3"),
        ("endLaneIndex", True, "expected a whole number"),
        ("width", -1, "width is -1"),
        ("maxSpeed", "fast", "expected a number"),
        ("x", 1e300, "expected a number"),
        ("availableRoadLinks", [99], "names road link"),
        ("availableRoadLinks", [0.5], "a list of int"),
        ("time", -5, "time is -5"),
        ("points", [{"x": 0, "y": 0}], "one point only"),
        ("id", "end0", "same id"),
    ],
)
def test_what_is_wrong_is_one_error_that_names_the_place(
    write: Any, name: str, value: Any, words: str
) -> None:
    path = write("roadnet.json", change(name, value))
    with pytest.raises(SourceError, match=words):
        build_network(path)


def test_ids_that_sumo_cannot_have_are_refused(write: Any) -> None:
    network = json.loads(json.dumps(draw_crossing()).replace("middle", "mid dle;"))
    with pytest.raises(SourceError, match="netconvert makes no network of it"):
        build_network(write("roadnet.json", network))


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"interval": 0}, "interval"),
        ({"interval": 0.001, "endTime": 1e7}, "vehicles"),
        ({"route": "in0"}, "route"),
        ({"vehicle": None}, "vehicle is missing"),
        ({"startTime": -1}, "startTime"),
    ],
)
def test_traffic_that_is_wrong_is_one_error(write: Any, changes: dict[str, Any], words: str) -> None:
    roads, flows = write("roadnet.json", draw_crossing()), write("flow.json", [{**FLOWS[0], **changes}])
    with pytest.raises(SourceError, match=words):
        build_network(roads, traffic=flows)


def test_files_of_others_are_refused(write: Any, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for path in (
        write("a.json", {"a": 1}),
        write("b.json", [1]),
        write("c.cfg", {"roadnetFile": "gone.json"}),
    ):
        assert cli.main(["convert", str(path), "-o", str(tmp_path / "x")]) == 3
        assert len(capsys.readouterr().err.splitlines()) == 1
    write("two/roadnet_a.json", draw_crossing())
    write("two/roadnet_b.json", draw_crossing())
    with pytest.raises(SourceError, match=r"roadnet_a\.json, roadnet_b\.json"):
        find_files(tmp_path / "two")
