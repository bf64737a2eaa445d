"""Options of a command out of a TOML file, by the names that they have on the command line.

    scenario = "cologne1"
    seeds = 5
    all-red = 1

They take the place of the defaults, so what stands on the command line counts more.
"""

import argparse
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from dojo_maps.errors import UsageError
from dojo_maps.safe_toml import read_toml
from dojo_maps.wording import did_you_mean

_OPTION = "--config"
_MOST_BYTES = 1_000_000
NUMBERS = {"int": "a whole number", "float": "a number"}
"""What is expected of a text, by the name of the type that it is to become."""


def take_file(parser: argparse.ArgumentParser, arguments: Sequence[str]) -> None:
    """Let the file that the arguments name, if any, set a command's defaults.

    Args:
        parser: of the command.
        arguments: the command's.

    Raises:
        SourceError: the file cannot be read.
        UsageError: the file names no option of the command, or gives one a value that cannot be.
    """
    if _OPTION not in parser._option_string_actions:
        return
    finder = argparse.ArgumentParser(add_help=False, allow_abbrev=False, exit_on_error=False)
    finder.add_argument(_OPTION)
    try:
        named = finder.parse_known_args(list(arguments))[0].config
    except argparse.ArgumentError:
        return  # The command's own parser says what is wrong.
    if named is not None:
        _set_defaults(parser, read_toml(Path(named), most=_MOST_BYTES), named)


def _set_defaults(parser: argparse.ArgumentParser, table: Mapping[str, Any], path: str) -> None:
    known = {name.lstrip("-"): action for name, action in parser._option_string_actions.items()}
    for name, value in table.items():
        action = known.get(name.replace("_", "-"))
        if action is None or action.dest in ("help", "version", "config"):
            hint = did_you_mean(name.replace("_", "-"), known) or f"; {parser.prog} --help lists them"
            raise UsageError(f"{path}: {name}: no option of {parser.prog}{hint}")
        try:
            action.default = _read_value(action, value)
        except (argparse.ArgumentTypeError, TypeError, ValueError) as error:
            raise UsageError(f"{path}: {name} = {value!r}: {error}") from None
        action.required = False
        for group in parser._mutually_exclusive_groups:
            if action in group._group_actions:
                group.required = False


def _read_value(action: argparse.Action, value: Any) -> Any:
    """Read a value as the command line has it: each part as text, in the option's own type."""
    if action.nargs == 0:
        if not isinstance(value, bool):
            raise ValueError("expected true or false")
        return value
    if isinstance(value, dict) or (isinstance(value, list) and action.nargs not in ("+", "*")):
        raise ValueError("expected one value")
    parts = value if isinstance(value, list) else [value]
    if any(isinstance(part, bool | dict | list) for part in parts):
        raise ValueError("expected numbers or texts")
    convert = action.type if callable(action.type) else str
    try:
        read = [convert(str(part)) for part in parts]
    except ValueError:
        raise ValueError(
            f"expected {NUMBERS.get(getattr(convert, '__name__', ''), 'another value')}"
        ) from None
    if action.choices is not None and (wrong := [part for part in read if part not in action.choices]):
        raise ValueError(f"{wrong[0]!r} is not among {', '.join(map(str, action.choices))}")
    return read if action.nargs in ("+", "*") else read[0]
