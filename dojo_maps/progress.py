"""Tell a person at a terminal what a long step is doing; say nothing in pipes or when asked to be quiet."""

import ctypes
import os
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager

_PATIENCE = 2.0
"""Seconds before anything is said."""


class Progress:
    """Prints the current stage on standard error once a run takes longer than two seconds."""

    def __init__(self, *, quiet: bool = False) -> None:
        """Start the clock."""
        self._shown = not quiet and sys.stderr.isatty()
        self._start = time.monotonic()

    def __call__(self, stage: str) -> None:
        """Say what begins."""
        seconds = time.monotonic() - self._start
        if self._shown and seconds > _PATIENCE:
            print(f"{seconds:6.1f} s  {stage}", file=sys.stderr, flush=True)  # noqa: T201


def say(words: str) -> None:
    """Say a line of a run of minutes or hours on standard error, at a terminal or not."""
    print(words, file=sys.stderr, flush=True)  # noqa: T201


def say_nothing(_words: str) -> None:
    """Take the place of `say` where a user wants quiet."""


@contextmanager
def quiet_output() -> Iterator[None]:
    """Keep what C code says off standard error: libraries greet who loads them, and tell what they try."""
    kept, silent = os.dup(2), os.open(os.devnull, os.O_WRONLY)
    try:
        os.dup2(silent, 2)
        yield
    finally:
        ctypes.CDLL(None).fflush(None)
        os.dup2(kept, 2)
        os.close(kept)
        os.close(silent)
