"""Checks of the data that a network is imported from, and of what is lost; a network alone skips them."""

from dojo_maps.validation.check import NOTE, WARNING, Check, Need

_ROWS = (
    ("OSM001", "osm.restriction", "Turn restrictions are complete and kept", WARNING),
    ("OSM002", "osm.lane_count", "Numbers of lanes agree", WARNING),
    ("OSM003", "osm.turn_lanes_order", "Turn lanes are in order", WARNING),
    ("OSM004", "osm.separate_sidewalk", "Sidewalks are not drawn twice", WARNING),
    ("OSM007", "osm.crossing_ignored", "Refuges and forbidden crossings are kept", NOTE),
    ("OSM008", "osm.approach_signals", "Signals stand at junctions, not on approaches only", WARNING),
    ("OSM009", "osm.junction_tag", "junction=intersection is meant", NOTE),
    ("OSM010", "osm.tram_on_road", "Trams and roads are drawn apart", NOTE),
    ("OSM011", "osm.clipped_way", "Ways are not cut at the area's border", NOTE),
    ("OSM012", "osm.driving_side", "The driving side is set", WARNING),
    ("OSM013", "osm.unknown_lane_use", "Lane uses are known words", NOTE),
)

_LOSSES = (
    ("OSM005", "osm.parallel_ways", "Ways are not drawn twice", WARNING, "none"),
    ("OSM006", "osm.unshared_node", "Roads that cross on one level share a node", WARNING, "none"),
    ("IMP001", "osm.split_signal", "A signalised junction has one controller", WARNING, "one controller"),
    ("IMP002", "osm.turn_lane_lost", "Lanes lead where their arrows say", NOTE, "all arrows"),
    ("IMP003", "osm.turn_lane_mismatch", "There is an arrow entry for each lane", NOTE, "equal numbers"),
    ("IMP004", "osm.restriction_lost", "Forbidden turns are not connected", WARNING, "none"),
    ("IMP005", "osm.restriction_incomplete", "Turn restrictions are complete", NOTE, "from, via and to"),
    ("IMP006", "osm.sidewalk_lost", "Mapped sidewalks are built", NOTE, "6 m, for all but 10 m"),
    ("IMP007", "osm.short_edge", "Roads between junctions can store a car", NOTE, "5 m"),
    ("IMP008", "osm.missing_node", "Roads have all their nodes", NOTE, "none missing"),
    ("IMP009", "osm.netconvert_warning", "netconvert has nothing to object", NOTE, "none"),
    ("IMP010", "osm.netconvert_failed", "netconvert takes all options", WARNING, "none"),
    ("IMP011", "osm.context_left_out", "Buildings, trees and areas are all kept", NOTE, "thousands of each"),
    ("IMP012", "osm.edit_lost", "Kept edits fit the new network", WARNING, "all"),
    ("IMP013", "osm.restriction_conditional", "Turn restrictions hold at all times", NOTE, "no conditions"),
)
"""What an import counts while it builds a network: code, id, title, severity and limit."""

_OPENDRIVE = (
    ("IMP014", "sumo.opendrive_warning", "netconvert has nothing to object", NOTE),
    ("IMP015", "sumo.opendrive_lost", "All of an OpenDRIVE file is in the network", WARNING),
)

CHECKS = (
    *(
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
    ),
    *(
        Check(
            id=id_,
            code=code,
            title=title,
            severity=severity,
            limit=limit,
            source="OpenStreetMap",
            hint="look at the place in OpenStreetMap, and correct it there or in netedit",
            needs=Need.IMPORT,
        )
        for code, id_, title, severity, limit in _LOSSES
    ),
    *(
        Check(
            id=id_,
            code=code,
            title=title,
            severity=severity,
            limit="none",
            source="ASAM OpenDRIVE",
            hint="look at the place in netedit, and correct it there or in the OpenDRIVE file",
            needs=Need.IMPORT,
        )
        for code, id_, title, severity in _OPENDRIVE
    ),
)
