"""A scenario's files write nowhere but where the user says, and open no port; what they simulate stays."""

import contextlib
import gzip
import os
import subprocess
import sys
import xml.etree.ElementTree as ET
from collections.abc import Callable
from pathlib import Path

import pytest
from conftest import command_environment

import dojo_env
from dojo_env.config import build_config
from dojo_env.env import TrafficSignalEnv
from dojo_env.errors import ConfigError, ScenarioError, SimulationError
from dojo_env.local_world import LocalWorld
from dojo_env.scenario import Scenario, find_scenario
from dojo_env.sumo_files import SumoFiles

STATES = ("GGggrrrrGGggrrrr", "yyyyrrrryyyyrrrr", "rrrrGGggrrrrGGgg", "rrrryyyyrrrryyyy")
DETECTORS = """<additional>
<inductionLoop id="d0" lane="e_0" pos="10" period="10" file="{0}/loop.xml"/>
<e1Detector id="d1" lane="e_1" pos="10" period="10" file="stdout"/>
<instantInductionLoop id="d2" lane="e_0" pos="20" file="127.0.0.1:5678"/>
<laneAreaDetector id="d3" lane="e_0" pos="10" endPos="60" period="10" file="x.net.xml"/>
<entryExitDetector id="d4" period="10" file="e3.xml">
  <detEntry lane="e_0" pos="10"/><detExit lane="-w_0" pos="10"/></entryExitDetector>
<vTypeProbe id="p" period="10" file="probe.xml"/>
<edgeData id="ed" file="edges.xml" period="10"/>
<laneData id="ld" file="lanes.csv" period="10"/>
<calibrator id="cal" edge="n" pos="0" period="10" output="calibrator.xml"/>
<timedEvent type="SaveTLSStates" source="c" dest="states.xml"/>
<timedEvent type="SaveTLSProgram" source="c" dest="program.xml"/>
<variableSpeedSign id="v" lanes="s_0" file="inner/speeds.xml"/>
<include href="inner/more.add.xml"/>
</additional>"""
MORE = """<additional><include href="most.add.xml"/>
<inductionLoop id="d5" lane="s_0" pos="10" period="10" file="../../more.xml"/></additional>"""
MOST = '<additional><inductionLoop id="d6" lane="w_0" pos="10" period="10" file="NUL"/></additional>'
SPEEDS = '<vss><step time="0" speed="7"/></vss>'
ROUTES = """<routes>
<vType id="a"><param key="has.ssm.device" value="true"/></vType>
<vType id="b"><param key="has.ssm.device" value="true"/><param key="device.ssm.file" value="../ssm.xml"/>
  <param key="has.toc.device" value="true"/><param key="device.toc.file" value="toc.xml"/>
  <param key="device.toc.manualType" value="b"/><param key="device.toc.automatedType" value="b"/></vType>
<flow id="f" type="a" from="e" to="-w" begin="0" end="60" period="3"/>
<flow id="g" type="b" from="n" to="-s" begin="0" end="60" period="3"/></routes>"""
CONFIGURATION = """<configuration>
<input><n v="x.net.xml"/><r value="x.rou.xml"/><additional value="x.add.xml"/></input>
<output><tripinfo value="../trips.xml"/><summary-output value="stdout"/><fcd-output value="127.0.0.1:5679"/>
<output-prefix value="../"/><save-state.times value="10"/><save-state.files value="state.xml"/></output>
<report><log value="x.net.xml"/><verbose value="true"/><duration-log.statistics value="true"/></report>
<traci_server><remote-port value="{port}"/></traci_server></configuration>"""
COPIED = """<?xml version="1.0" encoding="iso-8859-1"?><additional a="&lt;&quot;&#10;ü"><!-- c -->t &amp; ü
<poi id="ä" imgFile="i.png"><param key="profile" value="p"/><param key="k.FILE" value="p"/></poi>
<tlLogic id="c"><param key="file" value="w.xml"/><param key="SWARMLOG" value="/w"/></tlLogic>
<routeProbe id="r" edge="e" file="w.xml"/><calibrator file="nowhere.xml" output="w.xml"/>
<rerouter id="r" file="inner/speeds.xml"/><edgeData file="w.xml" edgesFile="e.txt"/></additional>"""
SCRIPT = """
import os, sys
from dojo_env.config import build_config
from dojo_env.local_world import LocalWorld

world = LocalWorld(build_config(scenario="x.sumocfg", num_seconds=60, backend=sys.argv[1]))
world.reset(1)
for _ in range(11):
    _, _, _, info = world.step({"c": 0})
get = world.traffic.simulation._get
print(sorted(get.inductionloop_getIDList()), get.lane_getMaxSpeed("s_0"), info["system_total_departed"] > 20)
if sys.argv[1] == "libsumo":
    print([name for name in map(os.path.realpath, os.scandir("/proc/self/fd")) if "socket" in name])
world.close()
"""


