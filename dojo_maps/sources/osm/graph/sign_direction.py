"""Which traffic a signal or a sign on a road is for."""

from dojo_maps.sources.osm.graph.road_graph import RoadGraph, Section

_KEYS = ("traffic_signals:direction", "direction")
_SIDES = ("forward", "backward")


def sign_direction(graph: RoadGraph, section: Section, node: int) -> int:
    """Tell which traffic a signal or a sign on a road is for.

    Args:
        graph: the roads; tags speak of the direction of the way.
        section: the road.
        node: one of its nodes, with the sign.

    Returns:
        1 for traffic along the section, -1 for traffic against it, 0 where nothing says which.
    """
    if section.road.oneway:
        return 1
    tags = graph.tags[node]
    said = next((tags[key] for key in _KEYS if tags.get(key) in _SIDES), None)
    if said is None:
        return 0
    index = section.nodes.index(node)
    way = graph.ways.get(section.ways[min(index, len(section.ways) - 1)])
    other = section.nodes[index + 1] if index + 1 < len(section.nodes) else section.nodes[index - 1]
    if way is None or node not in way.nodes or other not in way.nodes:
        return 0
    same = (way.nodes.index(other) > way.nodes.index(node)) == (section.nodes.index(other) > index)
    return 1 if same == (said == "forward") else -1
