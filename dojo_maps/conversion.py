"""From a network or an extract to a bundle, in named steps: read, furnish, build, check, write."""

import hashlib
import os
import shutil
from collections.abc import Callable, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Literal

from dojo_maps import bundle
from dojo_maps.demand import DemandOptions, as_json, write_demand
from dojo_maps.description import RoadMap
from dojo_maps.drawing import draw
from dojo_maps.edits import reapply_edits
from dojo_maps.errors import DojoError, UsageError, WriteError
from dojo_maps.exports import EXPORTERS
from dojo_maps.input_files import read_bytes, sha256_of
from dojo_maps.issue import Issue, Report
from dojo_maps.memory import without_cycle_search
from dojo_maps.meshes.gltf import write_scene
from dojo_maps.meshes.mesh import Mesh
from dojo_maps.report.overview import draw_overview
from dojo_maps.report.page import write_page
from dojo_maps.serialization import to_json
from dojo_maps.short_repr import short_repr
from dojo_maps.sources import cityflow, opendrive
from dojo_maps.sources.cityflow import CityFlowNetwork
from dojo_maps.sources.cityflow_files import find_files, is_cityflow
from dojo_maps.sources.enrich_net import enrich_network
from dojo_maps.sources.files import find_network
from dojo_maps.sources.geotiff import read_elevations
from dojo_maps.sources.opendrive import OpenDriveNetwork
from dojo_maps.sources.osm import is_osm, read_osm
from dojo_maps.sources.osm.completeness.losses import tell_unread_conditions
from dojo_maps.sources.osm.completeness.score import score_network
from dojo_maps.sources.osm.network.osm_network import OsmNetwork
from dojo_maps.sources.osm.pipeline import build_network
from dojo_maps.sources.osm.read.conditions import UnreadCondition, apply_conditions, read_moment
from dojo_maps.sources.osm.read.country import read_country
from dojo_maps.sources.osm.read.data import OsmData
from dojo_maps.sources.osm.surroundings.props import read_context
from dojo_maps.sources.sumo_net import read_network
from dojo_maps.sumo_loading import Loading, loading
from dojo_maps.validation.runner import run_checks
from dojo_maps.whole_file import write_text


@dataclass(frozen=True, slots=True, kw_only=True)
class ConvertOptions:
    """How to convert.

    Attributes:
        generated: add what the source does not tell of to look at: sidewalks, crossings, surroundings.
        surroundings: whether houses, trees and street lamps are among it.
        enrich_net: add real sidewalks and crossings to the network itself.
        exports: further formats, by their names in `EXPORTERS`.
        jobs: threads for cutting triangles; None takes one per core.
        far_side_signals: give traffic signal heads across the junction, too; None does so for OpenStreetMap
            data of countries that have them.
        demand: vehicles per hour to write beside the map, None for what its junctions can take, 0 for none.
        at: a moment of the week, such as `Mo 08:00`, at which OpenStreetMap's conditional tags are taken;
            None leaves them out and says so.
        drive: left or right, the side that traffic keeps to on OpenStreetMap data; None for its country's.
        terrain: a GeoTIFF of elevations that the streets of OpenStreetMap data follow.
    """

    generated: bool = True
    surroundings: bool = True
    enrich_net: bool = False
    exports: tuple[str, ...] = ()
    jobs: int | None = None
    far_side_signals: bool | None = None
    demand: float | None = 0.0
    at: str | None = None
    drive: Literal["left", "right"] | None = None
    terrain: str | Path | None = None

    __repr__ = short_repr

    def __post_init__(self) -> None:
        """Refuse exports that there are not.

        Raises:
            UsageError: a name is unknown, or it is one text and no tuple of names.
        """
        names = [self.exports] if isinstance(self.exports, str) else list(self.exports)
        if isinstance(self.exports, str) or set(names) - set(EXPORTERS):
            raise UsageError(
                f"exports={self.exports!r}: expected a tuple with some of {', '.join(EXPORTERS)}"
            )


