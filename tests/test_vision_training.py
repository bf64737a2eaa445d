"""The network that sees lanes: its labels, its training, and the controller that acts on it."""

from pathlib import Path

import pytest
from commands import run_env

from dojo_env.config import build_config
from dojo_env.controllers import make_controller
from dojo_env.controllers.phase_competition import PhaseCompetition
from dojo_env.instant import Instant, build_approach
from dojo_env.local_world import LocalWorld
from dojo_maps.signals.programs import green_links

torch = pytest.importorskip("torch")

from dojo_env.learning.vision.episodes import draw_case, mark_cells  # noqa: E402
from dojo_env.learning.vision.settings import VisionTraining  # noqa: E402
from dojo_env.sensors.strip_geometry import CELL, build_strips  # noqa: E402

SMALL = ["--vision", "--junctions", "two-way", "--set", "episodes=2", "looks=3", "seconds=125", "epochs=1"]


def test_labels_are_where_the_simulation_has_vehicles() -> None:
    world = LocalWorld(build_config(scenario="two-way", num_seconds=200))
    world.reset(2)
    acting, ended = make_controller("cycle"), False
    acting.reset(2)
    while not ended:
        ended = world.step(acting.act(world.instant))[2]
    (signal,), now = world.signals, world.instant
    plan, snapshot = world.map.plans[signal], now.snapshot
    strips = build_strips(world.eyes.scene, plan, world.eyes.cameras(signal))
    simulation, seen = world.traffic.simulation, 0
    for row, (name, lane) in enumerate(zip(snapshot.ids, snapshot.lanes, strict=True)):
        if lane not in plan.lanes:
            continue
        # SUMO's own distance to the stop line, not ours.
        ((_, _, metres),) = simulation.list_next_links([name])
        if metres < CELL * 15:
            strip = strips[plan.lanes.index(lane)]
            column = 0 if snapshot.speeds[row] < 0.1 else 1
            near = mark_cells(strip, snapshot)[
                max(int((metres - 1) / CELL), 0) : int((metres + 1) / CELL) + 1
            ]
            assert near[:, column].any(), name
            seen += 1
    assert seen > 5
    world.close()


def test_cases_are_those_of_their_seed_and_vary() -> None:
    junctions = [("two-way", ("t",)), ("cologne3", ("a", "b", "c"))]
    cases = [draw_case(junctions, seed=seed, seconds=300, looks=9) for seed in range(30)]
    assert cases == [draw_case(junctions, seed=seed, seconds=300, looks=9) for seed in range(30)]
    assert len({case.conditions.hour for case in cases}) == 30
    assert {case.scenario for case in cases} == {"two-way", "cologne3"}
    assert len({case.preset for case in cases}) > 3
    assert VisionTraining(scenarios=["a"]).scenarios == ("a",)


@pytest.mark.slow
def test_training_gives_the_same_network_however_many_processes_and_it_acts(tmp_path: Path) -> None:
    for name, processes in (("one", 1), ("two", 2)):
        done = run_env("train", *SMALL, "--processes", processes, "--out", tmp_path / name)
        assert done.returncode == 0, done.stderr
    for file in ("curve.csv", "lanes.npz"):
        assert (tmp_path / "one" / file).read_bytes() == (tmp_path / "two" / file).read_bytes()
    done = run_env("evaluate", tmp_path / "one", "cycle", "--scenario", "two-way", "--under", "night",
                   "--seeds", 1, "--seconds", 60)  # fmt: skip
    assert done.returncode == 0, done.stderr
    assert [line.split()[1:3] for line in done.stdout.splitlines()[1:]] == [
        ["two-way", "night"],
        ["two-way", "as-trained"],
    ]
    done = run_env("train", *SMALL, "--out", tmp_path / "one")
    assert done.returncode == 2
    assert "holds a run already" in done.stderr


def test_bad_arguments_are_one_line(tmp_path: Path) -> None:
    for words, arguments in (
        ("--steps is for one scenario", ["--steps", 5]),
        ("leave --resume out", ["--resume"]),
        ("expected at least 2", ["--set", "episodes=1"]),
        ("120 more than looks", ["--set", "seconds=125", "looks=20"]),
    ):
        done = run_env("train", "--quiet", "--vision", *arguments, "--out", tmp_path / "a")
        assert done.returncode == 2, done.stderr
        assert words in done.stderr
        assert len(done.stderr.strip().splitlines()) == 1, done.stderr


def test_blue_lights_get_a_phase_that_lets_them_go() -> None:
    world = LocalWorld(build_config(scenario="cologne1", num_seconds=60))
    world.reset(1)
    (signal,), now = world.signals, world.instant
    plan = world.map.plans[signal]
    for link in dict.fromkeys(link for link, _, _ in plan.links):
        coming = build_approach(plan, [(0, 0.0, 0.0)] * 9, [0.0] * len(plan.out_lanes), [link])
        hurried = Instant.of_views(now.time, now.signals)
        hurried._approaches = {signal: coming}
        chosen = PhaseCompetition().choose(signal, hurried)
        assert link in green_links(plan.phases[chosen])
    world.close()
