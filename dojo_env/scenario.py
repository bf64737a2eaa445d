"""What is simulated: a map, its demand and its time; the packaged scenarios by name; any .sumocfg, as data.

A network that is not yet a bundle is converted on first use, into a cache of the user's.
"""

import importlib.util
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

from dojo_env.cache import cache_folder, convert_once, writing_cache
from dojo_env.demand import write_two_way_demand
from dojo_env.elements import read_elements
from dojo_env.errors import ConfigError, ScenarioError
from dojo_env.notes import say_once
from dojo_env.scenario_folders import NETWORKS, find_start, first_departure, is_other_project_s
from dojo_env.sumo_options import ROOTS, Configuration, read_configuration
from dojo_maps.bundle import DEMAND, DESCRIPTION, JUNCTION_BLOCKER, NETWORK, REPORT, Bundle, open_bundle
from dojo_maps.demand.patterns import Pattern, find_pattern, split_pattern
from dojo_maps.input_files import is_there
from dojo_maps.safe_json import read_json
from dojo_maps.short_repr import short_repr
from dojo_maps.signals.programs import read_seconds
from dojo_maps.wording import did_you_mean

Files = str | Path | Sequence[str | Path]
LETS_THROUGH = "sumo_outputs, or --sumo-outputs FOLDER, lets outputs through"


@dataclass(frozen=True, slots=True, kw_only=True)
class Scenario:
    """A map with its demand.

    Attributes:
        map: a bundle's folder, or a SUMO network, which is converted on first use.
        routes: route files.
        additional: additional files.
        pattern: draws each episode's traffic by its seed, in place of route files: a pattern, the name of a
            packaged one, or a `.toml` file.
        begin: simulated seconds at which an episode begins.
        end: seconds at which the demand ends; None where it is not known.
        config: a .sumocfg whose options hold where nothing else is said, as far as a simulation needs them.
        name: shown in tables.
        licence: of the network and the demand.
        options: SUMO's, by its own names, that hold where nothing else is said; those of `config`, if given.
        outputs: what `config` wants written; it is, where the user names a folder.
        left_out: the names of all else that `config` asks for.
    """

    map: Path
    routes: tuple[Path, ...] = ()
    additional: tuple[Path, ...] = ()
    pattern: Pattern | None = None
    begin: float = 0.0
    end: float | None = None
    config: Path | None = None
    name: str = ""
    licence: str = ""
    options: Mapping[str, str] = field(default_factory=dict)
    outputs: Mapping[str, str] = field(init=False, default_factory=dict)
    left_out: tuple[str, ...] = field(init=False, default=())

    __repr__ = short_repr

    def __post_init__(self) -> None:
        """Accept plain strings and single files, and refuse files that are not there."""
        object.__setattr__(self, "map", Path(self.map))
        object.__setattr__(self, "routes", _paths(self.routes))
        object.__setattr__(self, "additional", _paths(self.additional))
        object.__setattr__(self, "name", self.name or self.map.name.split(".")[0])
        if self.pattern is not None:
            self._settle_pattern(self.pattern)
        if self.config is not None:
            object.__setattr__(self, "config", Path(self.config))
            self._take(read_configuration(self.config))
        for path in (self.map, *self.routes, *self.additional):
            if not is_there(path):
                raise ScenarioError(path, f"scenario {self.name}: does not exist; correct the path")
        if self.end is not None and self.end <= self.begin:
            raise ConfigError(
                f"scenario {self.name}: it ends at {self.end} s, before it begins at {self.begin} s"
            )

    def _settle_pattern(self, pattern: Pattern | str | Path) -> None:
        if self.routes:
            raise ConfigError(f"scenario {self.name}: a pattern draws all of its traffic; leave routes out")
        if not isinstance(pattern, Pattern):
            object.__setattr__(self, "pattern", find_pattern(pattern))

    def _take(self, configuration: Configuration) -> None:
        files = configuration.files
        own = () if self.pattern is not None else files.get("route-files", ())
        object.__setattr__(self, "routes", self.routes or own)
        object.__setattr__(self, "additional", self.additional or files.get("additional-files", ()))
        for name in ("options", "outputs", "left_out"):
            object.__setattr__(self, name, getattr(configuration, name))

    def describe_left_out(self, *, outputs: bool) -> list[str]:
        """Tell in a line, if any, what of the configuration does not hold.

        Args:
            outputs: whether its outputs do.

        Returns:
            One line, or none.
        """
        names = (*self.left_out, *(() if outputs else self.outputs))
        if self.config is None or not names:
            return []
        hint = f"; {LETS_THROUGH}" if self.outputs and not outputs else ""
        return [f"{self.config.name}: left out {', '.join(names)}{hint}"]


