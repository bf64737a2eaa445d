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
from dojo_env.benchmark.rows import FOLDER, ONE_SIGNAL, find_row, list_groups, read_packaged_rows, read_row
from dojo_env.learning.evaluation import run_policy
from dojo_env.learning.replay_buffer import NStepDictReplayBuffer
from dojo_env.learning.settings import RunFileError, Training


def short_task(row: str) -> dict[str, Any]:
    whole = find_row(row).find_training("two-way")
    settings = {"n_steps": 60, "batch_size": 60} if whole.algorithm == "ppo" else {}
    training = dataclasses.replace(whole, **SHORT, hyperparameters=settings)
    task = describe(find_row(row), "two-way", seeds=2, seconds=300)
    return {**task, "training": dataclasses.asdict(training)}


@pytest.mark.slow
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
    assert len((folder / "series.csv").read_text().splitlines()) == 1 + 300 // 60


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


def test_every_row_has_settings_that_work_and_the_files_name() -> None:
    groups = list_groups()
    for row in read_packaged_rows().values():
        assert row.summary
        assert (FOLDER / find_folder(row.name, "", Path()).name).with_suffix(".toml").is_file()
    for name in (*groups["learned"], *groups["varied"]):
        for scenario in ONE_SIGNAL:
            assert find_row(name).find_training(scenario).environment["scenario"] == scenario


def test_a_row_is_a_file_that_can_be_copied_and_changed(tmp_path: Path) -> None:
    packaged = (FOLDER / "DQN-MV.toml").read_text()
    changed = packaged.replace('"DQN-MV"', '"mine"').replace("train_freq = 1", "train_freq = 1, gamma = 0.5")
    (tmp_path / "mine.toml").write_text(changed)
    row = find_row(str(tmp_path / "mine.toml"))
    assert row.name == "mine"
    usual, own = (each.find_training("cologne1").hyperparameters for each in (find_row("DQN-MV"), row))
    assert own == {**usual, "gamma": 0.5}
    assert row.find_training("grid4x4").hyperparameters["buffer_size"] == 20_000
    assert describe(find_row("SOTL"), "two-way", seeds=5, seconds=3600)["settings"]["min_green"] == 8


@pytest.mark.parametrize(
    ("content", "words"),
    [
        ("name = ", "not TOML"),
        ("name = " + "[" * 100_000, "not TOML"),
        ('controller = "sotl"', "name = None"),
        ('name = "../up/"', "expected letters"),
        ('name = "a"\ncontroller = "magic"', "expected one of"),
        ('name = "a"\ncontroller = "sotl"\n[training]', "a row has a controller"),
        ('name = "a"\ncolour = 1', "colour: unknown"),
        ('name = "a"\ntraining = 3', "expected tables"),
        ('name = "a"\n[scenarios]\ncologne1 = 3', "expected tables"),
    ],
)
def test_a_file_that_is_no_row_is_refused(content: str, words: str, tmp_path: Path) -> None:
    (tmp_path / "row.toml").write_text(content)
    with pytest.raises(RunFileError, match=words):
        read_row(tmp_path / "row.toml")


def test_unknown_settings_of_a_row_are_refused(tmp_path: Path) -> None:
    (tmp_path / "row.toml").write_text('name = "a"\n[training]\nwings = 2')
    with pytest.raises(ConfigError, match=r"row a: .*wings"):
        read_row(tmp_path / "row.toml").find_training("cologne1")


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
