"""How validation grows with a network: seconds beside conversion's, and the slope of log time to log lanes.

    python tools/bench_validate.py [--repeats 3] [--largest] [NETWORK ...]

Validation reads the network and runs every check, as `dojo-maps validate` does; conversion is the whole of
`dojo-maps convert`. Grids of up to 10,000 edges, with signals, sidewalks and crossings, are made by
netgenerate; `--largest` converts the largest of them, too. Each network runs in a process of its own, warmed
by a small one; of several repeats the fastest counts.
"""

import argparse
import json
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

from bench_convert import default_networks, slope

_GRIDS = (8, 16, 32, 51)
_SOME_LANES = 6_000
"""Conversion of larger networks takes minutes, and says nothing more about validation."""


def make_grid(side: int, folder: Path) -> Path:
    """Let netgenerate make a grid with signals, sidewalks and crossings; 4 x side x (side - 1) edges."""
    from dojo_maps.sources.netconvert import find_netconvert

    target = folder / f"grid{side}.net.xml"
    program = find_netconvert().with_name("netgenerate")
    shape = ["--grid", f"--grid.number={side}", "--grid.length=120", "--default.lanenumber=2"]
    walks = ["--sidewalks.guess", "--crossings.guess", "--walkingareas"]
    command = [str(program), *shape, *walks, "--default-junction-type=traffic_light", "-o", str(target)]
    subprocess.run(command, check=True, capture_output=True)  # noqa: S603
    return target


def measure(network: str, repeats: int, *, largest: bool) -> dict[str, float]:
    """Validate a network, and convert it, in this process; the fastest of some repeats."""
    from dojo_maps import convert
    from dojo_maps.inspection import inspect

    def fastest(run: Callable[[], object]) -> float:
        seconds = []
        for _ in range(repeats):
            start = time.perf_counter()
            run()
            seconds.append(time.perf_counter() - start)
        return min(seconds)

    with tempfile.TemporaryDirectory() as folder:
        inspect("two-way")
        convert("two-way", Path(folder) / "warm.dojo")
        validated = fastest(lambda: inspect(network))
        read, _ = inspect(network)
        lanes = len(read.road_map.lanes)
        converted = float("nan")
        if largest or lanes <= _SOME_LANES:
            converted = fastest(lambda: convert(network, Path(folder) / "map.dojo"))
    edges = len(read.road_map.roads)
    return {"edges": edges, "lanes": lanes, "seconds": validated, "convert": converted}


def main() -> int:
    """Measure every network and print a table; 1 if validation takes longer or grows faster than it may."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("networks", nargs="*", metavar="NETWORK")
    parser.add_argument("--repeats", type=int, default=3)
    parser.add_argument("--largest", action="store_true", help="convert the largest networks, too")
    parser.add_argument("--in-process", action="store_true", help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.in_process:
        print(json.dumps(measure(options.networks[0], options.repeats, largest=options.largest)))
        return 0
    print(f"{'network':16}{'edges':>7}{'lanes':>7}{'seconds':>9}{'lanes/s':>9}{'convert s':>11}")
    with tempfile.TemporaryDirectory() as folder:
        grids = [] if options.networks else [str(make_grid(side, Path(folder))) for side in _GRIDS]
        rows = [_row(network, options) for network in (options.networks or [*default_networks(), *grids])]
    dear = [row for row in rows if row["convert"] < row["seconds"]]
    steep = len(rows) > 1 and slope(rows) > 1.15
    if len(rows) > 1:
        print(f"slope of log seconds against log lanes: {slope(rows):.2f} (allowed: 1.15)")
    return int(bool(dear) or steep)


def _row(network: str, options: argparse.Namespace) -> dict[str, float]:
    flags = ["--in-process", "--repeats", str(options.repeats), *(["--largest"] if options.largest else [])]
    command = [sys.executable, __file__, *flags, network]
    done = subprocess.run(command, check=True, capture_output=True, text=True)  # noqa: S603
    row: dict[str, float] = json.loads(done.stdout)
    print(
        f"{Path(network).name[:15]:16}{row['edges']:7}{row['lanes']:7}{row['seconds']:9.2f}"
        f"{row['lanes'] / row['seconds']:9.0f}{row['convert']:11.2f}",
        flush=True,
    )
    return row


if __name__ == "__main__":
    sys.exit(main())
