"""Timing plans: searched to the best there is, kept in files, and shown by SUMO as they say."""

import json
import re
from pathlib import Path

import numpy as np
import pytest
from commands import run_env

from dojo_env.config import build_config
from dojo_env.controllers.timed import Timed
from dojo_env.errors import ConfigError, PlanError
from dojo_env.local_world import LocalWorld
from dojo_env.plan_search import Memory, Search, describe_episode, list_sequences
from dojo_env.scenario import find_scenario, open_map
from dojo_env.signals.plan import build_plan
from dojo_env.timing_plans import SignalTiming, TimingPlan, read_plan, write_plan

SIGNAL = "GS_cluster_357187_359543"
PLAN = TimingPlan(signals={SIGNAL: SignalTiming(stages=((0, 17), (2, 13)), offset=4)})


def test_a_search_finds_the_plan_that_is_best_and_the_same_one_again() -> None:
    best = {"a": ((1, 2), (31, 9)), "b": ((0, 1), (14, 26))}

    def judge(plan: TimingPlan, seed: int) -> float:
        """Count seconds from the best plan, and more for other phases."""
        off = 0.0
        for signal, (phases, seconds) in best.items():
            stages = plan.signals[signal].stages
            wrong = tuple(phase for phase, _ in stages) != phases
            off += 500 if wrong else sum(abs(s - w) for (_, s), w in zip(stages, seconds, strict=True))
        return 100 + off + seed % 3

    def search() -> Search:
        orders = {"a": ((0, 1, 2), (0, 2), (1, 2)), "b": ((0, 1, 2), (0, 1), (1, 2))}
        sequences = {
            signal: tuple(tuple((phase, 20) for phase in order) for order in known)
            for signal, known in orders.items()
        }
        found = Search(score=judge, sequences=sequences, budget=2000, seed=3)
        found.run()
        return found

    one, other = search(), search()
    for signal, (phases, seconds) in best.items():
        assert one.found.signals[signal].stages == tuple(zip(phases, seconds, strict=True))
    assert one.found == other.found
    assert one.spent == other.spent <= 2000


def test_a_search_keeps_to_its_budget_and_needs_enough_for_one_plan() -> None:
    judged: list[int] = []

    def judge(_plan: TimingPlan, seed: int) -> float:
        judged.append(seed)
        return 1.0 / len(judged)

    Search(score=judge, sequences={"a": (((0, 20), (1, 20)),)}, budget=11).run()
    assert len(judged) <= 11
    with pytest.raises(ConfigError, match="at least 4 episodes"):
        Search(score=judge, sequences={"a": (((0, 20), (1, 20)),)}, budget=3).run()


def test_sumos_logics_are_tuned_by_their_own_parameters() -> None:
    def judge(plan: TimingPlan, _seed: int) -> float:
        return abs(plan.max_green - 45) + abs(plan.parameters["max-gap"] - 1.5) + 1

    search = Search(score=judge, sequences={"a": (((0, 20), (1, 20)),)}, logic="actuated", budget=200)
    search.run()
    assert search.found.max_green == 45
    assert search.found.parameters["max-gap"] == 1.5


def test_every_sequence_lets_everybody_go() -> None:
    bundle = open_map(find_scenario("cologne1"))
    config = build_config(scenario="cologne1").signals
    plan = build_plan(bundle.road_map, bundle.road_map.signals[0], config)
    sequences = list_sequences(plan)
    greens = [{link for link, letter in enumerate(state) if letter in "Gg"} for state in plan.phases]
    assert sequences[0] == tuple(green.phase for green in plan.greens)
    assert len(set(sequences)) == len(sequences) > 1
    for sequence in sequences:
        assert set().union(*(greens[phase] for phase in sequence)) == set().union(*greens)


