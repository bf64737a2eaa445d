"""What a SUMO configuration asks for holds, unless an argument says otherwise, and then that is said."""

import re
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from conftest import command_environment
from osm_drawings import cross

from dojo_env.config import build_config
from dojo_env.elements import read_elements
from dojo_env.env import TrafficSignalEnv
from dojo_env.errors import ConfigError, ScenarioError
from dojo_env.local_world import LocalWorld
from dojo_env.sumo_settings import read_words
from dojo_maps import DemandOptions, add_demand
from dojo_maps.conversion import ConvertOptions, convert
from dojo_maps.sumo_programs import find_program

OWN = """
<time><begin value="100"/><end value="0:11:40"/><step-length value="0.5"/></time>
<processing><time-to-teleport value="60"/><max-depart-delay value="30"/></processing>
<random_number><seed value="7"/><random value="true"/></random_number>
<routing><device.rerouting.probability value="0.5"/></routing>
"""
ROUTES = """<routes>
<vType id="lorry" vClass="truck"/><vType id="electric" emissionClass="Zero/default"/>
<vType id="old" emissionClass="HBEFA3/PC_G_EU0"/><vType id="plain"/>
{}</routes>"""


def run(*arguments: object) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-m", "dojo_env", "run", "--controller", "fixed-time", *map(str, arguments)]
    return subprocess.run(command, env=command_environment(), capture_output=True, text=True, check=True)


@pytest.fixture
def write(tmp_path: Path, network_path: Callable[[str], Path]) -> Callable[[str], Path]:
    """Write a configuration over a crossroads with some demand."""

    def written(own: str) -> Path:
        network = network_path("bare")
        trips = "".join(
            f'<trip id="{k}" type="{("lorry", "electric", "old", "plain")[k % 4]}" depart="{100 + 4 * k}"'
            ' from="n" to="-s"/>'
            for k in range(120)
        )
        (tmp_path / "x.rou.xml").write_text(ROUTES.format(trips))
        path = tmp_path / "x.sumocfg"
        path.write_text(
            f'<configuration><input><net-file value="{network}"/><route-files value="x.rou.xml"/></input>'
            f"{own}</configuration>"
        )
        return path

    return written


def test_a_configurations_own_options_hold(write: Callable[[str], Path]) -> None:
    config = build_config(scenario=write(OWN))
    sumo = config.sumo
    assert (sumo.begin, sumo.end, sumo.step, sumo.interval) == (100, 700, 0.5, 5)
    assert config.seed == 7
    wanted = {"time-to-teleport": "60", "max-depart-delay": "30", "device.rerouting.probability": "0.5"}
    assert wanted.items() <= sumo.options.items()
    assert "random" not in sumo.options
    assert not sumo.notes
    unsaid = build_config(scenario=write("")).sumo
    assert (unsaid.begin, unsaid.end, unsaid.step, unsaid.interval) == (0, 3600, 1, 5)
    assert {"time-to-teleport": "-1", "max-depart-delay": "-1"}.items() <= unsaid.options.items()


def test_arguments_win_over_a_configuration_and_that_is_said(write: Callable[[str], Path]) -> None:
    asked: dict[str, Any] = {"begin_time": 150, "num_seconds": 300, "time_to_teleport": -1, "sumo_seed": 3}
    config = build_config(
        scenario=write(OWN), max_depart_delay=30, additional_sumo_cmd="--step-length 1", **asked
    )
    sumo = config.sumo
    assert (sumo.begin, sumo.end, sumo.step, config.seed) == (150, 450, 1, 3)
    assert sumo.options["time-to-teleport"] == "-1"
    said = sorted(re.sub(r".*: (\S+) (\S+) gives way to (\S+),.*", r"\1 \2 \3", note) for note in sumo.notes)
    assert said == [
        "begin 100 150",
        "end 0:11:40 450",
        "step-length 0.5 1",
        "time-to-teleport 60 -1",
    ]


@pytest.mark.parametrize(
    ("own", "keywords", "words"),
    [
        ("<time><step-length value='0.4'/></time>", {"delta_time": 5}, "no multiple of SUMO's step of 0.4 s"),
        ("<time><step-length value='-1'/></time>", {}, "step-length -1: expected 0.001 to 3,600 s"),
        ("<time><step-length value='half'/></time>", {}, "step-length 'half': expected a number of seconds"),
        ("<time><end value='50'/></time>", {"begin_time": 60}, "ends at 50 s, before it begins at 60 s"),
        ("<random_number><seed value='x'/></random_number>", {}, "expected a whole number from 0"),
        ("", {"num_seconds": 7}, "no multiple of delta_time=5"),
        ("", {"additional_sumo_cmd": "--remote-port 8813"}, "remote-port cannot be set here"),
        ("", {"additional_sumo_cmd": "-c other.sumocfg"}, "c cannot be set here; give scenario="),
        ("", {"additional_sumo_cmd": "--load-state x.xml"}, "load-state cannot be set here"),
        ("", {"additional_sumo_cmd": "300"}, "'300' belongs to no option"),
        ("", {"additional_sumo_cmd": '--a "'}, "No closing quotation"),
    ],
)
def test_what_cannot_be_is_refused(
    write: Callable[[str], Path], own: str, keywords: dict[str, Any], words: str
) -> None:
    with pytest.raises(ConfigError) as refused:
        build_config(scenario=write(own), **keywords)
    assert words in str(refused.value)
    assert isinstance(refused.value, ScenarioError) == ("'half'" in words or "whole number" in words)


