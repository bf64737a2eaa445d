"""The Gymnasium environment: its API, determinism, seeds, saved states, and every class of bad input."""

import hashlib
import json
import pickle
import subprocess
import sys
import warnings
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
import pytest
from conftest import command_environment
from gymnasium.utils.env_checker import check_env

import dojo_env
from dojo_env.env import TrafficSignalEnv
from dojo_env.errors import ConfigError, EpisodeOverError, SimulationError
from dojo_env.scenario import packaged_scenario
from dojo_maps.errors import DescriptionError, SourceError

Make = Callable[..., TrafficSignalEnv]


@pytest.fixture
def make() -> Iterator[Make]:
    """Make environments that are closed after the test."""
    made: list[TrafficSignalEnv] = []

    def build(scenario: Any = "cologne1", **keywords: Any) -> TrafficSignalEnv:
        keywords.setdefault("num_seconds", 100)
        made.append(TrafficSignalEnv(scenario=scenario, **keywords))
        return made[-1]

    yield build
    for env in made:
        env.close()


def digest(env: TrafficSignalEnv, seed: int | None) -> str:
    """Hash all that an episode with fixed actions gives."""
    observation, info = env.reset(seed=seed)
    code = hashlib.sha256(np.asarray(observation).tobytes())
    ended, step = False, 0
    while not ended:
        observation, reward, _, ended, info = env.step(step // 3 % 4)
        code.update(np.asarray(observation).tobytes() + np.float64(reward).tobytes())
        code.update(json.dumps(info).encode())
        step += 1
    code.update(json.dumps(env.metrics()).encode())
    return code.hexdigest()


@pytest.mark.slow
@pytest.mark.sampled(1)
@pytest.mark.parametrize("scenario", ["two-way", "cologne1", "ingolstadt1"])
def test_gymnasium_accepts_the_environment(scenario: str) -> None:
    env = gymnasium.make("dojo_env/TrafficSignal-v0", scenario=scenario, num_seconds=100)
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", message=".*can be closed.*|.*spec.*")
        check_env(env.unwrapped)
    env.close()


def test_spaces_are_those_that_users_of_sumo_rl_know(make: Make) -> None:
    env = make()
    assert env.observation_space.shape == (21,)
    assert env.action_space == gymnasium.spaces.Discrete(4)
    observation, info = env.reset(seed=1)
    assert observation.dtype == np.float32
    keys = list(info)
    assert {"step", "system_total_stopped", "system_mean_speed", "agents_total_stopped"} <= set(keys)
    assert f"{env.signal}_accumulated_waiting_time" in keys
    for _ in range(5):
        *_, info = env.step(1)
        assert list(info) == keys


@pytest.mark.slow
def test_same_seed_gives_same_bytes_across_resets_and_processes(make: Make) -> None:
    env = make("two-way", num_seconds=600)
    here = [digest(env, 7), digest(env, 8), digest(env, 7)]
    assert here[0] == here[2] != here[1]
    code = (
        "import sys; sys.path.insert(0, 'tests')\n"
        "from test_env_env import digest, TrafficSignalEnv\n"
        "print(digest(TrafficSignalEnv(scenario='two-way', num_seconds=600), 7))"
    )
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True, env=command_environment(),
        cwd=Path(__file__).resolve().parents[1],
    )  # fmt: skip
    assert done.stdout.strip() == here[0]


def test_episodes_without_a_seed_follow_from_the_seed_before(make: Make) -> None:
    env = make("two-way")
    first = [digest(env, 3), digest(env, None), digest(env, None)]
    second = [digest(env, 3), digest(env, None), digest(env, None)]
    assert first == second
    assert len(set(first)) == 3


def test_minimum_green_holds_an_early_change(make: Make) -> None:
    env = make("two-way", min_green=10)
    env.reset(seed=1)
    phases = []
    for _ in range(6):
        *_, info = env.step(1)
        phases.append(info["t_phase"])
    assert phases == [0, 0, 1, 1, 1, 1]
    assert info["safety_violations"] == 0


