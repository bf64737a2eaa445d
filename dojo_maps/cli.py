"""The command `dojo-maps`. Results go to standard output, everything else to standard error."""

import argparse
import sys
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING

from dojo_maps.cli_area import add_area_options, join_signed
from dojo_maps.cli_demand import add_demand, read_volume
from dojo_maps.command import Parser, add_command, run_command
from dojo_maps.progress import Progress
from dojo_maps.wording import counted

if TYPE_CHECKING:
    from dojo_maps.bundle import Bundle
    from dojo_maps.viewer import Playback

EXPORT_NAMES = ("metadrive", "opendrive", "geojson", "lanelet2")
_PROFILES = ("default", "rl", "strict")
_REPORTS = {"json": "the report", "html": "a page", "sarif": "SARIF", "geojson": "the issues as GeoJSON"}


def main(arguments: Sequence[str] | None = None) -> int:
    """Run a command and return its exit status; see `command`.

    Args:
        arguments: None for the process's own.

    Returns:
        The exit status.
    """
    return run_command(
        "dojo-maps", build_parser, join_signed(sys.argv[1:] if arguments is None else arguments)
    )


def build_parser() -> argparse.ArgumentParser:
    """Declare the commands and what each takes.

    Returns:
        The parser, which sets `run` to a command's function.
    """
    parser = Parser(prog="dojo-maps", description="Road maps for vision-based traffic signal control.")
    commands = parser.add_subparsers(required=True, metavar="COMMAND")

    convert = add_command(
        commands,
        "convert",
        _convert,
        "turn a SUMO network, OpenStreetMap data or OpenDRIVE into a bundle",
        example="dojo-maps convert cologne1 -o cologne1.dojo --export geojson",
    )
    convert.add_argument(
        "source",
        metavar="NET_OR_OSM",
        help=".net.xml, .net.xml.gz, .osm, .osm.gz, .osm.pbf, .xodr, or a packaged scenario such as cologne1",
    )
    convert.add_argument(
        "--enrich-net",
        action="store_true",
        help="give the network itself sidewalks and crossings, keep its programs",
    )
    _add_bundle_options(convert)

    import_osm = add_command(
        commands,
        "import-osm",
        _import_osm,
        "build a bundle from OpenStreetMap data",
        example="dojo-maps import-osm --point 60.1699,24.9385 --radius 150 -o junction.dojo",
    )
    add_area_options(import_osm)
    import_osm.add_argument(
        "--demand",
        metavar="VEH_PER_HOUR",
        type=read_volume,
        help="vehicles in all (default: what the junctions can take; 0 for none)",
    )
    _add_bundle_options(import_osm)

    add_demand(commands)

    keep = add_command(
        commands,
        "keep",
        _keep,
        "keep what was changed in netedit for the next import",
        example="dojo-maps keep junction.dojo fixed.net.xml",
    )
    keep.add_argument("bundle", metavar="BUNDLE", type=Path)
    keep.add_argument("edited", metavar="NET", type=Path, help="the bundle's network as netedit saved it")

    view = add_command(
        commands,
        "view",
        _view,
        "show a map's 3D scene in the browser",
        example="dojo-maps view cologne1",
    )
    view.add_argument(
        "source",
        metavar="NET_OR_BUNDLE",
        help="a bundle; networks and packaged names are converted first",
    )
    view.add_argument(
        "--recording",
        metavar="FILE",
        type=Path,
        help="play an episode in it that dojo-env run --record wrote",
    )
    view.add_argument(
        "-o", "--output", metavar="FILE", type=Path, help="write the page here and open nothing"
    )

    validate = add_command(
        commands,
        "validate",
        _validate,
        "check a network or a bundle",
        example="dojo-maps validate cologne1 --html report.html",
    )
    validate.add_argument(
        "source", metavar="NET_OR_BUNDLE", help="a network, a packaged scenario or a bundle"
    )
    for name, what in _REPORTS.items():
        validate.add_argument(f"--{name}", metavar="FILE", type=Path, help=f"write {what} here")
    validate.add_argument("--netedit", metavar="FOLDER", type=Path, help="write selections and views here")
    validate.add_argument("--profile", choices=_PROFILES, default=_PROFILES[0], help="limits and severities")
    validate.add_argument("--exclude", metavar="FILE", type=Path, help="known issues to leave out, as JSON")
    validate.add_argument("--strict", action="store_true", help="exit with 1 on warnings, too")

    fix = add_command(
        commands,
        "fix",
        _fix,
        "repair a network where that is safe",
        example="dojo-maps fix arterial4x4 -o mended.net.xml --patch patch",
    )
    fix.add_argument("source", metavar="NET_OR_BUNDLE", help="a network, a packaged scenario or a bundle")
    fix.add_argument("-o", "--output", metavar="NET", type=Path, help="the network to write")
    fix.add_argument(
        "--only", metavar="CHECK", nargs="+", action="extend", default=[], help="repair these checks only"
    )
    fix.add_argument("--dry-run", action="store_true", help="show the patch and the counts, write no network")
    fix.add_argument("--patch", metavar="FOLDER", type=Path, help="write the patch here, as plain XML files")
    fix.add_argument("--json", metavar="FILE", type=Path, help="write what was done, and what it cost, here")

    add_command(commands, "checks", _list_checks, "list the checks", example="dojo-maps checks")
    return parser


