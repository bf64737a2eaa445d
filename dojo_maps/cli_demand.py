"""The command `dojo-maps demand`: traffic for a bundle or a SUMO network, generated or as it was counted."""

import argparse
import math
import sys
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING

from dojo_maps.command import Commands, add_command
from dojo_maps.wording import counted

if TYPE_CHECKING:
    from dojo_maps.demand import Demand

_DURATION = 3600.0
_MOST_SHOWN = 40
"""Counts in the table; the report has all."""


def add_demand(commands: Commands) -> None:
    """Add the command to the parser.

    Args:
        commands: what `add_subparsers` made.
    """
    demand = add_command(
        commands,
        "demand",
        _demand,
        "write traffic for a bundle or a SUMO network",
        example="dojo-maps demand cologne1.dojo --volume 900 --seed 1",
    )
    demand.add_argument(
        "source", metavar="NET_OR_BUNDLE", help="a bundle, a SUMO network or a packaged scenario"
    )
    demand.add_argument(
        "-o",
        "--output",
        metavar="FILE",
        type=Path,
        help="the .rou.xml to write (default: the bundle's own demand, or NAME.demand.rou.xml)",
    )
    demand.add_argument(
        "--volume", metavar="V", type=read_volume, help="vehicles per hour (default: what junctions can take)"
    )
    demand.add_argument(
        "--bicycles", metavar="N", type=read_volume, help="per hour (default: some where they have own lanes)"
    )
    demand.add_argument(
        "--walkers", metavar="N", type=read_volume, help="people per hour (default: some on each crossing)"
    )
    demand.add_argument(
        "--counts",
        metavar="CSV",
        type=Path,
        help="meet these counts; columns: from_edge, to_edge, count, and if needed begin, end, class",
    )
    demand.add_argument(
        "--pattern",
        metavar="NAME",
        help="traffic that changes, as a pattern has it: a packaged one such as surges, or a .toml file",
    )
    demand.add_argument("--seed", metavar="S", type=_seed, default=0, help="of the departures (default: 0)")
    demand.add_argument("--begin", metavar="TIME", type=_time, default=0.0, help="seconds or h:m:s")
    demand.add_argument("--end", metavar="TIME", type=_time, help="seconds or h:m:s (default: an hour later)")
    for name, what in (("json", "a report on map and demand"), ("html", "the same as a page")):
        demand.add_argument(f"--{name}", metavar="FILE", type=Path, help=f"write {what} here")


def read_volume(text: str) -> float:
    """Read a number per hour.

    Args:
        text: of the command line.

    Returns:
        The number.

    Raises:
        argparse.ArgumentTypeError: it is negative or beyond any map.
    """
    with suppress(ValueError):
        if 0 <= float(text) <= 1e6:
            return float(text)
    raise argparse.ArgumentTypeError(f"{text!r}: expected 0 or more per hour, at most 1,000,000")


def _demand(options: argparse.Namespace) -> int:
    from dojo_maps.demand import DemandOptions
    from dojo_maps.demand.patterns import find_pattern
    from dojo_maps.demand_files import deliver_demand
    from dojo_maps.errors import UsageError

    end = options.begin + _DURATION if options.end is None else options.end
    if end <= options.begin:
        raise UsageError(f"--end {end:g}: comes before --begin {options.begin:g}")
    if options.counts and options.volume is not None:
        raise UsageError("--volume and --counts: the counts say how many vehicles there are; leave one out")
    others = (options.volume, options.bicycles, options.walkers, options.counts)
    if options.pattern and any(value is not None for value in others):
        raise UsageError("--pattern: it says how much traffic there is; leave the other amounts out")
    wanted = DemandOptions(
        pattern=find_pattern(options.pattern) if options.pattern else None,
        volume=options.volume,
        bicycles=options.bicycles,
        walkers=options.walkers,
        seed=options.seed,
        begin=options.begin,
        end=end,
    )
    demand, start = deliver_demand(
        options.source,
        wanted,
        counts=options.counts,
        output=options.output,
        json=options.json,
        html=options.html,
    )
    print(
        f"written to {start}: {counted(demand.vehicles, 'vehicle')}, "
        f"{counted(demand.bicycles, 'bicycle')} and {counted(demand.walkers, 'walker')} "
        f"from {demand.begin:g} to {demand.end:g} s; "
        f"the fullest lane is used to {demand.saturation:.0%}"
    )
    for line in _table(demand):
        print(line)
    if demand.saturation > 1 and (options.counts or options.volume is not None):
        print(
            f"dojo-maps: warning: {options.source}: a lane is to take {demand.saturation:.1f} times what it "
            "can; traffic will jam there",
            file=sys.stderr,
        )
    return 0


def _table(demand: "Demand") -> Iterator[str]:
    """Show how well counts are met; of many, the worst."""
    from dojo_maps.demand import share_met

    if not demand.counts:
        return
    shown = list(demand.counts)
    if len(shown) > _MOST_SHOWN:
        shown = sorted(shown, key=lambda met: -met.geh)[:_MOST_SHOWN]
    rows = [("from_edge", "to_edge", "class", "begin", "end", "count", "modelled", "GEH")]
    rows += [
        (
            *(met.count.from_edge, met.count.to_edge, met.count.vehicle_class, f"{met.count.begin:g}"),
            *(f"{met.count.end:g}", str(met.count.count), str(met.modelled), f"{met.geh:.2f}"),
        )
        for met in shown
    ]
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    for row in rows:
        names = [cell.ljust(width) for cell, width in zip(row[:3], widths[:3], strict=True)]
        numbers = [cell.rjust(width) for cell, width in zip(row[3:], widths[3:], strict=True)]
        yield "  ".join(names + numbers)
    if len(shown) < len(demand.counts):
        yield f"the worst {len(shown)} of {len(demand.counts)} counts; the report has all"
    good = sum(met.geh < 5 for met in demand.counts)
    yield f"GEH below 5: {good} of {len(demand.counts)} counts ({share_met(demand):.0%})"


def _seed(text: str) -> int:
    with suppress(ValueError):
        if 0 <= int(text) < 1 << 32:
            return int(text)
    raise argparse.ArgumentTypeError(f"{text!r}: expected a whole number from 0 to 4294967295")


def _time(text: str) -> float:
    from dojo_maps.signals.programs import read_seconds

    try:
        value = read_seconds(text)
    except ValueError as problem:
        raise argparse.ArgumentTypeError(str(problem)) from None
    if not (value >= 0 and math.isfinite(value) and value.is_integer()):
        raise argparse.ArgumentTypeError("expected whole seconds, or h:m:s")
    return value
