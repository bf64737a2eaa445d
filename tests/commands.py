"""The tools' commands as users run them, and rows of the benchmark that are there within seconds."""

import json
import subprocess
import sys
from pathlib import Path
from typing import Any

from conftest import REPOSITORY, command_environment

TOOLS = REPOSITORY / "tools"
sys.path.insert(0, str(TOOLS))  # Their modules import each other as scripts do.
_MAKE_ROW = """
import json, sys
from pathlib import Path
sys.path.insert(0, sys.argv[1])
from learning.run_row import run_row
if __name__ == "__main__":
    run_row(json.loads(sys.argv[2]), Path(sys.argv[3]))
"""
SHORT: dict[str, Any] = {"steps": 60, "seconds": 300, "processes": 1}
"""A training of a single short episode."""


def run_tool(name: str, *arguments: object) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, str(TOOLS / f"{name}.py"), *map(str, arguments)]
    return subprocess.run(
        command, capture_output=True, text=True, env=command_environment(), check=False, timeout=300
    )


def make_row(results: Path, row: str, **settings: object) -> None:
    """Train and evaluate a learned row with other settings than the benchmark's own."""
    training = {
        "scenario": "two-way",
        **SHORT,
        "hyperparameters": {"n_steps": 60, "batch_size": 60},
        **settings,
    }
    task = {"row": row, "scenario": "two-way", "seeds": 2, "seconds": 300, "training": training}
    script = results.parent / "make_row.py"
    script.write_text(_MAKE_ROW)
    subprocess.run(
        [sys.executable, str(script), str(TOOLS), json.dumps(task), str(results)],
        check=True, capture_output=True, text=True, env=command_environment(), timeout=300,
    )  # fmt: skip
