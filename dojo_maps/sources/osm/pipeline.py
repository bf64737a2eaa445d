"""From an OpenStreetMap extract to a SUMO network: laid out here, built by netconvert, mended, checked.

netconvert is never trusted: a crash or refusal drops the option most likely at fault and is reported, what
it warns of is counted and tied to its element, and edges that come out too short join their junctions.
"""

import re
from dataclasses import dataclass
from pathlib import Path

from dojo_maps.description import RoadMap
from dojo_maps.errors import SourceError
from dojo_maps.index import MapIndex
from dojo_maps.issue import Element, Issue, Severity
from dojo_maps.sources.netconvert import NetconvertError, run_netconvert, warning_issue
from dojo_maps.sources.osm.graph.edge_id import EdgeId
from dojo_maps.sources.osm.graph.road_graph import build_graph
from dojo_maps.sources.osm.junctions.overlap_merging import lying_on_neighbours
from dojo_maps.sources.osm.layout.arms import Layout
from dojo_maps.sources.osm.layout.stages import lay_out
from dojo_maps.sources.osm.plain.junction_outlines import mend_outlines
from dojo_maps.sources.osm.plain.movements import Restriction, read_restrictions
from dojo_maps.sources.osm.plain.plain_xml import CONNECTIONS, EDGES, NODES, Plain, write_plain
from dojo_maps.sources.osm.read.data import OsmData
from dojo_maps.sources.signal_programs import program_signals
from dojo_maps.sources.sumo_net import read_network
from dojo_maps.whole_file import scratch_folder

_ALWAYS = (
    *("-n", NODES, "-e", EDGES, "-x", CONNECTIONS, "-o", "output.net.xml"),
    *("--no-internal-links", "false", "--offset.disable-normalization", "--no-turnarounds"),
    *("--output.street-names", "--junctions.join", "false", "--geometry.max-grade.fix", "false"),
)
_DROPPED_IN_TURN = ("--walkingareas",)
"""Given first, and left out one more at each attempt after a failure."""
_SHORTEST = 5.0
_ROUNDS = 8
_TIMEOUT = 240.0
_NO_PAVEMENT = re.compile(
    r"(?:invalid crossing .* with edges|crossing .* across) \[([^]]*)\] (?:\(no walkingarea|has no target)"
)
_PLACELESS = re.compile(
    rb'<edge id=":[^"]*" function="crossing" crossingEdges="([^"]*)"[^>]*>\s*<lane [^>]*"[^"]*\bnan\b'
)


@dataclass(frozen=True, slots=True, kw_only=True)
class OsmNetwork:
    """A built network and what it was built from.

    Attributes:
        data: the network's bytes.
        warnings: netconvert's own.
    """

    data: bytes
    road_map: RoadMap
    layout: Layout
    plain: Plain
    restrictions: tuple[Restriction, ...]
    issues: tuple[Issue, ...]
    warnings: tuple[str, ...]


def build_network(data: OsmData, *, path: Path, name: str, sha256: str) -> OsmNetwork:
    """Build the network of an extract.

    Args:
        data: the extract.
        path: where it came from, for errors.
        name: the map's name.
        sha256: of the file as it lies on disk.

    Raises:
        SourceError: the extract has no roads that make a network.
        NetconvertError: netconvert fails on it whatever is left out.
        ToolMissingError: netconvert is not installed.
    """
    restrictions, broken = read_restrictions(data)
    joined: list[tuple[int, int]] = []
    moved: dict[int, tuple[int, float]] = {}
    paved: set[str] = set()
    for _ in range(_ROUNDS):
        layout = lay_out(data, build_graph(data, path), joined, moved)
        with scratch_folder() as folder:
            plain = write_plain(data, layout, restrictions, folder, paved)
            built, warnings, dropped = _convert(folder, path, left_hand=layout.graph.left_hand)
        road_map, _ = read_network(built, path=path, name=name, sha256=sha256)
        short, unpaved = _too_short(road_map, plain), _unpaved(warnings)
        moves = _moves(layout, short)
        pairs = [(one, other) for one, other in short if not {one, other} & (moves.keys() - moved.keys())]
        if moves.keys() <= moved.keys() and set(pairs) <= set(joined) and unpaved <= paved:
            pairs = lying_on_neighbours(road_map, layout, plain)
            if set(pairs) <= set(joined):
                break
        joined += pairs
        moved = moves | moved
        paved |= unpaved
    built = mend_outlines(program_signals(built, road_map))
    road_map, issues = read_network(built, path=path, name=name, sha256=sha256)
    issues += tuple(_dropped_issue(option, reason, road_map) for option, reason in dropped)
    hint = "look at the place in netedit; correct the map data where it is wrong"
    index = MapIndex(road_map)
    issues += tuple(
        warning_issue(warning, index, check="osm.netconvert_warning", hint=hint) for warning in warnings
    )
    issues += tuple(_broken_restriction(relation, road_map) for relation in broken)
    return OsmNetwork(
        data=built,
        road_map=road_map,
        layout=layout,
        plain=plain,
        restrictions=tuple(restrictions),
        issues=issues,
        warnings=warnings,
    )


