"""What a user should know and is no error: a line on standard error, once in a process."""

import logging
from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache

_LOG = logging.getLogger("dojo_env")


@cache
def say_once(note: str) -> None:
    """Log a warning on one line, unless this process has already.

    Args:
        note: what to say.
    """
    _LOG.warning(" ".join(note.split()))


@contextmanager
def notes_unsaid() -> Iterator[None]:
    """Say no notes for a while: somebody else has."""
    before = _LOG.level
    _LOG.setLevel(logging.ERROR)
    try:
        yield
    finally:
        _LOG.setLevel(before)
