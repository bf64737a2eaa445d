"""Calls in forks: they leave this process as it was, and tell what happened to them."""

import os
import signal
import subprocess
import sys
import threading
from pathlib import Path

import pytest

from dojo_env.errors import ConfigError, SimulationError
from dojo_env.forks import call_in_fork


def test_a_call_returns_and_changes_nothing_here() -> None:
    held: list[int] = []

    def add(number: int) -> tuple[list[int], int]:
        held.append(number)
        return held, os.getpid()

    returned, process = call_in_fork(add, 3)
    assert returned == [3]
    assert held == []
    assert process != os.getpid()


def test_what_a_call_raises_is_raised() -> None:
    def fail() -> None:
        raise ConfigError("colour=mauve: expected a colour")

    with pytest.raises(ConfigError, match="mauve"):
        call_in_fork(fail)


def test_what_cannot_be_sent_is_told() -> None:
    with pytest.raises(Exception, match="pickle"):
        call_in_fork(threading.Lock)


def test_a_death_is_told_and_leaves_no_zombie(monkeypatch: pytest.MonkeyPatch) -> None:
    def die() -> None:
        os.kill(os.getpid(), signal.SIGKILL)

    forked: list[int] = []
    fork = os.fork
    monkeypatch.setattr(os, "fork", lambda: forked.append(fork()) or forked[-1])
    with pytest.raises(SimulationError, match="died"):
        call_in_fork(die)
    with pytest.raises(ChildProcessError):
        os.waitpid(forked[0], os.WNOHANG)


def test_a_fork_ends_with_its_caller() -> None:
    script = """
import os, time
from dojo_env.forks import call_in_fork
def wait():
    print(os.getpid(), flush=True)
    time.sleep(600)
call_in_fork(wait)
"""
    with subprocess.Popen([sys.executable, "-c", script], stdout=subprocess.PIPE, text=True) as running:
        assert running.stdout is not None
        fork = int(running.stdout.readline())
        running.kill()
        assert running.stdout.read() == ""  # The fork held its end, too.
    assert not Path(f"/proc/{fork}/exe").exists()


def test_an_interrupted_call_comes_to_its_end(tmp_path: Path) -> None:
    def wait() -> None:
        try:
            os.kill(os.getppid(), signal.SIGINT)
            signal.pause()
        finally:
            (tmp_path / "written").touch()

    with pytest.raises(KeyboardInterrupt):
        call_in_fork(wait)
    assert (tmp_path / "written").exists()
