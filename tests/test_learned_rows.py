"""Learned rows of the benchmark: trained once, evaluated to the same figures again."""

import dataclasses
import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from commands import SHORT
from gymnasium import spaces

from dojo_env.errors import ConfigError

pytest.importorskip("stable_baselines3")

from stable_baselines3.common.buffers import NStepReplayBuffer

from dojo_env.benchmark.row_runs import describe, find_folder, is_done, run_row
from dojo_env.benchmark.rows import CONSTRAINTS, LEARNED, find_training
from dojo_env.learning.evaluation import run_policy
from dojo_env.learning.replay_buffer import NStepDictReplayBuffer
from dojo_env.learning.settings import Training


def short_task(row: str) -> dict[str, Any]:
    whole = find_training(row, "two-way")
    settings = {"n_steps": 60, "batch_size": 60} if whole.algorithm == "ppo" else {}
    training = dataclasses.replace(whole, **SHORT, hyperparameters=settings)
    return {**describe(row, "two-way", 2, 300), "training": dataclasses.asdict(training)}


def test_row_is_trained_once_and_evaluated_to_the_same_figures(tmp_path: Path) -> None:
    task = short_task("PPO-F")
    assert not is_done(task, tmp_path)
    run_row(task, tmp_path)
    assert is_done(task, tmp_path)
    folder = find_folder("PPO-F", "two-way", tmp_path)
    first, weights = (folder / "figures.json").read_bytes(), (folder / "policy.pt").stat().st_mtime_ns
    (folder / "figures.json").unlink()
    run_row(task, tmp_path)
    assert (folder / "figures.json").read_bytes() == first
    assert (folder / "policy.pt").stat().st_mtime_ns == weights
    known = json.loads(first)
    assert [episode["seed"] for episode in known["episodes"]] == [0, 1]
    assert known["episodes"][0]["violations"] == {}
    assert len((folder / "series.csv").read_text().splitlines()) == 1 + 300 // 5


def test_row_that_was_trained_otherwise_is_refused(tmp_path: Path) -> None:
    task = short_task("PPO-F")
    run_row(task, tmp_path)
    (find_folder("PPO-F", "two-way", tmp_path) / "figures.json").unlink()
    other = {**task, "training": {**task["training"], "seed": 7}}
    with pytest.raises(ConfigError, match="trained with other settings"):
        run_row(other, tmp_path)


def test_policy_of_another_observation_is_refused(tmp_path: Path) -> None:
    task = short_task("A2C-F")
    run_row(task, tmp_path)
    other = dataclasses.replace(Training(**task["training"]), observation="bev")
    with pytest.raises(ConfigError, match="another policy"):
        run_policy(other, find_folder("A2C-F", "two-way", tmp_path), [0])


def test_every_row_of_the_table_has_settings() -> None:
    for row in LEARNED:
        for scenario in ("two-way", "cologne1"):
            assert find_training(row, scenario).environment["scenario"] == scenario


def test_settings_that_fewer_rows_share_win(monkeypatch: pytest.MonkeyPatch) -> None:
    own = {
        ("two-way", "learned"): {"steps": 1, "min_green": 7, "hyperparameters": {"batch_size": 1}},
        ("two-way", "DQN"): {"steps": 2, "hyperparameters": {"batch_size": 2, "n_steps": 4}},
        ("two-way", "DQN-MV"): {"steps": 3, "hyperparameters": {"batch_size": 3}},
    }
    monkeypatch.setattr("dojo_env.benchmark.rows.OWN_SETTINGS", own)
    found = {row: find_training(row, "two-way") for row in ("PPO-MV", "DQN-F", "DQN-MV")}
    assert {row: (each.steps, each.min_green) for row, each in found.items()} == {
        "PPO-MV": (1, 7), "DQN-F": (2, 7), "DQN-MV": (3, 7)
    }  # fmt: skip
    used = found["DQN-MV"].hyperparameters
    assert [used[name] for name in ("batch_size", "n_steps", "buffer_size")] == [3, 4, 20_000]
    assert describe("SOTL", "two-way", 5, 3600)["settings"] == {**CONSTRAINTS["paper"], "min_green": 8}


def sample_from(buffer: Any) -> Any:
    np.random.seed(1)  # noqa: NPY002 - Stable-Baselines3 draws from it
    return buffer.sample(200)


@pytest.mark.parametrize("written", [7, 12, 31])
def test_dqns_memory_of_several_pictures_gives_what_the_buffer_of_one_picture_gives(written: int) -> None:
    seen = spaces.Box(0, 255, (3, 4, 4), np.uint8)
    known = {"action_space": spaces.Discrete(3), "n_envs": 2, "n_steps": 4, "gamma": 0.9}
    one = NStepReplayBuffer(24, seen, **known, handle_timeout_termination=True)
    many = NStepDictReplayBuffer(
        24, spaces.Dict(left=seen, right=seen), **known, handle_timeout_termination=True
    )
    draw = np.random.default_rng(0)
    for step in range(written):
        before, after = draw.integers(0, 255, (2, 2, 3, 4, 4), np.uint8)
        actions, rewards = draw.integers(0, 3, 2), draw.normal(size=2)
        done = np.array([step % 5 == 4, step % 9 == 8])
        infos = [{"TimeLimit.truncated": bool(done[0])}, {}]
        one.add(before, after, actions, rewards, done, infos)
        many.add(
            {"left": before, "right": 255 - before},
            {"left": after, "right": 255 - after}, actions, rewards, done, infos,
        )  # fmt: skip
    expected, found = (sample_from(buffer) for buffer in (one, many))
    for name in ("actions", "dones", "rewards", "discounts"):
        np.testing.assert_allclose(getattr(found, name), getattr(expected, name), rtol=1e-6)
    for name in ("observations", "next_observations"):
        np.testing.assert_array_equal(getattr(found, name)["left"], getattr(expected, name))
        np.testing.assert_array_equal(255 - getattr(found, name)["right"], getattr(expected, name))