def test_sumo_shows_a_plan_second_by_second() -> None:
    config = build_config(scenario="cologne1", num_seconds=95, delta_time=1, timing=PLAN, min_green=8)
    world = LocalWorld(config)
    world.reset(0)
    phases, states = world.map.plans[SIGNAL].phases, []
    ended = False
    while not ended:
        _, _, ended, info = world.step({})
        states.append(world.instant.signals[SIGNAL].state)
    assert not info["safety_violations"]
    world.close()
    greens = "".join("a" if s == phases[0] else "b" if s == phases[2] else "." for s in states)
    # 2 s of yellow of each stage; the episode begins 4 s into the cycle.
    assert re.fullmatch(r"a{10,12}\.{2}b{11}\.{2}(a{15}\.{2}b{11}\.{2}){2}a{0,15}", greens), greens


def test_a_plan_comes_back_from_its_file(tmp_path: Path) -> None:
    tuned = TimingPlan(
        signals=PLAN.signals, logic="actuated", max_green=45, parameters={"max-gap": 2.0, "detector-gap": 1.5}
    )
    for plan in (PLAN, tuned):
        write_plan(plan, tmp_path / "plan.json", about="people")
        assert read_plan(tmp_path / "plan.json") == plan
        assert Timed(tmp_path / "plan.json").settings == {"timing": plan}


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"format": "other"}, "not a timing plan"),
        ({"version": 2}, "not a timing plan"),
        ({"signals": []}, "expected an object"),
        ({"logic": "clever"}, "expected one of fixed"),
        ({"max_green": 1.5}, "max_green = 1.5"),
        ({"parameters": {"max-gap": "3"}}, "expected numbers"),
        ({"logic": "actuated", "parameters": {"file": 3}}, "parameters of actuated: file"),
        ({"parameters": {"max-gap": 3}}, "it has none"),
        ({"signals": {"x": {"stages": []}}}, "signal x"),
        ({"signals": {"x": {"stages": [[0, 0]]}}}, "stage [0, 0]"),
        ({"signals": {"x": {"stages": [[0, True]]}}}, "stage [0, True]"),
        ({"signals": {"x": {"stages": [[0, 9]], "offset": -1}}}, "offset = -1"),
    ],
)
def test_a_file_that_is_no_plan_is_refused(change: dict[str, object], words: str, tmp_path: Path) -> None:
    path = tmp_path / "plan.json"
    write_plan(PLAN, path)
    path.write_text(json.dumps({**json.loads(path.read_text()), **change}))
    with pytest.raises(PlanError, match=re.escape(words)):
        read_plan(path)


@pytest.mark.parametrize(
    ("signals", "words"),
    [
        ({"elsewhere": SignalTiming(stages=((0, 20),))}, "no signal 'elsewhere'"),
        ({SIGNAL: SignalTiming(stages=((0, 20), (9, 20)))}, "has no phase 9"),
    ],
)
def test_a_plan_for_other_signals_is_refused(signals: dict[str, SignalTiming], words: str) -> None:
    with pytest.raises(ConfigError, match=words):
        LocalWorld(build_config(scenario="cologne1", timing=TimingPlan(signals=signals)))


def test_episodes_are_remembered_and_a_damaged_memory_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "search.json"
    memory = Memory(path)
    key = describe_episode(PLAN, 1, {})
    assert key != describe_episode(PLAN, 2, {})
    memory.add(key, 3.5)
    assert Memory(path).scores == {key: 3.5}
    path.write_text('{"a": "b"}')
    with pytest.raises(PlanError, match="delete it"):
        Memory(path)
    memory.forget()
    assert not path.exists()


@pytest.mark.slow
def test_the_command_finds_a_plan_that_run_runs(tmp_path: Path) -> None:
    plan = tmp_path / "plan.json"
    done = run_env("plan", "cologne1", "--budget", 5, "--seconds", 60, "-o", plan)
    assert done.returncode == 0, done.stderr
    assert SIGNAL in done.stdout
    assert [path.name for path in tmp_path.iterdir()] == ["plan.json"]
    told = json.loads(plan.read_text())["validation"]
    assert f"{np.mean(list(told.values())):.1f} s a trip" in done.stdout
    done = run_env("run", "--scenario", "cologne1", "--controller", plan, "--seconds", 60)
    assert done.returncode == 0, done.stderr
    assert re.search(r"safety violations +0$", done.stdout, re.MULTILINE)
