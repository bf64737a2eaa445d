"""Runs `dojo-maps` in a process of its own, forked from one that has loaded what the command needs.

To load it takes ten times as long as to convert a small network. Run as a script, this is what forks.
"""

import atexit
import json
import os
import signal
import subprocess
import sys
import tempfile
import traceback
from collections.abc import Sequence
from functools import cache
from pathlib import Path
from typing import NoReturn

_STREAMS = ("out", "errors")


def run(
    arguments: Sequence[str], *, cwd: Path | None, env: dict[str, str], timeout: float
) -> subprocess.CompletedProcess[str]:
    """Run the command; what takes longer than its seconds ends with SIGALRM."""
    server = _start_server()
    assert server.stdin is not None
    assert server.stdout is not None
    with tempfile.TemporaryDirectory() as folder:
        streams = [Path(folder, name) for name in _STREAMS]
        task = (arguments, str(cwd or Path.cwd()), env, int(timeout), [*map(str, streams)])
        server.stdin.write(f"{json.dumps(task)}\n")
        server.stdin.flush()
        status = int(server.stdout.readline())
        out, errors = (path.read_text(encoding="utf-8") for path in streams)
    return subprocess.CompletedProcess([*arguments], status, out, errors)


@cache
def _start_server() -> subprocess.Popen[str]:
    server = subprocess.Popen(
        [sys.executable, __file__], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True,
        env={**os.environ, "PYTHONPATH": os.pathsep.join(filter(None, sys.path))},
    )  # fmt: skip
    atexit.register(server.communicate)
    return server


def _serve() -> None:
    import dojo_maps.cli  # noqa: PLC0415
    import dojo_maps.conversion  # noqa: F401, PLC0415 - what all that takes long loads

    signal.signal(signal.SIGINT, signal.SIG_IGN)
    for line in sys.stdin:
        child = os.fork()
        if not child:
            _run_command(*json.loads(line))
        print(os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]), flush=True)  # noqa: T201


def _run_command(
    arguments: list[str], folder: str, environment: dict[str, str], timeout: int, streams: list[str]
) -> NoReturn:
    """Be what `python -m dojo_maps.cli` is once it has loaded."""
    from dojo_maps import cli, interruption  # noqa: PLC0415

    for number, path in enumerate(["/dev/null", *streams]):
        os.dup2(os.open(path, os.O_RDWR | os.O_CREAT, 0o600), number)
    try:
        signal.signal(signal.SIGINT, signal.default_int_handler)
        signal.alarm(timeout)
        os.environ.clear()
        os.environ.update(environment)
        os.chdir(folder)
        interruption.begin("dojo-maps: interrupted")
        cli.main(arguments)  # It ends the process.
    except BaseException:  # noqa: BLE001 - the end of this process, whatever it is
        traceback.print_exc()
    finally:
        os._exit(1)


if __name__ == "__main__":
    _serve()
