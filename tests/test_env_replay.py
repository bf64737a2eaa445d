"""Recordings seen again without SUMO: the same bytes as live, other cameras and light, videos, MetaDrive."""

import hashlib
import itertools
import json
import os
import pickle
import pty
import re
import subprocess
import sys
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from conftest import command_environment

import dojo_env
from dojo_env.camera import Camera, write_cameras
from dojo_env.cli import main
from dojo_env.conditions import Conditions
from dojo_env.config import build_config
from dojo_env.env import TrafficSignalEnv
from dojo_env.errors import ConfigError, RecordingError
from dojo_env.local_world import LocalWorld
from dojo_env.recording import Recorder, Recording
from dojo_env.replaying import find_map, replay
from dojo_env.sensors.lidar import Lidar
from dojo_maps.errors import ExportError

_SPOILT = {"hour": 20.0, "rain": 0.4, "noise": 3.0, "shake_m": 0.2, "dropped": 0.3}
_WITHOUT_SUMO = """
import hashlib, json, sys
from dojo_env.conditions import Conditions
from dojo_env.recording import Recording
from dojo_env.replaying import replay
path, conditions = sys.argv[1], Conditions(**json.loads(sys.argv[2]))
digests = [
    [hashlib.sha256(picture.rgb.tobytes()).hexdigest() for picture in seen.pictures]
    for seen in replay(Recording.open(path), every=5, conditions=conditions)
]
assert not {"libsumo", "traci", "dojo_env.simulation"} & sys.modules.keys()
print(json.dumps(digests))
"""


