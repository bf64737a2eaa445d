"""Commands that are interrupted at any moment: one line, status 130, nothing left, nobody left."""

import contextlib
import os
import random
import re
import select
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

import osm_drawings
import pytest
from conftest import command_environment, locked

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
FIRST = {"dojo_maps/__init__.py", "dojo_env/__init__.py", "dojo_maps/interruption.py"}
"""What is loaded until signals are answered."""
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
    folder = shared_folder / "interruptions"
    folder.mkdir(exist_ok=True)
    recorded, drawn, old = folder / "recorded_ep1.npz", folder / "drawn.osm", folder / "old.dojo"

    def run(package: str, *arguments: object) -> None:
        command = [sys.executable, "-m", package, *map(str, arguments)]
        subprocess.run(command, cwd=folder, env=command_environment(), check=True, capture_output=True)

    with locked(folder / "lock"):
        if not (folder / "first.mp4").exists():
            osm_drawings.left_hand().write(drawn)
            run("dojo_maps", "convert", drawn, "-o", old)
            run("dojo_env", "run", "--scenario", "two-way", "--controller", "random", "--seconds", "60",
                "--record", "recorded")  # fmt: skip
            run("dojo_env", "replay", recorded, "--video", "first.mp4")
    return {
        "net": str(network_path("cologne1")),
        "osm": str(drawn),
        "bundle": str(old),
        "recording": str(recorded),
    }


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
        # Python itself answered, in its own way, before it had read more of ours than the first lines.
        assert set(re.findall(r"/(dojo_\w+/[\w/]+\.py)", errors)) <= FIRST, told
        assert "gymnasium" not in errors, told
        return "Python"
    assert (process.returncode, lines) == (130, [WORDS[package]]), told
    return "interrupted"


@pytest.mark.slow
def test_an_interruption_is_one_line_at_any_moment(
    interruption_seed: int, tmp_path: Path, inputs: dict[str, str]
) -> None:
    check_trial(draw_trial(interruption_seed), tmp_path / "trial", inputs)


SCRIPT = """
import atexit, os, signal, sys, time
from dojo_maps import command, interruption

interruption.begin("it: interrupted")

def interrupt(*numbers):
    signal.pthread_sigmask(signal.SIG_BLOCK, numbers)
    for number in numbers:
        signal.raise_signal(number)
    signal.pthread_sigmask(signal.SIG_UNBLOCK, numbers)

{before}

def run(options):
{work}
    return 0

def build_parser():
    parser = command.Parser()
    command.add_command(parser.add_subparsers(), "it", run, "")
    return parser

{loading}
command.run_command("it", build_parser, ["it"])
"""
"""A command that interrupts itself."""
ALL = "interrupt(signal.SIGINT, signal.SIGTERM)"


def run_itself(folder: Path, work: str, *, before: str = "", loading: str = "") -> tuple[int, str, str]:
    lines = "\n".join(f"    {line}" for line in work.splitlines())
    (folder / "script.py").write_text(SCRIPT.format(before=before, work=lines, loading=loading))
    with default_answers():
        done = subprocess.run(
            [sys.executable, "script.py"], cwd=folder, env=command_environment(),
            capture_output=True, text=True, timeout=60, check=False,
        )  # fmt: skip
    return done.returncode, done.stdout, done.stderr


INTERRUPTED = (130, "", "it: interrupted\n")


@pytest.mark.parametrize("count", [1, 200])
def test_signals_at_once_are_one_interruption(count: int, tmp_path: Path) -> None:
    storm = "\n".join([ALL] * count)
    assert run_itself(tmp_path, "pass", loading=storm) == INTERRUPTED
    assert run_itself(tmp_path, f"try:\n    {ALL}\nfinally:\n    " + "; ".join([ALL] * count)) == INTERRUPTED


@pytest.mark.parametrize("becomes", ["pass", "raise ImportError('numpy.core.multiarray failed to import')"])
def test_an_interruption_that_is_swallowed_or_renamed_is_told(becomes: str, tmp_path: Path) -> None:
    swallow = f"try:\n    {ALL}\nexcept KeyboardInterrupt:\n    {becomes}"
    status, _, errors = run_itself(tmp_path, swallow)
    assert (status, errors) == (130, "it: interrupted\n")


