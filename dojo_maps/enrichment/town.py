"""The town around the streets of a map, generated from the map alone: houses, lamps, signs, trees, hedges."""

from dataclasses import replace

from dojo_maps.description import RoadMap
from dojo_maps.enrichment.houses import generate_forecourts, generate_houses
from dojo_maps.enrichment.roadside import Roadside
from dojo_maps.enrichment.surroundings import prop_shapes
from dojo_maps.enrichment.vicinity import look_around

_TELLS_ITSELF = ("osm",)
"""Kinds of sources that say what stands around a street, or that nothing does."""


def build_town(road_map: RoadMap) -> RoadMap:
    """Build a town around the signals of a furnished map whose source tells of none."""
    near = None if road_map.source.kind in _TELLS_ITSELF else look_around(road_map)
    if near is None:
        return road_map
    houses = generate_houses(near)
    rows = tuple(house for house in houses if dict(house.tags)["building"] == "apartments")
    gardens = tuple(house for house in houses if house not in rows)
    roadside = Roadside(near, prop_shapes(houses))
    return replace(
        road_map,
        sidewalks=road_map.sidewalks + tuple(generate_forecourts(near, prop_shapes(rows))),
        props=(
            *road_map.props,
            *houses,
            *roadside.put_lamps(),
            *roadside.put_signs(),
            *roadside.plant_trees(),
            *roadside.plant_hedges(prop_shapes(gardens)),
        ),
    )