@pytest.fixture(scope="module")
def record(tmp_path_factory: pytest.TempPathFactory) -> Callable[..., Path]:
    """Record a minute of a scenario, once, and give the file."""
    made: dict[tuple[str, int], Path] = {}

    def make(scenario: str, seconds: int = 60) -> Path:
        if (scenario, seconds) not in made:
            stem = tmp_path_factory.mktemp("recording") / scenario
            config = build_config(scenario=scenario, num_seconds=seconds, record_name=str(stem))
            world = LocalWorld(config)
            world.reset(1)
            for k in itertools.count():
                *_, ended, _ = world.step(dict.fromkeys(world.signals, k // 3 % 2))
                if ended:
                    break
            world.close()
            made[scenario, seconds] = Path(f"{stem}_ep1.npz")
        return made[scenario, seconds]

    return make


@pytest.mark.slow
@pytest.mark.sampled(2)
@pytest.mark.parametrize("scenario", ["two-way", "cologne1"])
@pytest.mark.parametrize("conditions", [{}, _SPOILT], ids=["clear", "spoilt"])
def test_replayed_pictures_have_the_bytes_of_the_episode_s(
    scenario: str, conditions: dict[str, float], tmp_path: Path
) -> None:
    env = TrafficSignalEnv(
        scenario=scenario,
        observation={name: name for name in (*(f"approach_{k}" for k in range(4)), "bev")},
        num_seconds=60,
        conditions=Conditions(**conditions),
        record_name=str(tmp_path / "rec"),
    )
    seen = [env.reset(seed=5)[0]]
    ended = False
    while not ended:
        observation, _, _, ended, _ = env.step(len(seen) % 2)
        seen.append(observation)
    env.close()
    live = [[hashlib.sha256(view.tobytes()).hexdigest() for view in each.values()] for each in seen]
    command = [sys.executable, "-c", _WITHOUT_SUMO, str(tmp_path / "rec_ep1.npz"), json.dumps(conditions)]
    done = subprocess.run(
        command, env=command_environment(), capture_output=True, text=True, timeout=300, check=False
    )
    assert done.returncode == 0, done.stderr
    assert json.loads(done.stdout) == live


@pytest.mark.slow
def test_a_recording_is_seen_through_other_cameras_lidars_and_light(record: Callable[..., Path]) -> None:
    recording = Recording.open(record("cologne1"))
    assert (recording.scenario, recording.seed, len(recording)) == ("cologne1", 1, 61)
    place = next(replay(recording)).pictures[0].camera.position
    mine = Camera(name="mine", position=(place[0], place[1], 30.0), pitch_deg=-60, width=120, height=90)
    lidar = Lidar(name="spin", position=place)
    outputs = ("rgb", "depth", "instance")
    day, night = (
        list(replay(recording, [mine], lidars=[lidar], outputs=outputs, every=20, conditions=each))
        for each in (Conditions(), Conditions(hour=23))
    )
    assert [seen.snapshot.time for seen in day] == [25200, 25220, 25240, 25260]
    for bright, dark in zip(day, night, strict=True):
        assert bright.pictures[0].rgb.shape == (90, 120, 3)
        assert bright.pictures[0].rgb.mean() > 1.5 * dark.pictures[0].rgb.mean()
        assert np.array_equal(bright.pictures[0].instance, dark.pictures[0].instance)
        assert np.array_equal(bright.scans[0].ranges, dark.scans[0].ranges)


def test_a_recording_is_only_replayed_on_its_own_map(
    record: Callable[..., Path], network_path: Callable[[str], Path], tmp_path: Path
) -> None:
    recording = Recording.open(record("cologne1"))
    with pytest.raises(RecordingError, match="another map than two-way"):
        find_map(recording, "two-way")
    assert find_map(recording, network_path("cologne1")).road_map.name == "cologne1"
    recorder = Recorder(scenario="mine", map_sha256="0")
    recorder.add(recording[0])
    recorder.write(tmp_path / "mine.npz")
    with pytest.raises(RecordingError, match=r"'mine'.*give the map"):
        find_map(Recording.open(tmp_path / "mine.npz"))
    with pytest.raises(ConfigError, match="every=0"):
        next(replay(recording, every=0))
    with pytest.raises(ConfigError, match="colour"):
        next(replay(recording, colour="red"))


@pytest.mark.slow
@pytest.mark.sampled(1)
@pytest.mark.parametrize("suffix", [".mp4", ".webm"])
def test_run_films_every_second(suffix: str, tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    target = tmp_path / f"out{suffix}"
    arguments = ["run", "--scenario", "two-way", "--controller", "sotl", "--seconds", "30"]
    assert main([*arguments, "--video", str(target)]) == 0
    assert list(tmp_path.iterdir()) == [target]
    assert count_frames(target) == (31, 1456, 658)


@pytest.mark.slow
def test_a_long_film_tells_a_terminal_how_far_it_is(tmp_path: Path) -> None:
    command = [sys.executable, "-m", "dojo_env.cli", "run", "--scenario", "two-way", "--controller", "sotl"]
    command += ["--seconds", "300", "--video", str(tmp_path / "out.mp4")]
    ours, theirs = pty.openpty()
    done = subprocess.run(command, env=command_environment(), stderr=theirs, timeout=300, check=False)
    os.close(theirs)  # Else a read of nothing would wait forever.
    said = os.read(ours, 10_000).decode()
    os.close(ours)
    assert done.returncode == 0, said
    assert re.search(r"\d s  300 seconds drawn", said)


def count_frames(path: Path) -> tuple[int, int, int]:
    video = cv2.VideoCapture(str(path))
    size = int(video.get(cv2.CAP_PROP_FRAME_WIDTH)), int(video.get(cv2.CAP_PROP_FRAME_HEIGHT))
    count = 0
    while video.read()[0]:
        count += 1
    video.release()
    return count, *size


@pytest.mark.parametrize("name", ["out.avi", "missing/out.mp4", "."])
def test_a_video_that_cannot_be_written_is_one_line_and_leaves_nothing(
    name: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    target = str(tmp_path / name)
    arguments = ["run", "--scenario", "two-way", "--controller", "sotl", "--seconds", "30", "--video", target]
    assert main(arguments) == 2
    said = capsys.readouterr()
    assert said.err.count("\n") == 1
    assert "dojo-env: " in said.err
    assert not list(tmp_path.iterdir())


@pytest.mark.slow
def test_a_run_that_fails_leaves_no_video(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    target = tmp_path / "out.mp4"
    target.write_bytes(b"before")
    routes = tmp_path / "bad.rou.xml"
    routes.write_text("<routes><vehicle id='a' depart='5'><route edges='nowhere'/></vehicle></routes>")
    network = find_map_of("two-way")
    config = tmp_path / "bad.sumocfg"
    config.write_text(
        f"<configuration><net-file value='{network}'/><route-files value='{routes}'/></configuration>"
    )
    arguments = ["run", "--scenario", str(config), "--controller", "sotl", "--seconds", "30"]
    assert main([*arguments, "--video", str(target)]) == 4
    assert target.read_bytes() == b"before"
    assert len(list(tmp_path.iterdir())) == 3


def find_map_of(scenario: str) -> Path:
    from dojo_env.scenario import packaged_scenario  # noqa: PLC0415

    return packaged_scenario(scenario).map


@pytest.mark.slow
def test_replay_films_through_given_cameras_at_night(
    record: Callable[..., Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = record("two-way")
    camera = next(replay(Recording.open(path))).pictures[0].camera
    write_cameras([camera], tmp_path / "cameras.json")
    films = [tmp_path / f"{name}.mp4" for name in ("day", "night")]
    for film in films:
        arguments = ["replay", str(path), "--cameras", str(tmp_path / "cameras.json"), "--video", str(film)]
        assert main([*arguments, "--conditions", film.stem]) == 0
    first = []
    for film in films:
        assert count_frames(film)[0] == 61
        video = cv2.VideoCapture(str(film))
        first.append(video.read()[1].mean())
        video.release()
    assert first[0] > first[1] + 10
    assert capsys.readouterr().out.split() == [str(film) for film in films]


@pytest.mark.parametrize(
    ("arguments", "status", "words"),
    [
        (["missing.npz"], 3, "missing.npz"),
        (["GOOD", "--map", "two-way"], 3, "another map"),
        (["GOOD", "--signals", "nobody"], 2, "nobody"),
        (["GOOD", "--conditions", "hour=99"], 2, "hour"),
        (["GOOD", "--conditions", "sunny"], 2, "sunny"),
        (["GOOD", "--conditions", "seed=1"], 2, "seed"),
        (["GOOD", "--cameras", "missing.json"], 3, "missing.json"),
        (["GOOD", "--export", "metadrive", "-o", "HERE"], 2, "already"),
    ],
)
def test_wrong_usage_of_replay_is_one_line_and_a_status(
    arguments: list[str],
    status: int,
    words: str,
    record: Callable[..., Path],
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:
    places = {"GOOD": str(record("cologne1")), "HERE": str(tmp_path)}
    assert main(["replay", *(places.get(word, word) for word in arguments)]) == status
    said = capsys.readouterr()
    assert not said.out
    assert words in said.err
    assert said.err.count("\n") == 1


@pytest.fixture(scope="module")
def exported(record: Callable[..., Path], tmp_path_factory: pytest.TempPathFactory) -> tuple[Recording, Any]:
    """A recording of cologne1 and the scenarios that MetaDrive gets of it, by their files' names."""
    path = record("cologne1", 200)
    target = tmp_path_factory.mktemp("metadrive") / "out"
    assert main(["replay", str(path), "--export", "metadrive", "-o", str(target)]) == 0
    return Recording.open(path), {file.name: load(file) for file in sorted(target.iterdir())}


def load(path: Path) -> Any:
    return pickle.loads(path.read_bytes())  # noqa: S301 (our own)


def check_sanity(scenario: dict[str, Any]) -> None:
    """The rules of MetaDrive's `ScenarioDescription.sanity_check`, with all its checks on."""
    assert {"id", "version", "length", "metadata", "tracks", "dynamic_map_states", "map_features"} <= set(
        scenario
    )
    length = scenario["length"]
    for name, item in [*scenario["tracks"].items(), *scenario["dynamic_map_states"].items()]:
        assert {"type", "state", "metadata"} <= set(item)
        assert item["type"] in {"VEHICLE", "PEDESTRIAN", "CYCLIST", "TRAFFIC_LIGHT"}
        assert item["metadata"]["object_id"] == name
        assert item["metadata"]["type"] == item["type"]
        for key, values in item["state"].items():
            assert isinstance(values, np.ndarray | list)
            assert len(values) == length
            if isinstance(values, np.ndarray):
                assert values.ndim in {1, 2}
                absent = ~item["state"]["valid"]
                assert not values[absent][..., :2].any(), (name, key)
    for track in scenario["tracks"].values():
        assert {"position", "heading", "velocity", "valid", "length", "width", "height"} <= set(
            track["state"]
        )
        assert track["state"]["valid"].any()
    for feature in scenario["map_features"].values():
        assert "polyline" in feature or "LANE" not in feature["type"] or feature["type"] == "CROSSWALK"
    assert {"metadrive_processed", "coordinate", "ts"} <= set(scenario["metadata"])
    assert scenario["metadata"]["ts"].shape == (length,)
    assert scenario["metadata"]["sdc_id"] in scenario["tracks"]


@pytest.mark.slow
def test_a_long_recording_exports_as_scenarios_that_metadrive_s_rules_accept(
    exported: tuple[Recording, Any],
) -> None:
    recording, files = exported
    names = [name for name in files if name.startswith("sd_")]
    assert set(files) == {*names, "dataset_summary.pkl", "dataset_mapping.pkl"}
    assert list(files["dataset_summary.pkl"]) == list(files["dataset_mapping.pkl"]) == names
    assert len(names) == 2
    assert len({files[name]["id"] for name in names}) == 2
    assert sum(files[name]["length"] - 1 for name in names) <= 10 * (len(recording) - 1)
    for name in names:
        check_sanity(files[name])


def test_tracks_are_where_the_recording_has_them(exported: tuple[Recording, Any]) -> None:
    recording, files = exported
    name, scenario = next((name, files[name]) for name in files if name.startswith("sd_"))
    start = float(name.removesuffix(".pkl").rsplit("_", 1)[1])
    origin = np.array(scenario["metadata"]["map_origin"])
    first = int(np.flatnonzero(recording.times == start)[0])
    checked = 0
    for second in range(0, 100, 7):
        snapshot = recording[first + second]
        present = {key for key, t in scenario["tracks"].items() if t["state"]["valid"][10 * second]}
        assert present == set(snapshot.ids)
        for row, key in enumerate(snapshot.ids):
            state = {what: values[10 * second] for what, values in scenario["tracks"][key]["state"].items()}
            ahead = np.array([np.cos(snapshot.headings[row]), np.sin(snapshot.headings[row])])
            middle = snapshot.positions[row, :2] - ahead * snapshot.sizes[row, 0] / 2
            assert state["position"][:2] + origin == pytest.approx(middle, abs=1e-6)
            assert [np.cos(state["heading"]), np.sin(state["heading"])] == pytest.approx(ahead, abs=1e-9)
            assert np.hypot(*state["velocity"]) == pytest.approx(snapshot.speeds[row], abs=1e-9)
            assert state["length"] == snapshot.sizes[row, 0]
            checked += 1
    assert checked > 100


def test_nobody_jumps_between_the_seconds_of_a_track(exported: tuple[Recording, Any]) -> None:
    _, files = exported
    for scenario in (files[name] for name in files if name.startswith("sd_")):
        for key, track in scenario["tracks"].items():
            valid = track["state"]["valid"]
            both = valid[1:] & valid[:-1]
            steps = np.linalg.norm(np.diff(track["state"]["position"][:, :2], axis=0), axis=1)[both]
            assert not len(steps) or steps.max() < 3.0, key
            turns = np.abs((np.diff(track["state"]["heading"])[both] + np.pi) % (2 * np.pi) - np.pi)
            assert not len(turns) or turns.max() < np.pi / 10 + 1e-9, key


def test_exported_lights_are_those_that_were_shown(exported: tuple[Recording, Any]) -> None:
    recording, files = exported
    name, scenario = next((name, files[name]) for name in files if name.startswith("sd_"))
    first = int(np.flatnonzero(recording.times == float(name.removesuffix(".pkl").rsplit("_", 1)[1]))[0])
    colours = {"r": "STOP", "y": "CAUTION", "g": "GO", "G": "GO"}
    assert len(scenario["dynamic_map_states"]) == 20
    seen = set()
    for second in range(100):
        shown = recording[first + second].signals
        for light in scenario["dynamic_map_states"].values():
            about, states = light["metadata"], light["state"]["object_state"]
            letter = shown[about["signal"]][about["link_index"]]
            assert set(states[10 * second : 10 * second + 10]) == {f"LANE_STATE_{colours[letter]}"}
            seen.add(letter)
    assert {"r", "y", "G"} <= seen


def test_the_car_that_metadrive_follows_is_there_from_the_begin(exported: tuple[Recording, Any]) -> None:
    for name, scenario in exported[1].items():
        if name.startswith("sd_"):
            track = scenario["tracks"][scenario["metadata"]["sdc_id"]]
            assert track["type"] == "VEHICLE"
            assert track["state"]["valid"][0]
            about = scenario["metadata"]["object_summary"][scenario["metadata"]["sdc_id"]]
            assert about["continuous_valid_length"] > 100


@pytest.mark.filterwarnings("ignore")
def test_exported_scenarios_are_read_by_metadrive_itself(record: Callable[..., Path], tmp_path: Path) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        reader = pytest.importorskip("metadrive.scenario.utils", exc_type=ImportError)
        from metadrive.scenario import ScenarioDescription  # noqa: PLC0415
    target = tmp_path / "out"
    arguments = ["replay", str(record("cologne1")), "--export", "metadrive", "-o", str(target)]
    assert main(arguments) == 0
    _, files, mapping = reader.read_dataset_summary(target)
    scenario = reader.read_scenario_data(target / mapping[files[0]] / files[0])
    ScenarioDescription.sanity_check(scenario.to_dict(), check_self_type=True, valid_check=True)
    written = dict(scenario["metadata"]["number_summary"])
    counted = ScenarioDescription.update_summaries(scenario)["metadata"]["number_summary"]
    for key in ("num_objects", "num_moving_objects", "num_traffic_lights", "num_map_features"):
        assert written[key] == counted[key]


def test_a_recording_without_vehicles_exports_nothing(record: Callable[..., Path], tmp_path: Path) -> None:
    recording = Recording.open(record("cologne1"))
    recorder = Recorder(scenario="cologne1", map_sha256=recording.map_sha256)
    for k in range(3):
        recorder.add(dojo_env.Snapshot(time=float(k), signals=recording[0].signals))
    recorder.write(tmp_path / "empty.npz")
    from dojo_env.metadrive import export_recording  # noqa: PLC0415

    empty = Recording.open(tmp_path / "empty.npz")
    with pytest.raises(ExportError, match="no vehicle"):
        export_recording(empty, find_map(empty), tmp_path / "out")
    assert not (tmp_path / "out").exists()
