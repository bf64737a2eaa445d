"""From a network or bundle to a report: read it, run every check, write what is asked for."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from dojo_maps import bundle
from dojo_maps.description import RoadMap
from dojo_maps.input_files import is_there, read_bytes, sha256_of
from dojo_maps.issue import Issue, Report
from dojo_maps.memory import without_cycle_search
from dojo_maps.meshes.mesh import Mesh
from dojo_maps.report.formats import as_geojson, as_sarif
from dojo_maps.report.netedit import write_netedit_files
from dojo_maps.report.page import write_page
from dojo_maps.sources.files import find_network
from dojo_maps.sources.line_numbers import find_lines
from dojo_maps.sources.sumo_net import read_network
from dojo_maps.sumo_loading import loading
from dojo_maps.validation.exclusions import Exclusion
from dojo_maps.validation.profiles import DEFAULT, Profile
from dojo_maps.validation.runner import run_checks
from dojo_maps.whole_file import replaced


@dataclass(frozen=True, slots=True, kw_only=True)
class Inspected:
    """A network as it was read: where from, its bytes, its description, and what reading found."""

    path: Path
    data: bytes
    road_map: RoadMap
    issues: tuple[Issue, ...]
    meshes: tuple[Mesh, ...] | None


def read_source(source: str) -> Inspected:
    """Read a network by path or name, or the network and the scene of a bundle.

    Args:
        source: a path, a packaged scenario's name, or a bundle.

    Returns:
        What was read.

    Raises:
        SourceError: it cannot be read.
    """
    if is_there(Path(source) / bundle.DESCRIPTION):
        found = bundle.read_bundle(source)
        path, name, meshes = found.network, found.road_map.name, found.read_meshes()
    else:
        path, name = find_network(source)
        meshes = None
    data = read_bytes(path)
    road_map, issues = read_network(data, path=path, name=name, sha256=sha256_of(path))
    return Inspected(path=path, data=data, road_map=road_map, issues=issues, meshes=meshes)


def inspect(
    source: str, profile: Profile = DEFAULT, exclusions: Sequence[Exclusion] = ()
) -> tuple[Inspected, Report]:
    """Check a network or bundle.

    Args:
        source: a path, a packaged scenario's name, or a bundle.
        profile: limits and severities.
        exclusions: known issues to leave out.

    Returns:
        What was read, and the report as JSON values.

    Raises:
        SourceError: it cannot be read.
    """
    with without_cycle_search():
        read = read_source(source)
        with loading(read.data) as sumo:
            report = run_checks(read.road_map, read.meshes, read.issues, profile, exclusions, sumo=sumo)
        return read, report


def write_reports(
    read: Inspected,
    report: dict[str, Any],
    *,
    json: Path | None = None,
    html: Path | None = None,
    sarif: Path | None = None,
    geojson: Path | None = None,
    netedit: Path | None = None,
) -> None:
    """Write a report in each format that has a path; each file whole or not at all.

    Args:
        read: the network.
        report: what was found in it.
        json: a file for the report.
        html: a file for the page.
        sarif: a file for SARIF.
        geojson: a file for the issues as GeoJSON.
        netedit: a folder for netedit's selections and views.

    Raises:
        UsageError: a path is a folder, or lies in none.
        WriteError: a path cannot be written.
    """
    if json is not None:
        with replaced(json) as fresh:
            bundle.write_json(fresh, report)
    if sarif is not None:
        with replaced(sarif) as fresh:
            bundle.write_json(fresh, as_sarif(report, read.path.name, find_lines(read.data)))
    if geojson is not None:
        with replaced(geojson) as fresh:
            bundle.write_json(fresh, as_geojson(report))
    if html is not None:
        with replaced(html) as fresh:
            write_page(report, read.road_map, fresh)
    if netedit is not None:
        write_netedit_files(report, netedit)
