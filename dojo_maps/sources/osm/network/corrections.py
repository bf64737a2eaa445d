"""What the next attempt must do otherwise, by what netconvert made of this one.

Junctions that took whole roads for theirs get an outline; roads that still came out shorter than a car, or on
top of a neighbour, become part of their junction; crossings between junctions move where that gives their
road enough length; crossings get the pavement that they lack.
"""

import re
from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import shapely

from dojo_maps.description import RoadMap
from dojo_maps.geometry.polylines import Floats
from dojo_maps.index import MapIndex
from dojo_maps.issue import Element, Issue, Severity
from dojo_maps.sources.osm.graph.edge_id import EdgeId
from dojo_maps.sources.osm.graph.road_graph import RoadGraph
from dojo_maps.sources.osm.layout.arms import Arm, Layout
from dojo_maps.sources.osm.network.overlap_merging import lying_on_neighbours
from dojo_maps.sources.osm.plain.plain_xml import Plain
from dojo_maps.sources.osm.read.data import link_to
from dojo_maps.wording import counted

_NO_PAVEMENT = re.compile(
    r"(?:invalid crossing .* with edges|crossing .* across) \[([^]]*)\] (?:\(no walkingarea|has no target)"
)


@dataclass(frozen=True, slots=True, kw_only=True)
class Corrections:
    """What attempts before have shown.

    Attributes:
        joined: pairs of vertices to join.
        moved: crossings to move, by node: towards which node, and how many metres.
        paved: sections with pavement on both sides.
        outlined: junctions, each by its vertices, with outlines of our own: netconvert's took whole roads.
        closed: junctions that tracks lead over without a link.
        absorbed: tracks that are part of the junction at one of their ends.
    """

    joined: tuple[tuple[int, int], ...] = ()
    moved: Mapping[int, tuple[int, float]] = field(default_factory=dict)
    paved: frozenset[str] = frozenset()
    outlined: frozenset[frozenset[int]] = frozenset()
    closed: frozenset[int] = frozenset()
    absorbed: frozenset[str] = frozenset()


def find_corrections(
    known: Corrections, road_map: RoadMap, warnings: tuple[str, ...], layout: Layout, plain: Plain
) -> Corrections:
    """Add to the corrections what a built network still needs.

    Args:
        known: the corrections that it was built with.
        road_map: the network.
        warnings: netconvert's own.
        layout: what it was built from.
        plain: what was written of that.

    Returns:
        The same object where nothing is new.
    """
    short, unpaved = _too_short(road_map, plain, layout.rules.network.shortest_edge), _unpaved(warnings)
    moves, outlined = _moves(layout, short), _overdrawn(layout, short) - known.outlined
    changed = (moves.keys() - known.moved.keys()).union(*outlined)
    pairs = [pair for pair in short if not changed & {*pair}]
    if not changed and set(pairs) <= set(known.joined) and unpaved <= known.paved:
        pairs = lying_on_neighbours(road_map, layout, plain)
        if set(pairs) <= set(known.joined):
            return known
    return replace(
        known,
        joined=(*known.joined, *pairs),
        moved=moves | {**known.moved},
        paved=known.paved | unpaved,
        outlined=known.outlined | outlined,
    )


def find_track_corrections(
    known: Corrections,
    before: RoadMap,
    road_map: RoadMap,
    warnings: tuple[str, ...],
    layout: Layout,
    plain: Plain,
) -> Corrections:
    """Add to the corrections what a network built with tracks still needs.

    Args:
        known: the corrections that it was built with.
        before: the network without tracks.
        road_map: the network with them.
        warnings: netconvert's own.
        layout: what it was built from.
        plain: what was written of that.

    Returns:
        The same object where nothing is new.
    """
    shortest, of = layout.rules.network.shortest_edge, layout.junctions.of
    pressed = _too_short(road_map, plain, shortest).keys() - _too_short(before, plain, shortest).keys()
    reached = set(layout.tracks.nodes.values()) if layout.tracks is not None else set()
    closed = {of[vertex] for pair in pressed for vertex in pair} & reached
    unpaved = _unpaved(warnings) & layout.sidewalks.keys()
    absorbed = _short_tracks(road_map, layout)
    if closed <= known.closed and unpaved <= known.paved and absorbed <= known.absorbed:
        return known
    return replace(
        known,
        paved=known.paved | unpaved,
        closed=known.closed | closed,
        absorbed=known.absorbed | absorbed,
    )


