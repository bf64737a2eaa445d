"""Vector environments, wrappers and checks of others, each as in its own documentation."""

import gc
import pickle
from collections.abc import Callable
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
import pytest
import supersuit
from gymnasium.wrappers import RecordVideo
from pettingzoo.test import parallel_seed_test
from pettingzoo.utils import parallel_to_aec

import dojo_env
from dojo_env.errors import SimulationBusyError
from dojo_env.local_world import LocalWorld
from dojo_env.world_process import WorldProcess

NAME = "dojo_env/TrafficSignal-v0"
SHORT: dict[str, Any] = {"scenario": "cologne1", "num_seconds": 60}


def make(**keywords: Any) -> Any:
    return gymnasium.make(NAME, **{**SHORT, **keywords})


def observations_of(env: Any, seed: int) -> list[Any]:
    found, ended = [env.reset(seed=seed)[0]], False
    while not ended:
        observation, _, _, ended, _ = env.step(0)
        found.append(observation)
    return found


@pytest.mark.slow
@pytest.mark.parametrize("mode", ["sync", "async"])
def test_gymnasium_makes_vectors(mode: str) -> None:
    envs = gymnasium.make_vec(NAME, num_envs=2, vectorization_mode=mode, **SHORT)
    together = [envs.reset(seed=[1, 2])[0], *(envs.step(np.array([0, 0]))[0] for _ in range(3))]
    envs.close()
    for k, seed in enumerate((1, 2)):
        env = make()
        assert np.array_equal(observations_of(env, seed)[:4], [both[k] for both in together])
        env.close()


@pytest.mark.parametrize("kind", ["DummyVecEnv", "SubprocVecEnv"])
def test_stable_baselines_makes_vectors(kind: str) -> None:
    vec_env = pytest.importorskip("stable_baselines3.common.vec_env")
    envs = getattr(vec_env, kind)([make, make])
    envs.seed(1)
    assert envs.reset().shape == (2, 21)
    assert envs.step([0, 1])[1].shape == (2,)
    envs.close()


@pytest.mark.slow
def test_supersuit_makes_vectors_of_signals() -> None:
    env = dojo_env.parallel_env(scenario="grid4x4", num_seconds=60)
    envs = supersuit.concat_vec_envs_v1(
        supersuit.pettingzoo_env_to_vec_env_v1(env), 1, num_cpus=1, base_class="gymnasium"
    )
    observations, _ = envs.reset(seed=1)
    assert len(observations) == 16
    assert len(envs.step(np.zeros(16, dtype=int))[1]) == 16
    envs.close()


@pytest.mark.slow
def test_pettingzoo_s_own_checks_hold_with_two_environments_open() -> None:
    parallel_seed_test(lambda: dojo_env.parallel_env(scenario="cologne3", num_seconds=60), num_cycles=8)


def test_signals_act_one_after_the_other_by_pettingzoo_s_wrapper() -> None:
    env = parallel_to_aec(dojo_env.parallel_env(scenario="cologne3", num_seconds=60))
    env.reset(seed=1)
    seen = []
    for agent in env.agent_iter(6):
        seen.append(agent)
        env.step(0)
    env.close()
    assert seen == [*env.possible_agents, *env.possible_agents]


@pytest.mark.slow
def test_gymnasium_records_videos(tmp_path: Path) -> None:
    folder = tmp_path / "films"
    env = RecordVideo(make(render_mode="rgb_array", num_seconds=20), str(folder))
    observations_of(env, 1)
    env.close()
    (film,) = folder.glob("*.mp4")
    assert film.stat().st_size > 1000


@pytest.mark.parametrize("env", [make, lambda: dojo_env.parallel_env(**SHORT)], ids=["single", "parallel"])
def test_environments_are_pickled_as_they_were_made(env: Callable[[], Any]) -> None:
    first = env()
    first.reset(seed=1)
    again = pickle.loads(pickle.dumps(first))  # noqa: S301 - our own
    begun = [each.reset(seed=2)[0] for each in (first, again)]
    again.close()
    first.close()
    one, other = (next(iter(each.values())) if isinstance(each, dict) else each for each in begun)
    assert np.array_equal(one, other)


@pytest.mark.slow
def test_an_environment_that_nobody_holds_is_closed_at_once() -> None:
    gc.collect()
    gc.disable()  # No cycle of references may have to be found.
    try:
        for _ in range(3):
            env = make(observation="bev")
            env.reset(seed=1)
            assert isinstance(env.unwrapped.world, LocalWorld)
            del env
        env = make(render_mode="rgb_array")
        env.reset(seed=1)
        env.render()
        env = make()
        env.reset(seed=1)
        assert isinstance(env.unwrapped.world, LocalWorld)
        env.close()
    finally:
        gc.enable()


def test_a_second_environment_begins_in_a_process_of_its_own() -> None:
    first, second = make(), make()
    first.reset(seed=1)
    second.reset(seed=1)
    assert isinstance(second.unwrapped.world, WorldProcess)
    assert np.array_equal(first.step(0)[0], second.step(0)[0])
    second.close()
    lambdas = make(reward_fn=lambda _signal, _before, _now: 0.0)
    with pytest.raises(SimulationBusyError, match=r"close it first.*not lambdas"):
        lambdas.reset(seed=1)
    lambdas.close()
    first.close()
