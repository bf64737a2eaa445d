"""From an OpenStreetMap extract to a SUMO network: laid out here, built by netconvert, mended, checked.

The stages run in the order of `build_network`, each on what those before it made. What netconvert builds may
show that junctions must be joined: then they are planned anew, a bounded number of times.
"""

from pathlib import Path

from dojo_maps.description import RoadMap
from dojo_maps.index import MapIndex
from dojo_maps.issue import Element, Issue, Severity
from dojo_maps.sources.geotiff import ElevationGrid
from dojo_maps.sources.netconvert import warning_issue
from dojo_maps.sources.osm.graph.steps import build_graph
from dojo_maps.sources.osm.junctions.steps import add_midblock_vertices, plan_junctions
from dojo_maps.sources.osm.layout.arms import Layout
from dojo_maps.sources.osm.layout.sidewalks import pave
from dojo_maps.sources.osm.layout.steps import lay_out
from dojo_maps.sources.osm.layout.track_settling import settle_tracks
from dojo_maps.sources.osm.network.corrections import (
    Corrections,
    find_corrections,
    find_outlines,
    find_track_corrections,
    not_converged,
)
from dojo_maps.sources.osm.network.cycle_paths import follow_tracks
from dojo_maps.sources.osm.network.junction_outlines import mend_outlines
from dojo_maps.sources.osm.network.netconvert_run import Converted, convert_plain
from dojo_maps.sources.osm.network.osm_network import OsmNetwork
from dojo_maps.sources.osm.network.outline_filling import fill_outlines
from dojo_maps.sources.osm.network.outline_trimming import trim_outlines
from dojo_maps.sources.osm.network.pavement_trimming import trim_pavement
from dojo_maps.sources.osm.network.precedence import settle_precedence
from dojo_maps.sources.osm.network.track_clearing import clear_cycle_tracks, clear_rails
from dojo_maps.sources.osm.network.track_walkers import part_walkers_from_cyclists
from dojo_maps.sources.osm.network.waiting_places import move_waiting_places
from dojo_maps.sources.osm.plain.plain_xml import Plain, write_plain
from dojo_maps.sources.osm.read.country import Country
from dojo_maps.sources.osm.read.data import OsmData
from dojo_maps.sources.osm.read.restrictions import read_restrictions
from dojo_maps.sources.osm.rules import RULES, ImportRules
from dojo_maps.sources.osm.signals.programs import program_signals
from dojo_maps.sources.sumo_net import read_network, read_roads
from dojo_maps.whole_file import scratch_folder


def build_network(
    data: OsmData,
    *,
    path: Path,
    name: str,
    sha256: str,
    rules: ImportRules = RULES,
    country: Country | None = None,
    raster: ElevationGrid | None = None,
) -> OsmNetwork:
    """Build the network of an extract.

    Args:
        data: the extract.
        path: where it came from, for errors.
        name: the map's name.
        sha256: of the file as it lies on disk.
        rules: the limits to go by.
        country: whose rules hold; None for the one that the extract lies in.
        raster: elevations of the ground.

    Returns:
        The network, what it was built from, and what was wrong on the way.

    Raises:
        SourceError: the extract has no roads that make a network, or too many on one place, or the raster
            lies elsewhere.
        NetconvertError: netconvert fails on it whatever is left out.
        ToolMissingError: netconvert is not installed.
    """
    restrictions, broken = read_restrictions(data)
    graph = add_midblock_vertices(build_graph(data, path, rules, country))

    def build(layout: Layout) -> tuple[Plain, Converted, RoadMap]:
        with scratch_folder() as folder:
            plain = write_plain(layout, restrictions, folder)
            converted = convert_plain(folder, path, left_hand=graph.left_hand, timeout=rules.network.timeout)
        return plain, converted, read_roads(converted.data, path=path, name=name, sha256=sha256)

    wanted, unsettled = Corrections(), []
    for _ in range(rules.network.attempts):
        known = wanted
        plan = plan_junctions(graph, known.joined, known.moved)
        layout = lay_out(plan, known.paved, known.outlined, raster)
        plain, converted, road_map = build(layout)
        wanted = find_corrections(known, road_map, converted.warnings, layout, plain)
        if wanted is known:
            break
    else:
        unsettled.append(not_converged(known, wanted, layout.graph, attempts=rules.network.attempts))
    if layout.tracks is not None:
        # Tracks are built on the outlines that the roads' junctions have, so that they do not change those.
        alone, outlines, wanted = (layout, road_map), find_outlines(road_map, layout, plain), known
        for _ in range(rules.network.track_attempts):
            known = wanted
            layout = settle_tracks(pave(alone[0], known.paved), outlines, known.closed, known.absorbed)
            plain, converted, road_map = build(layout)
            wanted = find_track_corrections(known, alone[1], road_map, converted.warnings, layout, plain)
            if wanted is known:
                break
        else:
            tried = rules.network.track_attempts
            unsettled.append(not_converged(known, wanted, layout.graph, attempts=tried))
    cleared = clear_rails(converted.data)
    road_map, _ = read_network(cleared, path=path, name=name, sha256=sha256)
    built = follow_tracks(cleared, road_map, layout)
    if layout.tracks is not None:
        built = clear_cycle_tracks(built, road_map, layout.tracks, rules.tracks)
    built = settle_precedence(built, road_map)
    if built != cleared:  # Programs and waiting places go by where bicycles ride, and by who waits.
        road_map, _ = read_network(built, path=path, name=name, sha256=sha256)
    built = move_waiting_places(program_signals(built, road_map), road_map, rules.waiting)
    built = mend_outlines(part_walkers_from_cyclists(built))
    built = trim_outlines(built, road_map, layout.graph)
    built, cut = trim_pavement(built, road_map)
    built = fill_outlines(built, road_map, layout, cut)
    road_map, issues = read_network(built, path=path, name=name, sha256=sha256)
    issues += tuple(unsettled)
    issues += tuple(_dropped_issue(option, reason, road_map) for option, reason in converted.dropped)
    hint = "look at the place in netedit; correct the map data where it is wrong"
    index = MapIndex(road_map)
    issues += tuple(
        warning_issue(warning, index, check="osm.netconvert_warning", hint=hint)
        for warning in converted.warnings
    )
    issues += tuple(_broken_restriction(relation, road_map) for relation in broken)
    return OsmNetwork(
        data=built,
        road_map=road_map,
        layout=layout,
        plain=plain,
        restrictions=tuple(restrictions),
        issues=issues,
        warnings=converted.warnings,
    )


def _dropped_issue(option: str, reason: str, road_map: RoadMap) -> Issue:
    return Issue(
        check="osm.netconvert_failed",
        severity=Severity.WARNING,
        elements=(),
        position=(*road_map.origin, 0.0),
        message=f"the network was built without {option}, because: {reason}",
        hint="import a smaller area to find the road that netconvert fails on",
    )


def _broken_restriction(relation: int, road_map: RoadMap) -> Issue:
    return Issue(
        check="osm.restriction_incomplete",
        severity=Severity.NOTE,
        elements=(Element(kind="relation", id=str(relation)),),
        position=(*road_map.origin, 0.0),
        message=f"turn restriction {relation} lacks a member or names one of the wrong type",
        hint=f"complete it: https://www.openstreetmap.org/relation/{relation}",
    )
