"""People on foot: seen where SUMO has them, measured as SUMO has it, and never cut off by a signal."""

import pickle
import random
import xml.etree.ElementTree as ET
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from dojo_env.config import build_config
from dojo_env.local_world import LocalWorld
from dojo_env.phase_features import DELAY, PHASE_FEATURES, PhaseReader
from dojo_env.queue_forecast import QueueForecast
from dojo_env.scenario import Scenario
from dojo_env.snapshot import Kind

SECONDS = 600
LEGS = ("e", "n", "w", "s")


@pytest.fixture(scope="module")
def scenario(network_path: Callable[[str], Path], tmp_path_factory: pytest.TempPathFactory) -> Scenario:
    """A junction of four legs that cars and walkers cross in all directions."""
    lines = []
    for k, start in enumerate(LEGS):
        for end in LEGS[:k] + LEGS[k + 1 :]:
            name = start + end
            lines.append(
                f'<personFlow id="p{name}" begin="0" end="{SECONDS}" period="45">'
                f'<walk from="-{start}" to="{end}"/></personFlow>'
                f'<flow id="{name}" begin="0" end="{SECONDS}" period="20" from="-{start}" to="{end}"/>'
            )
    routes = tmp_path_factory.mktemp("walkers") / "walkers.rou.xml"
    routes.write_text(f"<routes>{''.join(lines)}</routes>")
    return Scenario(map=network_path("right_hand"), routes=routes)


@pytest.fixture(scope="module")
def episode(scenario: Scenario, tmp_path_factory: pytest.TempPathFactory):
    """An episode of random actions, all seen, beside SUMO's own trajectories."""
    output = tmp_path_factory.mktemp("outputs") / "fcd.xml"
    world = LocalWorld(
        build_config(
            scenario=scenario,
            num_seconds=SECONDS,
            min_green=5,
            all_red=1,
            additional_sumo_cmd=f"--fcd-output {output} --precision 6",
        )
    )
    chance = random.Random(5)  # noqa: S311
    world.reset(5)
    snapshots, ended = [], False
    while not ended:
        actions = {s: chance.randrange(len(plan.phases)) for s, plan in world.map.plans.items()}
        _, _, ended, _ = world.step(actions)
        snapshots.append(world.instant.snapshot)
    figures = world.metrics()
    world.close()
    people = {}
    for step in ET.parse(output).getroot():  # noqa: S314 - SUMO's own file
        people[float(step.attrib["time"])] = {p.attrib["id"]: p.attrib for p in step.iter("person")}
    return snapshots, figures, people


def test_walkers_are_seen_where_sumo_has_them(episode) -> None:
    snapshots, _, people = episode
    met = 0
    for snapshot in snapshots:
        # SUMO writes a step's trajectories before it counts the second.
        known = people[snapshot.time - 1]
        rows = np.flatnonzero(snapshot.kinds == Kind.PEDESTRIAN)
        assert {snapshot.ids[row].removeprefix("person ") for row in rows} == set(known)
        for row in rows:
            sumo = known[snapshot.ids[row].removeprefix("person ")]
            assert snapshot.positions[row, :2] == pytest.approx(
                (float(sumo["x"]), float(sumo["y"])), abs=1e-4
            )
            assert snapshot.lanes[row].rpartition("_")[0] == sumo["edge"]
            met += 1
    assert met > 300


def test_walkers_figures_agree_with_their_trajectories(episode) -> None:
    snapshots, figures, people = episode
    waited: dict[str, int] = {}
    present, waiting = [], []
    due = {snapshot.time - 1 for snapshot in snapshots}
    for time, known in sorted(people.items()):
        waited = {
            name: waited.get(name, 0) + 1 if float(p["speed"]) < 0.1 else 0 for name, p in known.items()
        }
        if time in due:
            present.append(len(known))
            waiting.append(sum(waited.values()))
    assert figures["pedestrians"] == pytest.approx(np.mean(present))
    assert figures["pedestrian_waiting"] == pytest.approx(np.mean(waiting), rel=0.02)
    assert figures["pedestrian_waiting"] > 10


def test_random_actions_cut_no_walker_off(episode) -> None:
    assert episode[1]["violations"] == {}


def test_who_sees_with_cameras_knows_of_buttons_that_are_pressed(scenario: Scenario) -> None:
    world = LocalWorld(build_config(scenario=scenario, num_seconds=SECONDS, observation="lane-strips"))
    world.reset(5)
    (signal,) = world.signals
    pressed = 0
    for _ in range(20):
        seen, real = world.perceive(), world.instant
        assert seen is not real
        wanted = real.list_wanted_walks(signal)
        elsewhere = pickle.loads(pickle.dumps(seen))  # noqa: S301 - its own
        assert seen.list_wanted_walks(signal) == elsewhere.list_wanted_walks(signal) == wanted
        assert elsewhere.approach(signal) == seen.approach(signal)
        pressed += bool(wanted)
        world.step({signal: seen.signals[signal].phase})
    world.close()
    assert pressed


def test_phases_are_told_of_walkers_whom_another_one_would_serve(scenario: Scenario) -> None:
    world = LocalWorld(build_config(scenario=scenario, num_seconds=SECONDS, observation="lane-strips"))
    world.reset(5)
    (signal,), (plan,) = world.signals, world.map.plans.values()
    readers, most = (PhaseReader(plan), PhaseReader(plan)), 0.0
    for _ in range(20):
        real, seen = world.instant, world.perceive()
        told, guessed = (
            reader.read(signal, each) for reader, each in zip(readers, (real, seen), strict=True)
        )
        waiting, delay = (PHASE_FEATURES.index(name) for name in ("walkers_waiting", "delay"))
        assert (told[:, waiting] == guessed[:, waiting]).all()
        missed = 60 * (told[:, waiting].max() - told[:, waiting])
        for each, rows in ((real, told), (seen, guessed)):
            vehicles = QueueForecast(plan).measure_delays(
                each.signals[signal], each.approach(signal), each.list_wanted_walks(signal)
            )
            assert DELAY * rows[:, delay] == pytest.approx(vehicles + 0.9 * missed, abs=0.01)
        most = max(most, missed.max())
        world.step({signal: 0})
    world.close()
    assert most > 60