@pytest.fixture
def folder(tmp_path: Path, network_path: Callable[[str], Path]) -> Path:
    """A scenario whose files want to write all over the place."""
    folder = tmp_path / "outer" / "scenario"
    (folder / "inner").mkdir(parents=True)
    (folder / "x.net.xml").write_bytes(network_path("bare").read_bytes())
    (folder / "x.rou.xml").write_text(ROUTES)
    (folder / "x.add.xml").write_text(DETECTORS.format(tmp_path))
    (folder / "inner" / "more.add.xml").write_text(MORE)
    (folder / "inner" / "most.add.xml").write_text(MOST)
    (folder / "inner" / "speeds.xml").write_text(SPEEDS)
    (folder / "x.sumocfg").write_text(CONFIGURATION.format(port=0))
    return folder


def contents(folder: Path) -> dict[str, bytes]:
    return {str(path): path.read_bytes() for path in folder.rglob("*") if path.is_file()}


@pytest.mark.slow
@pytest.mark.parametrize("backend", ["libsumo", "traci"])
def test_a_scenarios_files_write_nothing_and_open_no_port(folder: Path, tmp_path: Path, backend: str) -> None:
    (folder / "x.sumocfg").write_text(CONFIGURATION.format(port=18813))
    before = contents(tmp_path)
    done = subprocess.run(
        [sys.executable, "-c", SCRIPT, backend], cwd=folder, env=command_environment(), capture_output=True,
        text=True, timeout=120, check=True,
    )  # fmt: skip
    assert contents(tmp_path) == before
    lines = [line for line in done.stdout.splitlines() if "Retrying" not in line and line.strip()]
    assert lines[0] == "['d0', 'd1', 'd5', 'd6'] 7.0 True"
    assert lines[1:] == (["[]"] if backend == "libsumo" else [])


@pytest.mark.slow
def test_the_command_says_once_what_is_left_out_and_prints_figures_alone(folder: Path) -> None:
    (folder / "x.sumocfg").write_text(CONFIGURATION.format(port=18814))
    command = [*(sys.executable, "-m", "dojo_env.cli", "run", "--scenario", "x.sumocfg")]
    command += ["--controller", "max-pressure", "--seconds", "60", "--seeds", "2"]
    before = contents(folder.parent)
    done = subprocess.run(
        command,
        cwd=folder,
        env=command_environment(),
        capture_output=True,
        text=True,
        timeout=120,
        check=True,
    )
    assert contents(folder.parent) == before
    assert all(
        " ± " in line or line.startswith(("figure", "episodes", "safety"))
        for line in done.stdout.splitlines()
    )
    (said,) = [line for line in done.stderr.splitlines() if "x.sumocfg: left out" in line]
    for name in ("remote-port", "log", "tripinfo-output", "save-state.files", "verbose", "--sumo-outputs"):
        assert name in said
    for name in ("x.rou.xml", "x.add.xml", "more.add.xml"):
        assert sum(line.startswith(f"{name}: left out") for line in done.stderr.splitlines()) == 1


