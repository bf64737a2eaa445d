"""What an import from OpenStreetMap is checked for; the checks are made while the network is built."""

from dojo_maps.issue import Severity

OSM_CHECKS = (
    ("osm.missing_crossing", "Mapped crossings are built", Severity.WARNING, "10 m"),
    ("osm.missing_signal", "Mapped signals are built", Severity.WARNING, "one controller"),
    ("osm.split_signal", "A signalised junction has one controller", Severity.WARNING, "one controller"),
    ("osm.turn_lane_lost", "Lanes lead where their arrows say", Severity.NOTE, "all arrows"),
    ("osm.turn_lane_mismatch", "There is an arrow entry for each lane", Severity.NOTE, "equal numbers"),
    ("osm.restriction_lost", "Forbidden turns are not connected", Severity.WARNING, "none"),
    ("osm.restriction_incomplete", "Turn restrictions are complete", Severity.NOTE, "from, via and to"),
    ("osm.sidewalk_lost", "Mapped sidewalks are built", Severity.NOTE, "6 m, for all but 10 m"),
    ("osm.short_edge", "Roads between junctions can store a car", Severity.NOTE, "5 m"),
    ("osm.missing_node", "Roads have all their nodes", Severity.NOTE, "none missing"),
    ("osm.netconvert_warning", "netconvert has nothing to object", Severity.NOTE, "none"),
    ("osm.context_left_out", "Buildings, trees and areas are all kept", Severity.NOTE, "thousands of each"),
    ("edits.no_longer_fits", "Kept edits fit the new network", Severity.WARNING, "all"),
    ("osm.netconvert_failed", "netconvert takes all options", Severity.WARNING, "none"),
)
"""Id, title, severity and limit."""