@dataclass(frozen=True, slots=True, kw_only=True)
class PackagedScenario:
    """A scenario whose files another installed package holds."""

    name: str
    network: str
    routes: str
    begin: float
    licence: str


_COLOGNE, _GRID, _INGOLSTADT = "CC BY-NC-SA 4.0", "CC BY-NC-ND 4.0", "GPL-3.0"
_RESCO = (
    ("cologne1", "cologne1", 25200, _COLOGNE),
    ("cologne3", "cologne3", 25200, _COLOGNE),
    ("cologne8", "cologne8", 25200, _COLOGNE),
    ("ingolstadt1", "ingolstadt1", 57600, _INGOLSTADT),
    ("ingolstadt7", "ingolstadt7", 57600, _INGOLSTADT),
    ("ingolstadt21", "ingolstadt21", 57600, _INGOLSTADT),
    ("grid4x4", "grid4x4_1", 0, _GRID),
    ("arterial4x4", "arterial4x4_1", 0, _GRID),
)
PACKAGED = {
    "two-way": PackagedScenario(
        name="two-way",
        network="2way-single-intersection/single-intersection.net.xml",
        routes="",
        begin=0,
        licence="MIT",
    ),
    **{
        name: PackagedScenario(
            name=name,
            network=f"RESCO/{name}/{name}.net.xml",
            routes=f"RESCO/{name}/{routes}.rou.xml",
            begin=begin,
            licence=licence,
        )
        for name, routes, begin, licence in _RESCO
    },
}
"""Scenarios by name, inside the installed `sumo_rl` package; each lasts 3,600 s."""
_DURATION = 3600
_LATE = 600.0
"""Seconds; whose first vehicle departs later begins in the minute in which it does."""


def find_scenario(value: str | Path | Scenario, *, routes: Files | None = None) -> Scenario:
    """Find a scenario.

    Args:
        value: a scenario; a packaged one's name; or the path of a .sumocfg, of a bundle that holds its
            demand, of RESCO's or LibSignal's folder, or of CityFlow's files; or one of these or any map, a
            hyphen, and the name of a packaged pattern, as in `cologne1-surges`.
        routes: files to drive in place of its own; a bundle or a network alone will do then.

    Returns:
        The scenario.

    Raises:
        ConfigError: there is none of that name, or the path alone names no demand.
    """
    if routes is not None:
        path = Path(value) if isinstance(value, str | Path) else None
        alone = path is not None and ((path / DESCRIPTION).is_file() or path.name.endswith(NETWORKS))
        return _with_routes(Scenario(map=path) if path and alone else find_scenario(value), _paths(routes))
    if isinstance(value, Scenario):
        return value
    if not isinstance(value, str | Path):
        raise ConfigError(f"scenario={value!r}: expected a name, a path or a Scenario")
    if str(value) in PACKAGED:
        return packaged_scenario(str(value))
    path = Path(value)
    base, pattern = split_pattern(str(value))
    if pattern and (base in PACKAGED or not is_there(path)):
        found = find_map(base)
        return replace(found, routes=(), pattern=find_pattern(pattern), name=f"{found.name}-{pattern}")
    return _read_scenario(path)


