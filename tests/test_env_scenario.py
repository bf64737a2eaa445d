"""Scenarios by name, and the cache of converted maps when several processes want one at once."""

import re
import subprocess
import sys
import xml.etree.ElementTree as ET
from collections.abc import Callable
from pathlib import Path

import pytest
from conftest import command_environment
from networks import build_rail_crossing

import dojo_maps
from dojo_env.cli import main
from dojo_env.config import SignalConfig, build_config
from dojo_env.demand import build_two_way_demand
from dojo_env.errors import ConfigError
from dojo_env.local_world import LocalWorld
from dojo_env.managers.map import MapManager
from dojo_env.scenario import PACKAGED, Scenario, find_scenario, open_map, packaged_scenario
from dojo_maps.description import RoadMap
from dojo_maps.sources.sumo_net import read_network


@pytest.mark.parametrize("name", PACKAGED)
def test_every_packaged_scenario_is_there(name: str) -> None:
    scenario = find_scenario(name)
    assert scenario.end == scenario.begin + 3600
    assert scenario.licence
    assert scenario.routes[0].stat().st_size > 1000


def test_two_way_demand_changes_four_times_an_hour() -> None:
    flows = [flow.attrib for flow in ET.fromstring(build_two_way_demand()).iter("flow")]  # noqa: S314
    assert sorted({float(flow["end"]) for flow in flows}) == [900, 1800, 2700, 3600]
    assert sum(float(flow["vehsPerHour"]) for flow in flows) / 4 == 2500


@pytest.mark.slow
def test_processes_that_convert_at_once_share_one_bundle(tmp_path: Path) -> None:
    code = "from dojo_env.scenario import *; print(open_map(packaged_scenario('cologne1')).folder)"
    command = [sys.executable, "-c", code]
    environment = command_environment(DOJO_CACHE=str(tmp_path))
    running = [
        subprocess.Popen(command, env=environment, stdout=subprocess.PIPE, text=True) for _ in range(3)
    ]
    said = {process.communicate(timeout=120)[0].strip() for process in running}
    assert {process.returncode for process in running} == {0}
    assert len(said) == 1
    assert sorted(path.suffix for path in tmp_path.iterdir()) == [".dojo", ".lock"]


def test_the_cached_bundle_holds_the_network_byte_for_byte() -> None:
    scenario = packaged_scenario("cologne1")
    assert open_map(scenario).network.read_bytes() == scenario.map.read_bytes()


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("<configuration/>", "net-file"),
        (
            "<configuration><net-file value='a.net.xml'/><begin value='soon'/></configuration>",
            "begin and end",
        ),
        ("<configuration><net-file value='a.net.xml'/><begin value='7:00'/></configuration>", "h:m:s"),
        ("<!DOCTYPE x [<!ENTITY a 'b'>]><configuration/>", "unsafe"),
        ("<configuration>", "not well-formed XML"),
    ],
)
def test_bad_configurations_get_one_clear_error(tmp_path: Path, text: str, words: str) -> None:
    path = tmp_path / "bad.sumocfg"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(ConfigError, match=words):
        find_scenario(path)


@pytest.mark.parametrize(
    ("begin", "end", "seconds"),
    [("15:0:0", "16:00:30", (54000, 57630)), ("1:0:0:5", "90000.5", (86405, 90000.5))],
)
def test_times_are_read_as_sumo_reads_them(
    tmp_path: Path, begin: str, end: str, seconds: tuple[float, float]
) -> None:
    path = tmp_path / "noon.sumocfg"
    (tmp_path / "a.net.xml").touch()
    path.write_text(
        f"<configuration><net-file value='a.net.xml'/><begin value='{begin}'/>"
        f"<end value='{end}'/></configuration>"
    )
    scenario = find_scenario(path)
    assert (scenario.begin, scenario.end) == seconds


def test_signals_of_railways_are_left_to_sumo(tmp_path: Path) -> None:
    bundle, _ = dojo_maps.convert(build_rail_crossing(tmp_path), tmp_path / "rail.dojo")
    signals = [signal.id for signal in bundle.road_map.signals]
    assert signals
    with pytest.raises(ConfigError, match="no signals to control"):
        MapManager(bundle, SignalConfig())


def test_a_map_alone_is_no_scenario(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match="no scenario; expected"):
        find_scenario(tmp_path)
    with pytest.raises(ConfigError, match="write some with dojo-maps demand"):
        find_scenario(packaged_scenario("two-way").map)
    with pytest.raises(ConfigError, match="before it begins"):
        Scenario(map=tmp_path, begin=10, end=5)


def read(name: str) -> RoadMap:
    path = packaged_scenario(name).map
    return read_network(path.read_bytes(), path=path, name=name, sha256="0" * 64)[0]


@pytest.mark.parametrize("name", ["cologne1", "cologne8", "ingolstadt7"])
def test_right_of_way_is_the_networks_own(name: str) -> None:
    described = read(name)
    connections = {c.id for c in described.connections}
    ways = {j.id: j.right_of_way for j in described.junctions if j.right_of_way}
    requests = {
        junction.get("id", ""): list(junction.iter("request"))
        for junction in ET.parse(packaged_scenario(name).map).iter("junction")  # noqa: S314
        if junction.get("type") != "internal"
    }
    assert ways
    for junction, links in ways.items():
        assert {link.link for link in links} <= connections
        assert len(links) == len(requests[junction])
        for link, request in zip(links, requests[junction], strict=True):
            assert sum(1 << foe for foe in link.foes) == int(request.get("foes", "0"), 2)
            assert sum(1 << foe for foe in link.response) == int(request.get("response", "0"), 2)


def test_signals_are_shown_phase_by_phase(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["scenarios", "cologne1"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines[0] == "cologne1: 1 signal to control"
    assert "  -32038056#3 left         .   .   g   G" in lines
    assert not [line for line in lines if "note:" in line]


def test_what_cannot_be_controlled_is_said(
    network_path: Callable[[str], Path],
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    caplog: pytest.LogCaptureFixture,
) -> None:
    network = network_path("bare").read_text()
    (program,) = re.findall(r"<tlLogic.*?</tlLogic>", network, re.DOTALL)
    states = re.findall(r'state="(\w+)"', program)
    one_green = program
    for state in states[1:]:
        one_green = one_green.replace(state, "r" * len(state))
    path = tmp_path / "one.net.xml"
    path.write_text(network.replace(program, one_green))
    assert main(["scenarios", str(path)]) == 0
    said = capsys.readouterr().out
    assert "note: has one green phase, so there is nothing to choose" in said
    assert "note: has no phase for the links" in said
    for fixed_ts in (True, False):  # Links without a green are odd under the programs, too.
        LocalWorld(build_config(net_file=path, route_file=(), fixed_ts=fixed_ts))
        told = [record.message for record in caplog.records]
        assert sum("has no phase for the links" in message for message in told) == 1
        assert sum("has one green phase" in message for message in told) == (not fixed_ts)
    off = one_green.replace(states[0], "o" * len(states[0]))
    path.write_text(network.replace(program, off))
    assert main(["scenarios", str(path)]) == 0
    assert "note: has no green phase of its own" in capsys.readouterr().out
