"""Pictures and the report: everything that was run is shown, what was not says so, and twice is the same."""

import json
import re
from pathlib import Path
from typing import Any

import pytest
from commands import make_row, run_env, run_tool

from dojo_env.metrics import SIX

pytest.importorskip("stable_baselines3")
kept = pytest.importorskip("dojo_env.benchmark.kept_rows")
pictures = pytest.importorskip("dojo_env.benchmark.pictures")

ROWS = ("MaxPressure", "Cycle")
KINDS = ("hour", "training", "figures")


@pytest.fixture(scope="module")
def results(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("kept") / "results"
    done = run_env("benchmark", "--rows", *ROWS, "--scenarios", "two-way", "--seeds", 2, "--seconds", 300,
                    "--results", folder)  # fmt: skip
    assert done.returncode == 0, done.stderr
    make_row(folder, "PPO-F")
    published = {"MaxPressure": {name: {"mean": 10.0, "std": 1.0} for name in SIX}}
    (folder / "paper.json").write_text(json.dumps({"scenarios": {"two-way": published}}))
    return folder


@pytest.mark.slow
def test_pictures_have_the_same_bytes_each_time(results: Path) -> None:
    drawn = []
    for _ in range(2):
        done = run_env("benchmark", "--results", results, "--paper", results / "paper.json", "--pictures")
        assert done.returncode == 0, done.stderr
        paths = sorted((results / "pictures").iterdir())
        assert [path.name for path in paths] == sorted(f"two-way-{kind}.png" for kind in KINDS)
        drawn.append([path.read_bytes() for path in paths])
    assert drawn[0] == drawn[1]
    for picture in drawn[0]:
        assert picture.startswith(b"\x89PNG")
        assert 2_000 < len(picture) < 100_000
        assert not re.search(rb"tEXt|tIME", picture)


@pytest.mark.slow
def test_rows_that_jam_are_not_chosen(results: Path) -> None:
    def row(name: str, travel: float, trips: float) -> Any:
        figures = {"travel_time": {"mean": travel}, "travel_time_all": {"mean": trips}}
        return kept.KeptRow(results, {"row": name, "training": {}, "figures": figures})

    rows = {f"PPO-{k}": row(f"PPO-{k}", 40 + k, 50 + k) for k in range(4)} | {"jam": row("jam", 20, 900)}
    assert pictures.choose_rows(rows) == [f"PPO-{k}" for k in range(4)]


def test_report_is_made_whole_from_the_rows(results: Path) -> None:
    done = run_tool("report", "--results", results, "--paper", results / "paper.json")
    assert done.returncode == 0, done.stderr
    text = (results / "README.md").read_text()
    mean = json.loads((results / "two-way/MaxPressure/figures.json").read_text())["figures"]["queue"]["mean"]
    assert f"{mean:.2f} ±" in text
    assert f"{mean / 10 - 1:+.1%}" in text
    for name in re.findall(r"\]\((pictures/[^)]+)\)", text):
        assert (results / name).is_file()
    assert text.count("](pictures/") == len(KINDS)
    assert f"| PPO-F | {compare(results, 'travel_time')} |" in text
    assert "| two-way | PPO-BEV* | not run | `dojo-env benchmark --rows 'PPO-BEV*'" in text
    assert "| two-way | Cycle |  | `dojo-env benchmark --rows Cycle --scenarios two-way --seeds 2" in text
    assert run_tool("report", "--results", results, "--paper", results / "paper.json").returncode == 0
    assert (results / "README.md").read_text() == text


def compare(results: Path, figure: str) -> str:
    """Tell by how much PPO-F's mean differs from MaxPressure's, and in how many hours it is less."""
    ours, rule = (
        {hour["seed"]: hour[figure] for hour in json.loads(path.read_text())["episodes"]}
        for path in (results / "two-way" / row / "figures.json" for row in ("PPO-F", "MaxPressure"))
    )
    better = sum(ours[seed] < rule[seed] for seed in rule)
    return f"{sum(ours.values()) / sum(rule.values()) - 1:+.1%}, {better} of {len(rule)}"


def test_bad_file_of_published_figures_is_one_line(results: Path) -> None:
    arguments = ("--results", results, "--paper", results / "nowhere.json")
    for done in (run_env("benchmark", *arguments, "--pictures"), run_tool("report", *arguments)):
        assert done.returncode == 3
        assert len(done.stderr.strip().splitlines()) == 1, done.stderr
