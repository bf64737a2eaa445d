"""What SIGINT and SIGTERM do to a running command: end it with one line and one status, at any moment."""

import os
import signal
import sys
import threading
from types import FrameType, TracebackType
from typing import NoReturn, Self

STATUS = 130
_MESSAGE = "dojo-maps: interrupted; every bundle is as it was, or complete"
_SIGNALS = (signal.SIGINT, signal.SIGTERM)


class Interruption:
    """Answers interruptions while it is entered, and gives the former answers back when it is left.

    While modules load it ends the process itself: an exception raised inside of an import may be swallowed
    by a C extension or come out as an ImportError, and there is nothing to clean up yet. After
    `raise_from_now_on` it raises KeyboardInterrupt, once, and takes it in at the end. A signal that the
    caller ignores stays ignored, and only the main thread has a say in signals.

    Attributes:
        happened: whether there was an interruption, even if a library swallowed or renamed the exception.
    """

    def __init__(self) -> None:
        self.happened = False
        self._former: dict[signal.Signals, signal._HANDLER] = {}

    def __enter__(self) -> Self:
        """Begin to answer, by ending at once."""
        if threading.current_thread() is threading.main_thread():
            answers = {number: signal.getsignal(number) for number in _SIGNALS}
            self._former = {k: answer for k, answer in answers.items() if answer is not signal.SIG_IGN}
        self._answer_with(_end_at_once)
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> bool:
        """Tell the user of an interruption, and put the former answers back."""
        caught = isinstance(error, KeyboardInterrupt)
        self.happened |= caught
        if self.happened:
            print(_MESSAGE, file=sys.stderr)  # noqa: T201
        for number, answer in self._former.items():
            # None stands for an answer that was not given in Python and cannot be put back from it.
            signal.signal(number, signal.SIG_DFL if answer is None else answer)
        return caught

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


def _end_at_once(_signal: int, _frame: FrameType | None) -> NoReturn:
    """End without any of Python's own last steps; the stream cannot be used, the signal may lie inside it."""
    try:
        os.write(2, f"{_MESSAGE}\n".encode())
    finally:
        os._exit(STATUS)


def leave_pipe() -> int:
    """Stop writing to who has seen enough of standard output, as in `| head`; returns the status for it."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
    return 128 + signal.SIGPIPE
