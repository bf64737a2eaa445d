"""Stable-Baselines3, where it is installed: its checker on every observation, its process pool, a learner."""

from functools import partial

import numpy as np
import pytest

from dojo_env.env import TrafficSignalEnv

env_checker = pytest.importorskip("stable_baselines3.common.env_checker")
vec_env = pytest.importorskip("stable_baselines3.common.vec_env")
stable_baselines3 = pytest.importorskip("stable_baselines3")

OBSERVATIONS = ["features", "bev", "multi_view", "detector"]


@pytest.mark.sampled(4)
@pytest.mark.parametrize("scenario", ["two-way", "cologne1", "ingolstadt1"])
@pytest.mark.parametrize("observation", OBSERVATIONS)
def test_checker_accepts_every_observation(scenario: str, observation: str) -> None:
    env = TrafficSignalEnv(scenario=scenario, observation=observation, num_seconds=50)
    env_checker.check_env(env, warn=True)
    env.close()


def test_named_sensors_are_accepted() -> None:
    sensors = {"top": "bev:depth", "who": "approach_1:instance", "spin": "lidar"}
    env = TrafficSignalEnv(scenario="two-way", observation=sensors, num_seconds=50)
    env_checker.check_env(env, warn=False)
    env.close()


@pytest.mark.slow
def test_environments_run_in_processes_and_a_policy_learns_from_them() -> None:
    build = partial(
        TrafficSignalEnv, scenario="two-way", num_seconds=100, observation="multi_view", height=64, width=64
    )
    envs = vec_env.SubprocVecEnv([build, build], start_method="spawn")
    seen = envs.reset()
    assert {image.shape for image in seen.values()} == {(2, 64, 64, 3)}
    learner = stable_baselines3.PPO(
        "MultiInputPolicy", envs, n_steps=16, batch_size=16, n_epochs=1, seed=1, device="cpu"
    )
    before = [parameter.detach().clone() for parameter in learner.policy.parameters()]
    learner.learn(32)
    after = list(learner.policy.parameters())
    assert any(not np.array_equal(a, b.detach()) for a, b in zip(before, after, strict=True))
    envs.close()
