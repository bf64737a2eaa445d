"""The options of `dojo-maps import-osm` that say which part of the world: a file, a place, a point, a box."""

import argparse
import re
from collections.abc import Callable, Sequence

_RADIUS = 200.0
_SIGNED = ("--point", "--bbox")
"""Options whose value may begin with a minus."""


def add_area_options(parser: argparse.ArgumentParser) -> None:
    """Declare the options; exactly one of the file and the three kinds of area must be given."""
    area = parser.add_mutually_exclusive_group(required=True)
    area.add_argument(
        "source", metavar="FILE", nargs="?", help=".osm, .osm.xml, .osm.gz, .osm.bz2 or .osm.pbf"
    )
    area.add_argument("--place", metavar="TEXT", help="download around a place with this name")
    area.add_argument("--point", metavar="LAT,LON", type=_numbers(2), help="download around a point, degrees")
    area.add_argument("--bbox", metavar="W,S,E,N", type=_numbers(4), help="download a box, degrees")
    parser.add_argument(
        "--radius", metavar="M", type=float, help=f"metres around the place or point (default: {_RADIUS:g})"
    )
    parser.add_argument("--overpass-url", metavar="URL", help="the Overpass server to download from")


def join_signed(arguments: Sequence[str]) -> list[str]:
    """Write `--point -33.9,151.2` as `--point=-33.9,151.2`, for argparse takes a minus for an option."""
    joined: list[str] = []
    for argument in arguments:
        if joined and joined[-1] in _SIGNED and re.match(r"-[\d.]", argument):
            joined[-1] += f"={argument}"
        else:
            joined.append(argument)
    return joined


def find_source(options: argparse.Namespace, say: Callable[[str], None]) -> str:
    """Give the file to import; download the area first where one was named instead.

    Raises:
        UsageError: the options do not go together, or name no area.
        SourceError: the area cannot be downloaded.
    """
    from dojo_maps.errors import UsageError
    from dojo_maps.sources.osm import is_osm
    from dojo_maps.sources.overpass import SERVER, Area, area_around, download_area, find_place

    if options.source is not None:
        unused = [name for name in ("radius", "overpass_url") if getattr(options, name) is not None]
        if unused:
            raise UsageError(f"--{unused[0].replace('_', '-')} says how to download, but a file is given")
        if not is_osm(options.source):
            raise UsageError(
                f"{options.source}: not named as OpenStreetMap data is (.osm, .osm.gz, .osm.pbf)"
            )
        return str(options.source)
    if options.bbox is not None:
        if options.radius is not None:
            raise UsageError("--radius goes with --place or --point; a box has its own size")
        west, south, east, north = options.bbox
        area, name = Area(west=west, south=south, east=east, north=north), "box"
    else:
        latitude, longitude = options.point if options.place is None else find_place(options.place)
        name = options.place or _point_name(latitude, longitude)
        radius = _RADIUS if options.radius is None else options.radius
        area = area_around(latitude, longitude, radius)
    found = download_area(area, name=_file_name(name), server=options.overpass_url or SERVER, on_pause=say)
    say(f"data of {found.date}: {found.path}")
    return str(found.path)


def _point_name(latitude: float, longitude: float) -> str:
    north, east = "SN"[latitude >= 0], "WE"[longitude >= 0]
    return f"{abs(latitude):.5f}{north}-{abs(longitude):.5f}{east}"


def _file_name(name: str) -> str:
    """Make a file's name of a place's: letters and digits of any script, the rest becomes hyphens."""
    return re.sub(r"[^\w.]+|_+", "-", name.lower()).strip("-.")[:60] or "area"


def _numbers(count: int) -> Callable[[str], tuple[float, ...]]:
    def read(text: str) -> tuple[float, ...]:
        values = tuple(float(value) for value in text.split(","))
        if len(values) != count:
            raise argparse.ArgumentTypeError(f"expected {count} numbers of degrees, separated by commas")
        return values

    read.__name__ = "degrees"
    return read
