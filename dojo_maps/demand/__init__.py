"""Traffic for a first run on a map that comes without any, or such as was counted there.

Described roads go in, a SUMO route file comes out: `movements` finds the ways through signals and routes
over them, `volumes` fills them up to a share of what lanes and greens let through, `walkers` sends people
over the crossings, `route_file` draws departures and writes. Where there are `counts`, `sampling` chooses
the vehicles that meet them. Of `patterns`, `changing` draws traffic that changes when nobody foresees it.
"""

import math
from collections import Counter, defaultdict
from dataclasses import dataclass
from itertools import chain
from pathlib import Path
from typing import Any

import numpy as np

from dojo_maps.demand.bus_stops import BusStops
from dojo_maps.demand.changing import ChangingTraffic
from dojo_maps.demand.counts import GOOD_GEH, WALKERS, Count, CountMet, compare
from dojo_maps.demand.movements import CYCLISTS, Route, find_rides, find_routes
from dojo_maps.demand.patterns import Pattern
from dojo_maps.demand.route_file import Stroll, Trip, draw_strolls, draw_trips, find_stubs, write_route_file
from dojo_maps.demand.sampling import model_counts, sample_trips
from dojo_maps.demand.volumes import compute_saturation, fill_routes
from dojo_maps.demand.walkers import Walk, find_walks
from dojo_maps.description import RoadMap
from dojo_maps.errors import DojoError, UsageError
from dojo_maps.short_repr import short_repr

_RIDES = 10.0
"""Cyclists per hour on a movement, where it has room for them."""
_IMPATIENCE = 0.5
"""SUMO's `impatience` of drivers and cyclists: who has to wait takes gaps in which others brake a little.
Without it some wait for minutes beside a busy stream. Changing patterns of demand have none."""


@dataclass(frozen=True, slots=True, kw_only=True)
class DemandOptions:
    """What traffic to write.

    Attributes:
        volume: vehicles per hour in all, bicycles aside; None for as many as use 50 % of the scarcest lanes'
            capacity.
        bicycles: per hour in all; None for some where they have lanes of their own.
        walkers: people on foot per hour in all; None for some on each crossing.
        pattern: how the traffic changes; the amounts above are left to it.
        counts: to be met; who was not counted is then there only where a number is given.
        seed: the same one gives the same file.
        begin: seconds, when the first may depart.
        end: seconds, when nobody departs any more.
    """

    volume: float | None = None
    bicycles: float | None = None
    walkers: float | None = None
    pattern: Pattern | None = None
    counts: tuple[Count, ...] = ()
    seed: int = 0
    begin: float = 0.0
    end: float = 3600.0

    __repr__ = short_repr

    def __post_init__(self) -> None:
        """Refuse amounts and times that cannot be.

        Raises:
            UsageError: one is negative, or the demand ends before it begins.
        """
        for name in ("volume", "bicycles", "walkers", "seed", "begin"):
            value = getattr(self, name)
            if value is not None and not (isinstance(value, int | float) and 0 <= value < math.inf):
                raise UsageError(f"{name}={value!r}: expected a number, 0 or more")
        if not self.begin < self.end:
            raise UsageError(f"end={self.end!r}: expected seconds after the begin, {self.begin:g}")


@dataclass(frozen=True, slots=True, kw_only=True)
class Demand:
    """What was written.

    Attributes:
        begin: seconds.
        end: seconds.
        vehicles: how many, bicycles aside.
        bicycles: how many.
        walkers: how many people on foot.
        saturation: the volume of the fullest lane as a share of its capacity.
        counts: each with what the demand makes of it.
    """

    begin: float
    end: float
    vehicles: int
    bicycles: int
    walkers: int
    saturation: float
    counts: tuple[CountMet, ...] = ()


def write_demand(
    road_map: RoadMap, network: Path, path: Path, options: DemandOptions | None = None
) -> Demand | None:
    """Write traffic for a map.

    Args:
        road_map: with signals, or at least with junctions.
        network: the SUMO network that it describes.
        path: the route file to write.
        options: what traffic; None for an hour of what the junctions can take.

    Returns:
        What was written; None, and nothing written, where no car or bus can cross a junction, or nobody was
        counted. With a pattern there is always a file.

    Raises:
        DojoError: the counts cannot be met, as nobody can walk where people were counted or SUMO's tool
            fails; or the pattern cannot be drawn, as no car or bus can cross a junction, or as it needs
            crossings that people can walk over and there are none.
        SourceError: the network cannot be read.
        ToolMissingError: vehicles were counted, and SUMO's tools are not installed.
        UsageError: the path is a folder, or lies in none.
        WriteError: the file cannot be written.
    """
    options = options or DemandOptions()
    if options.pattern is not None:
        traffic = ChangingTraffic(road_map, network, options.pattern)
        trips, strolls = traffic.draw(options.seed, begin=options.begin, end=options.end)
        return _deliver(road_map, trips, strolls, path, options)
    chance = np.random.default_rng(options.seed)
    walks = find_walks(road_map, network)
    if options.counts:
        trips, strolls = _counted(road_map, walks, options, chance)
    else:
        trips = _drawn(road_map, options, chance)
        strolls = []
    if not trips and not strolls:
        return None
    stops = BusStops(road_map)
    trips = [stops.call(trip) for trip in trips] + _cyclists(road_map, options, chance)
    strolls += _strollers(walks, options, chance)
    return _deliver(road_map, trips, strolls, path, options)