def test_with_generated_demand_nobody_waits_for_ever_inside_a_junction(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    convert(str(cross().write(tmp_path / "a.osm")), tmp_path / "a.dojo", ConvertOptions(demand=600))
    add_demand("cologne1", DemandOptions(volume=600))
    for scenario in ("a.dojo", "cologne1.demand.sumocfg"):
        assert build_config(scenario=scenario).sumo.options["ignore-junction-blocker"] == "60"
        other = build_config(scenario=scenario, additional_sumo_cmd="--ignore-junction-blocker -1").sumo
        assert other.options["ignore-junction-blocker"] == "-1"
        (note,) = other.notes
        assert note.endswith(": ignore-junction-blocker 60 gives way to -1, as you ask")
    assert "ignore-junction-blocker" not in build_config(scenario="cologne1").sumo.options


def test_words_are_read_as_on_sumos_command_line() -> None:
    text = "--time-to-teleport -1 --scale=1.5 -b 10 --sloppy-insert --eager-insert false"
    assert read_words(text) == {
        "time-to-teleport": "-1",
        "scale": "1.5",
        "begin": "10",
        "sloppy-insert": "true",
        "eager-insert": "false",
    }


def test_a_configurations_seed_is_that_of_the_first_episode(
    write: Callable[[str], Path], caplog: pytest.LogCaptureFixture
) -> None:
    said = "x.sumocfg: seed 7 gives way to the episodes' own, as you ask"
    random = "<random_number><seed value='7'/></random_number><routing><scale value='0.5'/></routing>"
    env = TrafficSignalEnv(scenario=write(random + "<time><begin value='100'/></time>"), num_seconds=100)
    departed = {}
    for seed in (None, 7, 8):
        env.reset(seed=seed)
        for _ in range(20):
            _, _, _, _, info = env.step(0)
        departed[seed] = (info["system_total_departed"], info["system_mean_speed"])
        assert (said in caplog.text) == (seed == 8)
    env.close()
    assert departed[None] == departed[7] != departed[8]


@pytest.mark.sampled(2)
@pytest.mark.parametrize("step", ["0.1", "0.4", "0.5", "1", "2"])
def test_trips_are_those_of_sumo_alone_whatever_the_length_of_its_steps(
    write: Callable[[str], Path], tmp_path: Path, step: str
) -> None:
    path = write(OWN.replace("0.5", step))
    network = build_config(scenario=path).scenario.map
    subprocess.run(
        [
            *(find_program("sumo"), "-c", path, "--random", "false", "--no-step-log", "--no-warnings"),
            *("--tripinfo-output", tmp_path / "trips.xml", "--end", "700", "-n", network),
        ],
        check=True,
        capture_output=True,
    )
    durations: list[float] = []
    read_elements(
        tmp_path / "trips.xml",
        lambda kind, trip: durations.append(float(trip["duration"])) if kind == "tripinfo" else None,
    )
    world = LocalWorld(build_config(scenario=path, fixed_ts=True))
    world.reset(seed=7)
    ended, times = False, []
    while not ended:
        _, _, ended, info = world.step({})
        times.append(info["step"])
    figures = world.metrics()
    world.close()
    assert len(durations) > 20
    assert times[-1] == 700
    assert figures["arrived"] == len(durations)
    assert figures["mean_trip_duration"] == pytest.approx(sum(durations) / len(durations), abs=0.005)


@pytest.mark.sampled(2)
@pytest.mark.parametrize("step", ["0.1", "0.4", "0.5", "2"])
def test_signals_keep_their_rules_whatever_the_length_of_sumos_steps(
    write: Callable[[str], Path], step: str
) -> None:
    world = LocalWorld(build_config(scenario=write(OWN.replace("0.5", step)), yellow_time=3, all_red=1))
    world.reset(seed=1)
    (signal,) = world.signals
    ended, number = False, 0
    while not ended:
        _, _, ended, _ = world.step({signal: number // 3 % len(world.map.plans[signal].phases)})
        number += 1
    violations = world.metrics()["violations"]
    world.close()
    assert number > 50
    assert not violations


def test_only_vehicles_like_sumos_usual_car_get_the_emission_class(write: Callable[[str], Path]) -> None:
    world = LocalWorld(build_config(scenario=write("<time><begin value='100'/></time>")))
    world.reset(seed=1)
    read = world.traffic.simulation._sumo.vehicletype.getEmissionClass
    classes = {name: read(name) for name in ("lorry", "electric", "old", "plain", "DEFAULT_VEHTYPE")}
    world.close()
    assert classes["plain"] == classes["DEFAULT_VEHTYPE"] == "HBEFA3/PC_G_EU4"
    assert (classes["electric"], classes["old"]) == ("Zero/default", "HBEFA3/PC_G_EU0")
    assert classes["lorry"].startswith("HBEFA4/RT_")


@pytest.mark.slow
def test_the_command_takes_the_configuration_at_its_word(write: Callable[[str], Path]) -> None:
    path = write(OWN)
    whole = run("--scenario", path)
    named = run("--scenario", path, "--seconds", 600)
    assert whole.stdout == named.stdout
    assert "random" in whole.stderr
    assert "gives way" not in whole.stderr
    assert "seed" not in whole.stderr
    other = run("--scenario", path, "--seconds", 300)
    assert other.stderr.count("x.sumocfg: end 0:11:40 gives way to 400") == 1