def convert(
    source: str,
    folder: Path | str | None = None,
    options: ConvertOptions | None = None,
    *,
    on_stage: Callable[[str], None] = lambda _stage: None,
) -> tuple[bundle.Bundle, Report]:
    """Convert a SUMO network, an OpenStreetMap extract, an OpenDRIVE or a CityFlow file into a bundle.

    Args:
        source: a path (.net.xml, .osm, .osm.pbf, .xodr, CityFlow's .json and so on) or the name of a packaged
            scenario.
        folder: the bundle to write; by default the map's name with .dojo, in the current folder.
        options: how to convert.
        on_stage: told what begins.

    Returns:
        The bundle, and its report as JSON values; its `exports` tell of each format whether it is written.

    Raises:
        GeometryError: the map's shapes defeat every way to cut them.
        SourceError: the input cannot be read.
        UsageError: the folder is there and is not a bundle.
        DojoError: the conversion failed; nothing is written then.
    """
    options = ConvertOptions() if options is None else options
    if not isinstance(options, ConvertOptions):
        raise UsageError(f"options={options!r}: expected dojo_maps.ConvertOptions(...)")
    path, name = find_network(source)
    folder = Path(folder) if folder is not None else Path(f"{name}.dojo")
    bundle.check_replaceable(folder)
    if options.drive not in (None, "left", "right"):
        raise UsageError(f"--drive {options.drive}: expected left or right")
    if not is_osm(path) and (options.drive, options.terrain) != (None, None):
        raise UsageError("--drive and --terrain are for OpenStreetMap data; other networks say it themselves")
    if options.enrich_net and is_osm(path):
        raise UsageError(
            "--enrich-net is for SUMO networks; an import has sidewalks and crossings of its own"
        )
    if options.at is not None and not is_osm(path):
        raise UsageError("--at is for the conditional tags of OpenStreetMap data; a network has none")
    with without_cycle_search():
        return _convert(path, name, folder, options, on_stage)


def _convert(
    path: Path, name: str, folder: Path, options: ConvertOptions, on_stage: Callable[[str], None]
) -> tuple[bundle.Bundle, Report]:
    on_stage("Reading")
    changes, quality, base, routes, far_side = None, None, None, "", False
    if is_osm(path):
        extract, unread = _read_extract(path, options.at)
        country = read_country(extract, options.drive)
        far_side = country.far_side_signals
        raster = None if options.terrain is None else read_elevations(Path(options.terrain))
        on_stage("Building the network")
        network = build_network(
            extract, path=path, name=name, sha256=sha256_of(path), country=country, raster=raster
        )
        base, described, issues, quality = _import_osm(extract, network, unread, options.at)
        data, lost = reapply_edits(base, folder, (*described.origin, 0.0))
        if data is not base:
            edited, _ = read_network(data, path=path, name=name, sha256=described.source.sha256)
            described = replace(edited, source=described.source, props=described.props)
        issues += lost
    else:
        drawn, kind = _import_other(path, on_stage)
        data = read_bytes(path) if drawn is None else drawn.data
        sha256 = sha256_of(path if drawn is None else drawn.path)
        if options.enrich_net:
            on_stage("Adding sidewalks and crossings to the network")
            data, changes = enrich_network(data, path=path)
        described, issues = read_network(
            data, path=path if drawn is None else drawn.path, name=name, sha256=sha256
        )
        if drawn is not None:
            described = replace(described, source=replace(described.source, kind=kind))
            issues += drawn.issues(described)
            routes = drawn.routes
    source = replace(described.source, network_sha256=hashlib.sha256(data).hexdigest())
    described = replace(described, source=source)
    with ExitStack() as stack:
        sumo = stack.enter_context(loading(data))
        road_map, meshes, uncut = draw(
            described,
            generated=options.generated,
            surroundings=options.surroundings,
            far_side_signals=far_side if options.far_side_signals is None else options.far_side_signals,
            jobs=options.jobs or os.cpu_count() or 1,
            on_stage=on_stage,
        )
        issues += uncut
        fresh = stack.enter_context(bundle.replace_bundle(folder))
        on_stage("Writing")
        (fresh / bundle.NETWORK).write_bytes(data)
        if base not in (None, data):
            (fresh / bundle.BASE_NETWORK).write_bytes(base)
        if changes is not None:
            bundle.write_json(fresh / bundle.ENRICHMENT, changes)
        extra = {} if quality is None else {"osm": quality}
        if options.demand != 0:
            extra |= _add_demand(fresh, road_map, options.demand)
        if routes:
            write_text(fresh / bundle.DEMAND, routes)
        if options.exports:
            extra["exports"] = _export(fresh, road_map, options.exports, on_stage)
        report = _write(fresh, road_map, meshes, issues, extra, sumo)
    return bundle.Bundle(folder=folder, road_map=road_map), report


