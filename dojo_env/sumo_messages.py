"""What SUMO says while it runs inside of this process, and what of it belongs into an error.

libsumo writes on the process's own standard error, often more than it then raises: its exception may say
"Process Error", and no more. So standard error goes into a file meanwhile. What is no error is passed on.
That is done while SUMO starts, and throughout in a process that does nothing else: to turn standard error
around at every decision would cost three in a hundred of an episode's time.
"""

import os
import sys
import tempfile

_STDERR = 2
_ERROR, _WARNING = "Error: ", "Warning: "
_EMPTY = ("", "Process Error")
"""What SUMO raises where it has said the reason before."""
_SHOWN = 3
_LONGEST = 400
"""Characters of a message that are shown."""


class SumoMessages:
    """Keeps what SUMO writes on standard error between `begin` and `end`."""

    def __init__(self) -> None:
        """Open a file for it, which nobody else sees."""
        self._file = tempfile.TemporaryFile()  # noqa: SIM115 - closed by `close`
        try:
            self._stderr = os.dup(_STDERR)
        except OSError:  # This process has none.
            self._stderr = -1
        self._errors: list[str] = []
        self._listens = False

    def close(self) -> None:
        """Stop listening, and close the file."""
        self.end()
        self._file.close()
        if self._stderr >= 0:
            os.close(self._stderr)

    def begin(self) -> None:
        """Take in what is written on standard error from now on."""
        if self._stderr >= 0:
            self._listens = True
            os.dup2(self._file.fileno(), _STDERR)

    def end(self) -> None:
        """Give standard error back, and pass on what was written and is no error of SUMO's."""
        sys.stderr.write("".join(self._stop_listening()))

    def _stop_listening(self) -> list[str]:
        """Give standard error back; returns the lines that are no error of SUMO's."""
        if not self._listens:
            return []
        self._listens = False
        os.dup2(self._stderr, _STDERR)
        return self._take_in() if os.fstat(self._file.fileno()).st_size else []

    def explain(self, error: Exception) -> str:
        """Stop listening, and say on one line what went wrong, in SUMO's own words, each once.

        What else was written, such as a library's complaints of the same, is dropped.

        Args:
            error: what libsumo or TraCI has raised.

        Returns:
            The line.
        """
        self._stop_listening()
        raised = " ".join(str(error).split())
        said = [words for words in dict.fromkeys(self._errors) if words not in raised]
        if raised not in _EMPTY and not any(raised in words for words in said):
            said.append(raised)
        self._errors = []
        shown = [words if len(words) <= _LONGEST else f"{words[:_LONGEST]}..." for words in said[:_SHOWN]]
        rest = [f"and {len(said) - _SHOWN} more"] if len(said) > _SHOWN else []
        return "; ".join([*shown, *rest]) or "SUMO has said why on standard error"

    def _take_in(self) -> list[str]:
        self._file.seek(0)
        text = self._file.read().decode("utf-8", "replace")
        self._file.seek(0)
        self._file.truncate()
        others: list[str] = []
        is_error = False
        for line in text.splitlines(keepends=True):
            if line.startswith(_ERROR):
                is_error = True
                self._errors.append(" ".join(line.removeprefix(_ERROR).split()))
            elif is_error and not line.startswith(_WARNING):  # It goes on.
                self._errors[-1] = " ".join([self._errors[-1], *line.split()])
            else:
                is_error = False
                others.append(line)
        return others
