"""What a learner asks of the process it runs in: the same bits each time, and no time lost on memory."""

import contextlib
import ctypes
import os
import sys
from collections.abc import Iterator

import torch

_TRIM_THRESHOLD, _MMAP_THRESHOLD = -1, -3
"""glibc's numbers of its settings."""
_LARGEST_PIECE, _KEPT = 32 << 20, 1 << 30
"""Bytes: glibc takes no larger piece from what it keeps, and keeps no more than this."""


def prepare_process() -> None:
    """Compute on one thread, deterministically, and keep freed memory for the next batch."""
    os.environ.setdefault("CUBLAS_WORKSPACE_CONFIG", ":4096:8")  # Without, CUDA refuses to be deterministic.
    torch.set_num_threads(1)
    torch.set_deterministic_debug_mode("error")  # As use_deterministic_algorithms, but starts no compiler.
    torch.utils.deterministic.fill_uninitialized_memory = False  # type: ignore[attr-defined]  # It would only show what was never written.
    _keep_memory()


@contextlib.contextmanager
def threads(count: int) -> Iterator[None]:
    """Compute on so many threads for a while; bits depend on their number, not on the machine's cores.

    Args:
        count: torch's threads as long as the context lasts.
    """
    before = torch.get_num_threads()
    torch.set_num_threads(count)
    try:
        yield
    finally:
        torch.set_num_threads(before)


def _keep_memory() -> None:
    """Tell glibc not to hand a batch of pictures back to the system, which would clear each page again.

    Up to a quarter of an update with pictures goes into that. Other C libraries are left as they are.
    """
    if sys.platform == "linux" and (set_option := getattr(ctypes.CDLL(None), "mallopt", None)):
        set_option(_MMAP_THRESHOLD, _LARGEST_PIECE)
        set_option(_TRIM_THRESHOLD, _KEPT)
