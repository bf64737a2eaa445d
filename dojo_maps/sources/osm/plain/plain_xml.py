"""Write a layout as SUMO's plain XML: nodes, edges with every lane, connections and crossings."""

from collections import defaultdict
from collections.abc import Iterable
from collections.abc import Set as AbstractSet
from dataclasses import dataclass, field
from pathlib import Path
from xml.sax.saxutils import quoteattr

import numpy as np

from dojo_maps.geometry.polylines import Floats
from dojo_maps.sources.osm.graph.edge_id import EdgeId
from dojo_maps.sources.osm.graph.heights import compute_heights
from dojo_maps.sources.osm.graph.road_graph import Section
from dojo_maps.sources.osm.junctions.roundabouts import find_rings
from dojo_maps.sources.osm.layout.arms import Arm, Layout, divider
from dojo_maps.sources.osm.layout.carriageway_spacing import side_by_side
from dojo_maps.sources.osm.layout.crossing_arms import CROSSING_WIDTH
from dojo_maps.sources.osm.layout.mapped_crossings import MappedCrossing
from dojo_maps.sources.osm.layout.sidewalks import ISLAND_WIDTH, SIDEWALK_WIDTH, Sidewalks
from dojo_maps.sources.osm.plain.lane_connections import connect_lanes
from dojo_maps.sources.osm.plain.movements import Movement, Movements, Restriction, directed, leads_through
from dojo_maps.sources.osm.plain.right_of_way import SIGNED_PRIORITY, RightOfWay
from dojo_maps.sources.osm.read.data import OsmData
from dojo_maps.sources.osm.read.lane_tags import LaneTags, LaneUse
from dojo_maps.sources.osm.read.way_tags import KINDS

NODES, EDGES, CONNECTIONS = "input.nod.xml", "input.edg.xml", "input.con.xml"
_WHO = {
    LaneUse.DRIVING: 'disallow="pedestrian tram rail_urban rail rail_electric rail_fast ship cable_car '
    'subway aircraft"',
    LaneUse.BUS: 'allow="bus coach taxi emergency"',
    LaneUse.BICYCLE: 'allow="bicycle"',
}
"""Vehicle classes of SUMO's by the use of a lane."""


_RING_RADIUS = 0.5
"""Metres by which the corners of roundabouts are rounded; more would leave nothing of a small ring."""


@dataclass(slots=True, kw_only=True)
class Plain:
    """What was written, and what of the extract it came from."""

    sections: dict[EdgeId, Section] = field(default_factory=dict)
    """Directed: an edge's section as it is driven."""
    crossings: list[tuple[str, frozenset[EdgeId], MappedCrossing]] = field(default_factory=list)
    sidewalks: dict[str, tuple[float, float]] = field(default_factory=dict)
    """Widths on the left and the right of a section, metres; 0 for none."""
    nodes: dict[int, str] = field(default_factory=dict)
    movements: list[Movement] = field(default_factory=list)
    guessed: dict[int, int] = field(default_factory=dict)
    """Crossings that nobody has mapped, by junction."""
    heights: dict[int, float] = field(default_factory=dict)


def write_plain(
    data: OsmData,
    layout: Layout,
    restrictions: list[Restriction],
    folder: Path,
    paved: AbstractSet[str] = frozenset(),
) -> Plain:
    """Write the three files that netconvert builds the network from.

    Args:
        data: the extract.
        layout: what to build.
        restrictions: turns that are forbidden.
        folder: where the files go.
        paved: sections with pavement on both sides whatever is mapped, because crossings lead there.
    """
    plain = Plain(heights=compute_heights(layout.graph))
    walks = Sidewalks(data, layout.graph)
    arms = layout.arms()
    for junction in sorted(layout.junctions.controllers):
        if not leads_through(layout, arms.get(junction, [])):
            del layout.junctions.controllers[junction], layout.junctions.signals[junction]
    plain.nodes = {junction: str(junction) for junction in arms}
    for name in sorted(layout.graph.sections):
        if name not in layout.inner:
            section = layout.graph.sections[name]
            left, right = (SIDEWALK_WIDTH * side for side in walks.sides(section))
            least = ISLAND_WIDTH if name in paved else 0.0
            plain.sidewalks[name] = (max(left, least), max(right, least))
    rights = RightOfWay(data, layout)
    _write(folder / EDGES, "edges", [*_edges(layout, arms, plain, rights), *_roundabouts(layout)])
    _write(folder / NODES, "nodes", [_location(layout), *_nodes(layout, arms, plain, rights)])
    _write(folder / CONNECTIONS, "connections", _connections(layout, arms, restrictions, plain))
    return plain


