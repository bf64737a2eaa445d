"""SUMO-RL's interface: equal to SUMO-RL itself step by step, and used as its examples do."""

import csv
import gc
import importlib
import json
import os
import subprocess
import sys
import weakref
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
import pytest
import sumo
from gymnasium import spaces
from gymnasium.utils.env_checker import check_env
from pettingzoo.test import api_test, parallel_api_test

from dojo_env.compat import sumo_rl
from dojo_env.compat.sumo_rl import ObservationFunction, SumoEnvironment, TrafficSignal
from dojo_env.compat.sumo_rl.agents import QLAgent
from dojo_env.compat.sumo_rl.exploration import EpsilonGreedy
from dojo_env.compat.sumo_rl.util.gen_route import write_route_file
from dojo_env.errors import ConfigError
from dojo_env.scenario import packaged_scenario

NETS = packaged_scenario("grid4x4").map.parents[2]
TWO_WAY = NETS / "2way-single-intersection"
JUNCTION = "GS_cluster_357187_359543"
STEPS = """
import importlib, json, sys
import numpy as np
import pettingzoo.utils
pettingzoo.utils.agent_selector = pettingzoo.utils.AgentSelector  # SUMO-RL 1.4.5 knows it by its old name.
module, face, keywords, steps = sys.argv[1], sys.argv[2], json.loads(sys.argv[3]), int(sys.argv[4])
chance, library, rows = np.random.default_rng(5), importlib.import_module(module), []
draw = lambda phases, step: int(chance.integers(phases)) if chance.random() < 0.2 else step // 3 % phases
plain = lambda value: {name: np.asarray(v).tolist() for name, v in value.items()}
note = lambda *values: rows.append(list(map(plain, values)))
if face == "signals":
    env = library.SumoEnvironment(sumo_warnings=False, **keywords)
    note(env.reset(seed=7))
    for step in range(steps):
        actions = {name: draw(env.action_spaces(name).n, step) for name in env.ts_ids}
        observations, rewards, dones, info = env.step(actions)
        note(observations, rewards, dones, info)
else:
    env = library.env(sumo_warnings=False, **keywords)
    env.reset(seed=7)
    for turn, agent in enumerate(env.agent_iter(steps * len(env.possible_agents))):
        observation, reward, terminated, truncated, info = env.last()
        note({agent: observation}, {agent: reward}, {agent: truncated}, info)
        env.step(None if truncated else draw(env.action_space(agent).n, turn // len(env.possible_agents)))
print(json.dumps(rows), file=sys.__stdout__)
"""
SCENARIOS = {
    "two-way": ("2way-single-intersection/single-intersection", "-vhvh", 0),
    "single": ("single-intersection/single-intersection", "", 0),
    "2x2": ("2x2grid/2x2", "", 0),
    "double": ("double/network", "/../flow", 0),
    "4x4": ("4x4-Lucas/4x4", "c1c2c1c2", 0),
    "4x4loop": ("4x4loop/4x4loop", "", 0),
    "cologne1": ("RESCO/cologne1/cologne1", "", 25200),
    "cologne3": ("RESCO/cologne3/cologne3", "", 25200),
    "cologne8": ("RESCO/cologne8/cologne8", "", 25200),
    "grid4x4": ("RESCO/grid4x4/grid4x4", "_1", 0),
    "arterial4x4": ("RESCO/arterial4x4/arterial4x4", "_1", 0),
    "ingolstadt1": ("RESCO/ingolstadt1/ingolstadt1", "", 57600),
}
SETTINGS: tuple[dict[str, Any], ...] = (
    {"reward_fn": "diff-waiting-time"},
    {"reward_fn": "average-speed", "yellow_time": 3, "min_green": 8},
    {"reward_fn": "queue", "delta_time": 7, "max_depart_delay": 0},
    {"reward_fn": "pressure", "waiting_time_memory": 100, "time_to_teleport": 60},
)


