"""What a program asks of maps beside `convert`, each as its command does it: import, check, mend, fill."""

import re
from collections.abc import Callable, Collection, Sequence
from pathlib import Path
from typing import Any

from dojo_maps.bundle import Bundle
from dojo_maps.conversion import ConvertOptions, convert
from dojo_maps.demand import DemandOptions, as_json
from dojo_maps.demand_files import deliver_demand
from dojo_maps.description import RoadMap
from dojo_maps.errors import UsageError
from dojo_maps.inspection import inspect, write_reports
from dojo_maps.issue import Report
from dojo_maps.repair import fixing
from dojo_maps.repair.cost import measure_cost
from dojo_maps.report.phase_diagrams import draw_phases
from dojo_maps.sources import overpass
from dojo_maps.sources.osm import is_osm
from dojo_maps.validation.exclusions import read_exclusions
from dojo_maps.validation.profiles import PROFILES
from dojo_maps.whole_file import write_text

RADIUS = 200.0
"""Metres around a place or a point, unless asked for."""


def import_osm(  # noqa: PLR0913 - an area can be named in several ways
    source: str | Path | None = None,
    folder: str | Path | None = None,
    options: ConvertOptions | None = None,
    *,
    place: str | None = None,
    point: tuple[float, float] | None = None,
    bbox: tuple[float, float, float, float] | None = None,
    radius: float | None = None,
    server: str | None = None,
    on_stage: Callable[[str], None] = lambda _stage: None,
) -> tuple[Bundle, Report]:
    """Build a bundle from OpenStreetMap data: from a file, or from an area that is downloaded once.

    Args:
        source: a file, .osm, .osm.gz, .osm.pbf and so on; or None, and an area instead.
        folder: the bundle to write; by default the map's name with .dojo, in the current folder.
        options: how to convert; None writes an hour of traffic beside the map, too.
        place: the name of a place, such as `Mannerheimintie 2, Helsinki`.
        point: latitude and longitude, degrees.
        bbox: west, south, east and north, degrees.
        radius: metres around the place or the point; None takes 200.
        server: the address of an Overpass server; None takes overpass-api.de.
        on_stage: told what begins.

    Returns:
        The bundle, and its report as JSON values.

    Raises:
        UsageError: not exactly one of file, place, point and box is given, or the area is none.
        SourceError: the file cannot be read, or the area cannot be downloaded.
        DojoError: the import failed; nothing is written then.
    """
    path = find_extract(
        source, place=place, point=point, bbox=bbox, radius=radius, server=server, say=on_stage
    )
    wanted = ConvertOptions(demand=None) if options is None else options
    return convert(path, folder, wanted, on_stage=on_stage)


def find_extract(
    source: str | Path | None,
    *,
    place: str | None,
    point: Sequence[float] | None,
    bbox: Sequence[float] | None,
    radius: float | None,
    server: str | None,
    say: Callable[[str], None],
) -> str:
    """Give the file to import; download the area first where one is named instead.

    Args:
        source: the file; the others are as `import_osm` has them.
        place: a name.
        point: latitude and longitude, degrees.
        bbox: west, south, east and north, degrees.
        radius: metres.
        server: the address of an Overpass server.
        say: told how the download goes.

    Returns:
        The file's path.

    Raises:
        UsageError: not exactly one of file, place, point and box is given, or the area is none.
        SourceError: the area cannot be downloaded.
    """
    if sum(given is not None for given in (source, place, point, bbox)) != 1:
        raise UsageError("give exactly one of a file, a place, a point and a box (bbox)")
    if source is not None:
        for name, value in (("--radius", radius), ("--overpass-url", server)):
            if value is not None:
                raise UsageError(f"{name} says how to download, but a file is given")
        if not is_osm(source):
            raise UsageError(
                f"{source}: not named as OpenStreetMap data is (.osm, .osm.gz, .osm.pbf); "
                "dojo-maps convert takes other maps"
            )
        return str(source)
    if bbox is not None:
        if radius is not None:
            raise UsageError("--radius goes with --place or --point; a box has its own size")
        if len(bbox) != 4:
            raise UsageError(f"bbox={tuple(bbox)}: expected west, south, east and north, in degrees")
        west, south, east, north = bbox
        area, name = overpass.Area(west=west, south=south, east=east, north=north), "box"
    else:
        if point is not None and len(point) != 2:
            raise UsageError(f"point={tuple(point)}: expected latitude and longitude, in degrees")
        latitude, longitude = point if point is not None else overpass.find_place(str(place))
        name = place or _point_name(latitude, longitude)
        area = overpass.area_around(latitude, longitude, RADIUS if radius is None else radius)
    found = overpass.download_area(
        area, name=_file_name(name), server=server or overpass.SERVER, on_pause=say
    )
    say(f"data of {found.date}: {found.path}")
    return str(found.path)


def _point_name(latitude: float, longitude: float) -> str:
    north, east = "SN"[latitude >= 0], "WE"[longitude >= 0]
    return f"{abs(latitude):.5f}{north}-{abs(longitude):.5f}{east}"


def _file_name(name: str) -> str:
    """Make a file's name of a place's: letters and digits of any script, the rest becomes hyphens."""
    return re.sub(r"[^\w.]+|_+", "-", name.lower()).strip("-.")[:60] or "area"


