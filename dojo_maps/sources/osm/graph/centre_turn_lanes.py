"""The lane in the middle of a street that both directions turn from: a turn lane of its own at each junction.

Between the junctions nothing is built of it, for SUMO has no lane for both directions.
"""

from dataclasses import replace

from dojo_maps.sources.osm.graph.road_graph import RoadGraph, Section

_LENGTH = 60.0
"""Metres of the turn lane before a junction."""
_LEAST = 20.0
"""Metres of a street that are left between its turn lanes."""


def add_centre_turn_lanes(graph: RoadGraph) -> None:
    """Give the streets of a graph that have a lane in their middle a turn lane before each junction."""
    ends = graph.ends()
    for name, section in sorted(graph.sections.items()):
        if not section.road.centre or section.road.oneway:
            continue
        busy = [len(ends[vertex]) > 2 for vertex in (section.start, section.end)]
        for at_end, piece in _before_junctions(graph, name, busy):
            graph.sections[piece] = _with_turn_lane(graph, graph.sections[piece], at_end=at_end)


def _before_junctions(graph: RoadGraph, name: str, busy: list[bool]) -> list[tuple[bool, str]]:
    """Split a street before its junctions; which end each piece leads to."""
    length = graph.length(graph.sections[name])
    if not any(busy):
        return []
    if length < _LENGTH * sum(busy) + _LEAST:
        return [(busy[1], name)]
    found = []
    if busy[1]:
        graph.split(name, graph.insert_node(name, length - _LENGTH))
        found.append((True, f"{name}b"))
        name = f"{name}a"
    if busy[0]:
        graph.split(name, graph.insert_node(name, _LENGTH))
        found.append((False, f"{name}a"))
    return found


def _with_turn_lane(graph: RoadGraph, section: Section, *, at_end: bool) -> Section:
    """Add the lane on the inner side of the traffic that leads to one end."""
    road = section.road
    if road.centre is None:
        return section
    lane = replace(road.centre, turns=("right" if graph.left_hand else "left",))
    if at_end:
        return replace(section, road=replace(road, forward=(*road.forward, lane), centre=None))
    return replace(section, road=replace(road, backward=(*road.backward, lane), centre=None))
