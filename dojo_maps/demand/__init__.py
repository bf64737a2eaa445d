"""Traffic for a first run on a map that comes without any: every movement used, no junction jammed or empty.

Described roads go in, a SUMO route file comes out: `movements` finds the ways through signals and routes
over them, `volumes` fills them up to a share of what lanes and greens let through, `walkers` sends people
over the crossings, `route_file` draws departures and writes.
"""

from dataclasses import dataclass
from pathlib import Path

from dojo_maps.demand.movements import find_routes
from dojo_maps.demand.route_file import write_route_file
from dojo_maps.demand.volumes import fill_routes
from dojo_maps.demand.walkers import find_walks
from dojo_maps.description import RoadMap

DURATION = 3600
"""Seconds over which departures are spread."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Demand:
    """What was written: vehicles and walkers in the first hour, and how full the fullest lane gets.

    `saturation` is the volume of the fullest lane as a share of its capacity.
    """

    vehicles: int
    walkers: int
    saturation: float


def write_demand(
    road_map: RoadMap, network: Path, path: Path, *, volume: float | None = None, seed: int = 0
) -> Demand | None:
    """Write an hour of traffic for a map.

    Args:
        road_map: with signals, or at least with junctions.
        network: the SUMO network that it describes.
        path: the route file to write.
        volume: vehicles per hour in all; None for as many as use 60 % of the scarcest lanes' capacity.
        seed: the same one gives the same file.

    Returns:
        What was written; None, and nothing written, where no car or bus can cross a junction.
    """
    routes = find_routes(road_map)
    if not routes:
        return None
    rates, saturation = fill_routes(road_map, routes, total=volume)
    vehicles, walkers = write_route_file(
        routes, rates, find_walks(road_map, network), path, seed=seed, duration=DURATION
    )
    return Demand(vehicles=vehicles, walkers=walkers, saturation=saturation)