def _add_bundle_options(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "-o", "--output", metavar="DIR", type=Path, help="the bundle to write (default: NAME.dojo)"
    )
    parser.add_argument(
        "--no-generated",
        action="store_true",
        help="add no sidewalks, crossings and surroundings that the source does not tell of",
    )
    parser.add_argument(
        "--no-surroundings",
        action="store_true",
        help="add no houses, trees and street lamps that the source does not tell of",
    )
    parser.add_argument(
        "--far-side-signals",
        action=argparse.BooleanOptionalAction,
        help="signal heads across the junction, too (default: where OpenStreetMap data's country has them)",
    )
    parser.add_argument(
        "--at",
        metavar="DAY_TIME",
        help="take OpenStreetMap's conditional tags as they are at, say, 'Mo 08:00' (default: left out)",
    )
    parser.add_argument(
        "--drive",
        choices=("left", "right"),
        help="the side that OpenStreetMap data's traffic keeps to (default: the country's)",
    )
    parser.add_argument(
        "--terrain",
        metavar="FILE.tif",
        type=Path,
        help="a GeoTIFF of elevations that the streets of OpenStreetMap data follow",
    )
    parser.add_argument(
        "--export", nargs="+", action="extend", default=[], choices=EXPORT_NAMES, help="also write"
    )
    parser.add_argument("--jobs", metavar="N", type=_positive, help="threads to use (default: one per core)")
    parser.add_argument("--strict", action="store_true", help="exit with 1 on warnings, too")


def _positive(text: str) -> int:
    with suppress(ValueError):
        if int(text) > 0:
            return int(text)
    raise argparse.ArgumentTypeError(f"{text!r}: expected a whole number above 0")


def _convert(options: argparse.Namespace) -> int:
    from dojo_maps.bundle import REPORT_PAGE
    from dojo_maps.conversion import ConvertOptions, convert

    wanted = ConvertOptions(
        generated=not options.no_generated,
        surroundings=not options.no_surroundings,
        enrich_net=options.enrich_net,
        exports=tuple(dict.fromkeys(options.export)),
        jobs=options.jobs,
        far_side_signals=options.far_side_signals,
        demand=getattr(options, "demand", 0.0),
        at=options.at,
        drive=options.drive,
        terrain=options.terrain,
    )
    written, report = convert(options.source, options.output, wanted, on_stage=Progress(quiet=options.quiet))
    road_map, counts = written.road_map, report["counts"]
    print(
        f"written to {written.folder}; {report}, see {written.folder / REPORT_PAGE}; {road_map.tell_size()}"
    )
    if "demand" in report:
        vehicles, walkers, bicycles = (
            counted(report["demand"][f"{name}s"], name) for name in ("vehicle", "walker", "bicycle")
        )
        cycling = f", {bicycles}" if report["demand"]["bicycles"] else ""
        print(f"demand: {vehicles} and {walkers}{cycling} in an hour")
    failed = {name: state for name, state in report.get("exports", {}).items() if state != "written"}
    for name, state in failed.items():
        print(f"dojo-maps: export {name} {state}; the rest is written", file=sys.stderr)
    return 4 if failed else int(counts["error"] > 0 or (options.strict and counts["warning"] > 0))