def _read_scenario(path: Path) -> Scenario:
    """Find the scenario of a path.

    Raises:
        ConfigError: it names no demand, or nothing.
    """
    if _is_configuration(path):
        return _read_sumocfg(path)
    if is_there(path / DEMAND):
        begin, end = _read_times(path / REPORT)
        options = {"ignore-junction-blocker": JUNCTION_BLOCKER}
        return Scenario(map=path, routes=(path / DEMAND,), begin=begin, end=end, options=options)
    if is_there(path) and is_other_project_s(path):
        return _read_folder(path)
    if is_there(path):
        if not (path / DESCRIPTION).is_file() and not path.name.endswith(NETWORKS):
            raise ConfigError(
                f"{path}: no scenario; expected a .sumocfg, a bundle of dojo-maps, or a folder of RESCO's or "
                "LibSignal's"
            )
        raise ConfigError(
            f"{path}: a map alone has no demand; write some with dojo-maps demand {path}, or name route "
            "files with routes= or --routes"
        )
    meant, known = did_you_mean(str(path), PACKAGED), ", ".join(PACKAGED)
    raise ConfigError(
        f"scenario {str(path)!r} is not known; give a bundle, a .sumocfg, a Scenario, or one of "
        f"{known}{meant}"
    )


def find_map(value: str | Path) -> Scenario:
    """Find a map, with or without demand: a scenario's, or any bundle or network by path.

    Args:
        value: a scenario's name, or a path.

    Returns:
        A scenario, which may lack routes.

    Raises:
        ConfigError: there is none.
    """
    path = Path(value)
    if str(value) in PACKAGED or _is_configuration(path) or not is_there(path):
        return find_scenario(value)
    return Scenario(map=path)


def packaged_scenario(name: str) -> Scenario:
    """Build a packaged scenario from the installed sumo-rl package, which is not imported.

    Args:
        name: one of `PACKAGED`.

    Returns:
        The scenario.

    Raises:
        ConfigError: the package is not installed, or lacks the files.
    """
    entry = PACKAGED[name]
    spec = importlib.util.find_spec("sumo_rl")
    if spec is None or not spec.submodule_search_locations:
        raise ConfigError(f"scenario {name} is part of the package sumo-rl: pip install sumo-rl")
    nets = Path(spec.submodule_search_locations[0]) / "nets"
    with writing_cache():
        routes = nets / entry.routes if entry.routes else write_two_way_demand(cache_folder())
    return Scenario(
        map=nets / entry.network,
        routes=(routes,),
        begin=entry.begin,
        end=entry.begin + _DURATION,
        name=name,
        licence=entry.licence,
    )


def open_map(scenario: Scenario, *, on_stage: Callable[[str], None] = lambda _stage: None) -> Bundle:
    """Read the scenario's bundle; convert its network into the cache first where there is none.

    Args:
        scenario: whose map it is.
        on_stage: told what begins, where it is converted.

    Returns:
        The bundle.

    Raises:
        SourceError: the map is neither a whole bundle of this version nor a readable network.
        ConfigError: the cache cannot be written.
    """
    if scenario.map.is_dir():
        return open_bundle(scenario.map)
    return open_bundle(convert_once(scenario.map, on_stage=on_stage))


def with_files(
    scenario: Scenario, *, net_file: str | Path | None = None, route_file: Files | None = None
) -> Scenario:
    """Replace a scenario's network or routes.

    Args:
        scenario: to start from.
        net_file: the network; None keeps the scenario's.
        route_file: one or several; None keeps the scenario's.

    Returns:
        The other scenario.
    """
    changed = scenario if net_file is None else replace(scenario, map=Path(net_file))
    return changed if route_file is None else replace(changed, routes=_paths(route_file))


def _with_routes(scenario: Scenario, routes: tuple[Path, ...]) -> Scenario:
    """Replace a scenario's routes; where they belong to another time of the day, it begins with them."""
    changed = replace(scenario, routes=routes)
    _check_roads(changed)
    first = min((first_departure(path) for path in routes), default=scenario.begin)
    if scenario.begin <= first < scenario.begin + _LATE:
        return changed
    begin = first // 60 * 60 if first >= _LATE else 0.0
    say_once(f"{routes[0].name}: begins at {begin:g} s, as its first vehicle departs at {first:g} s")
    return replace(changed, begin=begin, end=scenario.end and begin + scenario.end - scenario.begin)


