"""The options of `dojo-maps import-osm` that say which part of the world: a file, a place, a point, a box."""

import argparse
import re
from collections.abc import Callable, Sequence

_SIGNED = ("--point", "--bbox")
"""Options whose value may begin with a minus."""


def add_area_options(parser: argparse.ArgumentParser) -> None:
    """Declare the options; exactly one of the file and the three kinds of area must be given.

    Args:
        parser: of the command.
    """
    area = parser.add_mutually_exclusive_group(required=True)
    area.add_argument(
        "source",
        metavar="FILE",
        nargs="?",
        help=".osm, .osm.xml, .osm.pbf or .osm.json; also packed, as .gz, .bz2, .xz or .zip",
    )
    area.add_argument("--place", metavar="TEXT", help="download around a place with this name")
    area.add_argument(
        "--point", metavar="LAT,LON", type=_numbers("LAT,LON"), help="download around a point, degrees"
    )
    area.add_argument("--bbox", metavar="W,S,E,N", type=_numbers("W,S,E,N"), help="download a box, degrees")
    parser.add_argument(
        "--radius", metavar="M", type=float, help="metres around the place or point (default: 200)"
    )
    parser.add_argument("--overpass-url", metavar="URL", help="the Overpass server to download from")


def join_signed(arguments: Sequence[str]) -> list[str]:
    """Write `--point -33.9,151.2` as `--point=-33.9,151.2`, for argparse takes a minus for an option.

    Args:
        arguments: of the command line.

    Returns:
        The same, each such pair in one.
    """
    joined: list[str] = []
    for argument in arguments:
        if joined and joined[-1] in _SIGNED and re.match(r"-[\d.]", argument):
            joined[-1] += f"={argument}"
        else:
            joined.append(argument)
    return joined


def _numbers(names: str) -> Callable[[str], tuple[float, ...]]:
    def read(text: str) -> tuple[float, ...]:
        try:
            values = tuple(float(value) for value in text.split(","))
        except ValueError:
            values = ()
        if len(values) != len(names.split(",")):
            raise argparse.ArgumentTypeError(f"{text!r}: expected {names} in degrees, without spaces")
        return values

    return read
