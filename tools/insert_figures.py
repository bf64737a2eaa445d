"""Write figures into documents, between `<!-- figures: NAME -->` and `<!-- end -->`, from what is kept.

Rows of results come from `tools/results`, sizes of dependencies from what is installed (only where asked for,
since they differ from system to system).
"""

import argparse
import re
import sys
from collections.abc import Callable, Mapping, Sequence
from functools import cache
from importlib import metadata
from pathlib import Path
from typing import Any

from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

from dojo_env.runs import JAMMED
from dojo_maps.input_files import read_bytes
from dojo_maps.safe_json import read_json
from dojo_maps.whole_file import write_text

ROOT = Path(__file__).resolve().parents[1]
RESULTS = ROOT / "tools" / "results"
DOCUMENTS = (ROOT / "README.md", ROOT / "dojo_env" / "docs" / "installing.md")
WAITING_OF_JAMS = 1000
"""Seconds of accumulated waiting from which on a row jams, where no more than means is kept."""
PURPOSES = {
    "eclipse-sumo": "SUMO itself, netconvert, example networks",
    "libsumo": "SUMO inside the process",
    "sumolib": "SUMO's own Python tools",
    "sumo-rl": "the packaged scenarios; it is not imported",
    "numpy": "arrays",
    "numba": "the renderer, compiled",
    "opencv-python-headless": "pictures and films",
    "shapely": "geometry of maps",
    "manifold3d": "watertight solids",
    "trimesh": "meshes",
    "pyproj": "projections",
    "osmium": "OpenStreetMap extracts",
    "osmnx": "places by name (`--place`)",
    "tzfpy": "the country of a place",
    "tzdata": "time zones",
    "gymnasium": "the environment's interface",
    "pettingzoo": "the same for several agents",
    "pybullet": "a second renderer; with Python 3.11 only",
}


def write_cell(
    figures: Mapping[str, Mapping[str, float]], episodes: Sequence[Mapping[str, float]] = ()
) -> str:
    """Write travel time and accumulated waiting, seconds; where an episode jams, also that of all trips."""
    travel, waiting = (figures[name]["mean"] for name in ("travel_time", "accumulated_waiting"))
    jams = any(episode.get("late", 0.0) > JAMMED for episode in episodes)
    everyone = f", all trips {figures['travel_time_all']['mean']:.1f}" if jams else ""
    return f"{travel:.1f}{everyone} / {waiting:.0f}"


def fill_rows(table: str) -> str:
    """Fill in what each row came to on each scenario, or that it has not run; published figures stay."""
    kept = [_read(path) for path in sorted(RESULTS.glob("*/*/figures.json"))]
    found = {(each["scenario"], each["row"]): write_cell(each["figures"], each["episodes"]) for each in kept}

    def cell(row: str, column: str, old: str) -> str:
        if (column, row) not in found:
            return "not run"
        _, bracket, published = old.partition(" (")
        return found[column, row] + bracket + published

    return _fill(table, cell)


def fill_light(table: str) -> str:
    """Fill in what policies came to in other light and weather."""
    rows = {"PPO-BEV, by day": "PPO-BEV", "PPO-BEV, in any light": "PPO-BEV-random",
            "PPO-MV, in any light": "PPO-MV-random"}  # fmt: skip

    def cell(row: str, column: str, _old: str) -> str:
        under = _read(RESULTS / "cologne1" / rows[row] / "robustness.json")["under"]
        figures = under[column.replace(" ", "-")]["figures"]
        return "jams" if figures["accumulated_waiting"]["mean"] >= WAITING_OF_JAMS else write_cell(figures)

    return _fill(table, cell)


def list_dependencies(_table: str) -> str:
    """List what is installed for what, largest first: each with what it alone brings along."""
    brought = {name: frozenset(_list_brought(name)) for name in PURPOSES}
    sizes = {}
    for name, packages in brought.items():
        others = frozenset[str]().union(*(each for other, each in brought.items() if other != name))
        sizes[name] = sum(_measure(package) for package in {name, *(packages - others)})
    lines = [f"| `{name}` | {size / 1e6:.0f} | {PURPOSES[name]} |" for name, size in
             sorted(sizes.items(), key=lambda item: -item[1])]  # fmt: skip
    return "\n".join(["| package | MB | for |", "|---|---|---|", *lines])


TABLES: Mapping[str, Callable[[str], str]] = {
    "rows": fill_rows, "light": fill_light, "dependencies": list_dependencies,
}  # fmt: skip


def insert_figures(text: str, names: tuple[str, ...]) -> str:
    """Write tables anew.

    Args:
        text: of a document.
        names: of the tables that are written; others stay.

    Returns:
        The text with its tables.
    """

    def insert(found: re.Match[str]) -> str:
        name, table = found[1], found[2].strip()
        return f"<!-- figures: {name} -->\n{TABLES[name](table) if name in names else table}\n<!-- end -->"

    return re.sub(r"<!-- figures: (\w+) -->\n(.*?)<!-- end -->", insert, text, flags=re.DOTALL)


def _fill(table: str, cell: Callable[[str, str, str], str]) -> str:
    head, rule, *lines = table.splitlines()
    columns = _cells(head)[1:]
    filled = []
    for line in lines:
        row, *old = _cells(line)
        new = [cell(row, column, text) for column, text in zip(columns, old, strict=True)]
        filled.append(f"| {' | '.join([row, *new])} |")
    return "\n".join([head, rule, *filled])


def _cells(line: str) -> list[str]:
    return line.strip("| ").split(" | ")


@cache
def _read(path: Path) -> Any:
    return read_json(path)


def _list_brought(name: str, known: frozenset[str] = frozenset()) -> frozenset[str]:
    """List a package and all that it requires here."""
    if name in known:
        return known
    known |= {name}
    for text in metadata.requires(name) or ():
        needed = Requirement(text)
        if needed.marker is None or needed.marker.evaluate({"extra": ""}):
            known = _list_brought(canonicalize_name(needed.name), known)
    return known


def _measure(name: str) -> int:
    """Sum up the bytes of a package's files."""
    files = metadata.distribution(name).files or ()
    return sum(Path(file.locate()).stat().st_size for file in files if Path(file.locate()).is_file())


def main() -> int:
    """Write the documents."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--dependencies", action="store_true", help="also measure what is installed")
    names = ("rows", "light") + (("dependencies",) if parser.parse_args().dependencies else ())
    for document in DOCUMENTS:
        text = read_bytes(document).decode()
        write_text(document, insert_figures(text, names))
        print(document.relative_to(ROOT))
    return 0


if __name__ == "__main__":
    sys.exit(main())