def validate(
    source: str | Path,
    *,
    profile: str = "default",
    exclude: str | Path | None = None,
    json: str | Path | None = None,
    html: str | Path | None = None,
    sarif: str | Path | None = None,
    geojson: str | Path | None = None,
    netedit: str | Path | None = None,
) -> Report:
    """Check a network or a bundle, and write reports where they are wanted.

    Args:
        source: a SUMO network by its path, a packaged scenario's name, or a bundle.
        profile: limits and severities: `default`, `rl` for what a learner cannot drive, or `strict`.
        exclude: a JSON file of known issues to leave out, each with its reason.
        json: a file for the report.
        html: a file for the page, which opens offline.
        sarif: a file for SARIF, with line numbers.
        geojson: a file for the issues as GeoJSON.
        netedit: a folder for netedit's selections and views.

    Returns:
        The report: `counts` by severity, `checks` and `issues`, as report.json has them.

    Raises:
        SourceError: the map or the file of known issues cannot be read.
        UsageError: the profile is unknown, or a file cannot be written there.
    """
    exclusions = read_exclusions(Path(exclude)) if exclude is not None else ()
    if profile not in PROFILES:
        raise UsageError(f"profile={profile!r}: expected one of {', '.join(PROFILES)}")
    read, report = inspect(str(source), PROFILES[profile], exclusions)
    targets = {"json": json, "html": html, "sarif": sarif, "geojson": geojson, "netedit": netedit}
    write_reports(read, report, **{name: Path(path) for name, path in targets.items() if path is not None})
    return report


def fix(
    source: str | Path,
    output: Path | str | None = None,
    *,
    only: Collection[str] = (),
    patch: str | Path | None = None,
) -> dict[str, Any]:
    """Repair a network where that is safe; every byte that no repair concerns stays.

    Args:
        source: a SUMO network by its path, a packaged scenario's name, or a bundle.
        output: the network to write, packed if its name ends in .gz; None writes none.
        only: ids of the checks to repair; none named means all that are repaired unasked.
        patch: a folder for the repairs as SUMO's plain XML.

    Returns:
        `repairs`, what was `left` and why, `checks` and `counts` before and after, and how long generated
        traffic was `waiting`, where that changed.

    Raises:
        SourceError: the map cannot be read.
        UsageError: a check has no repair, or the output cannot be written there.
    """
    fixed = fixing.fix(str(source), only)
    cost = measure_cost(fixed)
    fixing.write_fixed(fixed, _path(output), _path(patch), None, cost)
    return fixing.as_record(fixed, cost)


def add_demand(
    source: str | Path,
    options: DemandOptions | None = None,
    *,
    counts: str | Path | None = None,
    output: str | Path | None = None,
) -> tuple[dict[str, Any], Path]:
    """Write traffic for a map: into a bundle, or beside a SUMO network.

    Args:
        source: a bundle, a SUMO network by its path, or a packaged scenario's name.
        options: what traffic; None for an hour of what the junctions can take.
        counts: a CSV file of counts to meet.
        output: the route file; None for the bundle's own, or NAME.demand.rou.xml in the current folder.

    Returns:
        What was written (numbers of vehicles, walkers and so on), and the path to use as a scenario.

    Raises:
        SourceError: the map or the counts cannot be read, or do not fit each other.
        UsageError: the output cannot be named so, or the options are none.
        DojoError: nobody can drive on the map, or the counts cannot be met.
    """
    if not isinstance(options, DemandOptions | None):
        raise UsageError(f"options={options!r}: expected dojo_maps.DemandOptions(...)")
    demand, start = deliver_demand(
        str(source), options or DemandOptions(), counts=_path(counts), output=_path(output)
    )
    return as_json(demand), start


def _path(given: str | Path | None) -> Path | None:
    return None if given is None else Path(given)


class Diagram:
    """A drawing that shows itself in a notebook.

    Attributes:
        svg: the drawing, as Scalable Vector Graphics.
    """

    def __init__(self, svg: str) -> None:
        """Take a drawing.

        Args:
            svg: as Scalable Vector Graphics.
        """
        self.svg = svg

    def save(self, path: str | Path) -> Path:
        """Write it.

        Args:
            path: of the .svg file.

        Returns:
            The path.

        Raises:
            WriteError: the file cannot be written.
        """
        write_text(Path(path), self.svg)
        return Path(path)

    def _repr_svg_(self) -> str:
        """Give what a notebook shows. Source: IPython's "rich display" protocol."""
        return self.svg

    def __repr__(self) -> str:
        """Tell what there is to do with it."""
        return "Diagram(.save(path) writes .svg)"


def draw_signal(road_map: RoadMap | Bundle, signal: str | None = None) -> Diagram:
    """Draw what may go in each phase of a signal's program, on its junction.

    Args:
        road_map: the map, or its bundle.
        signal: its id; None for the map's only one.

    Returns:
        The drawing: green arrows go first, pale ones yield, bars are people on foot.

    Raises:
        UsageError: the map has no signal of that id, or several and none is named, or it has no phases.
    """
    if isinstance(road_map, Bundle):
        road_map = road_map.road_map
    ids = ", ".join(each.id for each in road_map.signals)
    wanted = [each for each in road_map.signals if signal in (None, each.id)]
    if len(wanted) != 1:
        raise UsageError(
            f"signal={signal!r}: name one of the signals of {road_map.name}: {ids or 'it has none'}"
        )
    svg = draw_phases(road_map, wanted[0])
    if svg is None:
        raise UsageError(f"signal {wanted[0].id}: its program has no phase with green to draw")
    return Diagram(svg)
