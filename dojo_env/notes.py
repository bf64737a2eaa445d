"""What a user should know and is no error: a line on standard error, once in a process."""

import logging
from functools import cache

_LOG = logging.getLogger("dojo_env")


@cache
def say_once(note: str) -> None:
    """Log a warning on one line, unless this process has already.

    Args:
        note: what to say.
    """
    _LOG.warning(" ".join(note.split()))
