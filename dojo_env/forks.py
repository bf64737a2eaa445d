"""Processes whose calls run in forks: whatever a call does, their own memory stays as it was.

SUMO lets vehicles that block each other go in the order of their places in memory, and those depend on all
that was freed before. An episode that begins in a fork, in a thread of its own, to which glibc gives empty
memory, depends on none of it: not on which ran before, in a run that was interrupted, or in another process.
Only a process that we started for it forks: a fork of another may wait forever for one of its threads.
"""

import contextlib
import ctypes
import os
import signal
import sys
import threading
from collections.abc import Callable, Iterator
from multiprocessing import Pipe, resource_tracker
from multiprocessing.connection import Connection
from typing import Any, NoReturn

from dojo_env.errors import SimulationDiedError
from dojo_maps.interruption import held, silence

CAN_FORK = sys.platform == "linux"
"""Elsewhere libraries may not survive it, and calls happen here."""
_HEARTBEAT = 1.0
"""Seconds after which a wait looks up, so that an interruption can end it."""
_DIE_WITH_PARENT = 1
"""Of Linux's prctl: the signal that a process gets when its parent is gone."""
_INTERRUPTS = {signal.SIGINT, signal.SIGTERM}
_first = threading.Lock()
"""Taken by the first interrupt; later ones change nothing."""
_is_fork = False
"""Whether this process is a fork of `call_in_fork`."""


@contextlib.contextmanager
def interrupts_wait() -> Iterator[None]:
    """Keep interrupts from programs that start in here, until they take them, and from here meanwhile."""
    with held():
        if not CAN_FORK:
            yield
            return
        resource_tracker.ensure_running()  # Its start would let interrupts through again.
        before = signal.pthread_sigmask(signal.SIG_BLOCK, _INTERRUPTS)
        try:
            yield
        finally:
            signal.pthread_sigmask(signal.SIG_SETMASK, before)


@contextlib.contextmanager
def interrupts_taken() -> Iterator[None]:
    """Be interrupted in here, but once: a second time would disturb what is written then.

    What is said on standard error after that is lost; who started this process tells of it.
    """
    for number in _INTERRUPTS:
        if signal.getsignal(number) is not signal.SIG_IGN:
            signal.signal(number, _interrupt_once)
    if CAN_FORK:
        signal.pthread_sigmask(signal.SIG_UNBLOCK, _INTERRUPTS)
    try:
        yield
    finally:
        _first.acquire(blocking=False)


def _interrupt_once(*_: object) -> None:
    if _first.acquire(blocking=False):
        silence()
        raise KeyboardInterrupt


def must_return_within(seconds: float) -> None:
    """End a fork that is not back in time from a call into C, which holds Python's lock: nobody else could.

    Args:
        seconds: of processor time from now on, within which it must be called again; 0 sets no bound any
            more. A machine that is busy, or a process that is stopped for a while, does no harm.
    """
    if _is_fork:
        signal.setitimer(signal.ITIMER_PROF, seconds)


def call_in_fork(function: Callable[..., Any], *arguments: Any) -> Any:
    """Call a function in a fork.

    Args:
        function: what to call; what it returns must be something to pickle.
        arguments: what with.

    Returns:
        What it returns.

    Raises:
        SimulationDiedError: the fork has died, or was not back in time from a call.
        Exception: what the function raised.
    """
    if not CAN_FORK:
        return function(*arguments)
    mine, theirs = Pipe(duplex=False)
    before = signal.pthread_sigmask(signal.SIG_BLOCK, _INTERRUPTS)  # Or it might end what is the caller's.
    caller = os.getpid()
    with _no_threads_of_opencv():
        process = os.fork()
        if process == 0:
            _answer_and_end(caller, theirs, function, arguments)
    answer = None
    try:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)
        theirs.close()
        with contextlib.suppress(EOFError):
            answer = mine.recv()
    except KeyboardInterrupt:
        os.kill(process, signal.SIGINT)  # It writes what there is of its episode.
        raise
    finally:
        mine.close()
        _, status = os.waitpid(process, 0)
    if answer is None:
        late = os.WIFSIGNALED(status) and os.WTERMSIG(status) == signal.SIGPROF
        raise SimulationDiedError(
            "SUMO came to no end of a simulated second; look for impossible values, as a vehicle's length"
            if late
            else "the simulation's process has died"
        )
    error, value = answer
    if error is not None:
        raise error
    return value


@contextlib.contextmanager
def _no_threads_of_opencv() -> Iterator[None]:
    """End OpenCV's threads for a while: a fork would not have them, and wait for them for ever."""
    opencv: Any = sys.modules.get("cv2")
    if opencv is None:
        yield
        return
    count = opencv.getNumThreads()
    opencv.setNumThreads(1)
    try:
        yield
    finally:
        opencv.setNumThreads(count)


def _answer_and_end(
    caller: int, pipe: Connection, function: Callable[..., Any], arguments: tuple[Any, ...]
) -> NoReturn:
    """Send what a call returns or raises, and end without a word: all else here is the caller's."""
    global _is_fork  # noqa: PLW0603 - it is the whole process's
    _is_fork = True
    signal.signal(signal.SIGPROF, signal.SIG_DFL)
    ctypes.CDLL(None).prctl(_DIE_WITH_PARENT, signal.SIGKILL)
    if os.getppid() != caller:
        os._exit(0)

    def answer() -> None:
        try:
            pipe.send((None, function(*arguments)))
        except Exception as error:  # noqa: BLE001 - it is raised at the other end
            pipe.send((error, None))
        except KeyboardInterrupt:
            pass  # Who asks has been interrupted, too.
        finally:
            os._exit(0)

    try:
        thread = threading.Thread(target=answer)
        thread.start()
        # Raised by a handler, it could come while this thread holds a lock that the other one needs.
        number = signal.sigwait({n for n in _INTERRUPTS if signal.getsignal(n) is not signal.SIG_IGN})
        if signal.getsignal(number) is _interrupt_once:
            silence()
        interrupt = ctypes.py_object(KeyboardInterrupt)
        ctypes.pythonapi.PyThreadState_SetAsyncExc(ctypes.c_ulong(thread.ident or 0), interrupt)
        while True:
            signal.pause()  # Interrupts are blocked: what is written now is not disturbed.
    finally:
        os._exit(0)


def receive(pipe: Connection, gone: Any) -> Any:
    """Wait for a message from who started this process.

    Args:
        pipe: to them.
        gone: the answer where they are gone, or have interrupted this process.

    Returns:
        The message.
    """
    try:
        while not pipe.poll(_HEARTBEAT):
            pass  # An interruption cannot end a wait in a fork, so it comes between two of them.
        return pipe.recv()
    except (EOFError, OSError, KeyboardInterrupt):
        return gone