def _write(path: Path, root: str, lines: list[str]) -> None:
    path.write_text("\n".join([f"<{root}>", *lines, f"</{root}>", ""]), encoding="utf-8")


def _location(layout: Layout) -> str:
    graph = layout.graph
    return (
        f'<location netOffset="{graph.offset[0]:.2f},{graph.offset[1]:.2f}" convBoundary="0,0,1,1" '
        f'origBoundary="0,0,1,1" projParameter={quoteattr(graph.proj)}/>'
    )


def _nodes(layout: Layout, arms: dict[int, list[Arm]], plain: Plain, rights: RightOfWay) -> list[str]:
    members = layout.junctions.members()
    lines = []
    for junction in sorted(arms):
        places = np.array([layout.graph.places[vertex] for vertex in members[junction]])
        x, y = (places.min(axis=0) + places.max(axis=0)) / 2
        controller = layout.junctions.controllers.get(junction)
        kind = f'type="{rights.kind(junction, arms[junction])}"'
        if controller is not None:
            kind = f'type="traffic_light" tl="{controller}"'
        elif not any(_drives(plain, arm.outgoing) for arm in arms[junction]):
            kind = 'type="dead_end"'
        if any(layout.graph.sections[name].road.roundabout for name, _ in arms[junction]):
            kind += f' radius="{_RING_RADIUS}"'
        z = sum(plain.heights.get(vertex, 0.0) for vertex in members[junction]) / len(places)
        lines.append(f'<node id="{junction}" x="{x:.2f}" y="{y:.2f}" z="{z:.2f}" {kind}/>')
    return lines


def _edges(layout: Layout, arms: dict[int, list[Arm]], plain: Plain, rights: RightOfWay) -> list[str]:
    lines = []
    for name, (left, right) in sorted(plain.sidewalks.items()):
        section = layout.graph.sections[name]
        road = section.road
        middle = divider(layout, section, plain.heights)
        near, far = (left, right) if layout.graph.left_hand else (right, left)
        for forward, lanes, walk in ((True, road.forward, near), (False, road.backward, far)):
            if not lanes and not walk:
                continue
            driven = section if forward else section.flipped()
            edge = EdgeId(name, forward)
            plain.sections[edge] = driven
            ends = (layout.junctions.of[driven.start], layout.junctions.of[driven.end])
            shape = middle if forward else middle[::-1]
            arm = Arm(name, at_end=forward)
            signed = rights.sign(arm, arms[layout.junction(arm)])
            priority = SIGNED_PRIORITY if signed else KINDS[road.kind]
            lines += _edge(edge, ends, driven, lanes, walk=walk, shape=shape, priority=priority)
    return lines


def _roundabouts(layout: Layout) -> list[str]:
    """Name the rings, so that who drives in one has right of way."""
    lines = []
    for ring in find_rings(layout.graph):
        driven = [section for section in ring if section.id not in layout.inner]
        nodes = sorted({layout.junctions.of[vertex] for s in driven for vertex in (s.start, s.end)})
        if len(nodes) > 1:
            edges = " ".join(str(EdgeId(section.id, forward=True)) for section in driven)
            lines.append(f'<roundabout nodes="{" ".join(map(str, nodes))}" edges="{edges}"/>')
    return lines


def _edge(
    edge: EdgeId,
    ends: tuple[int, int],
    section: Section,
    lanes: tuple[LaneTags, ...],
    *,
    walk: float,
    shape: Floats,
    priority: int,
) -> list[str]:
    road = section.road
    places = " ".join(f"{x:.2f},{y:.2f},{z:.2f}" for x, y, z in shape)
    name = f"name={quoteattr(road.name)} " if road.name.strip() else ""
    lines = [
        f'<edge id="{edge}" from="{ends[0]}" to="{ends[1]}" {name}'
        f'type="highway.{road.kind}" priority="{priority}" numLanes="{len(lanes) + bool(walk)}" '
        f'speed="{road.speed:.2f}" spreadType="right" shape="{places}">'
    ]
    if walk:
        lines.append(f'<lane index="0" allow="pedestrian" width="{walk:.2f}" speed="{road.speed:.2f}"/>')
    for number, lane in enumerate(lanes):
        width = lane.width or road.width
        lines.append(f'<lane index="{number + bool(walk)}" {_WHO[lane.use]} width="{width:.2f}"/>')
    return [*lines, "</edge>"]