def _deliver(
    road_map: RoadMap, trips: list[Trip], strolls: list[Stroll], path: Path, options: DemandOptions
) -> Demand:
    impatience = _IMPATIENCE if options.pattern is None else 0.0
    write_route_file(trips, strolls, path, find_stubs(road_map), impatience=impatience)
    bicycles = sum(trip.vehicle_class == CYCLISTS for trip in trips)
    return Demand(
        begin=options.begin,
        end=options.end,
        vehicles=len(trips) - bicycles,
        bicycles=bicycles,
        walkers=len(strolls),
        saturation=_saturation(road_map, trips, options),
        counts=_met(options.counts, trips, strolls),
    )


def as_json(demand: Demand) -> dict[str, Any]:
    """Describe a demand as JSON values, as reports have it.

    Args:
        demand: what was written.

    Returns:
        Its amounts by their names; where there are counts, those with their GEH, and the share that is met.
    """
    names = ("begin", "end", "vehicles", "bicycles", "walkers", "saturation")
    described: dict[str, Any] = {name: getattr(demand, name) for name in names}
    if demand.counts:
        described["counts"] = [_count_as_json(met) for met in demand.counts]
        described["geh_below_5"] = share_met(demand)
    return described


def share_met(demand: Demand) -> float:
    """Tell the share of the counts whose GEH is below 5.

    Args:
        demand: with one count at least.

    Returns:
        From 0 to 1.
    """
    return sum(met.geh < GOOD_GEH for met in demand.counts) / len(demand.counts)


def _count_as_json(met: CountMet) -> dict[str, Any]:
    count = met.count
    return {
        "from_edge": count.from_edge,
        "to_edge": count.to_edge or None,
        "class": count.vehicle_class,
        "begin": count.begin,
        "end": count.end,
        "count": count.count,
        "modelled": met.modelled,
        "geh": round(met.geh, 2),
    }


def _drawn(road_map: RoadMap, options: DemandOptions, chance: np.random.Generator) -> list[Trip]:
    """Draw vehicles for each movement."""
    routes = find_routes(road_map)
    if not routes:
        return []
    rates, _ = fill_routes(road_map, routes, total=options.volume)
    return list(draw_trips(routes, rates, chance, begin=options.begin, end=options.end))


def _cyclists(road_map: RoadMap, options: DemandOptions, chance: np.random.Generator) -> list[Trip]:
    if options.bicycles == 0 or (options.bicycles is None and options.counts):
        return []
    rides = find_rides(road_map, own_lanes=options.bicycles is None)
    if not rides:
        return []
    if options.bicycles is None:
        rates = np.minimum(fill_routes(road_map, rides)[0], _RIDES)
    else:
        rates = np.full(len(rides), options.bicycles / len(rides))
    return list(draw_trips(rides, rates, chance, begin=options.begin, end=options.end))


def _strollers(walks: tuple[Walk, ...], options: DemandOptions, chance: np.random.Generator) -> list[Stroll]:
    if options.walkers is None and options.counts:
        return []
    total = sum(walk.rate for walk in walks)
    factor = 1.0 if options.walkers is None or not total else options.walkers / total
    hours = (options.end - options.begin) / 3600
    counts = [round(walk.rate * factor * hours) for walk in walks]
    return list(draw_strolls(walks, counts, chance, begin=options.begin, end=options.end))


def _counted(
    road_map: RoadMap, walks: tuple[Walk, ...], options: DemandOptions, chance: np.random.Generator
) -> tuple[list[Trip], list[Stroll]]:
    """Choose vehicles, class by class, and people that meet the counts."""
    by_class: dict[str, list[Count]] = defaultdict(list)
    for count in options.counts:
        by_class[count.vehicle_class].append(count)
    strolls = [stroll for count in by_class.pop(WALKERS, []) for stroll in _walk_over(walks, count, chance)]
    sampled = (sample_trips(road_map, counts, seed=options.seed) for counts in by_class.values())
    return list(chain.from_iterable(sampled)), strolls


def _walk_over(walks: tuple[Walk, ...], count: Count, chance: np.random.Generator) -> list[Stroll]:
    """Send as many people over a crossing as were counted, half of them each way."""
    ways = [number for number, walk in enumerate(walks) if walk.crossing == count.from_edge]
    if not ways:
        raise DojoError(f"crossing {count.from_edge!r}: no sidewalks lead to both of its ends; leave it out")
    shares = [0] * len(walks)
    for k, way in enumerate(ways):
        shares[way] = (count.count + k) // len(ways)
    return list(draw_strolls(walks, shares, chance, begin=count.begin, end=count.end))


def _saturation(road_map: RoadMap, trips: list[Trip], options: DemandOptions) -> float:
    hours = (options.end - options.begin) / 3600
    numbers = Counter((trip.roads, trip.vehicle_class) for trip in trips if trip.vehicle_class != CYCLISTS)
    routes = [
        Route(roads=roads, movement=(roads[0], roads[-1]), vehicle_class=name, direction="")
        for roads, name in numbers
    ]
    return compute_saturation(road_map, routes, np.array(list(numbers.values())) / hours)


def _met(counts: tuple[Count, ...], trips: list[Trip], strolls: list[Stroll]) -> tuple[CountMet, ...]:
    steps = [
        Trip(depart=stroll.depart, roads=(stroll.walk.crossing,), vehicle_class=WALKERS) for stroll in strolls
    ]
    return compare(counts, model_counts(counts, [*trips, *steps]))
