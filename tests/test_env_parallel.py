"""The PettingZoo environment."""

import contextlib
import types
import warnings
from typing import Any

import numpy as np
import pytest
from pettingzoo.test import parallel_api_test, parallel_seed_test

import dojo_env
from dojo_env.errors import ConfigError, EpisodeOverError


@pytest.mark.sampled(1)
@pytest.mark.parametrize("scenario", ["cologne3", "grid4x4", "two-way"])
def test_pettingzoo_accepts_the_environment(scenario: str) -> None:
    env = dojo_env.parallel_env(scenario=scenario, num_seconds=200)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        parallel_api_test(env, num_cycles=30)
    env.close()


@pytest.mark.slow
def test_same_seeds_give_the_same_in_two_environments() -> None:
    made: list[Any] = []

    def build() -> Any:
        made.append(dojo_env.parallel_env(scenario="cologne3", num_seconds=100, own_process=True))
        return made[-1]

    parallel_seed_test(build, num_cycles=15)
    for env in made:
        env.close()


def test_a_chosen_set_of_signals_acts_and_the_others_run_their_own_program() -> None:
    with contextlib.closing(dojo_env.parallel_env(scenario="cologne3")) as everyone:
        chosen = everyone.possible_agents[:2]
    env = dojo_env.parallel_env(scenario="cologne3", ts_ids=chosen, num_seconds=300)
    _, infos = env.reset(seed=1)
    assert env.agents == chosen == list(infos)
    ended = False
    while env.agents:
        actions = {agent: env.action_space(agent).sample() for agent in env.agents}
        observations, rewards, terminations, truncations, infos = env.step(actions)
        ended = all(truncations.values())
    assert ended
    assert not any(terminations.values())
    assert set(observations) == set(rewards) == set(chosen)
    assert env.metrics()["violations"] == {}
    assert [info["safety_violations"] for info in infos.values()] == [0] * len(chosen)
    with pytest.raises(EpisodeOverError):
        env.step({})
    env.close()


def test_actions_of_strangers_are_refused() -> None:
    env = dojo_env.parallel_env(scenario="cologne3", num_seconds=100)
    env.reset(seed=1)
    with pytest.raises(ConfigError, match="no agent 'nobody'"):
        env.step({"nobody": 0})
    env.close()


@pytest.mark.slow
@pytest.mark.sampled(1)
@pytest.mark.parametrize("scenario", ["cologne8", "ingolstadt7", "arterial4x4"])
def test_random_actions_break_no_rule_on_whole_networks(scenario: str) -> None:
    env = dojo_env.parallel_env(
        scenario=scenario, num_seconds=300, all_red=1, yellow_time="speed", min_green=3
    )
    env.reset(seed=2)
    draw = np.random.default_rng(2)
    while env.agents:
        env.step({agent: int(draw.integers(env.action_space(agent).n)) for agent in env.agents})
    assert env.metrics()["violations"] == {}
    env.close()


def test_no_import_hides_the_function() -> None:
    assert dojo_env.TrafficSignalsEnv is not None  # Loads the module that defines both.
    assert isinstance(dojo_env.parallel_env, types.FunctionType)
