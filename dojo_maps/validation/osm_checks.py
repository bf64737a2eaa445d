"""Checks of the data that a network is imported from, and of what is lost; a network alone skips them."""

from collections.abc import Iterable, Iterator

from dojo_maps.issue import Severity
from dojo_maps.validation.check import NOTE, WARNING, Check, Need

_ROWS = (
    ("OSM001", "osm.restriction", "Turn restrictions are complete and kept", WARNING, "none"),
    ("OSM002", "osm.lane_count", "Numbers of lanes agree", WARNING, "none"),
    ("OSM003", "osm.turn_lanes_order", "Turn lanes are in order", WARNING, "none"),
    ("OSM004", "osm.separate_sidewalk", "Sidewalks are not drawn twice", WARNING, "none"),
    ("OSM007", "osm.crossing_ignored", "Refuges and forbidden crossings are kept", NOTE, "none"),
    ("OSM008", "osm.approach_signals", "Signals stand at junctions, not on approaches only", WARNING, "none"),
    ("OSM009", "osm.junction_tag", "junction=intersection is meant", NOTE, "none"),
    ("OSM010", "osm.tram_on_road", "Trams and roads are drawn apart", NOTE, "none"),
    ("OSM011", "osm.clipped_way", "Ways are not cut at the area's border", NOTE, "none"),
    ("OSM013", "osm.unknown_lane_use", "Lane uses are known words", NOTE, "none"),
)

_LOSSES = (
    ("OSM005", "osm.parallel_ways", "Ways are not drawn twice", WARNING, "none"),
    ("OSM006", "osm.unshared_node", "Roads that cross on one level share a node", WARNING, "none"),
    ("OSM012", "osm.driving_side", "All agree on the side that traffic keeps to", WARNING, "none against it"),
    ("IMP001", "osm.split_signal", "A signalised junction has one controller", WARNING, "one controller"),
    ("IMP002", "osm.turn_lane_lost", "Lanes lead where their arrows say", NOTE, "all arrows"),
    ("IMP003", "osm.tag_not_kept", "What tags say of lanes and access is kept", NOTE, "all kept"),
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
    ("IMP018", "osm.road_lost", "Mapped roads are built whole", WARNING, "10 m of each class"),
    ("IMP021", "osm.junction_too_large", "Junctions pave no ground beside their roads", WARNING, "50 m²"),
    ("IMP025", "osm.ground", "Where the heights of streets are from", NOTE, "none"),
    ("IMP026", "osm.flat_ground", "The heights of streets are known", NOTE, "none"),
    ("IMP020", "osm.road_closed", "No barrier stands on a road", NOTE, "none"),
    ("IMP022", "osm.not_converged", "Junctions are settled after some attempts", WARNING, "8 attempts"),
    ("IMP019", "osm.not_imported", "All ways with traffic are imported", NOTE, "none left out"),
)
"""What an import counts while it builds a network: code, id, title, severity and limit."""

_OPENDRIVE = (
    ("IMP014", "sumo.opendrive_warning", "netconvert has nothing to object", NOTE, "none"),
    ("IMP015", "sumo.opendrive_lost", "All of an OpenDRIVE file is in the network", WARNING, "none"),
)
_CITYFLOW = (
    ("IMP016", "sumo.cityflow_warning", "netconvert has nothing to object", NOTE, "none"),
    ("IMP017", "sumo.cityflow_lost", "All of a CityFlow file is in the network", NOTE, "none"),
)


def _list_checks(
    rows: Iterable[tuple[str, str, str, Severity, str]], source: str, hint: str, needs: Need
) -> Iterator[Check]:
    for code, id_, title, severity, limit in rows:
        yield Check(
            id=id_,
            code=code,
            title=title,
            severity=severity,
            limit=limit,
            source=source,
            hint=hint,
            needs=needs,
        )


_LOOK = "look at the place in {}, and correct it there or in {}"
CHECKS = (
    *_list_checks(_ROWS, "OpenStreetMap wiki", "correct the tags in OpenStreetMap", Need.OSM),
    *_list_checks(_LOSSES, "OpenStreetMap", _LOOK.format("OpenStreetMap", "netedit"), Need.IMPORT),
    *_list_checks(_OPENDRIVE, "ASAM OpenDRIVE", _LOOK.format("netedit", "the OpenDRIVE file"), Need.IMPORT),
    *_list_checks(_CITYFLOW, "CityFlow", _LOOK.format("netedit", "the CityFlow file"), Need.IMPORT),
)
