"""Commands that are interrupted at any moment: one line, status 130, nothing left, nobody left."""

import contextlib
import os
import random
import select
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

import osm_drawings
import pytest
from conftest import command_environment

BOTH = (signal.SIGINT, signal.SIGTERM)
WORDS = {
    "dojo_maps": "dojo-maps: interrupted; every bundle is as it was, or complete",
    "dojo_env": "dojo-env: interrupted",
}
COMMANDS: dict[str, tuple[str, ...]] = {
    "convert": ("dojo_maps", "convert", "{net}", "-o", "out.dojo"),
    "validate": ("dojo_maps", "validate", "{net}", "--json", "out.json", "--html", "out.html"),
    "fix": ("dojo_maps", "fix", "{net}", "-o", "out.net.xml", "--patch", "patch"),
    "import-osm": ("dojo_maps", "import-osm", "{osm}", "-o", "out.dojo"),
    "run": ("dojo_env", "run", "--scenario", "two-way", "--controller", "fixed-time", "--seconds", "600",
            "--json", "out.json"),
    "watch": ("dojo_env", "watch", "--scenario", "two-way", "--no-browser"),
    "replay": ("dojo_env", "replay", "{recording}", "--video", "out.mp4"),
}  # fmt: skip
WHOLE = {
    "convert": {"out.dojo"},
    "validate": {"out.json", "out.html"},
    "fix": {"out.net.xml", "patch"},
    "import-osm": {"out.dojo"},
    "run": {"out.json"},
    "watch": set(),
    "replay": {"out.mp4"},
}
"""What each leaves when it is not interrupted."""


@dataclass(frozen=True)
class Trial:
    """One interruption: of which command, when, and with which signals."""

    command: str
    moment: float | None
    """Seconds after the start; None as soon as there is a result, when it is about to end."""
    signals: tuple[tuple[float, signal.Signals], ...]
    """Each after a pause, in seconds."""
    to_group: bool


def draw_trial(seed: int) -> Trial:
    chance = random.Random(seed)  # noqa: S311 - the same on every run
    command = chance.choice(list(COMMANDS))
    is_late = command != "watch" and chance.random() < 0.25
    manner = chance.choice(("one", "both", "storm"))
    if manner == "storm":
        numbers = list(BOTH * 10)
        chance.shuffle(numbers)
        longest = chance.choice((0.0, 0.001, 0.03))
        signals = tuple((chance.uniform(0, longest), number) for number in numbers)
    else:
        numbers = chance.sample(BOTH, 1 if manner == "one" else 2)
        signals = tuple((0.0, number) for number in numbers)
    return Trial(
        command=command,
        moment=None if is_late else chance.uniform(0, 3) ** chance.choice((1, 2)) / 2,
        signals=signals,
        to_group=chance.random() < 0.5,
    )


@pytest.fixture(scope="session")
def inputs(shared_folder: Path, network_path: Callable[[str], Path]) -> dict[str, str]:
    """What the commands read; making it, they fill their caches."""
    folder = shared_folder / "interruptions" / str(os.getpid())
    folder.mkdir(parents=True)
    osm_drawings.left_hand().write(folder / "drawn.osm")
    run = [sys.executable, "-m", "dojo_env", "run", "--scenario", "two-way", "--controller", "random"]
    record = [*run, "--seconds", "60", "--record", folder / "recorded"]
    subprocess.run(record, env=command_environment(), check=True, capture_output=True)
    found = {
        "net": str(network_path("cologne1")),
        "osm": str(folder / "drawn.osm"),
        "recording": str(folder / "recorded_ep1.npz"),
    }
    replay = [sys.executable, "-m", "dojo_env", "replay", found["recording"], "--video", folder / "first.mp4"]
    subprocess.run(replay, env=command_environment(), check=True, capture_output=True)
    return found


def answers_itself(process: subprocess.Popen[str]) -> bool:
    """Tell whether a process answers SIGTERM: while Python itself starts, it does not."""
    status = Path(f"/proc/{process.pid}/status").read_text()
    mask = next(line.split()[1] for line in status.splitlines() if line.startswith("SigCgt"))
    return bool(int(mask, 16) >> (signal.SIGTERM - 1) & 1)


def interrupt(trial: Trial, process: subprocess.Popen[str]) -> bool:
    """Send a trial's signals; returns whether the command was there to answer the first of them."""
    if trial.moment is None:
        select.select([process.stdout], [], [], 60)
    else:
        time.sleep(trial.moment)
    was_ready = answers_itself(process)
    for pause, number in trial.signals:
        if pause:
            time.sleep(pause)
        with contextlib.suppress(ProcessLookupError):
            os.killpg(process.pid, number) if trial.to_group else process.send_signal(number)
    return was_ready


def processes_of(mark: str) -> list[str]:
    """List the processes that a trial has started and that are still there."""
    found = []
    for path in Path("/proc").glob("[0-9]*"):
        with contextlib.suppress(OSError):
            if f"DOJO_TRIAL={mark}".encode() in (path / "environ").read_bytes().split(b"\0"):
                found.append((path / "cmdline").read_text().replace("\0", " "))
    return found


def wait_until_alone(mark: str) -> None:
    end = time.monotonic() + 20
    while left := processes_of(mark):
        assert time.monotonic() < end, left
        time.sleep(0.1)


@contextlib.contextmanager
def default_answers() -> Iterator[None]:
    """Start programs as a terminal does: what a job's background processes ignore, a command would, too."""
    former = {number: signal.signal(number, signal.default_int_handler) for number in BOTH}
    try:
        yield
    finally:
        for number, answer in former.items():
            signal.signal(number, answer)


def check_trial(trial: Trial, folder: Path, inputs: dict[str, str]) -> str:
    """Interrupt a command and look at its end; returns how it ended."""
    package, *arguments = COMMANDS[trial.command]
    work, temporary = folder / "work", folder / "temporary"
    work.mkdir(parents=True)
    temporary.mkdir()
    environment = command_environment(TMPDIR=str(temporary), DOJO_TRIAL=str(folder))
    command = [sys.executable, "-m", package, *(argument.format(**inputs) for argument in arguments)]
    with default_answers():
        process = subprocess.Popen(
            command, cwd=work, env=environment, text=True, start_new_session=True,
            stdout=subprocess.PIPE, stderr=subprocess.PIPE, stdin=subprocess.DEVNULL,
        )  # fmt: skip
    with process:
        was_ready = interrupt(trial, process)
        out, errors = process.communicate(timeout=60)
    told = f"{trial} {process.returncode} {was_ready} {out} {errors}"
    left = {path.name for path in work.iterdir()}
    wait_until_alone(str(folder))
    assert not list(temporary.iterdir()), (told, list(temporary.iterdir()))
    lines = [line for line in errors.splitlines() if not line.startswith("watch at http")]
    if process.returncode == 0:
        assert (lines, left) == ([], WHOLE[trial.command]), told
        return "done"
    assert left <= WHOLE[trial.command], told
    if process.returncode != 130 and not was_ready:
        # Python itself answered, in its own way, before it ran anything of ours.
        assert not any(f"/{name}/" in errors for name in WORDS), told
        return "Python"
    assert (process.returncode, lines) == (130, [WORDS[package]]), told
    return "interrupted"


def test_an_interruption_is_one_line_at_any_moment(
    interruption_seed: int, tmp_path: Path, inputs: dict[str, str]
) -> None:
    check_trial(draw_trial(interruption_seed), tmp_path / "trial", inputs)