def _check_roads(scenario: Scenario) -> None:
    """Refuse routes of another map."""
    network = scenario.map / NETWORK if scenario.map.is_dir() else scenario.map
    roads: set[str] = set()
    if network.name.endswith(NETWORKS):
        read_elements(network, lambda name, of: roads.add(of.get("id", "")) if name == "edge" else None)

    def visit(name: str, attributes: dict[str, str]) -> None:
        named = attributes.get("edges", "").split() if name in {"route", "walk"} else []
        if name in {"trip", "flow", "walk", "personTrip"}:
            named += [attributes[end] for end in ("from", "to") if end in attributes]
        for road in named:
            if road not in roads:
                raise ScenarioError(
                    path,
                    f"leads over {road!r}, which {scenario.name} does not have; give routes of its own",
                )

    for path in scenario.routes if roads else ():
        read_elements(path, visit)


def _read_times(report: Path) -> tuple[float, float]:
    """Read when the demand of a bundle begins and ends, seconds; an hour from 0 on where it is not told."""
    value = read_json(report, error=ScenarioError) if is_there(report) else {}
    demand = value.get("demand") if isinstance(value, dict) else None
    times = [demand.get(name) for name in ("begin", "end")] if isinstance(demand, dict) else [None, None]
    if times == [None, None]:
        return 0.0, float(_DURATION)
    begin, end = (float(time) if isinstance(time, int | float) else math.nan for time in times)
    if not 0 <= begin < end < math.inf:
        raise ScenarioError(report, f"its demand begins at {times[0]!r} and ends at {times[1]!r}, no seconds")
    return begin, end


def _paths(files: Files) -> tuple[Path, ...]:
    """List files given as one path, as SUMO's comma-separated text, or as a sequence."""
    if isinstance(files, str):
        return tuple(Path(name.strip()) for name in files.split(",") if name.strip())
    return (files,) if isinstance(files, Path) else tuple(Path(file) for file in files)


def _read_folder(path: Path) -> Scenario:
    """Make a scenario of another project's folder or file."""
    start, routes = find_start(path)
    if not routes:
        return _read_sumocfg(start)
    first = first_departure(routes[0])
    begin = first // 60 * 60 if first >= _LATE else 0.0
    if begin:
        say_once(f"{path.name}: begins at {begin:g} s, as its first vehicle departs at {first:g} s")
    name = path.name.split(".")[0]
    return Scenario(map=start, routes=routes, begin=begin, end=begin + _DURATION, name=name)


def _is_configuration(path: Path) -> bool:
    """Tell by name, or else by its root element, whether a file is a configuration of SUMO's."""
    return path.name.endswith((".sumocfg", ".sumocfg.xml")) or _read_root(path) in ROOTS


class _RootFoundError(Exception):
    """Reading may end: the root element is known."""


def _read_root(path: Path) -> str:
    """Find the name of an XML file's root element; "" where there is none."""

    def stop(name: str, _: dict[str, str]) -> None:
        raise _RootFoundError(name)

    try:
        if path.is_file():
            read_elements(path, stop)
    except _RootFoundError as found:
        return str(found)
    except (ConfigError, OSError):
        return ""  # Who reads it as what it is will say what is wrong.
    return ""


def _read_sumocfg(path: Path) -> Scenario:
    """Make a scenario of a SUMO configuration."""
    configuration = read_configuration(path)
    networks = configuration.files.get("net-file", ())
    if len(networks) != 1:
        raise ScenarioError(path, f"names {len(networks)} networks; give one, as <net-file value='...'/>")
    try:
        begin, end = (read_seconds(configuration.options.get(name, "-1")) for name in ("begin", "end"))
    except ValueError:
        raise ScenarioError(path, "begin and end must be seconds, h:m:s or d:h:m:s") from None
    return Scenario(
        map=networks[0],
        begin=max(begin, 0.0),
        end=end if end >= 0 else None,
        config=path,
        name=path.name.split(".")[0],
    )
