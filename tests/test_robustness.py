"""Policies under other conditions: as trained they give their own figures again, and twice is once."""

import csv
import json
from pathlib import Path

import pytest
from commands import make_row, run_env, run_tool

pytest.importorskip("stable_baselines3")


def read_under(results: Path, row: str) -> dict[str, dict[str, dict[str, dict[str, float]]]]:
    kept = json.loads((results / "two-way" / row / "robustness.json").read_text())
    assert "tools/robustness.py" in kept["command"]
    return kept["under"]


def evaluate(results: Path, row: str, *under: str) -> str:
    done = run_tool("robustness", "--results", results, "--scenarios", "two-way", "--rows", row,
                    "--under", *under, "--seeds", 2, "--seconds", 300)  # fmt: skip
    assert done.returncode == 0, done.stderr
    return done.stderr


@pytest.mark.slow
@pytest.mark.sampled(1)
@pytest.mark.parametrize(
    ("row", "settings", "own", "other"),
    [
        ("PPO-F", {}, "features", "noisy-detector"),
        ("PPO-BEV", {"observation": "bev", "height": 36, "width": 48}, "day", "night"),
    ],
)
def test_policy_gives_its_own_figures_again_and_others_beside(
    row: str, settings: dict[str, object], own: str, other: str, tmp_path: Path
) -> None:
    results = tmp_path / "results"
    make_row(results, row, **settings)
    assert evaluate(results, row, own, other).count(f"{row} under") == 2
    assert evaluate(results, row, own, other) == ""
    under = read_under(results, row)
    figures = json.loads((results / "two-way" / row / "figures.json").read_text())["figures"]
    assert set(under) == {own, other}
    assert all(figures[name] == cell for name, cell in under[own]["figures"].items())
    table = (results / "matrix.md").read_text()
    assert f"| two-way | {own} | {other} |" in table
    with (results / "matrix.csv").open() as file:
        means = {(line["under"], line["figure"]): float(line["mean"]) for line in csv.DictReader(file)}
    assert means[other, "queue"] == under[other]["figures"]["queue"]["mean"]


@pytest.mark.slow
def test_row_of_a_controller_is_evaluated_where_it_is_named(tmp_path: Path) -> None:
    results = tmp_path / "results"
    words = ("--rows", "QueuePressure", "--scenarios", "two-way", "--seeds", 2, "--seconds", 300)
    done = run_env("benchmark", *words, "--results", results)
    assert done.returncode == 0, done.stderr
    assert evaluate(results, "QueuePressure", "features", "noisier-detector").count("under") == 2
    under = read_under(results, "QueuePressure")
    figures = json.loads((results / "two-way" / "QueuePressure" / "figures.json").read_text())["figures"]
    assert all(figures[name] == cell for name, cell in under["features"]["figures"].items())
    assert under["noisier-detector"]["figures"] != under["features"]["figures"]


def test_row_without_a_policy_is_one_line(tmp_path: Path) -> None:
    done = run_tool("robustness", "--results", tmp_path, "--scenarios", "two-way", "--rows", "PPO-F")
    assert done.returncode == 2
    assert "no policy of PPO-F" in done.stderr
    assert len(done.stderr.strip().splitlines()) == 1, done.stderr