def files_of(name: str) -> dict[str, Any]:
    network, ending, begin = SCENARIOS[name]
    route = f"{network.rpartition('/')[0]}/flow" if name == "double" else f"{network}{ending}"
    return {
        "net_file": str(NETS / f"{network}.net.xml"),
        "route_file": str(NETS / f"{route}.rou.xml"),
        "begin_time": begin,
    }


def run_steps(
    module: str, face: str, keywords: dict[str, Any], steps: int, layout: str = "pymalloc"
) -> list[Any]:
    """Run in a process of its own: SUMO-RL needs the environment's variables when it is imported."""
    done = subprocess.run(
        [sys.executable, "-c", STEPS, module, face, json.dumps(keywords), str(steps)],
        env={**os.environ, "SUMO_HOME": sumo.SUMO_HOME, "LIBSUMO_AS_TRACI": "1", "PYTHONMALLOC": layout},
        capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert not done.returncode, done.stderr
    return json.loads(done.stdout.splitlines()[-1])


def find_difference(ours: list[Any], theirs: list[Any]) -> int | None:
    """Find the first decision that differs, by what both tell."""
    assert len(ours) == len(theirs)
    for k, (one, other) in enumerate(zip(ours, theirs, strict=True)):
        told = one[-1].keys() & other[-1].keys()
        figures = [{name: row[-1][name] for name in told} for row in (one, other)]
        if one[:3] != other[:3] or (k and figures[0] != pytest.approx(figures[1])):
            return k
    return None


def check_equal(face: str, keywords: dict[str, Any], steps: int) -> None:
    """Compare with SUMO-RL; where a junction is crowded, SUMO itself goes by where things lie in memory."""
    ours = run_steps("dojo_env.compat.sumo_rl", face, keywords, steps)
    assert len(ours) >= steps
    assert any(any(row[1].values()) for row in ours[1:]), "nothing was ever paid"
    found = []
    for layout in ("pymalloc", "malloc", "pymalloc_debug", "malloc_debug"):
        found.append(find_difference(ours, run_steps("sumo_rl", face, keywords, steps, layout)))
        if found[-1] is None:
            return
    raise AssertionError(f"first differences from SUMO-RL in four layouts of memory: decisions {found}")


@pytest.mark.slow
@pytest.mark.sampled(2)
@pytest.mark.parametrize("settings", SETTINGS, ids=lambda s: s["reward_fn"])
@pytest.mark.parametrize("name", SCENARIOS)
def test_observations_and_rewards_are_those_of_sumo_rl(name: str, settings: dict[str, Any]) -> None:
    check_equal("signals", {**files_of(name), **settings}, 120)


@pytest.mark.slow
@pytest.mark.sampled(1)
@pytest.mark.parametrize("name", ["cologne3", "4x4", "two-way"])
def test_turns_are_those_of_sumo_rl(name: str) -> None:
    check_equal("turns", {**files_of(name), "num_seconds": 250}, 42)


def short(**keywords: Any) -> dict[str, Any]:
    return {**files_of("cologne1"), "num_seconds": 60, "sumo_warnings": False, **keywords}


@pytest.fixture
def open_env() -> Any:
    opened: list[SumoEnvironment] = []

    def make(**keywords: Any) -> SumoEnvironment:
        opened.append(SumoEnvironment(**short(**keywords)))
        return opened[-1]

    yield make
    for env in opened:
        env.close()


def test_an_agent_learns_a_table_as_in_the_examples(open_env: Any, tmp_path: Path) -> None:
    env = open_env(
        reward_fn=["diff-waiting-time", "average-speed"], reward_weights=[1, 0.1], enforce_max_green=True
    )
    agents: dict[str, QLAgent] = {}
    for episode in (1, 2):
        states = env.reset()
        for name, state in states.items():
            explore = EpsilonGreedy(initial_epsilon=0.05, min_epsilon=0.005, decay=1)
            agents.setdefault(
                name,
                QLAgent(env.encode(state, name), env.observation_space, env.action_space, 0.1, 0.99, explore),
            ).state = env.encode(state, name)
        done = {"__all__": False}
        while not done["__all__"]:
            seen, rewards, done, _ = env.step(action={name: agent.act() for name, agent in agents.items()})
            for name, state in seen.items():
                agents[name].learn(next_state=env.encode(state, name), reward=rewards[name])
        env.save_csv(str(tmp_path / "out" / "ql"), episode)
        with (tmp_path / "out" / f"ql_conn{env.label}_ep{episode}.csv").open() as file:
            rows = list(csv.DictReader(file))
        assert [float(row["step"]) for row in rows] == [25205 + 5 * k for k in range(12)]
    assert len(agents[JUNCTION].q_table) > 1
    assert all(len(key) == 1 + 1 + 2 * 8 for key in agents[JUNCTION].q_table)


@pytest.mark.sampled(0)
def test_stable_baselines_trains_and_every_episode_is_written(tmp_path: Path) -> None:
    library = pytest.importorskip("stable_baselines3")
    vectors = pytest.importorskip("stable_baselines3.common.vec_env")
    write_route_file(tmp_path / "gen.rou.xml", 400, 100)
    keywords = {
        "net_file": TWO_WAY / "single-intersection.net.xml",
        "route_file": tmp_path / "gen.rou.xml",
        "out_csv_name": str(tmp_path / "a2c"),
        "single_agent": True,
        "num_seconds": 100,
    }
    envs = vectors.SubprocVecEnv([lambda: SumoEnvironment(**keywords) for _ in range(2)])
    library.A2C("MlpPolicy", envs, seed=0).learn(total_timesteps=80)
    envs.close()
    assert {path.name for path in tmp_path.glob("a2c*.csv")} == {
        f"a2c_conn{label}_ep{episode}.csv" for label in (0, 1) for episode in (1, 2)
    }


@pytest.mark.slow
def test_generated_demand_is_that_of_sumo_rl(tmp_path: Path) -> None:
    write_route_file(tmp_path / "ours.rou.xml", 400, 100)
    code = (
        f"from sumo_rl.util.gen_route import write_route_file as w; w({str(tmp_path / 'theirs')!r}, 400, 100)"
    )
    done = subprocess.run(
        [sys.executable, "-c", code], env={**os.environ, "SUMO_HOME": sumo.SUMO_HOME}, check=True
    )
    assert not done.returncode
    flows = []
    for name in ("ours.rou.xml", "theirs"):
        root = importlib.import_module("xml.etree.ElementTree").parse(tmp_path / name).getroot()
        # SUMO-RL writes "departSp100d": its placeholder for the end is "ee".
        names = ("route", "begin", "end", "vehsPerHour", "departPos", "departLane")
        flows.append(sorted(tuple(flow.get(key) for key in names) for flow in root.iter("flow")))
    assert flows[0] == flows[1]


def test_gymnasium_makes_it_and_checks_it() -> None:
    env = gymnasium.make("sumo-rl-v0", **short())
    assert isinstance(env.unwrapped, SumoEnvironment)
    check_env(env.unwrapped, skip_render_check=True)
    env.close()


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore::UserWarning")  # Names and shapes that differ are SUMO-RL's.
def test_pettingzoo_checks_both_of_its_faces() -> None:
    env = sumo_rl.cologne3(parallel=False)
    api_test(env, num_cycles=12)
    env.close()
    env = sumo_rl.cologne3()
    parallel_api_test(env, num_cycles=6)
    env.close()


class Queues(ObservationFunction):
    def __call__(self) -> Any:
        return np.array(self.ts.get_lanes_queue(), dtype=np.float32)

    def observation_space(self) -> spaces.Box:
        return spaces.Box(0, 1, (len(self.ts.lanes),), np.float32)


def test_observations_and_rewards_are_the_user_s_own(open_env: Any) -> None:
    def occupied(ts: TrafficSignal) -> float:
        return float(sum(ts.sumo.lane.getLastStepOccupancy(lane) for lane in ts.lanes))

    TrafficSignal.register_reward_fn(occupied)
    with pytest.raises(KeyError, match="occupied"):
        TrafficSignal.register_reward_fn(occupied)
    env = open_env(observation_class=Queues, reward_fn=["occupied", lambda ts: len(ts.lanes)])
    assert env.observation_space.shape == (8,)
    env.reset(seed=1)
    for _ in range(6):
        seen, rewards, _, _ = env.step({JUNCTION: 0})
    assert env.observation_space.contains(seen[JUNCTION])
    assert rewards[JUNCTION].shape == env.traffic_signals[JUNCTION].reward_space.shape == (2,)
    assert rewards[JUNCTION][0] > 0
    assert rewards[JUNCTION][1] == 8
    del TrafficSignal.reward_fns["occupied"]


def test_a_dict_of_rewards_names_the_agents_and_weights_add_up(open_env: Any) -> None:
    files = files_of("cologne3")
    env = open_env(**files, reward_fn={"360082": ["queue", "pressure"]}, reward_weights=[1, 0.5])
    env.reset(seed=1)
    assert env.ts_ids == ["360082"]
    for _ in range(12):
        rewards = env.step({"360082": 1})[1]
    signal = env.traffic_signals["360082"]
    assert rewards["360082"] == -signal.get_total_queued() + 0.5 * signal.get_pressure() != 0


@pytest.mark.parametrize(
    ("keywords", "words"),
    [
        ({"reward_fn": "quick"}, "diff-waiting-time"),
        ({"reward_fn": ["queue", "pressure"], "reward_weights": [1]}, "expected 2"),
        ({"reward_fn": {JUNCTION: "queue"}, "ts_ids": [JUNCTION, "a"]}, "no signal"),
        ({"sumo_seed": "often"}, '"random"'),
        ({"ts_ids": ["elsewhere"]}, "elsewhere"),
        ({"delta_time": 0}, "delta_time"),
    ],
)
def test_what_cannot_work_is_refused(open_env: Any, keywords: dict[str, Any], words: str) -> None:
    with pytest.raises(ConfigError, match=words):
        open_env(**keywords).reset()


def test_a_seed_given_once_holds_from_then_on(open_env: Any) -> None:
    env = open_env(single_agent=True)
    runs = []
    for seed in (3, None, 4):
        first, _ = env.reset(seed=seed)
        runs.append([first, *(env.step(1)[0] for _ in range(11))])
    assert np.array_equal(runs[0], runs[1])
    assert not np.array_equal(runs[0], runs[2])


@pytest.mark.slow
def test_several_run_side_by_side_and_end_with_who_held_them(open_env: Any) -> None:
    first, second = open_env(single_agent=True), open_env(single_agent=True)
    pairs = [[env.reset(seed=1)[0]] for env in (first, second)]
    for _ in range(11):
        for env, seen in zip((first, second), pairs, strict=True):
            seen.append(env.step(2)[0])
    assert np.array_equal(pairs[0], pairs[1])
    gc.disable()
    try:
        env = SumoEnvironment(**short(single_agent=True))
        env.reset()
        world = weakref.ref(env.world)
        del env
        assert world() is None
    finally:
        gc.enable()


def test_the_window_s_size_is_that_of_the_picture(open_env: Any) -> None:
    env = open_env(render_mode="rgb_array", virtual_display=(320, 200), single_agent=True)
    env.reset(seed=1)
    assert env.render().shape == (200, 320, 3)


@pytest.mark.slow
def test_what_differs_is_what_the_page_names(open_env: Any) -> None:
    twice = SumoEnvironment(
        str(NETS / "3x3grid/3x3Grid2lanes.net.xml"), str(NETS / "3x3grid/routes14000.rou.xml")
    )
    assert twice.action_space.n == 2  # Its programs show each green twice.
    alone = open_env(**files_of("cologne3"), single_agent=True, num_seconds=200)
    alone.reset(seed=1)
    shown = set()
    for _ in range(40):
        alone.step(0)
        shown.add(
            alone.sumo.trafficlight.getRedYellowGreenState("GS_cluster_2415878664_254486231_359566_359576")
        )
    assert len(shown) > 2  # The signals without an agent run their programs.
