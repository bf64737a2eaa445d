"""A world in a process of its own: crashes, errors of every kind, and processes within processes."""

import os
import re
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import gymnasium
import pytest
from conftest import command_environment

import dojo_env
from dojo_env.config import build_config
from dojo_env.controllers import make_controller
from dojo_env.errors import EpisodeOverError, SimulationDiedError, SimulationError
from dojo_env.instant import Instant
from dojo_env.local_world import LocalWorld
from dojo_env.snapshot import Snapshot
from dojo_env.world_process import WorldProcess
from dojo_maps.errors import DojoError

NAME = "dojo_env/TrafficSignal-v0"
SHORT: dict[str, Any] = {"scenario": "two-way", "num_seconds": 60}


@pytest.fixture
def world() -> Iterator[WorldProcess]:
    made = WorldProcess(build_config(**SHORT))
    yield made
    made.close()


def children(process: int) -> list[int]:
    return [int(word) for word in Path(f"/proc/{process}/task/{process}/children").read_text().split()]


def kill_episode(world: WorldProcess) -> None:
    """Let the process that simulates the episode die as it would by a crash of SUMO's."""
    assert world._process is not None
    assert world._process.pid is not None
    (fork,) = children(world._process.pid)
    os.kill(fork, signal.SIGSEGV)
    while fork in children(world._process.pid):
        time.sleep(0.01)


def test_reset_recovers_from_a_crash(world: WorldProcess) -> None:
    first = world.reset(3)[0]["t"].tolist()
    server = world._process
    kill_episode(world)
    with pytest.raises(SimulationDiedError, match="call reset"):
        world.step({"t": 0})
    with pytest.raises(EpisodeOverError):
        world.step({"t": 0})
    assert world.reset(3)[0]["t"].tolist() == first
    assert world.step({"t": 0})[3]["step"] == 5
    assert world._process is server


def test_an_episode_begins_after_a_crash_that_nobody_has_noticed(world: WorldProcess) -> None:
    world.reset(3)
    kill_episode(world)
    world.reset(3)
    assert world.step({"t": 0})[3]["step"] == 5


def test_a_crash_in_the_middle_of_a_call_is_told(world: WorldProcess) -> None:
    def crash(snapshot: Snapshot) -> None:
        if snapshot.time == 7:
            kill_episode(world)

    world.watch(crash)
    with pytest.raises(SimulationDiedError):
        world.run(make_controller("cycle"), 1)
    world.watch(lambda _snapshot: None)
    assert len(world.run(make_controller("cycle"), 1)[0]) == 12


@pytest.mark.slow
def test_reset_recovers_where_the_whole_process_died(world: WorldProcess) -> None:
    world.reset(3)
    assert world._process is not None
    world._process.kill()
    world._process.join()
    world.reset(3)
    assert world.step({"t": 0})[3]["step"] == 5


@pytest.mark.slow
def test_files_of_an_episode_that_crashed_are_not_those_of_the_next(tmp_path: Path) -> None:
    world = WorldProcess(build_config(**SHORT, record_name=str(tmp_path / "r")))
    for crashes in (False, True, False):
        world.reset(1)
        world.step({"t": 0})
        if crashes:
            kill_episode(world)
    world.close()
    assert sorted(path.name for path in tmp_path.iterdir()) == ["r_ep1.npz", "r_ep3.npz"]


CRASHING = """
import dojo_env, sys
from dojo_env.errors import DojoError
try:
    env = dojo_env.parallel_env(scenario=sys.argv[1], own_process=sys.argv[2] == "apart")
    for seed in range(2):
        try:
            env.reset(seed=seed)
        except DojoError as error:
            print(type(error).__name__)
except DojoError as error:
    print(type(error).__name__)
"""


@pytest.fixture
def crashing_scenario(tmp_path: Path, network_path: Callable[[str], Path]) -> Path:
    """A scenario on which SUMO itself dies when it loads: a lane outside of any edge."""
    text = network_path("right_hand").read_text(encoding="utf-8")
    text = re.sub(r"( *<lane [^>]*/>\n)( *</edge>\n)", r"\2\1", text, count=1)
    (tmp_path / "n.net.xml").write_text(text, encoding="utf-8")
    (tmp_path / "r.rou.xml").write_text("<routes/>", encoding="utf-8")
    config = tmp_path / "s.sumocfg"
    files = '<net-file value="n.net.xml"/><route-files value="r.rou.xml"/>'
    config.write_text(f"<configuration>{files}</configuration>", encoding="utf-8")
    return config


