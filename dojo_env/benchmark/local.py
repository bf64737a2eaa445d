"""The benchmark's rows on this machine, each in a process of its own: libsumo holds one simulation."""

import multiprocessing
import os
import signal
from collections.abc import Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
from multiprocessing.connection import wait
from pathlib import Path
from threading import Thread
from typing import Any

from dojo_env.benchmark.row_runs import run_row
from dojo_env.errors import SimulationError
from dojo_maps.progress import say


def run_rows(tasks: Sequence[Mapping[str, Any]], results: Path, jobs: int) -> None:
    """Run rows, so many at once.

    Args:
        tasks: what `describe` tells of each row.
        results: where their files go.
        jobs: rows at once.

    Raises:
        SimulationError: a row's process was killed.
    """
    spawn = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(jobs, mp_context=spawn, initializer=_prepare_to_end) as pool:
        running = {pool.submit(_run, task, results): task for task in tasks}
        try:
            for done in as_completed(running):
                done.result()
                task = running[done]
                say(f"{task['scenario']}: {task['row']}")
        except BrokenProcessPool:
            raise SimulationError(
                "a row's process was killed, perhaps for want of memory; the same command goes on from the "
                "last checkpoints, and fewer --jobs need less"
            ) from None
        except KeyboardInterrupt:
            for worker in multiprocessing.active_children():
                worker.terminate()
            raise


def _run(task: Mapping[str, Any], results: Path) -> None:
    try:
        run_row(task, results)
    except KeyboardInterrupt:
        os._exit(130)  # Back in the pool, it would begin with the next row.


def _prepare_to_end() -> None:
    """Let a row end in order when the benchmark says so, or is there no more."""
    parent = multiprocessing.parent_process()

    def watch() -> None:
        if parent is not None:
            wait([parent.sentinel])
            os.kill(os.getpid(), signal.SIGTERM)

    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.signal(signal.SIGTERM, signal.default_int_handler)
    Thread(target=watch, daemon=True).start()
