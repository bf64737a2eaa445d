"""Write a layout as SUMO's plain XML: nodes, edges with every lane, connections and crossings."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from xml.sax.saxutils import quoteattr

from dojo_maps.geometry.polylines import Floats
from dojo_maps.sources.osm.graph.edge_id import EdgeId
from dojo_maps.sources.osm.graph.road_graph import Section
from dojo_maps.sources.osm.graph.roundabouts import find_rings
from dojo_maps.sources.osm.layout.arms import Arm, Layout, divider
from dojo_maps.sources.osm.layout.carriageway_spacing import side_by_side
from dojo_maps.sources.osm.plain.junction_connections import write_lane_connections
from dojo_maps.sources.osm.plain.junction_nodes import write_nodes
from dojo_maps.sources.osm.plain.movements import Movement, Movements
from dojo_maps.sources.osm.plain.right_of_way import RightOfWay
from dojo_maps.sources.osm.plain.track_edges import TrackEdges
from dojo_maps.sources.osm.read.lane_tags import LaneUse
from dojo_maps.sources.osm.read.restrictions import Restriction
from dojo_maps.sources.osm.read.way_tags import RoadTags

NODES, EDGES, CONNECTIONS = "input.nod.xml", "input.edg.xml", "input.con.xml"
_WHO = {
    LaneUse.DRIVING: 'disallow="pedestrian tram rail_urban rail rail_electric rail_fast ship cable_car '
    'subway aircraft"',
    LaneUse.BUS: 'allow="bus coach taxi emergency"',
    LaneUse.BICYCLE: 'allow="bicycle"',
    LaneUse.PARKING: 'disallow="all"',
}
"""Vehicle classes of SUMO's by the use of a lane."""
_WITH_TRAM = {
    LaneUse.DRIVING: _WHO[LaneUse.DRIVING].replace(" tram", ""),
    LaneUse.BUS: 'allow="bus coach taxi emergency tram"',
}
"""The same of a lane that a tram shares."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Plain:
    """What was written, and what of the extract it came from.

    Attributes:
        sections: of each edge its section, in the direction in which it is driven.
        nodes: of each junction its name.
        movements: of all junctions.
        guessed: crossings that nobody has mapped, by junction.
    """

    sections: Mapping[EdgeId, Section]
    nodes: Mapping[int, str]
    movements: Sequence[Movement]
    guessed: Mapping[int, int]


def write_plain(layout: Layout, restrictions: Sequence[Restriction], folder: Path) -> Plain:
    """Write the three files that netconvert builds the network from.

    Args:
        layout: what to build.
        restrictions: turns that are forbidden.
        folder: where the files go.

    Returns:
        What was written, and what of the layout it came from.

    Raises:
        SourceError: more paths lead across a junction than can be followed.
    """
    arms = layout.arms()
    rights = RightOfWay(layout)
    finder = Movements(layout, restrictions)
    sections = _driven_sections(layout)
    movements = {junction: finder.at(junction, arms[junction]) for junction in sorted(arms)}
    guessed = {
        junction: found for junction in sorted(arms) if (found := _guess(layout, junction, arms[junction]))
    }
    tracks = TrackEdges(layout)
    edges = [*_edges(layout, arms, sections, rights), *_roundabouts(layout), *tracks.edges()]
    nodes = [_location(layout), *tracks.nodes(), *write_nodes(layout, arms, rights, tracks)]
    connections = [*_connections(layout, arms, movements, guessed), *tracks.connections()]
    _write(folder / EDGES, "edges", edges)
    _write(folder / NODES, "nodes", nodes)
    _write(folder / CONNECTIONS, "connections", connections)
    return Plain(
        sections=sections,
        nodes={junction: str(junction) for junction in arms},
        movements=[movement for found in movements.values() for movement in found],
        guessed={junction: len(found) for junction, found in guessed.items()},
    )


def _write(path: Path, root: str, lines: list[str]) -> None:
    path.write_text("\n".join([f"<{root}>", *lines, f"</{root}>", ""]), encoding="utf-8")


def _location(layout: Layout) -> str:
    projection = layout.graph.projection
    x, y = projection.net_offset
    return (
        f'<location netOffset="{x:.2f},{y:.2f}" convBoundary="0,0,1,1" '
        f'origBoundary="0,0,1,1" projParameter={quoteattr(str(projection.proj))}/>'
    )


def _driven_sections(layout: Layout) -> dict[EdgeId, Section]:
    """List the edges with lanes or a sidewalk, each with its section as it is driven."""
    found = {}
    for name in sorted(layout.sidewalks):
        section = layout.graph.sections[name]
        for edge in (EdgeId(name, forward=True), EdgeId(name, forward=False)):
            if section.lanes_towards(end=edge.forward) or layout.walk(edge):
                found[edge] = section if edge.forward else section.flipped()
    return found


def _edges(
    layout: Layout, arms: dict[int, list[Arm]], sections: Mapping[EdgeId, Section], rights: RightOfWay
) -> list[str]:
    lines = []
    for edge, section in sections.items():
        middle = divider(layout, layout.graph.sections[edge.section])
        ends = (layout.junctions.of[section.start], layout.junctions.of[section.end])
        arm = Arm(edge.section, at_end=edge.forward)
        lines += _edge(
            edge,
            ends,
            section.road,
            walk=layout.walk(edge),
            shape=middle if edge.forward else middle[::-1],
            priority=rights.priority(arm, arms[layout.junction(arm)]),
        )
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
    road: RoadTags,
    *,
    walk: float,
    shape: Floats,
    priority: int,
) -> list[str]:
    lanes = road.forward
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
        who = (_WITH_TRAM if lane.tram else _WHO)[lane.use]
        lines.append(f'<lane index="{number + bool(walk)}" {who} width="{width:.2f}"/>')
    return [*lines, "</edge>"]


def _connections(
    layout: Layout,
    arms: dict[int, list[Arm]],
    movements: Mapping[int, Sequence[Movement]],
    guessed: Mapping[int, Sequence[Arm]],
) -> list[str]:
    lines = []
    for junction, links in write_lane_connections(layout, movements).items():
        lines += links
        lines += _crossings(layout, junction, arms[junction])
        lines += [_crossing(layout, junction, [arm], marked=True) for arm in guessed.get(junction, ())]
    return lines


def _crossings(layout: Layout, junction: int, arms: list[Arm]) -> list[str]:
    lines = []
    for group in side_by_side(layout, arms):
        found = [layout.hosted[arm] for arm in group if arm in layout.hosted]
        if found:
            marked = any(crossing.marked for crossing in found)
            lines.append(_crossing(layout, junction, group, marked=marked))
    return lines


def _guess(layout: Layout, junction: int, arms: list[Arm]) -> list[Arm]:
    """Guess crossings of all arms of a signal where none is mapped."""
    mapped = any(arm in layout.hosted for arm in arms)
    if mapped or len(arms) < 3 or junction not in layout.junctions.controllers:
        return []
    ring = {arm for arm in arms if layout.graph.sections[arm.section].road.roundabout}
    return [arm for arm in arms if all(layout.sidewalks[arm.section]) and arm not in ring]


def _crossing(layout: Layout, junction: int, arms: Sequence[Arm], *, marked: bool) -> str:
    """Write a crossing over some arms; where it is marked, traffic gives way."""
    arriving = [str(arm.incoming) for arm in arms if layout.arriving(arm)]
    leaving = [str(arm.outgoing) for arm in arms if layout.leaving(arm)]
    return (
        f'<crossing node="{junction}" edges="{" ".join(sorted({*arriving, *leaving}))}" '
        f'width="{layout.rules.crossings.width:.2f}" priority="{str(marked).lower()}"/>'
    )