@pytest.mark.slow
@pytest.mark.parametrize("where", ["here", "apart"])
def test_a_network_that_crashes_sumo_takes_nobody_along(crashing_scenario: Path, where: str) -> None:
    done = subprocess.run(
        [sys.executable, "-c", CRASHING, str(crashing_scenario), where],
        env=command_environment(), capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    assert done.stdout.split() == ["SimulationError"] * 2
    assert done.stderr == ""


@pytest.mark.slow
def test_every_second_is_shown_here_and_the_episode_is_the_same() -> None:
    config = build_config(**SHORT)
    shown: list[float] = []
    here, apart = LocalWorld(config), WorldProcess(config)
    expected = here.run(make_controller("max-pressure"), 1)
    apart.watch(lambda snapshot: shown.append(snapshot.time))
    assert apart.run(make_controller("max-pressure"), 1) == expected
    assert shown == [float(second) for second in range(61)]
    here.close()
    apart.close()


def test_who_watches_may_fail_and_the_world_still_closes(tmp_path: Path) -> None:
    world = WorldProcess(build_config(**SHORT, record_name=str(tmp_path / "r")))
    process = world._process
    assert process is not None

    def fail(snapshot: Snapshot) -> None:
        if snapshot.time == 5:
            raise OSError("disk full")

    world.watch(fail)
    with pytest.raises(OSError, match="disk full"):
        world.run(make_controller("cycle"), 1)
    world.close()
    assert process.exitcode == 0
    assert len(dojo_env.Recording.open(tmp_path / "r_ep1.npz")) == 6


class OddError(Exception):
    """Pickles, and cannot be read back."""

    def __init__(self, a: int, b: int) -> None:
        super().__init__(f"odd: {a + b}")


def odd_reward(_signal: str, _before: Instant, _now: Instant) -> float:
    raise OddError(1, 2)


def broken_reward(_signal: str, _before: Instant, _now: Instant) -> float:
    raise KeyError("mine")


@pytest.mark.slow
def test_what_a_users_function_raises_arrives_with_its_place() -> None:
    world = WorldProcess(build_config(**SHORT, reward_fn=broken_reward))
    world.reset(1)
    with pytest.raises(KeyError, match="mine") as caught:
        world.step({"t": 0})
    world.close()
    assert "broken_reward" in "".join(caught.value.__notes__)


@pytest.mark.slow
def test_an_error_that_no_pipe_can_carry_is_told_in_words() -> None:
    world = WorldProcess(build_config(**SHORT, reward_fn=odd_reward))
    world.reset(1)
    with pytest.raises(SimulationError, match="OddError: odd: 3"):
        world.step({"t": 0})
    world.close()


@pytest.mark.slow
def test_what_cannot_be_written_at_the_end_is_told(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("", encoding="utf-8")
    for following in ("reset", "close"):
        world = WorldProcess(build_config(**SHORT, record_name=str(tmp_path / "file" / "r")))
        world.reset(1)
        world.step({"t": 0})
        with pytest.raises(DojoError, match="file"):
            world.reset(2) if following == "reset" else world.close()
        world.close()


@pytest.mark.slow
@pytest.mark.parametrize("vectorization", ["sync", "async"])
def test_own_processes_work_in_gymnasiums_vectors(vectorization: str) -> None:
    made = gymnasium.make_vec(NAME, 2, vectorization_mode=vectorization, **SHORT, own_process=True)
    assert made.reset(seed=1)[0].shape[0] == 2
    assert made.step(made.action_space.sample())[0].shape[0] == 2
    made.close()


def test_a_vector_is_made_beside_an_open_environment() -> None:
    beside = gymnasium.make(NAME, **SHORT)
    beside.reset(seed=1)
    made = gymnasium.make_vec(NAME, 2, vectorization_mode="async", **SHORT)
    made.reset(seed=[1, 1])
    for _ in range(3):
        ours, theirs = beside.step(0)[0], made.step([0, 0])[0]
        assert ours.tolist() == theirs[0].tolist() == theirs[1].tolist()
    made.close()
    beside.step(0)
    beside.close()


def test_a_fork_that_ends_leaves_its_parents_simulation_alone(tmp_path: Path) -> None:
    script = """
import os, gymnasium, dojo_env
env = gymnasium.make("dojo_env/TrafficSignal-v0", scenario="two-way")
env.reset(seed=1)
if os.fork() == 0:
    env.close()
    os._exit(0)
os.wait()
print(env.step(0)[4]["step"])
"""
    done = subprocess.run(
        [sys.executable, "-c", script], env=command_environment(), capture_output=True, text=True, check=False
    )
    assert (done.stdout, done.stderr) == ("5.0\n", "")


UNCLOSED = """
import multiprocessing, os, time, gymnasium, dojo_env
def work(ready):
    env = gymnasium.make("dojo_env/TrafficSignal-v0", scenario="two-way", own_process=True)
    env.reset(seed=1)
    ready.send(env.unwrapped.world._process.pid)
    time.sleep(60 if {killed} else 0)
if __name__ == "__main__":
    mine, theirs = multiprocessing.Pipe()
    process = multiprocessing.get_context("fork").Process(target=work, args=(theirs,), daemon=True)
    process.start()
    server = mine.recv()
    if {killed}:
        process.terminate()
    process.join()
    while os.path.exists(f"/proc/{{server}}"):
        time.sleep(0.1)
    print("ended")
"""


@pytest.mark.slow
@pytest.mark.parametrize("killed", [False, True])
def test_processes_end_with_who_forgot_to_close_them(tmp_path: Path, *, killed: bool) -> None:
    script = tmp_path / "script.py"
    script.write_text(UNCLOSED.format(killed=killed), encoding="utf-8")
    done = subprocess.run(
        [sys.executable, str(script)], env=command_environment(), capture_output=True, text=True,
        check=False, timeout=120,
    )  # fmt: skip
    assert (done.stdout, done.stderr) == ("ended\n", "")


THREADS = """
from concurrent.futures import ThreadPoolExecutor
from threading import Barrier
from dojo_env.config import build_config
from dojo_env.world_process import WorldProcess
barrier = Barrier(4)
def work(_):
    barrier.wait()
    world = WorldProcess(build_config(scenario="two-way", num_seconds=60))
    world.reset(1)
    world.close()
    return world.signals
with ThreadPoolExecutor(4) as pool:
    print(set(pool.map(work, range(4))))
"""


@pytest.mark.slow
def test_threads_of_a_script_without_a_guard_open_worlds_at_once(tmp_path: Path) -> None:
    script = tmp_path / "script.py"
    script.write_text(THREADS, encoding="utf-8")
    done = subprocess.run(
        [sys.executable, str(script)], env=command_environment(), capture_output=True, text=True,
        check=False, timeout=120,
    )  # fmt: skip
    assert (done.stdout, done.stderr) == ("{('t',)}\n", "")