def _validate(options: argparse.Namespace) -> int:
    from dojo_maps.inspection import inspect, write_reports
    from dojo_maps.report.formats import as_text
    from dojo_maps.validation.exclusions import read_exclusions
    from dojo_maps.validation.profiles import PROFILES

    exclusions = read_exclusions(options.exclude) if options.exclude else ()
    read, report = inspect(options.source, PROFILES[options.profile], exclusions)
    targets = {name: getattr(options, name) for name in (*_REPORTS, "netedit")}
    write_reports(read, report, **targets)
    for line in as_text(report):
        print(line)
    counts = report["counts"]
    return int(counts["error"] > 0 or (options.strict and counts["warning"] > 0))


def _fix(options: argparse.Namespace) -> int:
    from dojo_maps.errors import UsageError
    from dojo_maps.repair.cost import measure_cost
    from dojo_maps.repair.fixing import describe, fix, patch_of, write_fixed

    if options.output is None and not options.dry_run:
        raise UsageError("name the network to write with -o, or look at what would be done with --dry-run")
    fixed = fix(options.source, options.only)
    cost = measure_cost(fixed)
    if options.dry_run:
        for name, text in patch_of(fixed, cost).items():
            print(f"--- {name}\n{text}", end="")
    write_fixed(fixed, None if options.dry_run else options.output, options.patch, options.json, cost)
    for line in describe(fixed, cost):
        print(line)
    return int(any(issue.severity == "error" for issue in fixed.after.issues))


def _import_osm(options: argparse.Namespace) -> int:
    from dojo_maps.operations import find_extract

    def say(message: str) -> None:
        if not options.quiet:
            print(f"dojo-maps: {message}", file=sys.stderr)

    options.source = find_extract(
        options.source,
        place=options.place,
        point=options.point,
        bbox=options.bbox,
        radius=options.radius,
        server=options.overpass_url,
        say=say,
    )
    options.enrich_net = False
    return _convert(options)


def _keep(options: argparse.Namespace) -> int:
    from dojo_maps.edits import keep_edits

    count = keep_edits(options.bundle, options.edited)
    print(f"{options.bundle}: {counted(count, 'edit')} kept; the next import into this bundle applies them")
    return 0


def _view(options: argparse.Namespace) -> int:
    import tempfile
    import webbrowser

    from dojo_maps.bundle import REPORT, read_bundle
    from dojo_maps.conversion import ConvertOptions, convert
    from dojo_maps.errors import DescriptionError
    from dojo_maps.safe_json import read_json
    from dojo_maps.viewer import write_view

    with tempfile.TemporaryDirectory() as work:
        source = Path(options.source)
        shown = (
            read_bundle(source)
            if source.is_dir()
            else convert(options.source, Path(work) / f"{source.name}.dojo", ConvertOptions())[0]
        )
        page = options.output or (
            Path(tempfile.mkdtemp(prefix="dojo-maps-")) / f"{shown.folder.resolve().stem}.html"
        )
        report = shown.folder / REPORT
        write_view(
            shown.road_map,
            shown.read_meshes(),
            page,
            report=read_json(report, error=DescriptionError) if report.is_file() else None,
            playback=_read_playback(options.recording, shown) if options.recording else None,
        )
    print(page)
    if options.output is None:
        webbrowser.open(page.resolve().as_uri())
    return 0


def _read_playback(recording: Path, shown: "Bundle") -> "Playback":
    """Let the environment read its recording: it is found by name, because maps know nothing of it."""
    import importlib

    return importlib.import_module("dojo_env.playback").read_playback(recording, shown.road_map)


def _list_checks(_options: argparse.Namespace) -> int:
    from dojo_maps.validation.catalogue import CHECKS

    for check in CHECKS:
        print(f"{check.id:32} {check.severity.value:8} {check.title} (limit: {check.limit}; {check.source})")
    return 0


if __name__ == "__main__":
    sys.exit(main())
