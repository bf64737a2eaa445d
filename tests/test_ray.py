"""Training, the benchmark and data sets on a real Ray cluster of two nodes.

Trainings come with `--whole`: one is interrupted, and one of the nodes is lost in its middle.
"""

import csv
import json
import os
import signal
import socket
import subprocess
import time
from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import pytest
from commands import run_env, start_env
from test_datasets import digest

pytest.importorskip("stable_baselines3")
cluster_utils = pytest.importorskip("ray.cluster_utils")
torch = pytest.importorskip("torch")

TRAIN = ("train", "--scenario", "two-way", "--seconds", 300, "--set", "n_steps=30", "batch_size=60",
         "--processes", 2, "--every", 1)  # fmt: skip
NODE = {
    "RAY_USAGE_STATS_ENABLED": "0",
    "RAY_enable_worker_prestart": "0",
    "RAY_raylet_start_wait_time_s": "120",
    "RAY_agent_register_timeout_ms": "120000",
}
ROUND = 120
"""Steps of an episode in each of two environments."""
BENCHMARK = ("benchmark", "--rows", "MaxPressure", "Cycle", "--scenarios", "two-way", "--seeds", 1,
             "--seconds", 300)  # fmt: skip
DATASET = ("dataset", "cologne1", "-n", 4, "--per-episode", 2, "--split", 1, "--cameras", "bev", "--jobs", 1,
           "--conditions", "day", "--controllers", "fixed-time", "--seconds", 200,
           "--no-smooth")  # fmt: skip


def run(tool: str, *arguments: object) -> tuple[int, str]:
    return wait(start_env(tool, *arguments))


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


def describe_node() -> dict[str, Any]:
    """A node with room for one runner; with ports given, it does not give up when its agents start slowly."""
    names = (
        "metrics_agent_port",
        "metrics_export_port",
        "dashboard_agent_listen_port",
        "runtime_env_agent_port",
    )
    with ExitStack() as stack:
        sockets = [stack.enter_context(socket.create_server(("127.0.0.1", 0))) for _ in names]
        ports = {name: each.getsockname()[1] for name, each in zip(names, sockets, strict=True)}
    return {"num_cpus": 1, "object_store_memory": 80_000_000, "node_ip_address": "127.0.0.1", **ports}


@pytest.fixture(scope="module")
def cluster() -> Iterator[Any]:
    """Two nodes of real processes."""
    with pytest.MonkeyPatch.context() as patch:
        for name, value in NODE.items():
            patch.setenv(name, value)
        head = {**describe_node(), "include_dashboard": False}
        started = cluster_utils.Cluster(initialize_head=True, head_node_args=head)
        try:
            started.add_node(**describe_node())
            yield started
        finally:
            started.shutdown()


@pytest.mark.slow
def test_benchmark_gives_the_same_figures_on_a_cluster(cluster: Any, tmp_path: Path) -> None:
    done = run_env(*BENCHMARK, "--results", tmp_path / "here", "--jobs", 1)
    assert done.returncode == 0, done.stderr
    status, errors = run(*BENCHMARK, "--results", tmp_path / "there", "--ray", cluster.address)
    assert status == 0, errors
    for row in ("MaxPressure", "Cycle"):
        a, b = (tmp_path / folder / "two-way" / row for folder in ("here", "there"))
        assert json.loads((a / "figures.json").read_text()) == json.loads((b / "figures.json").read_text())
        assert (a / "series.csv").read_bytes() == (b / "series.csv").read_bytes()


@pytest.mark.sampled(0)
def test_a_data_set_has_the_same_bytes_on_a_cluster(cluster: Any, tmp_path: Path) -> None:
    done = run_env(*DATASET, "-o", tmp_path / "here")
    assert done.returncode == 0, done.stderr
    status, errors = run(*DATASET, "-o", tmp_path / "there", "--ray", cluster.address)
    assert status == 0, errors
    assert digest(tmp_path / "there") == digest(tmp_path / "here")


@pytest.mark.sampled(0)
def test_a_policy_is_trained_on_a_cluster(cluster: Any, tmp_path: Path) -> None:
    folder = tmp_path / "run"
    status, errors = run(*TRAIN, "--steps", ROUND, "--ray", cluster.address, "--out", folder)
    assert status == 0, errors
    rows = read_curve(folder)
    assert (rows[0]["part"], rows[-1]["part"]) == ("training", "validation")
    assert int(rows[-1]["steps"]) >= ROUND
    assert torch.load(folder / "policy.pt", weights_only=True)


def wait_for_checkpoint(folder: Path, running: subprocess.Popen[str], after: int = 0) -> int:
    """Wait until a run writes its next checkpoint; tells its time, in nanoseconds."""
    path = folder / "checkpoint.pt"
    while not path.exists() or path.stat().st_mtime_ns == after:
        assert running.poll() is None, running.communicate()
        time.sleep(0.1)
    return path.stat().st_mtime_ns


@pytest.mark.sampled(0)
def test_training_goes_on_when_it_is_interrupted_and_when_a_node_is_lost(
    cluster: Any, tmp_path: Path
) -> None:
    folder, steps = tmp_path / "run", 6 * ROUND
    command = (*TRAIN, "--steps", steps, "--ray", cluster.address, "--out", folder)
    running = start_env(*command)
    written = wait_for_checkpoint(folder, running)
    os.killpg(running.pid, signal.SIGINT)
    status, errors = wait(running, 60)
    assert status == 130, errors
    assert "--resume goes on" in errors.splitlines()[-1]
    assert "Traceback" not in errors
    before = read_curve(folder)

    running = start_env(*command, "--resume")
    wait_for_checkpoint(folder, running, written)
    cluster.remove_node(next(iter(cluster.worker_nodes)), allow_graceful=False)
    status, errors = wait(running)
    assert status == 0, errors
    assert "1 of 2 runners" in errors
    assert "Traceback" not in errors
    rows = read_curve(folder)
    assert rows[: len(before)] == before
    assert (rows[0]["part"], rows[-1]["part"]) == ("training", "validation")
    assert int(rows[-1]["steps"]) >= steps
    assert torch.load(folder / "policy.pt", weights_only=True)


def test_bad_arguments_are_one_line_before_any_work(tmp_path: Path) -> None:
    here, folder = ("--ray", "local"), ("--out", tmp_path / "a")
    wrong: list[tuple[str, tuple[object, ...]]] = [
        ("RLlib has no a2c", ("train", *here, "--algorithm", "a2c", *folder)),
        ("no averaged weights", ("train", *here, "--averaged-weights", *folder)),
        ("nowhere", ("train", *here, "--scenario", "nowhere", *folder)),
        ("no training", ("train", *here, "--resume", *folder)),
    ]
    for words, arguments in wrong:
        done = run_env(arguments[0], "--quiet", *arguments[1:])
        assert done.returncode == (3 if words == "no training" else 2), arguments
        assert words in done.stderr
        assert len(done.stderr.strip().splitlines()) == 1, done.stderr
    assert not (tmp_path / "a").exists()


@pytest.mark.parametrize("command", [("train", "--out"), (*BENCHMARK, "--results")], ids=lambda c: c[0])
def test_a_cluster_that_is_not_there_is_one_line(command: tuple[object, ...], tmp_path: Path) -> None:
    folder = tmp_path / "a"
    status, errors = run(*command, folder, "--quiet", "--ray", "127.0.0.1:1")
    assert status == 2
    assert "no Ray cluster answers" in errors
    assert len(errors.strip().splitlines()) == 1, errors
    assert not folder.exists()
