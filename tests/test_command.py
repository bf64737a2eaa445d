"""The frame of the commands: one line for each failure, and streams that are closed, full or ASCII only."""

import argparse
import shutil
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import NoReturn

import pytest
from conftest import REPOSITORY, command_environment, read_strict_json

import dojo_env.cli
import dojo_maps.cli
from dojo_env.recording import read_recording
from dojo_maps.command import Parser, add_command, run_command
from dojo_maps.errors import SourceError

COMMANDS = {
    "dojo_maps": ("convert", "import-osm", "keep", "view", "validate", "fix", "checks"),
    "dojo_env": ("run", "watch", "replay", "scenarios"),
}
EVERY = [(package, name) for package, names in COMMANDS.items() for name in names]
MAIN = {"dojo_maps": dojo_maps.cli.main, "dojo_env": dojo_env.cli.main}
UNKNOWN_USER = ("setpriv", "--reuid=54321", "--regid=54321", "--clear-groups",
                "--inh-caps=+dac_read_search", "--ambient-caps=+dac_read_search")  # fmt: skip
"""Runs a program for a user without a name, who may read everything and write almost nothing."""


def run_shell(line: str, folder: Path, *prefix: str, **environment: str) -> subprocess.CompletedProcess[str]:
    """Run a line of a shell in which `$PYTHON` is this Python."""
    return subprocess.run(
        [*prefix, "sh", "-c", line], cwd=folder, capture_output=True, text=True, timeout=120, check=False,
        env=command_environment(PYTHON=sys.executable, **environment),
    )  # fmt: skip


def check_one_line(done: subprocess.CompletedProcess[str], status: int, *words: str) -> None:
    assert done.returncode == status, done
    assert done.stderr.count("\n") == 1, done
    assert done.stderr.strip().isprintable(), done
    assert all(each in done.stderr for each in words), done


def recurse(depth: int = 0) -> int:
    return recurse(depth + 1) + 1


def fail(error: BaseException) -> NoReturn:
    raise error


@pytest.mark.parametrize(
    ("work", "status", "words"),
    [
        (lambda: 1, 1, ""),
        (lambda: fail(SourceError("a\x1b[31m.xml", "two\nlines\u2028of it")), 3,
         r"it: a\x1b[31m.xml: two lines of it"),
        (lambda: {}["key"], 4, "it: a defect of this program (KeyError: 'key'; test_command.py:"),
        (recurse, 4, "it: a defect of this program (RecursionError: maximum recursion depth exceeded"),
        (lambda: fail(MemoryError()), 4, "it: not enough memory"),
        (lambda: Path("/proc/nothing").write_bytes(b""), 4, "it: /proc/nothing: No such file or directory"),
        (lambda: fail(TimeoutError()), 4, "it: TimeoutError"),
        (lambda: fail(BrokenPipeError(32, "Broken pipe")), 4, "it: [Errno 32] Broken pipe"),
        (lambda: fail(ValueError("long" * 10_000)), 4, "it: a defect of this program (ValueError: longlong"),
        (lambda: sys.exit("no"), 4, "it: no"),
        (lambda: sys.exit(3), 3, ""),
    ],
)  # fmt: skip
def test_every_failure_is_one_line_and_a_status(
    work: Callable[[], int], status: int, words: str, capsys: pytest.CaptureFixture[str]
) -> None:
    def build_parser() -> argparse.ArgumentParser:
        parser = Parser(prog="it")
        add_command(parser.add_subparsers(required=True), "work", lambda _options: work(), "fails")
        return parser

    assert run_command("it", build_parser, ["work"]) == status
    said = capsys.readouterr().err
    assert said.startswith(words)
    assert said.count("\n") == bool(words)
    assert len(said) < 1000
    assert said.strip().isprintable()


