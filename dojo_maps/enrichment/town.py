"""The town around the streets of a map, generated from the map alone.

Houses, street lamps, signs, parking bays with cars in them, trees and hedges.
"""

from dataclasses import replace

import numpy as np
import shapely

from dojo_maps.description import RoadMap
from dojo_maps.enrichment.houses import generate_forecourts, generate_houses
from dojo_maps.enrichment.parking import PARKING, PAVEMENT_BEHIND, generate_parking, park_on_lanes
from dojo_maps.enrichment.roadside import Roadside
from dojo_maps.enrichment.surroundings import prop_shapes
from dojo_maps.enrichment.vicinity import look_around

_BUS = 9.0
"""How far around shelters nobody parks, metres."""
_TELLS_ITSELF = ("osm",)
"""Kinds of sources that say what stands around a street, but for its lamps."""


def build_town(road_map: RoadMap) -> RoadMap:
    """Build a town around the signals of a furnished map.

    Where the source tells of it, only lamps, shelters and the cars on its parking lanes are added.

    Args:
        road_map: with sidewalks, crossings, stop lines and signal heads.

    Returns:
        The map with more props; where its source tells of no town, sidewalks lead around parking bays, and
        forecourts are paved, too. A map without signals comes back as it is.
    """
    near = look_around(road_map)
    if near is None:
        return road_map
    is_told = road_map.source.kind in _TELLS_ITSELF
    houses = () if is_told else generate_houses(near)
    known = tuple(prop for prop in road_map.props if prop.kind == "building")
    roadside = Roadside(near, prop_shapes(known + houses))
    stops = [
        prop.position[:2]
        for prop in road_map.props
        if prop.kind == "bus_stop" and prop.position and ("shelter", "no") not in prop.tags
    ]
    props = houses + roadside.put_lamps()
    shelters = roadside.put_shelters(np.array(stops).reshape(-1, 2)) if stops or not is_told else ()
    props += shelters
    if is_told:
        return replace(road_map, props=road_map.props + props + park_on_lanes(near))
    rows = prop_shapes(tuple(house for house in houses if ("building", "apartments") in house.tags))
    gardens = prop_shapes(tuple(house for house in houses if ("building", "house") in house.tags))
    props += roadside.put_signs()
    stands = np.array([shelter.position[:2] for shelter in shelters if shelter.position]).reshape(-1, 2)
    buses = shapely.buffer(shapely.points(stands), _BUS)
    taken = np.concatenate([roadside.posts, buses])
    parking, sidewalks = generate_parking(near, road_map.sidewalks, roadside.walls, taken)
    bays = prop_shapes(tuple(prop for prop in parking if prop.kind == PARKING))
    roadside.keep_off(shapely.buffer(bays, PAVEMENT_BEHIND, join_style="mitre"))
    props += parking + roadside.plant_trees() + roadside.plant_hedges(gardens)
    return replace(
        road_map,
        sidewalks=sidewalks + generate_forecourts(near, rows, bays),
        props=road_map.props + props,
    )
