"""Learned rows of the benchmark: trained once, evaluated to the same figures again."""

import dataclasses
import json
from pathlib import Path
from typing import Any

import pytest
from commands import SHORT

from dojo_env.errors import ConfigError

pytest.importorskip("stable_baselines3")

from learning.evaluation import run_policy
from learning.rows import LEARNED, find_training
from learning.run_row import describe, find_folder, is_done, run_row
from learning.settings import Training


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
