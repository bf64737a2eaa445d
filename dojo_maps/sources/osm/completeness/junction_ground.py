"""Ground of junctions that is far from every mapped road: it was paved by mistake."""

import shapely

from dojo_maps.issue import Element, Issue
from dojo_maps.sources.osm.completeness.losses import loss
from dojo_maps.sources.osm.network.osm_network import OsmNetwork
from dojo_maps.sources.osm.network.outline_trimming import MappedGround


def check_junction_ground(network: OsmNetwork) -> list[Issue]:
    """Measure the ground of each junction that is more than 6 m from the mapped carriageways and tracks.

    Args:
        network: as it was built.

    Returns:
        A warning for each junction with too much of it.
    """
    graph = network.layout.graph
    most = graph.rules.completeness.junction_void
    mapped = MappedGround(graph)
    node_of = {name: node for node, name in network.plain.nodes.items()}
    issues = []
    for junction in network.road_map.junctions:
        if len(junction.polygon) < 3 or junction.id not in node_of:
            continue
        ground = shapely.make_valid(shapely.Polygon(junction.polygon[:, :2]))
        far = mapped.beyond(ground)
        if far.area > most:
            place = far.representative_point()
            issues.append(
                loss(
                    "osm.junction_too_large",
                    f"{far.area:.0f} m² of a junction's ground are far from every mapped road",
                    ("node", node_of[junction.id]), (place.x, place.y),
                    "draw the junction's shape in netedit, or split it",
                    near=Element(kind="junction", id=junction.id),
                    measured=round(far.area, 1), limit=most,
                )
            )  # fmt: skip
    return issues
