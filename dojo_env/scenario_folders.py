"""Scenarios of other projects by their path: RESCO's and LibSignal's folders, and CityFlow's files.

A folder is searched for what simulators are started with, in this order: one SUMO configuration; one SUMO
network with its routes; one road network of CityFlow's with its flows. LibSignal's own files of settings
(`configs/sim/*.cfg`) name these three.
"""

from pathlib import Path

import dojo_maps
from dojo_env.cache import convert_once
from dojo_env.elements import read_elements
from dojo_env.errors import ScenarioError
from dojo_env.notes import say_once
from dojo_maps.bundle import DEMAND, DESCRIPTION, REPORT
from dojo_maps.input_files import find_named
from dojo_maps.safe_json import read_json
from dojo_maps.safe_xml import Attributes
from dojo_maps.signals.programs import read_seconds

_CONFIGURATIONS = (".sumocfg", ".sumocfg.xml")
NETWORKS = (".net.xml", ".net.xml.gz")
"""What the names of SUMO networks end in."""
_ROUTES = (".rou.xml", ".rou.xml.gz")


def is_other_project_s(path: Path) -> bool:
    """Tell whether this is a folder of a scenario, or a file of settings of CityFlow's or LibSignal's.

    Args:
        path: of a folder or a file.

    Returns:
        Whether it is.
    """
    if (path / DESCRIPTION).exists():
        return False  # A bundle, which lacks demand.
    if path.is_dir():
        return bool(_list(path, _CONFIGURATIONS) or _list(path, NETWORKS)) or _is_cityflow(path)
    return _is_cityflow(path)


def find_start(path: Path) -> tuple[Path, tuple[Path, ...]]:
    """Find what a scenario is started with.

    Args:
        path: of the folder, or of a file of settings.

    Returns:
        A SUMO configuration alone; or a network, or a bundle, and its route files.

    Raises:
        ScenarioError: there is nothing to start, or more than one thing.
        SourceError: a file of CityFlow's is not what it claims to be.
    """
    if path.is_dir():
        if configurations := _list(path, _CONFIGURATIONS):
            return _only(path, configurations, "SUMO configuration"), ()
        if networks := _list(path, NETWORKS):
            return _only(path, networks, "SUMO network"), (_first_routes(path),)
    else:
        named = _read_settings(path)
        if named is not None:
            return named
    bundle = _convert(path)
    return bundle, (bundle / DEMAND,)


def first_departure(routes: Path) -> float:
    """Find when the first vehicle, flow or person of a route file departs, seconds.

    Args:
        routes: the file.

    Returns:
        Seconds; 0 where nobody departs.

    Raises:
        ScenarioError: it cannot be read.
    """
    found: list[float] = []

    def visit(name: str, attributes: Attributes) -> None:
        time = attributes.get("depart", attributes.get("begin", ""))
        if name in {"vehicle", "trip", "flow", "person", "personFlow"} and time[:1].isdigit():
            found.append(read_seconds(time))

    read_elements(routes, visit)
    return min(found, default=0.0)


def _read_settings(path: Path) -> tuple[Path, tuple[Path, ...]] | None:
    """Read which of SUMO's files LibSignal's settings name; None where they name CityFlow's."""
    value = read_json(path, error=ScenarioError)
    network = value.get("roadnetFile") if isinstance(value, dict) else None
    if not isinstance(network, str) or not network.endswith(NETWORKS):
        return None
    folder = value.get("dir") if isinstance(value.get("dir"), str) else ""
    configuration, flows = value.get("combined_file"), value.get("flowFile")
    if isinstance(configuration, str):
        return find_named(path, folder, configuration), ()
    if not isinstance(flows, str):
        raise ScenarioError(path, "names a SUMO network and neither combined_file nor flowFile; add one")
    return find_named(path, folder, network), (find_named(path, folder, flows),)


def _list(folder: Path, endings: tuple[str, ...]) -> list[Path]:
    return sorted(path for path in folder.iterdir() if path.name.endswith(endings))


def _only(folder: Path, found: list[Path], what: str) -> Path:
    if len(found) > 1:
        names = ", ".join(path.name for path in found)
        raise ScenarioError(folder, f"has more than one {what}; give one of them instead: {names}")
    return found[0]


def _first_routes(folder: Path) -> Path:
    """Take the only route file, or of RESCO's numbered ones the first."""
    found = sorted(_list(folder, _ROUTES), key=lambda path: (len(path.name), path.name))
    if not found:
        raise ScenarioError(folder, "has a SUMO network and no routes (.rou.xml); give route_file")
    if len(found) > 1:
        say_once(
            f"{folder.name}: takes {found[0].name} of {len(found)} route files; route_file names another"
        )
    return found[0]


def _convert(path: Path) -> Path:
    """Convert CityFlow's files into the cache, once, and tell what is lost."""
    roads, *traffic = dojo_maps.list_files(path)
    if not traffic:
        raise ScenarioError(path, "a road network alone has no traffic; name both in a configuration")
    folder = convert_once(path)
    for issue in read_json(folder / REPORT)["issues"]:
        if issue["check"] == "sumo.cityflow_lost":
            say_once(f"{roads.name}: {issue['message']}")
    return folder


def _is_cityflow(path: Path) -> bool:
    return path.name.endswith((".json", ".cfg")) or (path.is_dir() and any(path.glob("*roadnet*.json")))
