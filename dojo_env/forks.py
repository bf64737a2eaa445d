"""Calls in a fork of this process: whatever a call does, this process and its memory stay as they were.

SUMO lets vehicles that block each other go in the order of their places in memory, and those depend on all
that was freed before. Episodes that begin in forks of one process find the same memory, so none depends on
which ran before it, alone, after others, or in a run that was interrupted.
"""

import ctypes
import os
import signal
import sys
from collections.abc import Callable
from multiprocessing import Pipe
from multiprocessing.connection import Connection
from typing import Any, NoReturn

from dojo_env.errors import SimulationError

CAN_FORK = sys.platform == "linux"
"""Elsewhere libraries may not survive it, and calls happen here."""
_WHEN_PARENT_DIES = 1
"""Linux's PR_SET_PDEATHSIG."""
Call = tuple[str, Any]
"""What is asked of a process that answers, by name, and what with."""


def call_in_fork(function: Callable[..., Any], *arguments: Any) -> Any:
    """Call a function in a fork; returns what it returns, which must be something to pickle.

    Raises:
        SimulationError: the fork has died.
        Exception: what the function raised.
    """
    if not CAN_FORK:
        return function(*arguments)
    mine, theirs = Pipe(duplex=False)
    process = os.fork()
    if process == 0:
        _answer_and_end(theirs, function, arguments)
    theirs.close()
    try:
        error, value = mine.recv()
    except EOFError as problem:
        raise SimulationError("the simulation's process has died") from problem
    except KeyboardInterrupt:
        os.kill(process, signal.SIGINT)  # It writes what there is of its episode.
        raise
    finally:
        mine.close()
        os.waitpid(process, 0)
    if error is not None:
        raise error
    return value


def _answer_and_end(pipe: Connection, function: Callable[..., Any], arguments: tuple[Any, ...]) -> NoReturn:
    """Send what a call returns or raises, and end without a word: all else here is the caller's."""
    try:
        ctypes.CDLL(None).prctl(_WHEN_PARENT_DIES, signal.SIGTERM)
        try:
            pipe.send((None, function(*arguments)))
        except Exception as error:  # noqa: BLE001 - it is raised at the other end
            pipe.send((error, None))
    finally:
        os._exit(0)


def receive_call(pipe: Connection) -> Call:
    """Wait for a call; who is gone wants us to close."""
    try:
        name, arguments = pipe.recv()
    except (EOFError, OSError, KeyboardInterrupt):
        return "close", ()
    return name, arguments
