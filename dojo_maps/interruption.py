"""What SIGINT and SIGTERM do to a command: end it with one line and one status, at any moment.

Only the first signal counts, and none once the command has come to its end: so a storm of signals is one
interruption, none of them disturbs the cleaning up, and none comes too late for a handler.

The first one says the line at once and closes standard error behind it, for nothing that follows from it is
news. A command that has not begun its work is over with that; else KeyboardInterrupt ends it. A program that
only calls us answers signals as it likes.
"""

import contextlib
import os
import signal
import sys
from _thread import allocate_lock
from collections.abc import Callable, Iterator
from types import CodeType, FrameType

STATUS = 130
_SIGNALS = (signal.SIGINT, signal.SIGTERM)
_ONCE_MORE = 0.02
"""Seconds until an interruption that was lost is raised once more."""
present: "Interruption | None" = None
"""Of this process, if it is a command's own."""


class Interruption:
    """Whether and how a command is interrupted.

    Attributes:
        happened: whether it was, even if a library swallowed or renamed the exception.
    """

    def __init__(self, words: str) -> None:
        """Take what the user is told of it."""
        self.happened = self._is_over = False
        self._words = words
        self._first = allocate_lock()
        self._work: CodeType | None = None
        self._last = self._holds = self._waiting = 0

    def answer_signals(self) -> None:
        """Begin to answer. A signal that the caller ignores stays ignored."""
        for number in _SIGNALS:
            if signal.getsignal(number) is not signal.SIG_IGN:
                signal.signal(number, self._answer)
        sys.unraisablehook = self._note_unraisable

    def work_in(self, function: Callable[..., int]) -> None:
        """Raise from here on, but where the module of this function imports what it needs.

        Args:
            function: of the command.
        """
        self._work = function.__code__

    def explain(self, words: str) -> None:
        """Tell the user more of it, such as how to go on.

        Args:
            words: to say.
        """
        self._words = words

    def take(self) -> bool:
        """Make it happen, unless it has happened.

        Returns:
            Whether it happens now.
        """
        if not self._first.acquire(blocking=False):
            return False
        if not self.happened:
            self.happened = True
            with contextlib.suppress(OSError):
                os.write(2, f"{self._words}\n".encode())
            silence()
        return True

    def end(self) -> None:
        """Let it not happen any more: the command has come to its end."""
        self._is_over = True

    @contextlib.contextmanager
    def held(self) -> Iterator[None]:
        """Let it happen only at the end of this."""
        self._holds += 1
        try:
            yield
        finally:
            self._holds -= 1
            if self._waiting and not self._holds:
                self._answer(self._waiting)

    def _answer(self, number: int, frame: FrameType | None = None) -> None:
        self._last = number
        if self._holds:
            self._waiting = number
        elif not self._is_over and self.take():
            if self._is_loading(frame):
                os._exit(STATUS)
            raise KeyboardInterrupt

    def _is_loading(self, frame: FrameType | None) -> bool:
        """Tell whether there is nothing to clean up yet, only modules on their way in.

        An exception raised inside of an import may be swallowed by a C extension, or leave half of it.
        """
        work = self._work
        if work is None:
            return True
        called = ""
        while frame is not None and frame.f_code is not work:
            if frame.f_code.co_filename != work.co_filename:
                called = frame.f_code.co_filename
            frame = frame.f_back
        return frame is not None and called.startswith("<frozen importlib")

    def _note_unraisable(self, lost: "sys.UnraisableHookArgs") -> None:
        """Raise it once more if it was raised where nothing can be, as in a `__del__`."""
        if not issubclass(lost.exc_type, KeyboardInterrupt):
            sys.__unraisablehook__(lost)
        elif self.happened:
            import threading  # noqa: PLC0415 - what loads before us, nobody can interrupt in one line

            def raise_once_more() -> None:
                self._first.release()
                signal.pthread_kill(threading.main_thread().ident or 0, self._last)

            threading.Timer(_ONCE_MORE, raise_once_more).start()


def begin(words: str) -> None:
    """Make this process a command's own, which `words` tell the end of where it is interrupted.

    Args:
        words: to say on standard error.
    """
    global present  # noqa: PLW0603 - signals are the whole process's, too
    present = Interruption(words)
    present.answer_signals()


def begin_command(name: str, words: str) -> None:
    """Begin if this process was started for the command of this name, by its script or with `python -m`.

    Packages ask as soon as they are imported: before what takes long, and before `sys.argv` can tell.

    Args:
        name: of the command, as `dojo-maps`.
        words: see `begin`.
    """
    given = sys.orig_argv[1:]
    while given and given[0].startswith("-"):
        given = given[2 if given[0] in ("-X", "-W") else 1 :]
    if given and given[0].rpartition(os.sep)[2].partition(".")[0].replace("_", "-") == name:
        begin(words)


def explain(words: str) -> None:
    """Say this when the command is interrupted, instead of what was said at its beginning.

    Args:
        words: to say.
    """
    if present is not None:
        present.explain(words)


def held() -> contextlib.AbstractContextManager[None]:
    """Hold an interruption back where one half of what is done would be worse than none.

    Returns:
        The context in which it waits.
    """
    return contextlib.nullcontext() if present is None else present.held()


def heed() -> None:
    """Raise KeyboardInterrupt once more if a library swallowed it: what has no end of its own asks.

    numba's kernels drop what is raised while they call back into Python; numpy makes a TypeError of it.
    """
    if present is not None and present.happened:
        raise KeyboardInterrupt


def silence() -> None:
    """Send to nowhere what is still said on standard error, by C libraries or by Python."""
    with contextlib.suppress(OSError, ValueError):
        nowhere = os.open(os.devnull, os.O_WRONLY)
        os.dup2(nowhere, 2)
        if sys.stderr is not None:
            os.dup2(nowhere, sys.stderr.fileno())
        os.close(nowhere)
