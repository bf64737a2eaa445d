"""Processes that episodes run in."""

import os
import subprocess
import sys

import pytest

from dojo_env.learning.episode_pools import open_processes

ASK = "import os; print(os.environ.get('OPENBLAS_NUM_THREADS'))"


def ask_a_child(_: object) -> str:
    """Tell on how many threads NumPy computes in a process that is started here."""
    return subprocess.run(
        [sys.executable, "-c", ASK], capture_output=True, text=True, check=True
    ).stdout.strip()


@pytest.mark.parametrize(("said", "expected"), [(None, "1"), ("3", "3")])
def test_episodes_beside_each_other_do_not_fight_for_cores(
    said: str | None, expected: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.delenv("OPENBLAS_NUM_THREADS", raising=False)
    if said:
        monkeypatch.setenv("OPENBLAS_NUM_THREADS", said)
    before = dict(os.environ)
    with open_processes(1) as run_all:
        assert run_all(ask_a_child, [0]) == [expected]
    assert dict(os.environ) == before
