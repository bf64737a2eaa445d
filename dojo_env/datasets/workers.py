"""Processes of our own that make parts, as many as there are cores; each forks for SUMO (see `forks`)."""

import contextlib
import multiprocessing
from collections.abc import Callable, Iterator, Sequence
from multiprocessing.connection import Connection, wait
from multiprocessing.context import SpawnProcess
from typing import Any

from dojo_env.errors import SimulationDiedError
from dojo_env.forks import interrupts_taken, receive
from dojo_env.world_process import portable, start_process
from dojo_maps.interruption import heed

Call = tuple[Callable[..., Any], tuple[Any, ...]]

_PATIENCE = 20.0
"""Seconds that an interrupted process gets to remove what it has begun."""


class Worker:
    """A process that calls functions, one at a time."""

    def __init__(self) -> None:
        """Start it."""
        context = multiprocessing.get_context("spawn")
        self.pipe, theirs = context.Pipe()
        self._process: SpawnProcess = context.Process(target=_serve, args=(theirs,), daemon=True)
        try:
            start_process(self._process, None)
        except BaseException:
            self.pipe.close()
            raise
        finally:
            theirs.close()

    def begin(self, call: Call) -> None:
        """Hand it a call.

        Args:
            call: a function and its arguments, which can be pickled. `end` waits for it, before the next one.
        """
        with contextlib.suppress(OSError):  # `end` tells that it is gone.
            self.pipe.send(call)

    def end(self) -> Any:
        """Wait for the call's end; returns what it returned.

        Raises:
            SimulationDiedError: the process has died.
            Exception: what the call raised.
        """
        try:
            error, value = self.pipe.recv()
        except (EOFError, OSError) as gone:
            raise SimulationDiedError(
                "a process that makes pictures has died; run the same command again: it goes on from there"
            ) from gone
        if error is not None:
            raise error
        return value

    def close(self) -> None:
        """End it, in the middle of a call, too."""
        self.pipe.close()
        if self._process.is_alive():
            self._process.terminate()
            self._process.join(_PATIENCE)
        if self._process.is_alive():
            self._process.kill()
            self._process.join()


def run_calls(calls: Sequence[Call], count: int) -> Iterator[int]:
    """Make calls in processes.

    Args:
        calls: functions and their arguments, which can be pickled; they begin in this order.
        count: of processes at once.

    Yields:
        The place of a call in `calls`, when it is done.

    Raises:
        SimulationDiedError: a process has died.
        Exception: what a call raised; the others end with it.
    """
    with contextlib.ExitStack() as stack:
        waiting = list(enumerate(calls))[::-1]
        busy: dict[Any, tuple[Worker, int]] = {}
        idle = []
        for _ in range(min(count, len(calls))):
            worker = Worker()
            stack.callback(worker.close)
            idle.append(worker)
        while waiting or busy:
            while waiting and idle:
                worker, (place, call) = idle.pop(), waiting.pop()
                worker.begin(call)
                busy[worker.pipe] = worker, place
            for pipe in wait(list(busy), timeout=1.0):
                worker, place = busy.pop(pipe)
                worker.end()
                idle.append(worker)
                yield place
            heed()


def _serve(pipe: Connection) -> None:
    """Make calls until the other end is gone."""
    import cv2  # noqa: PLC0415 - only here; its threads would not survive a fork

    cv2.setNumThreads(1)
    with contextlib.suppress(KeyboardInterrupt, OSError), interrupts_taken():
        while (call := receive(pipe, None)) is not None:
            function, arguments = call
            try:
                answer = function(*arguments)
            except Exception as error:  # noqa: BLE001 - it is raised at the other end
                pipe.send((portable(error), None))
            else:
                pipe.send((None, answer))
