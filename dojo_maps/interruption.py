"""What SIGINT and SIGTERM do to a running command: end it with one line and one status, at any moment."""

import os
import signal
import sys
import threading
from types import FrameType, TracebackType
from typing import NoReturn, Self

STATUS = 130
_SIGNALS = (signal.SIGINT, signal.SIGTERM)
_present: "Interruption | None" = None


class Interruption:
    """Answers interruptions while it is entered, and gives the former answers back when it is left.

    While modules load it ends the process itself: an exception raised inside of an import may be swallowed
    by a C extension or come out as an ImportError, and there is nothing to clean up yet. After
    `raise_from_now_on` it raises KeyboardInterrupt, once, and takes it in at the end. A signal that the
    caller ignores stays ignored, and only the main thread has a say in signals.

    Attributes:
        happened: whether there was an interruption, even if a library swallowed or renamed the exception.
    """

    def __init__(self, message: str) -> None:
        """Take what the user is told of one."""
        self._message = message
        self.happened = False
        self._former: dict[signal.Signals, signal._HANDLER] = {}

    def __enter__(self) -> Self:
        """Begin to answer, by ending at once."""
        global _present  # noqa: PLW0603 - signals are the whole process's, too
        _present = self
        if threading.current_thread() is threading.main_thread():
            answers = {number: signal.getsignal(number) for number in _SIGNALS}
            self._former = {k: answer for k, answer in answers.items() if answer is not signal.SIG_IGN}
        self._answer_with(self._end_at_once)
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> bool:
        """Tell the user of an interruption rather than of the error it became, and put the answers back."""
        global _present  # noqa: PLW0603
        _present = None
        self.happened |= isinstance(error, KeyboardInterrupt)
        if self.happened:
            print(self._message, file=sys.stderr)  # noqa: T201
        for number, answer in self._former.items():
            # None stands for an answer that was not given in Python and cannot be put back from it.
            signal.signal(number, signal.SIG_DFL if answer is None else answer)
        return self.happened

    def raise_from_now_on(self) -> None:
        """Raise KeyboardInterrupt at the first signal; later ones must not disturb the cleaning up."""
        self._answer_with(self._raise_once)

    def _answer_with(self, answer: "signal._HANDLER") -> None:
        for number in self._former:
            signal.signal(number, answer)

    def _raise_once(self, _signal: int, _frame: FrameType | None) -> None:
        if not self.happened:
            self.happened = True
            raise KeyboardInterrupt

    def _end_at_once(self, _signal: int, _frame: FrameType | None) -> NoReturn:
        """End without any of Python's last steps; the stream cannot be used, the signal may lie inside it."""
        try:
            os.write(2, f"{self._message}\n".encode())
        finally:
            os._exit(STATUS)


def heed() -> None:
    """Raise KeyboardInterrupt once more if a library swallowed it: what has no end of its own asks.

    numba's kernels drop what is raised while they call back into Python; numpy makes a TypeError of it.
    """
    if _present is not None and _present.happened:
        raise KeyboardInterrupt


def leave_pipe() -> int:
    """Stop writing to who has seen enough of standard output, as in `| head`; returns the status for it."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
    return 128 + signal.SIGPIPE
