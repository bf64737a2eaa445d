"""Run SUMO's netconvert as a separate process: found, bounded in time, and never trusted to end well.

netconvert crashes on some real inputs, so its end is always read: an exit status, a signal or the time
limit each become one clear error. Nothing of SUMO is imported here.
"""

import importlib.util
import itertools
import os
import shutil
import signal
import subprocess
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from dojo_maps.errors import DojoError, ToolMissingError
from dojo_maps.interruption import held

_WARNING, _ERROR = "Warning: ", "Error: "
_AGGREGATE = "--aggregate-warnings"
"""Without it netconvert keeps the repetitions of a warning to itself after a few."""


class NetconvertError(DojoError):
    """netconvert refused its input, crashed, or took too long."""


@dataclass(frozen=True, slots=True, kw_only=True)
class NetconvertResult:
    """What a successful run said; every warning once, in order, without its prefix."""

    warnings: tuple[str, ...]


def run_netconvert(
    arguments: Sequence[str], *, folder: Path | None = None, timeout: float = 600
) -> NetconvertResult:
    """Run netconvert to its end.

    Args:
        arguments: its options, as on a command line.
        folder: where it runs; relative paths in the options start here.
        timeout: seconds after which it and what it started are killed.

    Raises:
        ToolMissingError: netconvert is not installed.
        NetconvertError: it refused its input, died by a signal, or ran past the time limit.
    """
    program = find_netconvert()
    command = [str(program), *arguments]
    if _AGGREGATE not in arguments:
        command += [_AGGREGATE, "1000000"]
    status, diagnostics = _run(command, folder, sumo_environment(program), timeout)
    lines = diagnostics.splitlines()
    if status < 0:
        raise NetconvertError(f"netconvert crashed ({_signal_name(-status)}); {_last_words(lines)}")
    if status > 0:
        raise NetconvertError(f"netconvert failed with exit status {status}; {_last_words(lines)}")
    return NetconvertResult(
        warnings=tuple(line.removeprefix(_WARNING) for line in lines if line.startswith(_WARNING))
    )


def find_netconvert() -> Path:
    """Find netconvert: in the package eclipse-sumo, under $SUMO_HOME, then on the PATH.

    Raises:
        ToolMissingError: it is in none of them.
    """
    name = "netconvert.exe" if os.name == "nt" else "netconvert"
    homes = []
    # Importing sumo itself would set environment variables for the whole process.
    spec = importlib.util.find_spec("sumo")
    if spec is not None and spec.submodule_search_locations:
        homes.append(Path(spec.submodule_search_locations[0]))
    if os.environ.get("SUMO_HOME"):
        homes.append(Path(os.environ["SUMO_HOME"]))
    for home in homes:
        program = home / "bin" / name
        if program.is_file() and os.access(program, os.X_OK):
            return program
    found = shutil.which(name)
    if found is None:
        raise ToolMissingError("netconvert is not installed; it is part of SUMO: pip install eclipse-sumo")
    return Path(found)


def sumo_environment(program: Path) -> dict[str, str]:
    """Name SUMO's own data for the child; the wheel's PROJ reads PROJ_LIB, later ones PROJ_DATA."""
    environment = dict(os.environ)
    home = program.parent.parent
    if (home / "data").is_dir():
        environment["SUMO_HOME"] = str(home)
    if (home / "data" / "proj" / "proj.db").is_file():
        environment["PROJ_LIB"] = environment["PROJ_DATA"] = str(home / "data" / "proj")
    return environment


def _run(
    command: list[str], folder: Path | None, environment: dict[str, str], timeout: float
) -> tuple[int, str]:
    """Run in a process group of its own, so that nothing outlives the time limit or an interruption."""
    child = None
    try:
        with held():  # Started by half, nobody would know whom to end.
            child = subprocess.Popen(  # noqa: S603 (no shell; the program is SUMO's own)
                command,
                cwd=folder,
                env=environment,
                stdin=subprocess.DEVNULL,
                stdout=subprocess.DEVNULL,
                stderr=subprocess.PIPE,
                text=True,
                encoding="utf-8",
                errors="replace",
                start_new_session=True,
            )
        _, diagnostics = child.communicate(timeout=timeout)
    except OSError as error:
        raise NetconvertError(f"netconvert cannot be started: {error.strerror} ({command[0]})") from error
    except subprocess.TimeoutExpired:
        raise NetconvertError(
            f"netconvert was stopped after {timeout:g} s, its time limit; give it a smaller network"
        ) from None
    finally:
        if child is not None:
            _end(child)
    return child.returncode, diagnostics


def _end(child: "subprocess.Popen[str]") -> None:
    with child:
        if child.returncode is None:
            _kill(child)


def _kill(child: "subprocess.Popen[str]") -> None:
    if hasattr(os, "killpg"):
        os.killpg(child.pid, signal.SIGKILL)
    else:
        child.kill()


def _signal_name(number: int) -> str:
    try:
        return signal.Signals(number).name
    except ValueError:
        return f"signal {number}"


def _last_words(lines: list[str]) -> str:
    """Quote netconvert's own error with the indented lines that belong to it, or else its last line."""
    start = next((number for number, line in enumerate(lines) if line.startswith(_ERROR)), None)
    if start is None:
        said = [line for line in lines if line.strip() and not line.startswith("Quitting")][-1:]
    else:
        rest = itertools.takewhile(lambda line: line.startswith(" "), lines[start + 1 :])
        said = [lines[start].removeprefix(_ERROR), *rest]
    words = " ".join(" ".join(said).split())
    words = words if len(words) <= 300 else f"{words[:300]}..."
    return f"it said: {words}" if words else "it gave no reason"