def test_outputs_go_into_the_folder_that_the_user_names(folder: Path, tmp_path: Path) -> None:
    text = DETECTORS.format(tmp_path).replace("127.0.0.1:5678", "instant.xml").replace("x.net", "area")
    (folder / "x.add.xml").write_text(text)
    configuration = CONFIGURATION.format(port=18815).replace("127.0.0.1:5679", "fcd.xml")
    (folder / "x.sumocfg").write_text(configuration.replace('<log value="x.net.xml"', '<log value="log.txt"'))
    before, mine = contents(tmp_path), tmp_path / "mine" / "deep"
    world = LocalWorld(build_config(scenario=folder / "x.sumocfg", num_seconds=60, sumo_outputs=mine))
    for _ in range(2):
        world.reset(1)
        for _ in range(12):
            world.step({"c": 0})
    world.close()
    after = contents(tmp_path)
    assert {name: after[name] for name in before} == before
    assert {path.name for path in mine.iterdir()} == {
        *("loop.xml", "stdout", "instant.xml", "area.xml", "e3.xml", "probe.xml", "edges.xml", "lanes.csv"),
        *("calibrator.xml", "states.xml", "program.xml", "more.xml", "ssm.xml", "device.ssm.xml", "toc.xml"),
        *("trips.xml", "fcd.xml", "log.txt"),
    }
    assert set(after) - set(before) == {str(path) for path in mine.iterdir()}
    assert (mine / "loop.xml").read_text().count("<interval") > 3
    assert len(ET.parse(mine / "trips.xml").findall("tripinfo")) > 2  # noqa: S314


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("e3.xml", "127.0.0.1:5678", "plain file name"),
        ("e3.xml", "..", "plain file name"),
        ("e3.xml", "a,b.xml", "plain file name"),
        ("e3.xml", "${HOME}", "plain file name"),
        ("e3.xml", "inner/edges.xml", "two outputs are called 'edges.xml'"),
    ],
)
def test_outputs_without_a_name_of_their_own_are_refused(
    folder: Path, tmp_path: Path, old: str, new: str, words: str
) -> None:
    text = '<additional><edgeData id="a" file="edges.xml"/><edgeData id="b" file="e3.xml"/></additional>'
    (folder / "y.add.xml").write_text(text.replace(old, new))
    scenario = Scenario(map=folder / "x.net.xml", additional=folder / "y.add.xml")
    with pytest.raises(ScenarioError, match=words):
        SumoFiles(folder / "x.net.xml", scenario, tmp_path / "mine")
    assert "y.add.xml" not in SumoFiles(folder / "x.net.xml", scenario, None).options["additional-files"]


def test_inputs_are_not_overwritten_by_outputs(folder: Path) -> None:
    network = folder / "x.net.xml"
    scenario = find_scenario(folder / "x.sumocfg")
    with pytest.raises(ScenarioError, match="plain file name"):
        SumoFiles(network, scenario, folder)
    (folder / "x.add.xml").write_text('<additional><edgeData id="a" file="../x.net.xml"/></additional>')
    (folder / "x.sumocfg").write_text('<configuration><n v="x.net.xml"/><a v="x.add.xml"/></configuration>')
    with pytest.raises(ScenarioError, match=r"x\.net\.xml: an output would be written over it"):
        SumoFiles(network, find_scenario(folder / "x.sumocfg"), folder)
    (folder / "outputs").mkdir()
    (folder / "outputs" / "x.net.xml").symlink_to(network)
    with pytest.raises(ScenarioError, match="written over it"):
        SumoFiles(network, find_scenario(folder / "x.sumocfg"), folder / "outputs")
    with pytest.raises(ConfigError, match="cannot be made"):
        SumoFiles(network, Scenario(map=network), network / "below")
    with pytest.raises(ConfigError, match="misreads"):
        dojo_env.TrafficConfig(sumo_outputs=Path("a:b"))


def test_a_copy_differs_from_its_file_in_where_it_writes_and_reads_alone(folder: Path) -> None:
    path = folder / "x.add.xml"
    path.write_bytes(COPIED.encode("iso-8859-1"))
    files = SumoFiles(folder / "x.net.xml", Scenario(map=folder / "x.net.xml", additional=path), None)
    copy = Path(files.options["additional-files"])
    found, wanted = ET.parse(copy).getroot(), ET.parse(path).getroot()  # noqa: S314
    for element in wanted.iter():
        for key in ("file", "output"):
            if key in element.attrib and element.tag not in ("calibrator", "rerouter"):
                element.set(key, "NUL")
        for key in ("imgFile", "edgesFile"):
            if key in element.attrib:
                element.set(key, str(folder / element.attrib[key]))
        if element.get("key") in ("k.FILE", "file", "SWARMLOG"):
            element.set("value", "NUL")
    wanted.find("calibrator").set("output", "NUL")
    wanted.find("rerouter").set("file", str(folder / "inner" / "speeds.xml"))
    assert ET.canonicalize(ET.tostring(found)) == ET.canonicalize(ET.tostring(wanted))


def test_files_that_write_nothing_are_passed_as_they_are(folder: Path) -> None:
    most = folder / "inner" / "most.add.xml"
    (folder / "x.add.xml").write_text(f'<additional><include href="{most}"/></additional>')
    packed = folder / "x.rou.xml.gz"
    packed.write_bytes(gzip.compress(b'<routes><trip id="t" depart="0" from="e" to="-w"/></routes>'))
    scenario = Scenario(map=folder / "x.net.xml", routes=packed, additional=folder / "x.add.xml")
    options = SumoFiles(folder / "x.net.xml", scenario, None).options
    names = ("net-file", "route-files", "additional-files")
    assert [options[name] for name in names] == [
        str(folder / name) for name in ("x.net.xml", "x.rou.xml.gz", "x.add.xml")
    ]
    packed.write_bytes(gzip.compress(ROUTES.encode()))
    files = SumoFiles(folder / "x.net.xml", scenario, None)
    copy = Path(files.options["route-files"])
    assert "ssm.xml" not in copy.read_text()