@pytest.mark.parametrize("mode", ["next_or_keep", "set_duration"])
def test_other_action_modes_run_without_a_violation(make: Make, mode: str) -> None:
    env = make("cologne1", action_mode=mode, num_seconds=300)
    env.reset(seed=1)
    env.action_space.seed(1)
    seen = set()
    ended = False
    while not ended:
        *_, ended, info = env.step(env.action_space.sample())
        seen.add(info[f"{env.signal}_phase"])
    assert len(seen) == 4
    assert info["safety_violations"] == 0


def test_restore_goes_back_exactly(make: Make) -> None:
    env = make("two-way", num_seconds=300)
    env.reset(seed=5)
    for step in range(20):
        observation, *_ = env.step(step // 3 % 4)
    saved = json.loads(json.dumps(env.save()))
    onward = [env.step(2)[0].tobytes() for _ in range(5)]
    again, _ = env.restore(saved)
    assert again.tobytes() == observation.tobytes()
    assert [env.step(2)[0].tobytes() for _ in range(5)] == onward
    with pytest.raises(ConfigError, match="saved state"):
        env.restore({"seed": 1})


def test_own_process_gives_the_same_and_leaves_nothing_running(make: Make) -> None:
    here, apart = make("two-way"), make("two-way", own_process=True)
    assert digest(here, 4) == digest(apart, 4)
    here.reset(seed=1)
    apart.reset(seed=1)
    process = apart.world._process
    with pytest.raises(ConfigError, match="expected a whole number from 0 to 3"):
        apart.step(9)
    apart.close()
    assert not process.is_alive()


@pytest.mark.slow
def test_an_own_process_gives_an_episode_wherever_it_stands(make: Make) -> None:
    alone, after = (make("cologne1", num_seconds=3600, own_process=True) for _ in range(2))
    for seed in (1, 2):
        act_at_random(after, seed)
    assert act_at_random(alone, 3) == act_at_random(after, 3)


def act_at_random(env: TrafficSignalEnv, seed: int) -> list[float]:
    """Run an episode; its rewards tell it from others."""
    env.reset(seed=seed)
    chance, rewards, ended = np.random.default_rng(seed), [], False
    while not ended:
        _, reward, _, ended, _ = env.step(chance.integers(env.action_space.n))
        rewards.append(reward)
    return rewards


SCRIPT = """
import dojo_env
def paid(signal, before, now): return 1.0
print("read")
env = dojo_env.parallel_env(scenario="two-way", num_seconds=60, own_process=True, reward_fn={reward})
env.reset(seed=1)
print(env.step(dict.fromkeys(env.agents, 0))[1])
env.close()
"""


@pytest.mark.slow
def test_an_own_process_reads_a_script_only_where_it_needs_it(tmp_path: Path) -> None:
    script = tmp_path / "script.py"
    for reward, needs in (("'queue'", False), ("paid", True)):
        script.write_text(SCRIPT.format(reward=reward))
        done = subprocess.run(
            [sys.executable, script], capture_output=True, text=True, timeout=120, check=False
        )
        assert done.stdout.count("read") == 1 + needs
        assert done.returncode == needs
        assert ('under `if __name__ == "__main__":`' in done.stderr) == needs


def test_an_own_process_refuses_what_it_cannot_get(make: Make) -> None:
    with pytest.raises(ConfigError, match="not lambdas"):
        make("two-way", own_process=True, reward_fn=lambda _signal, _before, _now: 1.0)


def test_traci_gives_the_same_as_libsumo(make: Make) -> None:
    assert digest(make("two-way", backend="traci", num_seconds=50), 2) == digest(
        make("two-way", num_seconds=50), 2
    )


@pytest.mark.sampled(4)
@pytest.mark.parametrize("reward", [
    "diff-waiting-time", "average-speed", "queue", "pressure", "co2", "delay", "throughput",
    {"queue": 0.5, "co2": 1.0}, {"t": "pressure"}, lambda _signal, _before, now: now.time,
])  # fmt: skip
def test_rewards_are_finite_numbers(make: Make, reward: Any) -> None:
    env = make("two-way", reward_fn=reward)
    env.reset(seed=1)
    rewards = [env.step(k % 4)[1] for k in range(20)]
    assert np.isfinite(rewards).all()
    assert any(rewards)


def test_config_can_be_sent_to_another_process(make: Make) -> None:
    config = make("cologne1").config
    assert pickle.loads(pickle.dumps(config)) == config  # noqa: S301


@pytest.mark.slow
def test_vector_environments_run_in_processes() -> None:
    envs = gymnasium.make_vec(
        "dojo_env/TrafficSignal-v0",
        num_envs=2,
        vectorization_mode="async",
        vector_kwargs={"context": "spawn"},
        scenario="two-way",
        num_seconds=50,
    )
    observations, _ = envs.reset(seed=1)
    assert observations.shape == (2, 21)
    observations, *_ = envs.step(np.array([0, 1]))
    assert observations.shape == (2, 21)
    envs.close()


@pytest.mark.parametrize(
    ("keywords", "words"),
    [
        ({"scenario": "cologne99"}, "cologne99.*cologne1"),
        ({"scenario": "cologne3"}, "several signals.*ts_ids"),
        ({"ts_ids": ["nowhere"]}, "no signal.*nowhere"),
        ({"yelow_time": 3}, "did you mean yellow_time"),
        ({"delta_time": 0}, "delta_time=0"),
        ({"num_seconds": 101}, "no multiple"),
        ({"reward_fn": "luck"}, "reward_fn='luck'"),
        ({"reward_fn": {"queue": float("nan")}}, "weight of 'queue' is nan"),
        ({"reward_fn": {"queue": "much"}}, "expected a finite number"),
        ({"observation": "smell"}, "observation='smell'"),
        ({"render_mode": "print"}, "render_mode='print'"),
        ({"use_gui": True}, 'backend="traci"'),
        ({"min_green": "long"}, "min_green='long'"),
        ({"sumo_seed": -4}, "sumo_seed=-4"),
    ],
)
def test_bad_settings_get_one_clear_error(make: Make, keywords: dict[str, Any], words: str) -> None:
    with pytest.raises(ConfigError, match=words):
        make(**keywords)


@pytest.mark.parametrize("action", [4, -1, 1.5, "go", None, float("nan"), [1, 2]])
def test_wrong_actions_change_nothing(make: Make, action: Any) -> None:
    env = make()
    env.reset(seed=1)
    with pytest.raises(ConfigError, match="whole number"):
        env.step(action)
    assert env.instant.time == 25200
    env.step(np.int64(1))


def test_step_outside_an_episode_is_refused(make: Make) -> None:
    env = make(num_seconds=5)
    with pytest.raises(EpisodeOverError, match="reset"):
        env.step(0)
    env.reset(seed=1)
    *_, ended, _ = env.step(0)
    assert ended
    with pytest.raises(EpisodeOverError, match="reset"):
        env.step(0)
    env.close()
    env.close()


def bad_routes(tmp_path: Path, kind: str) -> Path:
    good = packaged_scenario("cologne1").routes[0].read_bytes()
    path = tmp_path / "bad.rou.xml"
    if kind == "other_map":
        return packaged_scenario("ingolstadt1").routes[0]
    entities = b'<!DOCTYPE routes [<!ENTITY a "b">]>' + good[good.index(b"<routes") :]
    made = {
        "cut_short": good[:-300],
        "binary": b"\x00\x01 no routes",
        "entities": entities,
        "unknown_edge": good.replace(b'from="28198821#3"', b'from="nowhere"', 1),
    }
    path.write_bytes(made[kind])
    return path


@pytest.mark.parametrize("kind", ["cut_short", "binary", "entities"])
def test_routes_that_are_no_whole_xml_are_refused_before_any_work(
    make: Make, tmp_path: Path, kind: str
) -> None:
    routes = bad_routes(tmp_path, kind)
    with pytest.raises(ConfigError, match=r"bad\.rou\.xml") as caught:
        make(dojo_env.Scenario(map=packaged_scenario("cologne1").map, routes=routes))
    assert "\n" not in str(caught.value)
    config = tmp_path / "bad.sumocfg"
    network = packaged_scenario("cologne1").map
    config.write_text(
        f'<configuration><net-file value="{network}"/><route-files value="bad.rou.xml"/></configuration>',
        encoding="utf-8",
    )
    with pytest.raises(ConfigError, match=r"bad\.rou\.xml"):
        make(str(config))


@pytest.mark.parametrize("kind", ["other_map", "unknown_edge"])
def test_bad_routes_end_in_sumos_own_words_and_the_environment_recovers(
    make: Make, tmp_path: Path, kind: str
) -> None:
    good = packaged_scenario("cologne1")
    begin = 57600 if kind == "other_map" else 25200
    scenario = dojo_env.Scenario(map=good.map, routes=bad_routes(tmp_path, kind), begin=begin)
    env = make(scenario, num_seconds=3600)

    def run() -> None:
        env.reset(seed=1)
        for _ in range(720):
            env.step(0)

    for _ in range(2):
        with pytest.raises(SimulationError, match="SUMO") as caught:
            run()
        assert "\n" not in str(caught.value)
    with pytest.raises((EpisodeOverError, SimulationError)):
        env.step(0)
    other = make("two-way")
    other.reset(seed=1)
    other.step(0)


def test_missing_files_and_broken_maps_get_one_clear_error(make: Make, tmp_path: Path) -> None:
    routes = packaged_scenario("cologne1").routes
    with pytest.raises(ConfigError, match="does not exist"):
        dojo_env.Scenario(map="missing.net.xml", routes=routes)
    broken = tmp_path / "broken.net.xml"
    broken.write_text("<net>", encoding="utf-8")
    with pytest.raises(SourceError, match="broken"):
        make(dojo_env.Scenario(map=broken, routes=routes))
    newer = tmp_path / "newer.dojo"
    newer.mkdir()
    (newer / "map.json").write_text('{"format": "dojo-map", "version": 99}', encoding="utf-8")
    with pytest.raises(DescriptionError, match="version 99"):
        make(dojo_env.Scenario(map=newer, routes=routes))


def test_a_map_without_signals_is_refused(make: Make, network_path: Callable[[str], Path]) -> None:
    with pytest.raises(ConfigError, match="no signals"):
        make(dojo_env.Scenario(map=network_path("simple"), routes=packaged_scenario("cologne1").routes))


def test_a_sumocfg_and_plain_files_work_without_code(make: Make) -> None:
    found = packaged_scenario("cologne1")
    env = make(str(found.map.parent / "cologne1.sumocfg"))
    assert env.config.sumo.begin == 25200
    wanted = digest(make("cologne1"), 1)
    assert digest(env, 1) == wanted
    env.close()
    plain = TrafficSignalEnv(
        net_file=str(found.map), route_file=str(found.routes[0]), begin_time=25200, num_seconds=100
    )
    assert digest(plain, 1) == wanted
    plain.close()


PROGRAM = """<additional><tlLogic id="{signal}" programID="mine" type="static" offset="0">
{phases}</tlLogic></additional>"""


def test_a_program_from_an_additional_file_is_what_agents_and_sumo_run(make: Make, tmp_path: Path) -> None:
    found = packaged_scenario("cologne1")
    (own,) = make("cologne1").world.map.plans.values()
    first, second = own.phases[0], own.phases[2]
    states = [
        (30, first),
        (3, first.replace("G", "y").replace("g", "y")),
        (20, second),
        (3, "r" * len(first)),
    ]
    phases = "".join(f'<phase duration="{seconds}" state="{state}"/>' for seconds, state in states)
    path = tmp_path / "mine.add.xml"
    path.write_text(PROGRAM.format(phases=phases, signal=own.signal))
    scenario = dojo_env.Scenario(map=found.map, routes=found.routes, additional=path, begin=25200)
    env = make(scenario, fixed_ts=True, num_seconds=60)
    assert env.world.map.plans[own.signal].phases == (first, second)
    env.reset(seed=1)
    shown = set()
    for _ in range(12):
        shown.add(env.instant.signals[own.signal].state)
        env.step(0)
    assert {first, second} <= shown
    path.write_text(path.read_text().replace(first, first[1:]))
    with pytest.raises(ConfigError, match=r"letters.*links"):
        make(scenario)
