"""The benchmark's command: rows are run once, kept, and stand beside published figures."""

import csv
import json
import os
import signal
import subprocess
import time
from functools import partial
from pathlib import Path

import pytest
from commands import run_env, start_env, wait_for_file

from dojo_env.benchmark.rows import list_groups
from dojo_env.metrics import SIX
from dojo_env.runs import run_controller

benchmark = partial(run_env, "benchmark")


@pytest.mark.slow
def test_rows_are_run_once_and_stand_beside_published_figures(tmp_path: Path) -> None:
    published = {"scenarios": {"two-way": {"SOTL": {name: {"mean": 80.0, "std": 1.0} for name in SIX}}}}
    (tmp_path / "paper.json").write_text(json.dumps(published))
    arguments = ("--scenarios", "two-way", "--seeds", 2, "--seconds", 300, "--results", tmp_path / "results",
                 "--paper", tmp_path / "paper.json")  # fmt: skip
    done = benchmark("--rows", "MaxPressure", *arguments)
    assert done.returncode == 0, done.stderr
    assert "| SOTL | not run |" in done.stdout
    kept = tmp_path / "results" / "two-way" / "MaxPressure" / "figures.json"
    first = kept.stat().st_mtime_ns
    done = benchmark("--rows", "MaxPressure", "Cycle", *arguments)
    assert done.returncode == 0, done.stderr
    assert kept.stat().st_mtime_ns == first
    assert "**" in done.stdout
    assert "80.00 ± 1.00" in done.stdout
    with (tmp_path / "results" / "table.csv").open() as file:
        rows = {(row["row"], row["figure"]): row for row in csv.DictReader(file)}
    wanted = run_controller("max-pressure-paper", range(2), scenario="two-way", num_seconds=300)
    mean = sum(episode["queue"] for episode in wanted) / 2
    assert float(rows["MaxPressure", "queue"]["mean"]) == mean
    assert rows["SOTL", "queue"]["mean"] == ""


def test_bad_input_is_one_line_and_a_status(tmp_path: Path) -> None:
    for status, *arguments in ((2, "--scenarios", "nowhere"), (3, "--paper", tmp_path / "none.json")):
        done = benchmark("--rows", "Cycle", "--results", tmp_path, *arguments)
        assert done.returncode == status
        assert len(done.stderr.strip().splitlines()) == 1, done.stderr


@pytest.mark.sampled(0)
def test_all_that_does_not_learn_has_a_short_name(tmp_path: Path) -> None:
    done = benchmark("--rows", "controllers", "--scenarios", "two-way", "--seeds", 1, "--seconds", 10,
                     "--results", tmp_path)  # fmt: skip
    assert done.returncode == 0, done.stderr
    assert {folder.name for folder in (tmp_path / "two-way").iterdir()} == set(list_groups()["controllers"])


def start_row(results: Path) -> subprocess.Popen[str]:
    """Run a benchmark until its row trains."""
    running = start_env("benchmark", "--rows", "A2C-F", "--scenarios", "two-way", "--results", results)
    wait_for_file(results / "two-way" / "A2C-F" / "training.json", running)
    return running


def wait_for_end_of_group(group: int) -> None:
    end = time.monotonic() + 60
    with pytest.raises(ProcessLookupError):
        while time.monotonic() < end:
            os.killpg(group, 0)
            time.sleep(0.1)


@pytest.mark.sampled(0)
def test_rows_end_with_a_benchmark_that_is_killed(tmp_path: Path) -> None:
    pytest.importorskip("stable_baselines3")
    running = start_row(tmp_path)
    running.kill()
    running.communicate()
    wait_for_end_of_group(running.pid)


@pytest.mark.slow
def test_row_that_is_killed_is_one_line(tmp_path: Path) -> None:
    pytest.importorskip("stable_baselines3")
    running = start_row(tmp_path)
    children = Path(f"/proc/{running.pid}/task/{running.pid}/children").read_text().split()
    (row,) = (pid for pid in children if b"spawn_main" in Path(f"/proc/{pid}/cmdline").read_bytes())
    os.kill(int(row), signal.SIGKILL)
    _, told = running.communicate(timeout=60)
    assert running.returncode == 4
    assert "dojo-env: a row's process was killed" in told  # Its environments may speak after it.
    assert "BrokenProcessPool" not in told
    wait_for_end_of_group(running.pid)
