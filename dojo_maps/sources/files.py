"""Find a network, by its path or by the name of a packaged scenario, and list its files."""

import importlib.util
from pathlib import Path

from dojo_maps.errors import SourceError, ToolMissingError
from dojo_maps.input_files import is_there
from dojo_maps.sources.cityflow_files import find_files, is_cityflow
from dojo_maps.sources.osm.read.reading import SUFFIXES as OSM_SUFFIXES
from dojo_maps.wording import did_you_mean

SCENARIO_NETWORKS = {
    "two-way": "nets/2way-single-intersection/single-intersection.net.xml",
    **{
        name: f"nets/RESCO/{name}/{name}.net.xml"
        for name in (
            "cologne1", "cologne3", "cologne8", "ingolstadt1", "ingolstadt7", "ingolstadt21",
            "grid4x4", "arterial4x4",
        )
    },
}  # fmt: skip
"""Networks by name, inside the installed `sumo_rl` package."""

_SUFFIXES = (".net.xml.gz", ".net.xml", *OSM_SUFFIXES, ".xodr.gz", ".xodr", ".xml.gz", ".xml", ".json")


def find_network(name: str) -> tuple[Path, str]:
    """Find a network by its path or by the name of a packaged scenario.

    Args:
        name: a path, or a key of `SCENARIO_NETWORKS`; what lies at the path goes first.

    Returns:
        The file's path and the map's name: the scenario's, or the file's without its suffixes.

    Raises:
        SourceError: there is no such file and no such scenario.
        ToolMissingError: the scenario's package is not installed.
    """
    path = Path(name)
    if is_there(path):
        return path, map_name(path)
    if name not in SCENARIO_NETWORKS:
        meant, known = did_you_mean(name, SCENARIO_NETWORKS), ", ".join(SCENARIO_NETWORKS)
        raise SourceError(name[:255], f"no such file; give a path, or a packaged scenario: {known}{meant}")
    # Importing sumo_rl itself fails where SUMO_HOME is not set.
    spec = importlib.util.find_spec("sumo_rl")
    if spec is None or not spec.submodule_search_locations:
        raise ToolMissingError(f"scenario {name} is part of the package sumo-rl: pip install sumo-rl")
    return Path(spec.submodule_search_locations[0]) / SCENARIO_NETWORKS[name], name


def list_files(source: str | Path) -> list[Path]:
    """List the files that a map is made of: the road network first, then CityFlow's traffic, if any.

    Args:
        source: a network, an extract, or a folder or a configuration of CityFlow's.

    Returns:
        Their paths.

    Raises:
        SourceError: a file cannot be read, or names another that is not there.
    """
    source = Path(source)
    if not is_cityflow(source):
        return [source]
    return [path for path in find_files(source) if path is not None]


def map_name(path: Path) -> str:
    """Name a map after its file: `cologne.net.xml.gz` becomes `cologne`.

    Args:
        path: of the file; only its name counts, and it need not be there.

    Returns:
        The file's name without the longest suffix of a known kind, else without its last one.
    """
    fitting = [suffix for suffix in _SUFFIXES if path.name.endswith(suffix) and path.name != suffix]
    return path.name.removesuffix(max(fitting, key=len)) if fitting else path.stem