def test_an_interruption_where_nothing_can_be_raised_is_raised_once_more(tmp_path: Path) -> None:
    lost = f"class Lost:\n    def __del__(self):\n        {ALL}"
    assert run_itself(tmp_path, "Lost()\ntime.sleep(600)", before=lost) == INTERRUPTED


def test_an_interruption_inside_of_an_import_of_the_command_ends_it_at_once(tmp_path: Path) -> None:
    swallow = f"import __main__, signal\ntry:\n    __main__.{ALL}\nexcept BaseException:\n    pass\n"
    (tmp_path / "swallowing.py").write_text(swallow)
    work = "try:\n    {}\nfinally:\n    Path('touched').touch()"
    before = "from pathlib import Path"
    assert run_itself(tmp_path, work.format("import swallowing"), before=before) == INTERRUPTED
    assert not (tmp_path / "touched").exists()
    # But of what is open while the work goes on, nothing is left open.
    (tmp_path / "library.py").write_text("def load():\n    import swallowing")
    before += "\nimport library"
    assert run_itself(tmp_path, work.format("library.load()"), before=before) == INTERRUPTED
    assert (tmp_path / "touched").exists()


def test_an_interruption_waits_for_the_end_of_what_is_held(tmp_path: Path) -> None:
    work = f"with interruption.held():\n    {ALL}\n    open('whole', 'w').close()\nopen('more', 'w').close()"
    assert run_itself(tmp_path, work) == INTERRUPTED
    assert (tmp_path / "whole").exists()
    assert not (tmp_path / "more").exists()


def test_signals_that_come_too_late_change_nothing(tmp_path: Path) -> None:
    late = f"atexit.register(lambda: {ALL})"
    assert run_itself(tmp_path, "print('done')", before=late) == (0, "done\n", "")


def test_signals_that_the_caller_ignores_stay_ignored(tmp_path: Path) -> None:
    (tmp_path / "script.py").write_text(SCRIPT.format(before="", work=f"    {ALL}", loading=""))
    ignoring = "trap '' INT TERM; exec \"$0\" script.py"
    done = subprocess.run(
        ["sh", "-c", ignoring, sys.executable], cwd=tmp_path, env=command_environment(),
        capture_output=True, text=True, timeout=60, check=False,
    )  # fmt: skip
    assert (done.returncode, done.stderr) == (0, "")


AT_A_CALL = """
import importlib, signal, sys
from dojo_maps import interruption

package, place, *arguments = sys.argv[1:]
interruption.begin(package)
main = importlib.import_module(f"{package}.cli").main
left = int(place)

def count(frame, event, argument):
    global left
    if frame.f_code.co_filename.endswith(("/tempfile.py", "/shutil.py", "/contextlib.py", "/subprocess.py",
                                          "/whole_file.py", "/bundle.py", "/netconvert.py", "/fixing.py")):
        left -= 1
        if left == 0:
            sys.setprofile(None)
            signal.raise_signal(signal.SIGINT)

sys.setprofile(count)
main(arguments)
"""
"""Interrupts itself at a certain call or return in what makes files, folders and processes, and ends them."""


@pytest.mark.slow
def test_an_interruption_at_any_call_leaves_nothing(
    interruption_seed: int, tmp_path: Path, inputs: dict[str, str]
) -> None:
    chance = random.Random(interruption_seed)  # noqa: S311 - the same on every run
    command = chance.choice(("convert", "fix", "import-osm"))
    package, *arguments = (argument.format(**inputs) for argument in COMMANDS[command])
    work, temporary = tmp_path / "work", tmp_path / "temporary"
    work.mkdir()
    temporary.mkdir()
    environment = command_environment(TMPDIR=str(temporary), DOJO_TRIAL=str(tmp_path))
    if command == "convert":
        shutil.copytree(inputs["bundle"], work / "out.dojo")
    with default_answers():
        done = subprocess.run(
            [sys.executable, "-c", AT_A_CALL, package, str(chance.randint(1, 2500)), *arguments],
            cwd=work, env=environment, capture_output=True, text=True, timeout=60, check=False,
        )  # fmt: skip
    assert (done.returncode, done.stderr) in {(130, f"{package}\n"), (0, "")}
    assert {path.name for path in work.iterdir()} <= WHOLE[command]
    assert not list(temporary.iterdir())
    wait_until_alone(str(tmp_path))
