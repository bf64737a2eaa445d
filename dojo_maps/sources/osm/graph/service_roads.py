"""Service roads that have a place at a signal: entrances of car parks and malls that are arms of a junction.

Other service roads are left out: thousands of drives and parking aisles would hide the streets.
"""

from collections.abc import Collection

from dojo_maps.sources.osm.read.data import OsmData
from dojo_maps.sources.osm.read.way_tags import DRIVES, why_not_a_road


def find_signalised_service_roads(data: OsmData, roads: Collection[int]) -> frozenset[int]:
    """Find the service roads that end at a road's signal, or have a signal of their own before a road.

    Args:
        data: the extract.
        roads: the ways that are built anyway.

    Returns:
        Ids of the ways.
    """
    on_roads = {node for way in roads for node in data.ways[way].nodes}
    signals = {node for node, found in data.nodes.items() if found.tags.get("highway") == "traffic_signals"}
    return frozenset(
        way
        for way, found in data.ways.items()
        if found.tags.get("highway") == "service"
        and found.tags.get("service") not in DRIVES
        and why_not_a_road(found.tags, service=True) is None
        and signals.intersection(found.nodes)
        and on_roads.intersection(found.nodes)
    )
