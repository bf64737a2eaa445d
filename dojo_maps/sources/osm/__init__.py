"""OpenStreetMap: from mapped ways to plain nodes and edges that netconvert takes."""

from dojo_maps.sources.osm.read.data import OsmData, link_to
from dojo_maps.sources.osm.read.reading import is_osm, read_osm

__all__ = ["OsmData", "is_osm", "link_to", "read_osm"]