@pytest.mark.parametrize(("package", "name"), [*EVERY, ("dojo_maps", ""), ("dojo_env", "")])
def test_every_command_knows_its_version_and_can_be_quiet(
    package: str, name: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert MAIN[package]([name, "--quiet", "--version"] if name else ["--version"]) == 0
    assert capsys.readouterr().out.startswith("traffic-dojo ")


def test_the_version_is_told_where_the_package_is_not_installed(tmp_path: Path) -> None:
    shutil.copytree(REPOSITORY / "dojo_maps", tmp_path / "dojo_maps")
    done = run_shell("$PYTHON -S -m dojo_maps checks --version", tmp_path, PYTHONPATH=str(tmp_path))
    assert (done.returncode, done.stdout, done.stderr) == (0, "traffic-dojo (not installed)\n", "")


@pytest.mark.parametrize("package", COMMANDS)
@pytest.mark.parametrize("arguments", ["", "nonsense", "--nonsense"])
def test_wrong_usage_is_one_line(package: str, arguments: str, tmp_path: Path) -> None:
    check_one_line(run_shell(f"$PYTHON -m {package} {arguments}", tmp_path), 2, "--help")


@pytest.mark.slow
@pytest.mark.sampled(1)
@pytest.mark.parametrize("closed", [">&-", "2>&-", ">&- 2>&-", "<&-", "<&- >&- 2>&-"])
def test_commands_work_with_closed_streams(
    closed: str, tmp_path: Path, network_path: Callable[[str], Path]
) -> None:
    line = f"$PYTHON -m dojo_maps convert {network_path('bare')} -o out.dojo {closed}"
    done = run_shell(line, tmp_path)
    assert (done.returncode, done.stderr) == (0, "")
    assert (not done.stdout) == (">&-" in closed.split())
    assert read_strict_json(tmp_path / "out.dojo" / "map.json")["format"] == "dojo-map"
    line = "$PYTHON -m dojo_env run --scenario two-way --controller random --seconds 20 --record it"
    done = run_shell(f"{line} --json it.json {closed}", tmp_path)
    assert (done.returncode, done.stderr) == (0, "")
    assert read_strict_json(tmp_path / "it.json")["scenario"] == "two-way"
    assert len(list(read_recording(tmp_path / "it_ep1.npz"))) == 21
    assert run_shell(f"$PYTHON -m dojo_maps validate nowhere {closed}", tmp_path).returncode == 3


@pytest.mark.slow
@pytest.mark.parametrize("command", ["dojo_maps checks", "dojo_maps --help", "dojo_env scenarios"])
def test_a_full_device_behind_standard_output_is_one_line(command: str, tmp_path: Path) -> None:
    done = run_shell(f"$PYTHON -m {command} > /dev/full", tmp_path)
    check_one_line(done, 4, "standard output: No space left on device")
    assert run_shell(f"$PYTHON -m {command} > /dev/full 2>&1", tmp_path).returncode == 4


@pytest.mark.slow
def test_streams_that_are_ascii_only_get_everything(
    tmp_path: Path, network_path: Callable[[str], Path]
) -> None:
    def run_ascii(arguments: str) -> subprocess.CompletedProcess[str]:
        return run_shell(f"$PYTHON -m {arguments}", tmp_path, PYTHONIOENCODING="ascii", LC_ALL="C")

    done = run_ascii(f"dojo_maps convert {network_path('bare')} -o Größe.dojo")
    assert r"Gr\xf6\xdfe.dojo; " in done.stdout
    check_one_line(run_ascii("dojo_maps validate Größe"), 3, r"Gr\xf6\xdfe")
    done = run_ascii("dojo_env run --scenario two-way --controller random --seconds 20")
    assert r" \xb1 " in done.stdout
    check_one_line(run_ascii("dojo_env run --scenario 'Grö\nße' --controller random"), 2, r"Gr\xf6")


def is_possible(*command: str) -> bool:
    try:
        return not subprocess.run(command, capture_output=True, check=False).returncode
    except OSError:
        return False


@pytest.mark.slow
@pytest.mark.skipif(not is_possible(*UNKNOWN_USER, sys.executable, "-c", ""), reason="needs root and setpriv")
def test_an_unknown_user_without_a_home_gets_all_that_needs_none(
    tmp_path: Path, network_path: Callable[[str], Path]
) -> None:
    tmp_path.chmod(0o777)
    nobody = (*UNKNOWN_USER, "env", "-u", "HOME", "-u", "XDG_CACHE_HOME")
    for place in ("-u DOJO_CACHE", "DOJO_CACHE=/nowhere", "DOJO_CACHE=/etc"):
        for command in (
            "dojo_maps import-osm --point 50,7",
            "dojo_env run --scenario two-way --controller sotl",
        ):
            done = run_shell(f"$PYTHON -m {command}", tmp_path, *nobody, *place.split())
            check_one_line(done, 2, "DOJO_CACHE")
    for line in (f"$PYTHON -m dojo_maps convert {network_path('bare')} -o out.dojo",
                 "$PYTHON -m dojo_env scenarios"):  # fmt: skip
        done = run_shell(line, tmp_path, *nobody, f"DOJO_CACHE={tmp_path / 'cache'}", f"TMPDIR={tmp_path}")
        assert (done.returncode, done.stderr) == (0, "")
    # Without any place to keep kernels, not even beside their sources, they are only compiled.
    line = (
        "$PYTHON -c 'from dojo_env.rendering.compiling import kernel; from ntpath import join; kernel(join)'"
    )
    done = run_shell(line, tmp_path, *nobody, "-u", "DOJO_CACHE")
    assert (done.returncode, done.stderr) == (0, "")


def test_a_users_files_are_not_where_closed_streams_were(tmp_path: Path) -> None:
    """What a C library prints must not end in the next file that is opened."""
    script = (
        "import os, sys; from dojo_maps import command, interruption; interruption.begin('')\n"
        "def run(_):\n"
        "    with open('it', 'w') as file: os.write(1, b'noise'); os.write(2, b'noise')\n"
        "    return 0\n"
        "def parser():\n"
        "    it = command.Parser(); command.add_command(it.add_subparsers(), 'it', run, ''); return it\n"
        "command.run_command('it', parser, ['it'])\n"
    )
    (tmp_path / "script.py").write_text(script)
    assert run_shell("$PYTHON script.py >&- 2>&- <&-", tmp_path).returncode == 0
    assert (tmp_path / "it").read_bytes() == b""
