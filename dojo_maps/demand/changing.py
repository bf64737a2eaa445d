"""Traffic by a pattern: surges, platoons, turns, breakdowns, buses and emergency vehicles, drawn by a seed.

At each signal one side has the surge, for a while that nobody can foresee; then another has it. Routes and
their volumes are found once for a map, departures are drawn for each seed.
"""

from collections import defaultdict
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np

from dojo_maps.demand.bus_stops import BusStops
from dojo_maps.demand.movements import BUS, Route, find_routes
from dojo_maps.demand.patterns import Pattern, Range
from dojo_maps.demand.route_file import Stop, Stroll, Trip, draw_strolls, find_stubs, format_routes
from dojo_maps.demand.volumes import fill_routes
from dojo_maps.demand.walkers import find_walks
from dojo_maps.description import Lane, RoadMap
from dojo_maps.errors import DojoError
from dojo_maps.geometry.polylines import Floats
from dojo_maps.index import MapIndex

_HEADWAY = 2.0
"""Seconds between cars of a platoon: about a lane's saturation flow."""
_LEFT = ("l", "L")
_BROKEN_DOWN = (15.0, 60.0)
"""Metres from the stop line to where a car breaks down."""
_SHORTEST_CLOSED = 80.0
"""Metres of a road on which one may: those behind it need room to change lanes."""
_CAR = 8.0
"""Metres that a stopped car takes with its gap."""


_Side = tuple[int, ...]
"""The routes of one approach of a signal, by their places in the list of all."""


class ChangingTraffic:
    """A map's routes, and what a pattern makes of them for a seed."""

    def __init__(self, road_map: RoadMap, network: Path, pattern: Pattern) -> None:
        """Find the routes, their volumes, and where people walk.

        Args:
            road_map: with signals, or at least with junctions.
            network: the SUMO network that it describes.
            pattern: how its traffic varies.

        Raises:
            DojoError: nobody can drive across a junction, or the pattern needs crossings and there are none.
            SourceError: the network cannot be read.
        """
        self._pattern = pattern
        self._routes = find_routes(road_map)
        if not self._routes:
            raise DojoError(
                f"{road_map.name}: no car or bus can cross a junction; there is no demand to draw"
            )
        rates, _ = fill_routes(road_map, self._routes)
        self._rates: Floats = rates
        self._walks = find_walks(road_map, network)
        if pattern.needs_crossings and not self._walks:
            raise DojoError(
                f"{road_map.name}: no crossings that people can walk over, as pattern {pattern.name} needs "
                "some; dojo-maps convert --enrich-net adds some"
            )
        self._signals = _group_sides(road_map, self._routes)
        self._closable = _find_closable(road_map, self._routes)
        self._stubs = find_stubs(road_map)
        self._bus_stops = BusStops(road_map)

    def draw(self, seed: int, *, begin: float, end: float) -> tuple[list[Trip], list[Stroll]]:
        """Draw the traffic of an episode.

        Args:
            seed: another one gives other traffic.
            begin: seconds.
            end: seconds; nobody departs then or later.

        Returns:
            The vehicles and the people on foot, not in the order of their departures.
        """
        chance, pattern = np.random.default_rng([seed, 7]), self._pattern
        level = _draw(pattern.level, chance)
        trips: list[Trip] = []
        for sides in self._signals:
            for start, stop, factors in self._draw_surges(sides, chance, begin=begin, end=end):
                for place, rate in factors:
                    wanted = level * rate * (stop - start) / 3600
                    trips += self._draw_cars(place, wanted, chance, start=start, stop=stop)
            trips += self._draw_others(sides, chance, begin=begin, end=end)
        hours = (end - begin) / 3600
        busy = _draw(pattern.walkers, chance)
        counts = [int(chance.poisson(walk.rate * busy * hours)) for walk in self._walks]
        strolls = list(draw_strolls(self._walks, counts, chance, begin=begin, end=end))
        return [trip for trip in trips if trip.depart < end], strolls

    def format(self, seed: int, *, begin: float, end: float) -> str:
        """Write the traffic of an episode as a SUMO route file.

        Args:
            seed: another one gives other traffic.
            begin: seconds.
            end: seconds; nobody departs then or later.

        Returns:
            The file's text, in the order of departures.
        """
        return format_routes(*self.draw(seed, begin=begin, end=end), self._stubs)

    def _draw_surges(
        self, sides: Sequence[_Side], chance: np.random.Generator, *, begin: float, end: float
    ) -> Iterator[tuple[float, float, list[tuple[int, float]]]]:
        """Divide an episode at a signal: from when, until when, and each route's vehicles per hour then."""
        pattern, now, busy = self._pattern, begin, -1
        while now < end:
            others = [place for place in range(len(sides)) if place != busy]
            busy = int(chance.choice(others)) if others else 0
            # The first one has begun before the episode did.
            lasts = _draw(pattern.surge_seconds, chance) * (chance.random() if now == begin else 1.0)
            until = min(now + lasts, end)
            surge, rest = _draw(pattern.surge, chance), _draw(pattern.rest, chance)
            yield (
                now,
                until,
                [
                    (route, rate * (surge if place == busy else rest))
                    for place, side in enumerate(sides)
                    for route, rate in self._turn(side, chance)
                ],
            )
            now = until

    def _turn(self, side: _Side, chance: np.random.Generator) -> Iterator[tuple[int, float]]:
        """Share out a side's vehicles per hour among its turns."""
        usual = self._rates[list(side)]
        left = np.array([self._routes[place].direction in _LEFT for place in side])
        wanted = usual * np.where(left, _draw(self._pattern.left_turns, chance), 1.0)
        total = wanted.sum()
        shares = wanted * (usual.sum() / total) if total else wanted
        return zip(side, shares.tolist(), strict=True)

    def _draw_cars(
        self, place: int, wanted: float, chance: np.random.Generator, *, start: float, stop: float
    ) -> Iterator[Trip]:
        """Let so many vehicles of a route depart, by chance, alone or in platoons."""
        route, pattern = self._routes[place], self._pattern
        share = _draw(pattern.platoons, chance) if route.vehicle_class == "passenger" else 0.0
        size = sum(pattern.platoon_size) / 2
        times = [float(start + chance.random() * (stop - start))
                 for _ in range(int(chance.poisson(wanted * (1 - share))))]  # fmt: skip
        for _ in range(int(chance.poisson(wanted * share / size))):
            first = start + chance.random() * (stop - start)
            count = round(_draw(pattern.platoon_size, chance))
            times += [float(first + number * _HEADWAY) for number in range(count)]
        for time in sorted(times):
            yield Trip(depart=time, roads=route.roads, vehicle_class=route.vehicle_class)

    def _draw_others(
        self, sides: Sequence[_Side], chance: np.random.Generator, *, begin: float, end: float
    ) -> Iterator[Trip]:
        """Draw a signal's buses, emergency vehicles and incidents."""
        pattern, hours = self._pattern, (end - begin) / 3600
        places = [place for side in sides for place in side if self._rates[place] > 0]
        for name, often in ((BUS, pattern.buses), ("emergency", pattern.emergencies)):
            for _ in range(int(chance.poisson(_draw(often, chance) * hours)) if places else 0):
                route = self._routes[int(chance.choice(places))]
                depart = begin + chance.random() * (end - begin)
                trip = Trip(depart=float(depart), roads=route.roads, vehicle_class=name)
                yield self._bus_stops.call(trip)
        closable = [place for place in places if place in self._closable]
        for _ in range(int(chance.poisson(_draw(pattern.incidents, chance) * hours)) if closable else 0):
            place = int(chance.choice(closable))
            lanes = self._closable[place]
            lane = lanes[int(chance.integers(len(lanes)))]
            stop = Stop(
                lane=lane.id,
                place=round(lane.length - _draw(_BROKEN_DOWN, chance), 1),
                length=_CAR,
                seconds=round(_draw(pattern.incident_seconds, chance)),
            )
            depart = begin + chance.random() * (end - begin)
            yield Trip(
                depart=float(depart),
                roads=self._routes[place].roads,
                vehicle_class="passenger",
                stops=(stop,),
            )


