"""Calls in forks: they leave their process as it was, and tell what happened to them.

Each test's process is a new one, for tests have threads.
"""

import re
import subprocess
import sys
from pathlib import Path

import pytest

IMPORTS = """
import ctypes, itertools, os, signal, threading, time
from dojo_env.errors import ConfigError
from dojo_env.forks import call_in_fork, must_return_within

def tell(function):
    try:
        call_in_fork(function)
    except Exception as error:
        print(f"{type(error).__name__}: {error}")
"""


def run_script(script: str) -> str:
    """Run a script that must go well; returns what it prints."""
    command = [sys.executable, "-c", IMPORTS + script]
    return subprocess.run(command, capture_output=True, text=True, timeout=60, check=True).stdout.strip()


def test_a_call_returns_and_changes_nothing_here() -> None:
    script = """
held = []
def add(number):
    held.append(number)
    return held, os.getpid()
returned, process = call_in_fork(add, 3)
print(returned, held, process != os.getpid())
"""
    assert run_script(script) == "[3] [] True"


def test_a_call_finds_empty_memory() -> None:
    script = """
import ctypes, random
libc = ctypes.CDLL(None)
libc.malloc.restype, libc.free.argtypes = ctypes.c_void_p, [ctypes.c_void_p]
def is_in_order():
    places = [libc.malloc(600) for _ in range(100)]
    return places == sorted(places)
used = [libc.malloc(600) for _ in range(1000)]
for place in random.Random(1).sample(used, 500):
    libc.free(place)
print(call_in_fork(is_in_order), is_in_order())
"""
    assert run_script(script) == "True False"


def test_a_call_does_not_wait_for_threads_that_opencv_has_here() -> None:
    script = """
import cv2, numpy as np
def count_threads():
    return len(os.listdir("/proc/self/task"))
cv2.setNumThreads(3)
y, x = np.mgrid[:900, :1200].astype(np.float32)
cv2.remap(np.zeros((900, 1200, 3), np.uint8), x, y, cv2.INTER_LINEAR)
before = count_threads()
print(call_in_fork(cv2.getNumThreads), cv2.getNumThreads(), count_threads() < before)
"""
    assert run_script(script) == "1 3 True"


def test_what_a_call_raises_is_raised() -> None:
    script = """
def fail():
    raise ConfigError("colour=mauve: expected a colour")
tell(fail)
"""
    assert run_script(script) == "ConfigError: colour=mauve: expected a colour"


def test_what_cannot_be_sent_is_told() -> None:
    assert "pickle" in run_script("tell(threading.Lock)")


def test_a_death_is_told_and_leaves_no_zombie() -> None:
    script = """
tell(lambda: os.kill(os.getpid(), signal.SIGKILL))
try:
    os.waitpid(-1, os.WNOHANG)
except ChildProcessError:
    print("none is left")
"""
    assert run_script(script) == "SimulationDiedError: the simulation's process has died\nnone is left"


@pytest.mark.slow
def test_a_call_that_does_not_come_back_ends_its_fork() -> None:
    script = """
def hang():
    must_return_within(0.3)
    sum(itertools.repeat(0))
def return_in_time():
    must_return_within(0.3)
    time.sleep(0.6)  # Who is stopped for a while is not late.
    must_return_within(0)
    begin = time.process_time()
    while time.process_time() < begin + 0.6:
        pass
    return "back"
tell(hang)
print(call_in_fork(return_in_time))
"""
    assert re.fullmatch("SimulationDiedError: SUMO came to no end of .*\nback", run_script(script))


@pytest.mark.parametrize("work", ["time.sleep(600)", "ctypes.PyDLL(None).sleep(600)"])
def test_a_fork_ends_with_its_caller_even_in_a_call_that_holds_the_lock(work: str) -> None:
    script = f"""
def wait():
    print(os.getpid(), flush=True)
    {work}
call_in_fork(wait)
"""
    command = [sys.executable, "-c", IMPORTS + script]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as running:
        assert running.stdout is not None
        fork = int(running.stdout.readline())
        running.kill()
        assert running.stdout.read() == ""  # The fork held its end, too.
    assert not Path(f"/proc/{fork}/exe").exists()


def test_an_interrupted_call_comes_to_its_end() -> None:
    script = """
def wait():
    try:
        os.kill(os.getppid(), signal.SIGINT)
        while True:
            time.sleep(0.01)
    finally:
        print("written", flush=True)
try:
    call_in_fork(wait)
except KeyboardInterrupt:
    print("interrupted")
"""
    assert run_script(script) == "written\ninterrupted"
