"""What a street has and a network does not say, added to a description step by step."""

from dataclasses import replace

import shapely

from dojo_maps.description import RoadMap
from dojo_maps.enrichment.crossings import generate_crossings
from dojo_maps.enrichment.islands import find_islands
from dojo_maps.enrichment.sidewalks import generate_sidewalks
from dojo_maps.enrichment.signals import place_signal_heads, place_stop_lines
from dojo_maps.enrichment.surroundings import clear_street
from dojo_maps.enrichment.town import build_town


def furnish(
    road_map: RoadMap,
    paved: shapely.Geometry,
    *,
    generated: bool,
    surroundings: bool = True,
    far_side_signals: bool = False,
) -> RoadMap:
    """Add stop lines, islands, signal heads and poles, and where the network has none, places to walk.

    Buildings and trees that stand in the street give way to it.

    Args:
        road_map: as a source describes it.
        paved: the network's own ground, in the frame of `origin`.
        generated: whether to add what the source does not tell of: sidewalks, crossings and surroundings.
        surroundings: whether houses, trees and street lamps are among it.
        far_side_signals: whether traffic also has signal heads across the junction.

    Returns:
        The furnished map.
    """
    road_map = replace(road_map, props=road_map.props + find_islands(road_map, paved))
    if generated:
        road_map = replace(road_map, sidewalks=road_map.sidewalks + generate_sidewalks(road_map))
    road_map = clear_street(road_map, paved)
    if generated and not road_map.crossings:
        road_map = replace(road_map, crossings=generate_crossings(road_map))
    road_map = replace(road_map, stop_lines=place_stop_lines(road_map))
    road_map = place_signal_heads(road_map, far_side=far_side_signals)
    return build_town(road_map) if generated and surroundings else road_map
