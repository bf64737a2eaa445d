"""Programs of every type run safely: NEMA's, those of additional files, those without any yellow."""

import re
from pathlib import Path

import networks
import pytest

from dojo_env.cli import main
from dojo_env.config import SignalConfig, build_config
from dojo_env.controllers import make_controller
from dojo_env.errors import ConfigError
from dojo_env.local_world import LocalWorld
from dojo_env.managers.map import MapManager
from dojo_env.runs import run_controller
from dojo_env.scenario import find_map, open_map
from dojo_env.signals.cycle import build_cycle, find_step
from dojo_env.signals.plan import SignalPlan
from dojo_env.signals.proof import prove

ROUTES = "".join(
    f'<flow id="{a}{b}" begin="0" end="600" period="15" from="{a}0A0" to="A0{b}0" departLane="best"/>'
    for a in ("left", "right", "top", "bottom")
    for b in ("left", "right", "top", "bottom")
    if a != b
)
NO_YELLOW = """<additional><tlLogic id="A0" type="static" programID="x" offset="begin">
    <phase duration="0:00:20" state="rrrrGGGgrrrrGGGg"/><phase duration="20" state="GGGgrrrrGGGgrrrr"/>
</tlLogic></additional>"""
ONE_GREEN = NO_YELLOW.replace('state="GGGgrrrrGGGgrrrr"', 'state="rrrrrrrrrrrrrrrr"')
OFF = NO_YELLOW.replace('state="GGGgrrrrGGGgrrrr"', 'state="oooooooooooooooo"')
WAUT = """<additional><WAUT id="w" startProg="0" refTime="0"><wautSwitch time="60" to="0"/></WAUT>
    <wautJunction wautID="w" junctionID="A0"/></additional>"""


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    home = tmp_path_factory.mktemp("nema")
    shape = ("--grid", "--grid.number=1", "--grid.attach-length=150", "--turn-lanes=1")
    types = ("-j=traffic_light", "--tls.default-type=NEMA", "--default.lanenumber=2", "--no-turnarounds")
    networks.run_sumo_tool("netgenerate", *shape, *types, "-o", home / "nema.net.xml")
    (home / "nema.rou.xml").write_text(f"<routes>{ROUTES}</routes>")
    return home


def write_scenario(folder: Path, name: str, additional: str = "") -> str:
    inputs = '<net-file value="nema.net.xml"/><route-files value="nema.rou.xml"/>'
    if additional:
        (folder / f"{name}.add.xml").write_text(additional)
        inputs += f'<additional-files value="{name}.add.xml"/>'
    path = folder / f"{name}.sumocfg"
    path.write_text(f"<configuration><input>{inputs}</input></configuration>")
    return str(path)


def plan_of(scenario: str, config: SignalConfig) -> SignalPlan:
    found = find_map(scenario)
    return MapManager(open_map(found), config, additional=found.additional).plans["A0"]


def test_nema_phases_are_the_pairs_of_its_rings_with_their_own_times(folder: Path) -> None:
    plan = plan_of(write_scenario(folder, "nema"), SignalConfig())
    # One movement of each ring, two on each side of both barriers.
    assert len(plan.phases) == 8
    assert "GGGgrrrrGGGgrrrr" in plan.phases
    assert set(plan.yellow.tolist()) == {3.0}
    assert set(plan.red.tolist()) == {2.0}


def test_nema_plans_are_proved(folder: Path) -> None:
    scenario = write_scenario(folder, "proved")
    config = SignalConfig(min_green=1, max_green=2)
    proof = prove(plan_of(scenario, config), config)
    assert not proof.counterexamples
    assert proof.longest_change == 5


@pytest.mark.slow
@pytest.mark.sampled(3)
@pytest.mark.parametrize("additional", ["", NO_YELLOW, ONE_GREEN, OFF], ids=["nema", "cut", "one", "off"])
@pytest.mark.parametrize("controller", ["actuated", "delay-based", "random"])
def test_no_controller_is_unsafe_whatever_the_program(folder: Path, controller: str, additional: str) -> None:
    name = f"{controller}{len(additional)}"
    scenario = write_scenario(folder, name, additional)
    (figures,) = run_controller(controller, [1], scenario=scenario, num_seconds=300, all_red=1)
    assert not figures["violations"]
    assert figures["departed"] > 50