def test_networks_write_nothing_either(folder: Path, tmp_path: Path) -> None:
    network = folder / "x.net.xml"
    loop = '<inductionLoop id="d" lane="e_0" pos="10" period="10" file="loop.xml"/></net>'
    network.write_text(network.read_text().replace("</net>", loop))
    before = contents(tmp_path)
    env = TrafficSignalEnv(net_file=str(network), route_file=str(folder / "x.rou.xml"), num_seconds=60)
    env.reset(seed=1)
    assert env.world.traffic.simulation._get.inductionloop_getIDList() == ("d",)
    for _ in range(12):
        env.step(0)
    env.close()
    assert contents(tmp_path) == before


@pytest.mark.slow
def test_forks_and_processes_of_their_own_read_the_copies(folder: Path, tmp_path: Path) -> None:
    before = contents(tmp_path)
    env = TrafficSignalEnv(scenario=folder / "x.sumocfg", num_seconds=60, own_process=True)
    departed = []
    for _ in range(2):
        env.reset(seed=1)
        departed.append([env.step(0)[4]["system_total_departed"] for _ in range(12)][-1])
    env.close()
    assert departed[0] == departed[1] > 20
    assert contents(tmp_path) == before


@pytest.mark.parametrize(
    ("files", "words"),
    [
        ({"x": '<additional><include href="x.add.xml"/></additional>'}, "includes itself"),
        ({"x": '<additional><include href="y.add.xml"/></additional>',
          "y": '<additional><include href="inner/../x.add.xml"/></additional>'}, "includes itself"),
        ({chr(ord("a") + k): f'<additional><include href="{chr(ord("a") + k + 1)}.add.xml"/></additional>'
          for k in range(20)} | {"x": '<additional><include href="a.add.xml"/></additional>'}, "deep"),
        ({"x": "<additional>" + '<include href="y.add.xml"/>' * 40 + "</additional>",
          "y": "<additional>" + '<include href="z.add.xml"/>' * 40 + "</additional>",
          "z": "<additional/>"}, "more than 1000"),
        ({"x": '<additional><include href="y.add.xml"/></additional>', "y": "<additional>"}, "y.add.xml"),
        ({"x": '<additional><edgeData id="a" file="NUL" edgesFile="pipe"/></additional>'}, "regular file"),
    ],
)  # fmt: skip
def test_what_files_include_is_checked_and_bounded(folder: Path, files: dict[str, str], words: str) -> None:
    os.mkfifo(folder / "pipe")
    for name, text in files.items():
        (folder / f"{name}.add.xml").write_text(text)
    with pytest.raises(ConfigError, match=words) as caught:
        LocalWorld(build_config(scenario=folder / "x.sumocfg"))
    assert "\n" not in str(caught.value)


def test_a_value_does_not_become_an_option_of_its_own(folder: Path, tmp_path: Path) -> None:
    before = contents(tmp_path)
    for option, value in (("ignore-route-errors", "--log=evil"), ("collision.action", "--log=evil")):
        path = folder / "y.sumocfg"
        path.write_text(
            f'<configuration><n v="x.net.xml"/><{option} value="{value}"/></configuration>', encoding="utf-8"
        )
        world = LocalWorld(build_config(scenario=path))
        with contextlib.suppress(SimulationError):
            world.reset(1)
        world.close()
        path.unlink()
    assert contents(tmp_path) == before


def test_what_a_configuration_asks_of_the_simulation_holds(folder: Path) -> None:
    options = '<scale value="0"/><time-to-impatience value="7"/>'
    path = folder / "y.cfg"
    path.write_text(f'<configuration><n v="x.net.xml"/><r v="x.rou.xml"/>{options}</configuration>')
    for words, departed in (("", 0), ("--scale 1", 1)):
        world = LocalWorld(build_config(scenario=path, num_seconds=60, additional_sumo_cmd=words))
        world.reset(1)
        info = [world.step({"c": 0})[3] for _ in range(12)][-1]
        world.close()
        assert bool(info["system_total_departed"]) == bool(departed)


def test_paths_that_sumo_misreads_are_refused(folder: Path) -> None:
    (folder / "a,b").mkdir()
    routes = folder / "a,b" / "r.rou.xml"
    routes.write_text("<routes/>")
    with pytest.raises(ScenarioError, match="comma"):
        LocalWorld(build_config(scenario=Scenario(map=folder / "x.net.xml", routes=(routes,))))