def _convert(
    folder: Path, path: Path, *, left_hand: bool
) -> tuple[bytes, tuple[str, ...], list[tuple[str, str]]]:
    """Run netconvert, with one option less after each failure."""
    always = [*_ALWAYS, "--lefthand"] if left_hand else list(_ALWAYS)
    options = list(_DROPPED_IN_TURN)
    dropped: list[tuple[str, str]] = []
    output = folder / "output.net.xml"
    while True:
        try:
            result = run_netconvert([*always, *options], folder=folder, timeout=_TIMEOUT)
            placeless = _drop_placeless(folder, output) if output.is_file() else []
            if not placeless:
                break
            dropped += [
                (f"the crossing of {edges}", "netconvert finds no place for it") for edges in placeless
            ]
        except NetconvertError as error:
            what = options.pop() if options else _drop_crossings(folder)
            if what is None:
                raise
            dropped.append((what, str(error)))
    if not output.is_file():
        raise SourceError(path, "netconvert built no network from its roads; choose a larger area")
    return _without_header(output.read_bytes()), result.warnings, dropped


def _drop_placeless(folder: Path, output: Path) -> list[str]:
    """Take the crossings out of netconvert's input that it gave coordinates that are no numbers."""
    found = {frozenset(match[1].decode().split()) for match in _PLACELESS.finditer(output.read_bytes())}
    lines = (folder / CONNECTIONS).read_text(encoding="utf-8").splitlines(keepends=True)
    gone = [line for line in lines if _crossed_by(line) in found]
    kept = [line for line in lines if line not in gone]
    (folder / CONNECTIONS).write_text("".join(kept), encoding="utf-8")
    return [" ".join(sorted(_crossed_by(line))) for line in gone]


def _crossed_by(line: str) -> frozenset[str]:
    """Name the edges that a line of netconvert's input lets people cross; none if it is no crossing."""
    match = re.match(r'<crossing .*?edges="([^"]*)"', line)
    return frozenset(match[1].split()) if match else frozenset()


def _drop_crossings(folder: Path) -> str | None:
    """Take the crossings out of netconvert's input; None where there are none to take."""
    lines = (folder / CONNECTIONS).read_text(encoding="utf-8").splitlines(keepends=True)
    kept = [line for line in lines if not line.startswith("<crossing ")]
    if len(kept) == len(lines):
        return None
    (folder / CONNECTIONS).write_text("".join(kept), encoding="utf-8")
    return "crossings"


def _without_header(data: bytes) -> bytes:
    """Drop netconvert's comment, which names the time and the folder of the run."""
    return re.sub(rb"<!--.*?-->\s*", b"", data, count=1, flags=re.DOTALL)


def _moves(layout: Layout, short: dict[tuple[int, int], float]) -> dict[int, tuple[int, float]]:
    """Find the crossings between junctions that a few metres would give room: where to, and how far."""
    graph = layout.graph
    ends = graph.ends()
    crossed = {crossing.node for crossing in layout.crossings}
    found = {}
    for pair, length in short.items():
        for node, other in (pair, pair[::-1]):
            if node not in crossed or len(ends[node]) != 2 or len(ends[other]) == 2:
                continue
            sections = [graph.sections[name] for name in ends[node]]
            onward = [s for s in sections if {s.start, s.end} != {node, other}]
            room = _SHORTEST + 1.0 - length
            if len(onward) == 1 and graph.length(onward[0]) > 25:
                towards = onward[0].nodes[1] if onward[0].start == node else onward[0].nodes[-2]
                found[node] = (towards, room)
    return found


def _too_short(road_map: RoadMap, plain: Plain) -> dict[tuple[int, int], float]:
    """Find the vertices of sections that came out shorter than a car, and how short."""
    lanes = MapIndex(road_map).lanes
    found: dict[tuple[int, int], float] = {}
    for road in road_map.roads:
        length = min(lanes[lane].length for lane in road.lanes)
        section = plain.sections.get(EdgeId.read(road.id))
        if length < _SHORTEST and section is not None and not section.road.roundabout:
            pair = (min(section.start, section.end), max(section.start, section.end))
            found[pair] = min(length, found.get(pair, length))
    return dict(sorted(found.items()))


def _unpaved(warnings: tuple[str, ...]) -> set[str]:
    """Find the sections whose crossings netconvert dropped because they lead to no pavement."""
    found = (_NO_PAVEMENT.search(warning) for warning in warnings)
    return {EdgeId.read(name).section for match in found if match for name in match[1].split()}


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
