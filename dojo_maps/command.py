"""The frame of every command: its arguments, its streams, its one line of failure, and how its process ends.

A command is a function that takes the parsed arguments and returns its exit status: 0 done, 1 the map has
errors, 2 wrong usage, 3 bad input, 4 failure or a tool missing; 130 interrupted, see `interruption`.
"""

import argparse
import atexit
import contextlib
import io
import logging
import os
import re
import sys
import warnings
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, NoReturn, TypeAlias

from dojo_maps import interruption
from dojo_maps.errors import DojoError, UsageError, explain_missing
from dojo_maps.lazy_names import DISTRIBUTION, read_version
from dojo_maps.option_files import NUMBERS, take_file
from dojo_maps.wording import did_you_mean

Run = Callable[[argparse.Namespace], int]
_STANDARD_OUTPUT = "standard output"
_BROKEN_PIPE = 141
"""128 and the number of SIGPIPE, which Windows does not have."""
_LEVELS = ("debug", "info", "warning", "error")
_INVALID = re.compile(rf"invalid ({'|'.join(NUMBERS)}) value: ('.*')")
"""What argparse says of a text that is no number."""
_LONGEST = 900
"""Characters of a line about a failure."""


def run_command(
    name: str, build_parser: Callable[[], argparse.ArgumentParser], arguments: Sequence[str] | None
) -> int:
    """Run a command; every failure is one line on standard error and a status.

    Args:
        name: what the line begins with.
        build_parser: makes the parser, which sets `run` to a command's function.
        arguments: None for the process's own.

    Returns:
        The exit status; but where the process is the command's own, it ends with that.
    """
    given = sys.argv[1:] if arguments is None else arguments
    if interruption.present is not None:
        _end_process(name, lambda: _try(build_parser, given), interruption.present)
    status, words = _try(build_parser, given)
    _say(name, words)
    return status


class Parser(argparse.ArgumentParser):
    """Knows its version; wrong usage is one line, too."""

    def __init__(self, **options: Any) -> None:
        """Take what any parser takes."""
        super().__init__(**options)
        self.add_argument("--version", action=_Version, nargs=0, help="show the version and exit")

    def parse_known_args(self, args: Any = None, namespace: Any = None) -> Any:
        """Parse arguments, and what `--config` names beneath them.

        Args:
            args: of the command line.
            namespace: that takes what is found; None for a new one.

        Returns:
            What was found, and nothing unknown.
        """
        take_file(self, args or ())
        found, unknown = super().parse_known_args(args, namespace)
        if unknown:  # Here, where it is known which command's options are meant.
            name = unknown[0].partition("=")[0]
            meant = did_you_mean(name, self._option_string_actions)
            self.error(
                f"{name}: no such option{meant}" if name.startswith("-") else f"{name}: not expected here"
            )
        return found, unknown

    def error(self, message: str) -> NoReturn:
        """Refuse the arguments.

        Args:
            message: what is wrong.

        Raises:
            UsageError: always.
        """
        told = _INVALID.sub(lambda found: f"{found[2]}: expected {NUMBERS[found[1]]}", message)
        raise UsageError(f"{told}; {self.prog} --help tells more")


Commands: TypeAlias = "argparse._SubParsersAction[Parser]"
"""What `add_subparsers` makes."""


def add_command(
    commands: Commands, name: str, run: Run, summary: str, *, example: str = ""
) -> argparse.ArgumentParser:
    """Add a command with what all of them take.

    Args:
        commands: what `add_subparsers` made.
        name: of the command.
        run: carries it out and returns its exit status; it imports what it needs, first of all.
        summary: what it does, in a line.
        example: a command line, for its help; those of both packages have one.

    Returns:
        Its parser, for its own arguments.
    """
    parser = commands.add_parser(
        name,
        help=summary,
        description=f"{summary[:1].upper()}{summary[1:]}.",
        epilog=f"example: {example}" if example else None,
        formatter_class=_Help,
    )
    parser.add_argument("--quiet", action="store_true", help="no progress on standard error")
    parser.add_argument(
        "--log-level",
        choices=_LEVELS,
        help="also write the program's log on standard error, from this level on (default: none)",
    )
    parser.add_argument("--config", metavar="FILE.toml", help="take options from this file, by their names")
    parser.set_defaults(run=run)
    return parser


class _Help(argparse.HelpFormatter):
    """Tells defaults where the words of an option do not."""

    def _get_help_string(self, action: argparse.Action) -> str | None:
        words = action.help or ""
        untold = action.default in (None, argparse.SUPPRESS, "") or isinstance(action.default, bool | list)
        return words if untold or "default" in words else f"{words} (default: %(default)s)"


class _Version(argparse.Action):
    def __call__(self, parser: argparse.ArgumentParser, *_: object) -> NoReturn:
        print(f"{DISTRIBUTION} {read_version()}")  # noqa: T201
        parser.exit()


