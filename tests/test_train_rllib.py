"""Training and the benchmark on a real Ray cluster of two nodes, one of which is stopped in the middle."""

import csv
import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from conftest import REPOSITORY, command_environment

pytest.importorskip("stable_baselines3")
cluster_utils = pytest.importorskip("ray.cluster_utils")
torch = pytest.importorskip("torch")

TOOLS = REPOSITORY / "tools"
TRAIN = ("train_rllib.py", "--scenario", "two-way", "--seconds", 300, "--set", "n_steps=30", "batch_size=60",
         "--runners", 2, "--every", 1)  # fmt: skip
ROUND = 120
"""Steps of an episode in each of two environments."""
BENCHMARK = ("benchmark.py", "--rows", "MaxPressure", "Cycle", "--scenarios", "two-way", "--seeds", 1,
             "--seconds", 300)  # fmt: skip


def start(script: str, *arguments: object) -> subprocess.Popen[str]:
    return subprocess.Popen(
        [sys.executable, str(TOOLS / script), *map(str, arguments)], env=command_environment(), text=True,
        stdout=subprocess.PIPE, stderr=subprocess.PIPE, start_new_session=True,
    )  # fmt: skip


def run(script: str, *arguments: object) -> tuple[int, str]:
    running = start(script, *arguments)
    return wait(running)


def wait(running: subprocess.Popen[str], seconds: float = 300) -> tuple[int, str]:
    """Wait for a command's end; tells its status and what it wrote of errors."""
    try:
        _, errors = running.communicate(timeout=seconds)
    finally:
        if running.poll() is None:
            os.killpg(running.pid, signal.SIGKILL)
    return running.returncode, errors


def read_curve(folder: Path) -> list[dict[str, str]]:
    with (folder / "curve.csv").open() as file:
        return list(csv.DictReader(file))


@pytest.fixture(scope="module")
def cluster() -> Iterator[Any]:
    """Two nodes, each of them real processes with room for one runner."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("RAY_USAGE_STATS_ENABLED", "0")
        patch.setenv("RAY_enable_worker_prestart", "0")
        node = {"num_cpus": 1, "object_store_memory": 80_000_000, "node_ip_address": "127.0.0.1"}
        started = cluster_utils.Cluster(
            initialize_head=True, head_node_args={**node, "include_dashboard": False}
        )
        try:
            started.add_node(**node)
            yield started
        finally:
            started.shutdown()


def test_benchmark_gives_the_same_figures_on_a_cluster(cluster: Any, tmp_path: Path) -> None:
    for folder, more in (("here", ()), ("there", ("--ray", cluster.address))):
        status, errors = run(*BENCHMARK, "--results", tmp_path / folder, *more)
        assert status == 0, errors
    for row in ("MaxPressure", "Cycle"):
        a, b = (tmp_path / folder / "two-way" / row for folder in ("here", "there"))
        assert json.loads((a / "figures.json").read_text()) == json.loads((b / "figures.json").read_text())
        assert (a / "series.csv").read_bytes() == (b / "series.csv").read_bytes()


def wait_for_checkpoint(folder: Path, running: subprocess.Popen[str], after: int = 0) -> int:
    """Wait until a run writes its next checkpoint; tells its time, in nanoseconds."""
    path = folder / "checkpoint.pt"
    while not path.exists() or path.stat().st_mtime_ns == after:
        assert running.poll() is None, running.communicate()
        time.sleep(0.1)
    return path.stat().st_mtime_ns


def test_training_goes_on_when_it_is_interrupted_and_when_a_node_is_lost(
    cluster: Any, tmp_path: Path
) -> None:
    folder, steps = tmp_path / "run", 6 * ROUND
    command = (*TRAIN, "--steps", steps, "--address", cluster.address, "--out", folder)
    running = start(*command)
    written = wait_for_checkpoint(folder, running)
    os.killpg(running.pid, signal.SIGINT)
    status, errors = wait(running, 60)
    assert status == 130, errors
    assert "--resume goes on" in errors.splitlines()[-1]
    assert "Traceback" not in errors
    before = read_curve(folder)

    running = start(*command, "--resume")
    wait_for_checkpoint(folder, running, written)
    cluster.remove_node(next(iter(cluster.worker_nodes)), allow_graceful=False)
    status, errors = wait(running)
    assert status == 0, errors
    assert "1 of 2 runners" in errors
    rows = read_curve(folder)
    assert rows[: len(before)] == before
    assert (rows[0]["part"], rows[-1]["part"]) == ("training", "validation")
    assert int(rows[-1]["steps"]) >= steps
    assert torch.load(folder / "policy.pt", weights_only=True)
