"""The example of each learning library runs as its first lines say."""

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

EXAMPLES = Path(__file__).resolve().parents[1] / "examples" / "learning"
SCRIPTS = {
    "sb3_ppo": ["--steps", "96"],
    "cleanrl_ppo": ["--steps", "360", "--environments", "2"],
    "rllib_ppo": ["--rounds", "1", "--runners", "1"],
}
TOLD = {
    "sb3_ppo": r"PPO +\d+\.\d s +\d+ s of waiting\nmax-pressure +\d+\.\d s +\d+ s of waiting\n",
    "cleanrl_ppo": r"( +\d+ steps: an episode earned -?\d+\.\d\n)+",
    "rllib_ppo": r"round 0: episodes earn -?\d+\.\d\n",
}


@pytest.mark.slow
@pytest.mark.sampled(1)
@pytest.mark.parametrize("name", SCRIPTS)
def test_example_runs(name: str, tmp_path: Path) -> None:
    pytest.importorskip("ray" if name == "rllib_ppo" else "stable_baselines3")
    done = subprocess.run(
        [sys.executable, EXAMPLES / f"{name}.py", *SCRIPTS[name], "--seconds", "120"],
        cwd=tmp_path, env={**os.environ, "PYTHONPATH": str(EXAMPLES.parents[1])},
        capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    assert re.fullmatch(TOLD[name], done.stdout), done.stdout
