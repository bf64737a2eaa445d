"""A data set on a real Ray cluster of this machine has the bytes that processes of this machine give it."""

import subprocess
import sys
from pathlib import Path

import pytest
from conftest import command_environment
from test_datasets import digest

pytest.importorskip("ray")

COMMAND = (
    *(
        "dataset",
        "cologne1",
        "-n",
        "4",
        "--per-episode",
        "2",
        "--split",
        "1",
        "--cameras",
        "bev",
        "--jobs",
        "1",
    ),
    *("--conditions", "day", "--controllers", "fixed-time", "--seconds", "200", "--no-smooth"),
)


def test_a_cluster_gives_the_same_bytes(tmp_path: Path) -> None:
    for folder, more in (("here", ()), ("there", ("--ray",))):
        done = subprocess.run(
            [sys.executable, "-m", "dojo_env", *COMMAND, "-o", str(tmp_path / folder), *more],
            env=command_environment(), capture_output=True, text=True, timeout=400, check=False,
        )  # fmt: skip
        assert done.returncode == 0, done.stderr
    assert digest(tmp_path / "there") == digest(tmp_path / "here")