def _try(build_parser: Callable[[], argparse.ArgumentParser], arguments: Sequence[str]) -> tuple[int, str]:
    """Run a command; returns its status, and what is to be said of its failure."""
    try:
        status = _call(build_parser, arguments)
        if sys.stdout is not None:
            sys.stdout.flush()
    except DojoError as error:
        return error.exit_status, str(error)
    except MemoryError:
        return 4, "not enough memory; give it a smaller input"
    except OSError as error:
        if isinstance(error, BrokenPipeError) and error.filename == _STANDARD_OUTPUT:
            return _BROKEN_PIPE, ""  # Who reads has seen enough, as in `| head`.
        where = f"{error.filename}: {error.strerror}" if error.filename and error.strerror else ""
        return 4, where or str(error) or type(error).__name__
    except Exception as error:  # noqa: BLE001 - a user gets one line, whatever happens
        place = error.__traceback__
        while place and place.tb_next:
            place = place.tb_next
        where = f"{Path(place.tb_frame.f_code.co_filename).name}:{place.tb_lineno}" if place else "?"
        return 4, f"a defect of this program ({type(error).__name__}: {error}; {where}); please report it"
    return status, ""


def _call(build_parser: Callable[[], argparse.ArgumentParser], arguments: Sequence[str]) -> int:
    try:
        parser = build_parser()
        if "_ARGCOMPLETE" in os.environ:
            import argcomplete  # noqa: PLC0415 - only the shell's completion needs it

            argcomplete.autocomplete(parser)
        options = parser.parse_args(arguments)
        _open_log(options)
        if interruption.present is not None:
            interruption.present.work_in(options.run)
        status: int = options.run(options)
    except ModuleNotFoundError as error:
        raise explain_missing(error) or error from error
    except SystemExit as end:
        if isinstance(end.code, str):
            raise DojoError(end.code) from None
        return int(end.code or 0)
    return status


def _open_log(options: argparse.Namespace) -> None:
    """Show what the packages log; programs that call them listen to `dojo_maps` and `dojo_env` themselves."""
    if getattr(options, "log_level", None) is None:
        return
    handler = logging.StreamHandler()
    handler.setFormatter(logging.Formatter("%(asctime)s %(levelname)s %(name)s: %(message)s"))
    handler.addFilter(lambda record: not getattr(record, "is_shown", False))
    for name in ("dojo_maps", "dojo_env"):
        log = logging.getLogger(name)
        log.addHandler(handler)
        log.setLevel(options.log_level.upper())


def _end_process(
    name: str, attempt: Callable[[], tuple[int, str]], interrupted: interruption.Interruption
) -> NoReturn:
    """Run a command in its own process and end that.

    Without Python's last steps: in these it gives signals back to the system, one by one.
    """
    status, words = interruption.STATUS, ""
    try:
        _open_streams()
        status, words = attempt()
        interrupted.end()
    except KeyboardInterrupt:
        interrupted.take()  # Unless it was a signal that raised it.
        interrupted.end()
    if interrupted.happened:
        status, words = interruption.STATUS, ""
    _say(name, words)
    atexit._run_exitfuncs()
    os._exit(status)


def _say(name: str, words: str) -> None:
    """Say what went wrong in one line, whatever is in the words."""
    line = "".join(c if c.isprintable() else ascii(c)[1:-1] for c in " ".join(words.split()))
    if line:
        line = line if len(line) <= _LONGEST else f"{line[:_LONGEST]}..."
        with contextlib.suppress(OSError):
            print(f"{name}: {line}", file=sys.stderr, flush=True)  # noqa: T201


def _open_streams() -> None:
    """Make the standard streams such that printing never fails but for the device behind them.

    What is closed becomes /dev/null: else the next file that is opened would take its number, and all that
    C libraries print. What the encoding has no characters for is escaped.
    """
    for number in range(3):
        try:
            os.fstat(number)
        except OSError:
            os.set_inheritable(os.open(os.devnull, os.O_RDWR), True)
    former = sys.stdout
    sys.stdout = io.TextIOWrapper(
        io.BufferedWriter(_StandardOutput(1, "wb", closefd=False)),
        encoding=former.encoding if former is not None else "utf-8",
        errors="backslashreplace",
        line_buffering=isinstance(former, io.TextIOWrapper)
        and (former.line_buffering or former.write_through),
    )
    if sys.stderr is None:
        sys.stderr = open(2, "w", encoding="utf-8", closefd=False)  # noqa: SIM115 - it stays open
    if sys.stdin is None:
        sys.stdin = open(0, encoding="utf-8", closefd=False)  # noqa: SIM115
    if not sys.warnoptions:
        warnings.simplefilter("ignore")  # They are for programmers.


class _StandardOutput(io.FileIO):
    """Standard output whose errors say that they are its own."""

    def write(self, data: Any, /) -> int:
        try:
            return super().write(data)
        except OSError as error:
            raise OSError(error.errno, error.strerror, _STANDARD_OUTPUT) from None