def _draw(between: Range, chance: np.random.Generator) -> float:
    return float(chance.uniform(*between))


def _group_sides(road_map: RoadMap, routes: Sequence[Route]) -> list[tuple[_Side, ...]]:
    """Group routes by the signal that they are for, or the junction where there is none, and by side."""
    index = MapIndex(road_map)
    ends = {road.id: road.to_junction for road in road_map.roads}
    signals = {
        (index.lanes[link.from_lane].road, index.lanes[link.to_lane].road): link.signal
        for link in road_map.connections
        if link.signal is not None
    }
    found: dict[str, dict[str, list[int]]] = defaultdict(lambda: defaultdict(list))
    for place, route in enumerate(routes):
        road = route.movement[0]
        found[signals.get(route.movement, ends[road])][road].append(place)
    return [tuple(tuple(sides[road]) for road in sorted(sides)) for _, sides in sorted(found.items())]


def _find_closable(road_map: RoadMap, routes: Sequence[Route]) -> dict[int, tuple[Lane, ...]]:
    """List the lanes on which a car of a route may break down before its signal, where others can pass it."""
    index = MapIndex(road_map)
    roads = {road.id: road for road in road_map.roads}
    leading: dict[tuple[str, str], set[str]] = defaultdict(set)
    for link in road_map.connections:
        leading[index.lanes[link.from_lane].road, index.lanes[link.to_lane].road].add(link.from_lane)
    found: dict[int, tuple[Lane, ...]] = {}
    for place, route in enumerate(routes):
        lanes = [index.lanes[lane] for lane in roads[route.movement[0]].lanes]
        open_lanes = [lane for lane in lanes if "passenger" in lane.allow]
        own = tuple(lane for lane in open_lanes if lane.id in leading[route.movement])
        may = route.vehicle_class == "passenger" and len(open_lanes) > 1
        if may and own and own[0].length >= _SHORTEST_CLOSED:
            found[place] = own
    return found
