"""The figures against SUMO's own outputs, and the paper's rows."""

import csv
import json
import xml.etree.ElementTree as ET
from pathlib import Path

import numpy as np
import pytest

from dojo_env.config import build_config
from dojo_env.local_world import LocalWorld
from dojo_env.runs import run_controller, summarize

SECONDS = 900


@pytest.fixture(scope="module", params=["cologne1", "two-way"])
def episode(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory):
    """An episode with every output of SUMO's beside ours, decided upon every second."""
    folder = tmp_path_factory.mktemp("outputs")
    lanes = folder / "lanes.add.xml"
    lanes.write_text(
        f"<additional><laneData id='l' freq='1' file='{folder}/lanes.xml' excludeEmpty='true'/></additional>"
    )
    outputs = " ".join(
        f"--{name}-output {folder}/{name.split('-')[0]}.xml" for name in ("tripinfo", "summary", "emission")
    )
    world = LocalWorld(
        build_config(
            scenario=request.param,
            num_seconds=SECONDS,
            out_csv_name=str(folder / "out"),
            delta_time=5,
            additional_sumo_cmd=f"{outputs} --tripinfo-output.write-unfinished -a {lanes} --precision 6",
        )
    )
    world.reset(3)
    infos, ended, step = [], False, 0
    while not ended:
        _, _, ended, info = world.step({world.signals[0]: step // 4 % 4})
        infos.append(info)
        step += 1
    plan = world.map.plans[world.signals[0]]
    figures = world.metrics()
    world.close()
    return folder, plan, infos, figures, world.config.sumo.begin


def read(folder: Path, name: str) -> ET.Element:
    return ET.parse(folder / f"{name}.xml").getroot()  # noqa: S314 - SUMO's own file


def test_trips_agree_with_tripinfo(episode) -> None:
    folder, _, _, figures, begin = episode
    trips = [t.attrib for t in read(folder, "tripinfo")]
    arrived = [t for t in trips if float(t["arrival"]) >= 0]
    assert figures["arrived"] == len(arrived)
    assert figures["throughput"] == pytest.approx(len(arrived) * 3600 / SECONDS)
    durations = [float(t["duration"]) for t in arrived]
    assert figures["mean_trip_duration"] == pytest.approx(np.mean(durations))
    ends = [float(t["arrival"]) + 1 for t in arrived]
    so_far = [
        np.mean([d for d, end in zip(durations, ends, strict=True) if end <= begin + k])
        for k in range(5, SECONDS + 1, 5)
        if any(end <= begin + k for end in ends)
    ]
    assert figures["travel_time"] == pytest.approx(np.mean(so_far))
    present = [float(t["duration"]) + float(t["departDelay"]) for t in trips]
    assert len(trips) == figures["departed"]
    if not figures["backlogged"]:
        # SUMO counts unfinished trips to the last step's begin, we to its end.
        assert figures["travel_time_all"] == pytest.approx(np.mean(present), abs=1.0)
        delays = [float(t["departDelay"]) for t in trips]
        assert figures["depart_delay"] == pytest.approx(np.mean(delays), abs=0.01)
    assert figures["mean_trip_duration_all"] == figures["travel_time_all"]
    assert figures["missing"] == 1 - len(arrived) / (len(trips) + figures["backlogged"])
    late = [float(t["duration"]) + float(t["departDelay"]) > 600 and float(t["arrival"]) < 0 for t in trips]
    if not figures["backlogged"]:
        assert figures["late"] == pytest.approx(sum(late) / len(trips), abs=0.002)
    losses = [float(t["timeLoss"]) for t in trips]
    assert figures["time_loss"] == pytest.approx(np.mean(losses), abs=0.1)
    mode = figures["modes"]["passenger"]
    assert (mode["arrived"], mode["departed"]) == (figures["arrived"], figures["departed"])
    # What a vehicle stands after the last decision before it arrives is not counted.
    assert mode["mean_waiting"] == pytest.approx(np.mean([float(t["waitingTime"]) for t in trips]), abs=0.2)
    movements = next(iter(figures["movements"].values()))
    # A trip or two may end before the signal.
    assert 0 <= figures["departed"] - sum(m["departed"] for m in movements.values()) <= 2


def test_system_figures_agree_with_summary(episode) -> None:
    folder, _, infos, _, _ = episode
    steps = {float(s.get("time", 0)) + 1: s.attrib for s in read(folder, "summary")}
    for info in infos:
        step = steps[info["step"]]
        assert info["system_total_running"] == int(step["running"])
        assert info["system_total_stopped"] == int(step["halting"])
        assert info["system_total_arrived"] == int(step["arrived"])
        assert info["system_total_backlogged"] == int(step["waiting"])
        if info["system_total_running"]:
            assert info["system_mean_speed"] == pytest.approx(float(step["meanSpeed"]), abs=1e-4)


def test_episode_figures_are_means_of_what_info_tells(episode) -> None:
    _, _, infos, figures, _ = episode
    names = {
        "co2": "co2",
        "delay": "delay",
        "queue": "stopped",
        "accumulated_waiting": "accumulated_waiting_time",
    }
    for figure, name in names.items():
        assert figures[figure] == pytest.approx(np.mean([info[f"agents_total_{name}"] for info in infos])), (
            figure
        )


def test_co2_and_queue_agree_with_emission_output(episode) -> None:
    folder, plan, infos, figures, begin = episode
    lanes = set(plan.lanes)
    grams, halting = [], []
    for instant in read(folder, "emission"):
        if float(instant.get("time", 0)) + 1 in {info["step"] for info in infos}:
            here = [v.attrib for v in instant if v.get("lane") in lanes]
            grams.append(sum(float(v["CO2"]) for v in here) / 1000)
            halting.append(sum(float(v["speed"]) < 0.1 for v in here))
            assert {v["eclass"] for v in here} <= {"HBEFA3/PC_G_EU4"}
    assert len(grams) == SECONDS // 5
    assert figures["co2"] == pytest.approx(np.mean(grams), rel=1e-3)
    assert figures["queue"] == pytest.approx(np.mean(halting))
    assert begin == infos[0]["step"] - 5


def test_delay_agrees_with_lane_speeds(episode) -> None:
    folder, plan, infos, figures, _ = episode
    speeds: dict[float, dict[str, float]] = {}
    for interval in read(folder, "emission"):
        found: dict[str, list[float]] = {}
        for vehicle in interval:
            found.setdefault(vehicle.get("lane", ""), []).append(float(vehicle.get("speed", 0)))
        speeds[float(interval.get("time", 0)) + 1] = {lane: float(np.mean(v)) for lane, v in found.items()}
    limits = dict(zip(plan.lanes, plan.limits, strict=True))
    delays = [
        sum(
            1 - speeds[info["step"]][lane] / limit
            for lane, limit in limits.items()
            if lane in speeds[info["step"]]
        )
        for info in infos
    ]
    assert figures["delay"] == pytest.approx(np.mean(delays), rel=1e-3)


def test_every_episode_is_written(tmp_path: Path) -> None:
    stem = tmp_path / "deep" / "run"
    for _ in range(2):
        world = LocalWorld(build_config(scenario="two-way", num_seconds=20, out_csv_name=str(stem)))
        world.reset(1)
        for _ in range(4):
            world.step({"t": 0})
        world.reset(2)
        world.step({"t": 0})
        world.reset(3)
        world.step({"t": 0})
        world.close()
    names = sorted(path.name for path in stem.parent.iterdir())
    assert names == sorted(
        f"run_conn{label}_ep{n}.{kind}" for label in (0, 1) for n in (1, 2, 3) for kind in ("csv", "json")
    )
    with (stem.parent / "run_conn0_ep1.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert [float(row["step"]) for row in rows] == [5, 10, 15, 20]
    assert {"system_total_stopped", "t_stopped", "agents_total_stopped"} <= set(rows[0])
    figures = json.loads((stem.parent / "run_conn1_ep3.json").read_text())
    assert figures["seed"] == 3


@pytest.mark.slow
@pytest.mark.parametrize(
    ("scenario", "controller", "settings", "expected"),
    [
        (
            "two-way",
            "max-pressure-paper",
            {},
            {"travel_time": 44.18, "queue": 11.04, "co2": 55.81, "delay": 4.84},
        ),
        (
            "cologne1",
            "max-pressure-paper",
            {"min_green": 8},
            {"travel_time": 43.29, "co2": 39.12, "delay": 2.6},
        ),
    ],
)
def test_reference_rows_are_reproduced(scenario, controller, settings, expected) -> None:
    summary = summarize(run_controller(controller, range(2), scenario=scenario, **settings))
    for name, value in expected.items():
        assert summary[name]["mean"] == pytest.approx(value, rel=0.06), name
