"""OpenStreetMap: from mapped ways to plain nodes and edges that netconvert takes."""

from dojo_maps.sources.osm.read.data import OsmData, is_osm, link_to, read_osm

__all__ = ["OsmData", "is_osm", "link_to", "read_osm"]