@pytest.mark.slow
def test_nema_runs_as_the_network_s_own_program(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    scenario = write_scenario(folder, "own")
    assert main(["run", "--scenario", scenario, "--controller", "fixed-time", "--seconds", "300"]) == 0
    said = capsys.readouterr()
    assert re.search(r"safety violations +0\n", said.out)
    assert "unsafe" not in said.err


@pytest.mark.slow
def test_a_run_that_was_unsafe_ends_with_a_warning(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    scenario = write_scenario(folder, "cut", NO_YELLOW)
    assert main(["run", "--scenario", scenario, "--controller", "fixed-time", "--seconds", "100"]) == 0
    last = capsys.readouterr().err.splitlines()[-1]
    assert re.search(r"warning: .*cut\.sumocfg: .*[1-9]\d* skipped_yellow", last)


def test_signals_that_sumo_switches_by_the_clock_are_refused_or_left_to_it(folder: Path) -> None:
    scenario = write_scenario(folder, "waut", WAUT)
    with pytest.raises(ConfigError, match="WAUT switches the programs of signal A0"):
        plan_of(scenario, SignalConfig())
    assert plan_of(scenario, SignalConfig(fixed_ts=True)).phases


CLEARED = """<additional><tlLogic id="A0" type="static" programID="x" offset="0">
    <phase duration="20" state="GGGgrrrrGGGgrrrr"/><phase duration="3" state="Gyyyrrrryyyyrrrr"/>
    <phase duration="3" state="Grrrrrrrrrrrrrrr"/><phase duration="20" state="GrrrGGGgrrrrGGGg"/>
    <phase duration="3" state="Grrryyyyrrrryyyy"/><phase duration="3" state="Grrrrrrrrrrrrrrr"/>
</tlLogic></additional>"""


def test_a_clearance_beside_a_link_that_stays_green_is_no_phase(folder: Path) -> None:
    """A program's greens keep their places in its cycle, and the changes between them are those of all."""
    config = SignalConfig(fixed_ts=True, program="fixed", yellow_time=2, all_red=1)
    plan = plan_of(write_scenario(folder, "cleared", CLEARED), config)
    assert len(plan.phases) == 2
    assert [(green.seconds, green.change) for green in plan.greens] == [(20, 6), (20, 6)]
    steps = build_cycle(plan, config)
    assert [step.seconds for step in steps] == [23, 2, 1, 23, 2, 1]
    assert [step.varies for step in steps] == [True, False, False] * 2
    assert find_step(steps, 52 + 24) == (1, 1)


@pytest.mark.parametrize("controller", ["pretimed", "actuated", "delay-based"])
def test_sumo_s_logics_have_the_changes_of_agents(folder: Path, controller: str) -> None:
    """Who loses green sees two seconds of yellow, and a second later others have green."""
    settings = make_controller(controller).settings
    scenario = write_scenario(folder, f"same-{controller}", CLEARED)
    world = LocalWorld(build_config(scenario=scenario, num_seconds=300, all_red=1, delta_time=1, **settings))
    world.reset(1)
    states, ended = [], False
    while not ended:
        _, _, ended, _ = world.step({})
        states.append(world.instant.signals["A0"].state)
    world.close()
    link = "".join(state[2] for state in states)
    other = "".join(state[5] for state in states)
    yellows = re.findall(r"G(y+)r", link)
    assert len(yellows) > 2
    assert {len(yellow) for yellow in yellows} == {2}
    apart = re.findall(
        r"y(r+)$", "\n".join(link[: m.start()] for m in re.finditer(r"(?<=r)g", other)), re.MULTILINE
    )
    assert apart
    assert {len(red) for red in apart} == {1}
