"""SUMO's own words: in the error, each once, and nowhere else."""

import os
import subprocess
import sys
from pathlib import Path

import pytest
from conftest import command_environment

from dojo_env.config import build_config
from dojo_env.errors import SimulationError
from dojo_env.scenario import packaged_scenario
from dojo_env.sumo_messages import SumoMessages
from dojo_env.world import World
from dojo_env.world_process import open_world

TRIP = '<trip id="a" depart="0" from="n_t" to="t_s"/>'


def make_world(folder: Path, routes: str, *, own_process: bool = False, **settings: object) -> World:
    """A world of two-way's map with other routes, of which SUMO reads those from 200 s on while it runs."""
    path = folder / "r.rou.xml"
    path.write_text(f"<routes>{routes}</routes>", encoding="utf-8")
    config = build_config(net_file=packaged_scenario("two-way").map, route_file=str(path), **settings)
    return open_world(config, own_process=own_process)


@pytest.mark.slow
@pytest.mark.sampled(5)
@pytest.mark.parametrize(
    ("wrong", "words"),
    [
        ('<vehicle depart="0"><route edges="n_t t_s"/></vehicle>', "Attribute 'id' is missing"),
        ('<vehicle id="b" depart="0"><route edges="gone"/></vehicle>', "The edge 'gone'"),
        ('<vehicle id="b" depart="0" type="gone"><route edges="n_t t_s"/></vehicle>', "type 'gone'"),
        ('<vehicle id="b" depart="0" type="&#10;x"><route edges="n_t t_s"/></vehicle>', "vehicle type"),
        ('<flow id="f" begin="0" end="900" number="x" from="n_t" to="t_s"/>', "'number'"),
    ],
)
@pytest.mark.parametrize(("own_process", "late"), [(False, False), (True, False), (True, True)])
def test_an_error_holds_sumos_words_once(
    tmp_path: Path,
    capfd: pytest.CaptureFixture[str],
    wrong: str,
    words: str,
    *,
    own_process: bool,
    late: bool,
) -> None:
    far = '<trip id="far" depart="350" from="n_t" to="t_s"/>'
    routes = TRIP + far + wrong.replace('="0"', '="400"') if late else wrong
    world = make_world(tmp_path, routes, own_process=own_process, num_seconds=600)
    with pytest.raises(SimulationError) as caught:
        world.reset(1)
        for _ in range(120):
            world.step({"t": 0})
    world.close()
    assert str(caught.value).count(words) == 1
    assert "\n" not in str(caught.value)
    assert "Process Error" not in str(caught.value)
    assert capfd.readouterr() == ("", "")


def test_an_error_is_not_told_of_the_next_episode(tmp_path: Path) -> None:
    world = make_world(tmp_path, '<vehicle depart="0"><route edges="n_t t_s"/></vehicle>')
    told = []
    for seed in range(2):
        with pytest.raises(SimulationError) as caught:
            world.reset(seed)
        told.append(str(caught.value))
    assert told[0] == told[1]


@pytest.mark.slow
@pytest.mark.parametrize("own_process", [False, True])
def test_warnings_come_through_where_they_are_wanted(
    tmp_path: Path, capfd: pytest.CaptureFixture[str], *, own_process: bool
) -> None:
    unsorted = '<trip id="b" depart="9" from="n_t" to="t_s"/><trip id="c" depart="5" from="n_t" to="t_s"/>'
    for wanted in (True, False):
        world = make_world(tmp_path, unsorted, own_process=own_process, sumo_warnings=wanted)
        world.reset(1)
        for _ in range(3):
            world.step({"t": 0})
        world.close()
        out, err = capfd.readouterr()
        assert out == ""
        assert ("Warning: " in err) == wanted


def test_a_process_without_standard_error_simulates_as_well() -> None:
    script = """
import os
os.close(2)
import dojo_env
env = dojo_env.parallel_env(scenario="two-way")
env.reset(seed=1)
print(env.step({})[4]["t"]["step"])
"""
    done = subprocess.run(
        [sys.executable, "-c", script], env=command_environment(), stdout=subprocess.PIPE, check=True
    )
    assert done.stdout == b"5.0\n"


def test_what_a_library_writes_beside_an_error_is_dropped(capfd: pytest.CaptureFixture[str]) -> None:
    messages = SumoMessages()
    messages.begin()
    os.write(2, b"proj_create: no such column\nError: Could not build projection!\n")
    assert messages.explain(RuntimeError("Process Error")) == "Could not build projection!"
    messages.close()
    assert capfd.readouterr() == ("", "")
