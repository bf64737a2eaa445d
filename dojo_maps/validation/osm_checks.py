"""Checks of OpenStreetMap's own data; they are skipped where a map comes from a network alone."""

from dojo_maps.validation.check import NOTE, WARNING, Check, Need

_ROWS = (
    ("OSM001", "osm.restriction", "Turn restrictions are complete and kept", WARNING),
    ("OSM002", "osm.lane_count", "Numbers of lanes agree", WARNING),
    ("OSM003", "osm.turn_lanes_order", "Turn lanes are in order", WARNING),
    ("OSM004", "osm.separate_sidewalk", "Sidewalks are not drawn twice", WARNING),
    ("OSM005", "osm.parallel_ways", "Ways are not drawn twice", WARNING),
    ("OSM006", "osm.unshared_node", "Ways that cross share a node or differ in layer", WARNING),
    ("OSM007", "osm.crossing_ignored", "Refuges and forbidden crossings are kept", NOTE),
    ("OSM008", "osm.approach_signals", "Signals stand at junctions, not on approaches only", WARNING),
    ("OSM009", "osm.junction_tag", "junction=intersection is meant", NOTE),
    ("OSM010", "osm.tram_on_road", "Trams and roads are drawn apart", NOTE),
    ("OSM011", "osm.clipped_way", "Ways are not cut at the area's border", NOTE),
    ("OSM012", "osm.driving_side", "The driving side is set", WARNING),
    ("OSM013", "osm.unknown_lane_use", "Lane uses are known words", NOTE),
)

CHECKS = tuple(
    Check(
        id=id_,
        code=code,
        title=title,
        severity=severity,
        limit="none",
        source="OpenStreetMap wiki",
        hint="correct the tags in OpenStreetMap",
        needs=Need.OSM,
    )
    for code, id_, title, severity in _ROWS
)
