"""Locks between processes, each held as long as its file is open; none where the system has no `flock`."""

try:
    import fcntl
except ImportError:  # As on Windows, where two processes may do the same work at the same time.
    fcntl = None  # type: ignore[assignment]


def lock(handle: int, *, wait: bool = True) -> None:
    """Take the lock of an open file or folder.

    Args:
        handle: its descriptor.
        wait: until nobody else holds it.

    Raises:
        OSError: somebody holds it, and nobody waits; or the file system has no locks.
    """
    if fcntl is not None:
        fcntl.flock(handle, fcntl.LOCK_EX if wait else fcntl.LOCK_EX | fcntl.LOCK_NB)