def _connections(
    layout: Layout, arms: dict[int, list[Arm]], restrictions: list[Restriction], plain: Plain
) -> list[str]:
    finder = Movements(layout, restrictions)
    lines = []
    for junction in sorted(arms):
        movements = finder.at(junction, arms[junction])
        plain.movements += movements
        lines += _lane_links(layout, movements, plain)
        lines += _crossings(layout, junction, arms[junction], plain)
        if not any(arm in layout.hosted for arm in arms[junction]):
            lines += _guessed_crossings(layout, junction, arms[junction], plain)
    return lines


def _lane_links(layout: Layout, movements: list[Movement], plain: Plain) -> list[str]:
    by_source: dict[Arm, list[Movement]] = defaultdict(list)
    for movement in movements:
        by_source[movement.source].append(movement)
    lines = []
    links: list[tuple[Arm, int, Movement, int]] = []
    for source, found in by_source.items():
        lanes = directed(layout.graph.sections[source.section], into_end=source.at_end)
        targets = [
            directed(layout.graph.sections[m.target.section], into_end=not m.target.at_end) for m in found
        ]
        pairs = connect_lanes(lanes, targets, [m.angle for m in found], left_hand=layout.graph.left_hand)
        links += [(source, lane, found[number], onto) for lane, number, onto in pairs]
    for source, lane, movement, onto in _with_entries(layout, links):
        origin, goal = source.incoming, movement.target.outgoing
        shifts = [_has_walk(layout, plain, edge) for edge in (origin, goal)]
        lines.append(
            f'<connection from="{origin}" to="{goal}" fromLane="{lane + shifts[0]}" '
            f'toLane="{onto + shifts[1]}"/>'
        )
    return lines


def _with_entries(
    layout: Layout, links: list[tuple[Arm, int, Movement, int]]
) -> list[tuple[Arm, int, Movement, int]]:
    """Lead traffic into lanes that nothing leads to, from the straightest movement beside them."""
    onto_road: dict[Arm, list[tuple[Arm, int, Movement, int]]] = defaultdict(list)
    for link in links:
        onto_road[link[2].target].append(link)
    added = []
    for target, found in onto_road.items():
        lanes = directed(layout.graph.sections[target.section], into_end=not target.at_end)
        entered = {link[3] for link in found}
        for number, lane in enumerate(lanes):
            able = [link for link in found if not (lane.bicycle and _source_lane(layout, link).bus)]
            if number not in entered and able:
                best = min(able, key=lambda e: (abs(e[3] - number), abs(e[2].angle), e[0], e[1]))
                added.append((best[0], best[1], best[2], number))
    return [*links, *added]


def _source_lane(layout: Layout, link: tuple[Arm, int, Movement, int]) -> LaneTags:
    arm = link[0]
    return directed(layout.graph.sections[arm.section], into_end=arm.at_end)[link[1]]


def _has_walk(layout: Layout, plain: Plain, edge: EdgeId) -> bool:
    left, right = plain.sidewalks[edge.section]
    return bool(left if layout.graph.left_hand == edge.forward else right)


def _crossings(layout: Layout, junction: int, arms: list[Arm], plain: Plain) -> list[str]:
    lines = []
    for group in side_by_side(layout, arms):
        found = [layout.hosted[arm] for arm in group if arm in layout.hosted]
        both = (edge for arm in group for edge in (arm.incoming, arm.outgoing))
        edges = frozenset(edge for edge in both if _drives(plain, edge))
        if not found:
            continue
        plain.crossings += [(str(junction), edges, crossing) for crossing in found]
        priority = str(any(crossing.marked for crossing in found)).lower()
        lines.append(
            f'<crossing node="{junction}" edges="{_listed(edges)}" '
            f'width="{CROSSING_WIDTH:.2f}" priority="{priority}"/>'
        )
    return lines


def _guessed_crossings(layout: Layout, junction: int, arms: list[Arm], plain: Plain) -> list[str]:
    """Guess crossings of all arms of a signal where none is mapped."""
    if len(arms) < 3 or junction not in layout.junctions.controllers:
        return []
    lines = []
    for arm in arms:
        edges = [edge for edge in (arm.incoming, arm.outgoing) if _drives(plain, edge)]
        if all(plain.sidewalks[arm.section]) and not layout.graph.sections[arm.section].road.roundabout:
            plain.guessed[junction] = plain.guessed.get(junction, 0) + 1
            lines.append(
                f'<crossing node="{junction}" edges="{_listed(edges)}" width="{CROSSING_WIDTH:.2f}" '
                'priority="true"/>'
            )
    return lines


def _listed(edges: Iterable[EdgeId]) -> str:
    return " ".join(sorted(map(str, edges)))


def _drives(plain: Plain, edge: EdgeId) -> bool:
    return edge in plain.sections and bool(plain.sections[edge].road.forward)
