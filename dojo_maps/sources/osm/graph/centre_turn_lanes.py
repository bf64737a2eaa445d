"""The lane in the middle of a street that both directions turn from: a turn lane of its own at each junction.

Between the junctions nothing is built of it, for SUMO has no lane for both directions.
"""

from dataclasses import replace

from dojo_maps.sources.osm.graph.road_graph import RoadGraph, Section


def add_centre_turn_lanes(graph: RoadGraph) -> RoadGraph:
    """Give the streets of a graph that have a lane in their middle a turn lane before each junction.

    Args:
        graph: the roads.

    Returns:
        The graph with these lanes; a street with room for them is split where they begin, in a shorter one
        a single lane runs all along.
    """
    ends = graph.ends()
    for _, section in sorted(graph.sections.items()):
        busy = [len(ends[vertex]) > 2 for vertex in (section.start, section.end)]
        if section.road.centre and not section.road.oneway and any(busy):
            graph = _add_before_junctions(graph, section, *busy)
    return graph


def _add_before_junctions(graph: RoadGraph, section: Section, at_start: bool, at_end: bool) -> RoadGraph:
    """Split a street before its junctions, and give the pieces there their turn lanes."""
    rules, length = graph.rules.centre_lanes, graph.length(section)
    if length < rules.length * (at_start + at_end) + rules.street_left:
        return _with_turn_lane(graph, section.id, at_end=at_end)
    places = [rules.length] * at_start + [length - rules.length] * at_end
    graph, nodes = graph.add_nodes((section.id, place) for place in places)
    graph = graph.split_at_nodes({section.id: nodes})
    last = section.id + "b" * len(places)
    graph = _with_turn_lane(graph, f"{section.id}a", at_end=False) if at_start else graph
    return _with_turn_lane(graph, last, at_end=True) if at_end else graph


def _with_turn_lane(graph: RoadGraph, name: str, *, at_end: bool) -> RoadGraph:
    """Add the lane on the inner side of the traffic that leads to one end."""
    section = graph.sections[name]
    road = section.road
    if road.centre is None:
        return graph
    lane = replace(road.centre, turns=("right" if graph.left_hand else "left",))
    if at_end:
        road = replace(road, forward=(*road.forward, lane), centre=None)
    else:
        road = replace(road, backward=(*road.backward, lane), centre=None)
    return replace(graph, sections={**graph.sections, name: replace(section, road=road)})
