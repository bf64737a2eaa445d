"""Commands of the package and of the tools, and rows of the benchmark that are there within seconds."""

import contextlib
import importlib
import io
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any
from unittest import mock

from conftest import REPOSITORY, command_environment

from dojo_env import cli
from dojo_maps import cli as maps_cli

TOOLS = REPOSITORY / "tools"
sys.path.insert(0, str(TOOLS))  # Their modules import each other as scripts do.
SHORT: dict[str, Any] = {"steps": 60, "seconds": 300, "processes": 1}
"""A training of a single short episode."""


def run_tool(name: str, *arguments: object) -> subprocess.CompletedProcess[str]:
    """Run a tool as its command does, but in this process, where torch is loaded once for all tests."""
    with mock.patch.object(sys, "argv", [name, *map(str, arguments)]):
        return _collect(importlib.import_module(name).main, name, *arguments)


def run_env(*arguments: object) -> subprocess.CompletedProcess[str]:
    """Run `dojo-env` in this process, too."""
    return _collect(lambda: cli.main([*map(str, arguments)]), "dojo-env", *arguments)


def run_maps(*arguments: object) -> subprocess.CompletedProcess[str]:
    """Run `dojo-maps` in this process, too."""
    return _collect(lambda: maps_cli.main([*map(str, arguments)]), "dojo-maps", *arguments)


def _collect(main: Callable[[], int], *command: object) -> subprocess.CompletedProcess[str]:
    out, err = io.StringIO(), io.StringIO()
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
        try:
            code = main()
        except SystemExit as exit_:
            code = exit_.code
    return subprocess.CompletedProcess([*map(str, command)], code, out.getvalue(), err.getvalue())


def start_env(*arguments: object) -> subprocess.Popen[str]:
    """Start `dojo-env` in a group of processes of its own."""
    return subprocess.Popen(
        [sys.executable, "-m", "dojo_env", *map(str, arguments)], env=command_environment(),
        stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, start_new_session=True,
    )  # fmt: skip


def wait_for_file(path: Path, running: subprocess.Popen[str]) -> None:
    while not path.exists():
        assert running.poll() is None
        time.sleep(0.05)


def make_row(results: Path, row: str, **settings: object) -> None:
    """Train and evaluate a learned row with other settings than the benchmark's own."""
    from dojo_env.benchmark.row_runs import run_row  # noqa: PLC0415 - torch is not everywhere

    training = {
        "scenario": "two-way",
        **SHORT,
        "hyperparameters": {"n_steps": 60, "batch_size": 60},
        **settings,
    }
    run_row({"row": row, "scenario": "two-way", "seeds": 2, "seconds": 300, "training": training}, results)
