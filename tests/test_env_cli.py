"""The command `dojo-env`."""

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import pytest
from conftest import command_environment

from dojo_env.cli import main
from dojo_env.controllers import CONTROLLERS
from dojo_env.scenario import packaged_scenario


@pytest.mark.sampled(3)
@pytest.mark.parametrize("controller", CONTROLLERS)
def test_run_works_with_every_controller(
    controller: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    target = tmp_path / "out.json"
    arguments = [
        "run",
        "--scenario",
        "two-way",
        "--controller",
        controller,
        "--seeds",
        "2",
        "--seconds",
        "300",
    ]
    assert main([*arguments, "--json", str(target)]) == 0
    assert "travel_time" in capsys.readouterr().out
    found = json.loads(target.read_text())
    assert [episode["seed"] for episode in found["episodes"]] == [0, 1]
    assert found["summary"]["arrived"]["mean"] > 20
    assert all(not episode["violations"] for episode in found["episodes"])


def test_scenarios_lists_signals_demand_and_licence(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["scenarios"]) == 0
    lines = {line.split()[0]: line.split() for line in capsys.readouterr().out.splitlines() if line}
    assert lines["cologne1"][1:4] == ["1", "2015", "25200"]
    assert lines["ingolstadt21"][1] == "21"
    assert "GPL-3.0" in lines["ingolstadt21"]


def test_a_demand_that_begins_after_the_end_is_told(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A .sumocfg that forgets <begin> simulates hours in which nobody is there."""
    cologne = packaged_scenario("cologne1")
    path = tmp_path / "late.sumocfg"
    path.write_text(
        f'<configuration><input><net-file value="{cologne.map}"/>'
        f'<route-files value="{cologne.routes[0]}"/></input></configuration>'
    )
    assert main(["run", "--scenario", str(path), "--controller", "random", "--seconds", "60"]) == 0
    assert "no vehicle" in capsys.readouterr().err


@pytest.mark.slow
def test_a_run_without_a_controller_leaves_the_signals_to_their_programs(
    capsys: pytest.CaptureFixture[str],
) -> None:
    """Who only wants to see a scenario's figures need not know who could control it."""
    asked = ["run", "--scenario", "cologne1", "--seconds", "120"]
    tables = []
    for controller in ([], ["--controller", "fixed-time"], ["--controller", "max-pressure"]):
        assert main([*asked, *controller]) == 0
        tables.append(capsys.readouterr().out)
    assert tables[0] == tables[1] != tables[2]


@pytest.mark.parametrize(
    ("arguments", "status", "words"),
    [
        (["run", "--scenario", "nowhere", "--controller", "random"], 2, "nowhere"),
        (["run", "--scenario", "two-way", "--controller", "magic"], 2, "magic"),
        (["run", "--scenario", "two-way", "--controller", "random", "--seeds", "0"], 2, "--seeds"),
        (["run", "--scenario", "two-way", "--controller", "random", "--min-green", "0"], 2, "min_green"),
        (["run", "--scenario", "missing.sumocfg", "--controller", "random"], 3, "missing.sumocfg"),
        (["run", "--scenario", "two-way", "--controller", "random", "--json", "none/x.json"], 2, "--json"),
    ],
)
def test_wrong_usage_is_one_line_and_a_status(
    arguments: list[str], status: int, words: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(arguments) == status
    said = capsys.readouterr()
    assert not said.out
    assert words in said.err
    assert said.err.count("\n") == 1


@pytest.mark.parametrize("command", ["dojo_maps.cli checks", "dojo_env.cli scenarios"])
def test_who_reads_only_the_first_line_is_not_told_of_a_failure(command: str) -> None:
    shell = f"{sys.executable} -m {command} | head -1; exit ${{PIPESTATUS[0]}}"
    done = subprocess.run(
        ["bash", "-c", shell], capture_output=True, text=True, env=command_environment(), check=False
    )
    assert not done.stderr
    assert len(done.stdout.splitlines()) == 1
    assert done.returncode in {0, 128 + signal.SIGPIPE}


def count_group(leader: int) -> int:
    """Count the processes of a group."""

    def is_of_it(process: str) -> bool:
        try:
            return os.getpgid(int(process)) == leader
        except ProcessLookupError:
            return False

    return sum(is_of_it(path.name) for path in Path("/proc").iterdir() if path.name.isdigit())


@pytest.mark.slow
@pytest.mark.parametrize("send", [os.kill, os.killpg])  # As a program does, and as a terminal.
def test_an_interrupted_run_writes_what_there_is_of_its_episode(send: Any, tmp_path: Path) -> None:
    command = [sys.executable, "-m", "dojo_env.cli", "run", "--scenario", "two-way", "--controller", "random",
               "--seconds", "200000", "--csv", tmp_path / "run", "--record", tmp_path / "run"]  # fmt: skip
    with subprocess.Popen(
        command, stderr=subprocess.PIPE, text=True, env=command_environment(), start_new_session=True
    ) as running:
        while count_group(running.pid) < 4 and running.poll() is None:  # One counts what multiprocessing has.
            time.sleep(0.1)
        time.sleep(3)
        send(running.pid, signal.SIGINT)
        _, said = running.communicate(timeout=60)
    assert (running.returncode, said) == (130, "dojo-env: interrupted\n")
    assert sorted(path.suffix for path in tmp_path.iterdir()) == [".csv", ".json", ".npz"]


def test_who_blocks_a_junction_is_told(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Somebody stands right behind the junction; who drives in all the same stands inside."""
    routes = tmp_path / "blocked.rou.xml"
    routes.write_text(
        '<routes><vType id="car"/><vType id="pushing" jmIgnoreKeepClearTime="1"/>'
        '<route id="way" edges="w_t t_e"/>'
        '<vehicle id="broken" type="car" route="way" depart="0">'
        '<stop lane="t_e_0" startPos="0" endPos="6" duration="3000"/></vehicle>'
        '<vehicle id="behind" type="pushing" route="way" depart="20" departLane="0"/></routes>'
    )
    arguments = ["run", "--scenario", "two-way", "--controller", "max-pressure", "--seconds", "600"]
    assert main([*arguments, "--routes", str(routes), "--json", str(tmp_path / "out.json")]) == 0
    warnings = capsys.readouterr().err
    assert "stood inside a junction" in warnings
    assert "(t)" in warnings
    (episode,) = json.loads((tmp_path / "out.json").read_text())["episodes"]
    assert episode["locks"] == {"t": 1}