def find_outlines(road_map: RoadMap, layout: Layout, plain: Plain) -> dict[int, Floats]:
    """List the outlines of junctions that have some ground.

    Args:
        road_map: the network.
        layout: what it was built from.
        plain: what was written of that.

    Returns:
        (n, 3) metres, by their lowest vertex.
    """
    nodes = {name: node for node, name in plain.nodes.items()}
    return {
        nodes[junction.id]: junction.polygon
        for junction in road_map.junctions
        if junction.id in nodes
        and len(junction.polygon) > 2
        and shapely.Polygon(junction.polygon[:, :2]).area > layout.rules.tracks.least_ground
    }


def not_converged(known: Corrections, wanted: Corrections, graph: RoadGraph, *, attempts: int) -> Issue:
    """Report that the last attempt still showed something to correct.

    Args:
        known: the corrections that it was built with.
        wanted: those that it needs.
        graph: the roads as they were built.
        attempts: how many were made.

    Returns:
        A warning at one of the nodes, with the number of all.
    """
    nodes = {node for pair in wanted.joined if pair not in known.joined for node in pair}
    nodes |= wanted.moved.keys() - known.moved.keys()
    nodes |= {graph.sections[name].start for name in wanted.paved - known.paved}
    nodes |= (wanted.closed - known.closed).union(*(wanted.outlined - known.outlined))
    first = max(nodes)  # Not one below 0, which OpenStreetMap does not know, if there is another.
    return Issue(
        check="osm.not_converged",
        severity=Severity.WARNING,
        elements=(Element(kind="osm_node", id=str(first)),),
        position=(*graph.places[first], 0.0),
        message=(
            f"after {attempts} attempts roads at {counted(len(nodes), 'node')} are still too short, lie on a "
            f"neighbour, or lack pavement at a crossing; one is {link_to('node', first)}"
        ),
        hint="look at the place in netedit; draw what is crowded there simpler, or join its junctions",
        measured=len(nodes),
    )


def _moves(layout: Layout, short: dict[tuple[int, int], float]) -> dict[int, tuple[int, float]]:
    """Find the crossings between junctions that a few metres would give room: where to, and how far."""
    graph, rules = layout.graph, layout.rules.network
    ends = graph.ends()
    crossed = {crossing.node for crossing in layout.crossings}
    found = {}
    for pair, length in short.items():
        for node, other in (pair, pair[::-1]):
            if node not in crossed or len(ends[node]) != 2 or len(ends[other]) == 2:
                continue
            sections = [graph.sections[name] for name in ends[node]]
            onward = [s for s in sections if {s.start, s.end} != {node, other}]
            room = rules.shortest_edge + rules.move_margin - length
            if len(onward) == 1 and graph.length(onward[0]) > rules.room_to_move:
                towards = onward[0].nodes[1] if onward[0].start == node else onward[0].nodes[-2]
                found[node] = (towards, room)
    return found


def _too_short(road_map: RoadMap, plain: Plain, shortest: float) -> dict[tuple[int, int], float]:
    """Find the vertices of sections that came out shorter than a car, and how short."""
    lanes = MapIndex(road_map).lanes
    found: dict[tuple[int, int], float] = {}
    for road in road_map.roads:
        length = min(lanes[lane].length for lane in road.lanes)
        section = plain.sections.get(EdgeId.read(road.id))
        if length < shortest and section is not None and not section.road.roundabout:
            found[section.pair] = min(length, found.get(section.pair, length))
    return dict(sorted(found.items()))


def _overdrawn(layout: Layout, short: Mapping[tuple[int, int], float]) -> frozenset[frozenset[int]]:
    """Find the junctions of roads that came out short though the layout leaves enough of them."""
    least, found = layout.rules.network.left_by_layout, set()
    for section in layout.graph.sections.values():
        if section.pair in short and layout.left_of(section) >= least:
            found |= {layout.junction(Arm(section.id, at_end=at_end)) for at_end in (False, True)}
    members = layout.junctions.members()
    return frozenset(frozenset(members[junction]) for junction in found)


def _short_tracks(road_map: RoadMap, layout: Layout) -> set[str]:
    """Find the tracks that came out so short that nobody has room between the junctions at their ends."""
    built = layout.tracks.built if layout.tracks is not None else {}
    lanes, least = MapIndex(road_map).lanes, layout.rules.tracks.shortest_built
    short = {road.id for road in road_map.roads if min(lanes[lane].length for lane in road.lanes) < least}
    return {EdgeId.read(name).section for name in short} & built.keys()


def _unpaved(warnings: tuple[str, ...]) -> set[str]:
    """Find the sections whose crossings netconvert dropped because they lead to no pavement."""
    found = (_NO_PAVEMENT.search(warning) for warning in warnings)
    return {EdgeId.read(name).section for match in found if match for name in match[1].split()}
