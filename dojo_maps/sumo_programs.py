"""SUMO's programs as processes of their own: found, given SUMO's own data, ended with all they started.

Nothing of SUMO is imported here.
"""

import importlib.util
import os
import shutil
import signal
import subprocess
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import IO

from dojo_maps.errors import ToolMissingError
from dojo_maps.interruption import held


def find_program(name: str) -> Path:
    """Find one of SUMO's programs: in the package eclipse-sumo, under $SUMO_HOME, then on the PATH.

    Args:
        name: without an ending, such as `netconvert`.

    Returns:
        Its path.

    Raises:
        ToolMissingError: it is in none of them.
    """
    file = f"{name}.exe" if os.name == "nt" else name
    for home in _find_homes():
        program = home / "bin" / file
        if program.is_file() and os.access(program, os.X_OK):
            return program
    found = shutil.which(file)
    if found is None:
        raise ToolMissingError(f"{name} is not installed; it is part of SUMO: pip install eclipse-sumo")
    return Path(found)


def find_tool(name: str) -> Path:
    """Find one of SUMO's tools, which are Python's: in the package eclipse-sumo, then under $SUMO_HOME.

    Args:
        name: of the file, such as `routeSampler.py`.

    Returns:
        Its path.

    Raises:
        ToolMissingError: it is in neither.
    """
    for home in _find_homes():
        if (home / "tools" / name).is_file():
            return home / "tools" / name
    raise ToolMissingError(f"{name} is not installed; it is one of SUMO's tools: pip install eclipse-sumo")


def _find_homes() -> list[Path]:
    # Importing sumo itself would set environment variables for the whole process.
    spec = importlib.util.find_spec("sumo")
    found = spec.submodule_search_locations if spec is not None else None
    homes = [Path(found[0])] if found else []
    return homes + ([Path(os.environ["SUMO_HOME"])] if os.environ.get("SUMO_HOME") else [])


def sumo_environment(program: Path) -> dict[str, str]:
    """Name SUMO's own data for the child; the wheel's PROJ reads PROJ_LIB, later ones PROJ_DATA.

    Args:
        program: that will run.

    Returns:
        Its environment variables.
    """
    environment = dict(os.environ)
    home = program.parent.parent
    if (home / "data").is_dir():
        environment["SUMO_HOME"] = str(home)
    if (home / "data" / "proj" / "proj.db").is_file():
        environment["PROJ_LIB"] = environment["PROJ_DATA"] = str(home / "data" / "proj")
    return environment


@contextmanager
def running_program(
    program: Path, arguments: Sequence[str], folder: Path | None, diagnostics: int | IO[bytes]
) -> "Iterator[subprocess.Popen[bytes]]":
    """Run a program of SUMO in a process group of its own, which ends with the context at the latest.

    Args:
        program: as `find_program` or `find_tool` finds it; Python runs a tool.
        arguments: its options, as on a command line.
        folder: where it runs; relative paths in the options start here.
        diagnostics: where its standard error goes: a file, or `subprocess.PIPE`.

    Yields:
        The process.

    Raises:
        ToolMissingError: it cannot be started.
    """
    child = None
    try:
        with held():  # Started by half, nobody would know whom to end.
            child = _start(program, arguments, folder, diagnostics)
        yield child
    finally:
        if child is not None:
            with child:
                kill_program(child)


def _start(
    program: Path, arguments: Sequence[str], folder: Path | None, diagnostics: int | IO[bytes]
) -> "subprocess.Popen[bytes]":
    python = [sys.executable] if program.suffix == ".py" else []
    try:
        return subprocess.Popen(  # noqa: S603 (no shell; the program is SUMO's own)
            [*python, str(program), *arguments],
            cwd=folder,
            env=sumo_environment(program),
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            stderr=diagnostics,
            start_new_session=True,
        )
    except OSError as error:
        raise ToolMissingError(
            f"{program.name} cannot be started: {error.strerror} ({program}); "
            "it is part of SUMO: pip install eclipse-sumo"
        ) from error


def kill_program(child: "subprocess.Popen[bytes]") -> None:
    """End a program and what it started, if it still runs.

    Not by its own means: an interruption inside of `wait` may have left that locked for ever.

    Args:
        child: that was started.
    """
    with held():
        if child.returncode is not None:
            return
        if not hasattr(os, "killpg"):
            child.kill()
            return
        with suppress(ProcessLookupError):
            os.killpg(child.pid, signal.SIGKILL)
        child.returncode = -signal.SIGKILL
        with suppress(ChildProcessError):
            child.returncode = os.waitstatus_to_exitcode(os.waitpid(child.pid, 0)[1])


def signal_name(number: int) -> str:
    """Name a signal that ended a program.

    Args:
        number: of the signal.

    Returns:
        Its name, such as SIGKILL.
    """
    try:
        return signal.Signals(number).name
    except ValueError:
        return f"signal {number}"
