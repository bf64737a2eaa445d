"""Tell a person at a terminal what a long step is doing; say nothing in pipes or when asked to be quiet."""

import ctypes
import logging
import os
import re
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager

_LOG = logging.getLogger("dojo_maps.progress")
_SHARE = re.compile(r"\b(\d[\d,]*) of (\d[\d,]*)")
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
        line = f"{seconds:6.1f} s  {stage}{_tell_left(stage, seconds)}"
        is_shown = self._shown and seconds > _PATIENCE
        _LOG.info(line, extra={"is_shown": is_shown})
        if is_shown:
            print(line, file=sys.stderr, flush=True)  # noqa: T201


def _tell_left(stage: str, seconds: float) -> str:
    """Estimate how long is left of a stage that says how much of how much is done."""
    found = _SHARE.search(stage)
    done, total = (float(number.replace(",", "")) for number in found.groups()) if found else (0.0, 0.0)
    left = seconds * (total - done) / done if 0 < done < total else 0.0
    if left < _PATIENCE:
        return ""
    return f", about {left / 60:.0f} min left" if left >= 90 else f", about {left:.0f} s left"


def say(words: str) -> None:
    """Say a line of a run of minutes or hours on standard error, at a terminal or not.

    Args:
        words: the line.
    """
    _LOG.info(words, extra={"is_shown": True})
    print(words, file=sys.stderr, flush=True)  # noqa: T201


def say_nothing(_words: str) -> None:
    """Take the place of `say` where a user wants quiet.

    Args:
        _words: the line that is not said.
    """


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