def _import_other(
    path: Path, on_stage: Callable[[str], None]
) -> tuple[OpenDriveNetwork | CityFlowNetwork | None, str]:
    """Build the network of a file that is neither SUMO's nor OpenStreetMap's, and name what it is."""
    if opendrive.is_opendrive(path):
        on_stage("Building the network")
        return opendrive.build_network(read_bytes(path), path=path), "opendrive"
    if is_cityflow(path):
        on_stage("Building the network")
        roads, traffic = find_files(path)
        return cityflow.build_network(roads, traffic=traffic), "cityflow"
    return None, ""


def _read_extract(path: Path, at: str | None) -> tuple[OsmData, list[UnreadCondition]]:
    """Read an OpenStreetMap extract as it is at a moment; and the conditions that are not understood."""
    moment = None if at is None else read_moment(at)
    extract = read_osm(path)
    return (extract, []) if moment is None else apply_conditions(extract, moment)


def _import_osm(
    extract: OsmData, network: OsmNetwork, unread: Sequence[UnreadCondition], at: str | None
) -> tuple[bytes, RoadMap, tuple[Issue, ...], dict[str, Any]]:
    """Measure the network of an OpenStreetMap extract against the extract, and add what lies beside it."""
    quality, losses = score_network(extract, network)
    losses += tell_unread_conditions(extract, network, unread)
    quality |= {"at": at} if at is not None else {}
    context, notes = read_context(extract, network.road_map)
    source = replace(network.road_map.source, kind="osm")
    described = replace(network.road_map, source=source, props=network.road_map.props + context)
    return network.data, described, network.issues + losses + notes, quality


def _add_demand(folder: Path, road_map: RoadMap, volume: float | None) -> dict[str, Any]:
    """Write traffic beside the network, where there is a junction that it can cross."""
    options = DemandOptions(volume=volume)
    demand = write_demand(road_map, folder / bundle.NETWORK, folder / bundle.DEMAND, options)
    return {} if demand is None else {"demand": as_json(demand)}


def _export(
    folder: Path, road_map: RoadMap, names: tuple[str, ...], on_stage: Callable[[str], None]
) -> dict[str, str]:
    """Write every export; tells of each whether it is "written" or "failed: " and why.

    Raises:
        OSError, WriteError: nothing can be written there, so that the bundle cannot be either.
    """
    states = {}
    for name in names:
        on_stage(f"Exporting {name}")
        target = folder / bundle.EXPORTS / name
        target.mkdir(parents=True)
        try:
            EXPORTERS[name](road_map, target)
            states[name] = "written"
        except (OSError, WriteError):
            raise
        except Exception as error:  # noqa: BLE001 - one format must not cost the map and the others
            shutil.rmtree(target)
            what = str(error) if isinstance(error, DojoError) else f"{type(error).__name__}: {error}"
            states[name] = f"failed: {' '.join(what.split())}"
    return states


def _write(
    folder: Path,
    road_map: RoadMap,
    meshes: tuple[Mesh, ...],
    issues: tuple[Issue, ...],
    extra: dict[str, Any],
    sumo: Loading | None,
) -> Report:
    bundle.write_json(folder / bundle.DESCRIPTION, to_json(road_map))
    write_scene(meshes, folder / bundle.SCENE)
    draw_overview(road_map, meshes, folder / bundle.OVERVIEW)
    report = run_checks(road_map, meshes, issues, sumo=sumo)
    report |= extra
    bundle.write_json(folder / bundle.REPORT, report)
    write_page(report, road_map, folder / bundle.REPORT_PAGE)
    return report
