"""How conversion grows with a network: seconds, lanes per second and peak memory, beside sumolib's reading.

    python tools/bench_convert.py [--repeats 3] [NETWORK ...]

Every network is converted in a process of its own, warmed by one small conversion; of several repeats the
fastest counts, for both sides. The last line gives the slope of log time against log lanes; the difference
of the two is the fixed cost.
"""

import argparse
import importlib.util
import json
import math
import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path

_BERLIN = "tools/game/DRT/osm.net.xml"
_MB = 1024


def default_networks() -> list[str]:
    """List networks of growing size: packaged scenarios, and Berlin from the eclipse-sumo package."""
    spec = importlib.util.find_spec("sumo")
    folders = list(spec.submodule_search_locations or ()) if spec else []
    berlin = [str(Path(folder) / _BERLIN) for folder in folders]
    return ["two-way", "cologne1", "cologne8", "ingolstadt21", *berlin]


def measure(network: str, repeats: int) -> dict[str, float]:
    """Convert a network and let sumolib read it, in this process; the fastest of some repeats."""
    import sumolib

    from dojo_maps import convert
    from dojo_maps.sources.files import find_network

    path, _ = find_network(network)
    with tempfile.TemporaryDirectory() as folder:
        convert("two-way", Path(folder) / "warm.dojo")
        seconds, reading = [], []
        for _ in range(repeats):
            start = time.perf_counter()
            bundle, _ = convert(network, Path(folder) / "map.dojo")
            seconds.append(time.perf_counter() - start)
            start = time.perf_counter()
            sumolib.net.readNet(str(path))
            reading.append(time.perf_counter() - start)
        lanes = len(bundle.road_map.lanes)
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / _MB
    return {"lanes": lanes, "seconds": min(seconds), "sumolib": min(reading), "peak_mb": peak}


def slope(rows: list[dict[str, float]]) -> float:
    """Fit log seconds against log lanes by least squares."""
    x = [math.log(row["lanes"]) for row in rows]
    y = [math.log(row["seconds"]) for row in rows]
    mean_x, mean_y = sum(x) / len(x), sum(y) / len(y)
    spread = sum((a - mean_x) ** 2 for a in x)
    return sum((a - mean_x) * (b - mean_y) for a, b in zip(x, y, strict=True)) / spread


def main() -> int:
    """Measure every network and print a table."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("networks", nargs="*", metavar="NETWORK")
    parser.add_argument("--repeats", type=int, default=3)
    parser.add_argument("--in-process", action="store_true", help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.in_process:
        print(json.dumps(measure(options.networks[0], options.repeats)))
        return 0
    rows = []
    print(
        f"{'network':14}{'lanes':>7}{'seconds':>9}{'lanes/s':>9}{'sumolib s':>11}{'4 x + 3':>9}{'peak MB':>9}"
    )
    for network in options.networks or default_networks():
        command = [sys.executable, __file__, "--in-process", "--repeats", str(options.repeats), network]
        done = subprocess.run(command, check=True, capture_output=True, text=True)  # noqa: S603
        row = json.loads(done.stdout)
        rows.append(row)
        print(
            f"{Path(network).name[:13]:14}{row['lanes']:7}{row['seconds']:9.2f}"
            f"{row['lanes'] / row['seconds']:9.0f}"
            f"{row['sumolib']:11.3f}{4 * row['sumolib'] + 3:9.2f}{row['peak_mb']:9.0f}",
            flush=True,
        )
    if len(rows) > 1:
        print(f"slope of log seconds against log lanes: {slope(rows):.2f}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
