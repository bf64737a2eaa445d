"""How many vehicles each route gets: as many as lanes and greens can take, shared out fairly.

Movements that share a lane share its time. All routes grow together, each by its weight, until one of its
lanes has reached the wanted degree of saturation; then it stays and the others grow on (progressive
filling, which is max-min fair: Bertsekas and Gallager, Data Networks, section 6.5.2). What who yields can
take depends on the others' volumes, so this is done again with the volumes found, a few times.
"""

from collections import defaultdict
from collections.abc import Mapping, Sequence

import numpy as np

from dojo_maps.demand.capacities import Capacities
from dojo_maps.demand.movements import CLASSES, Arc, Route
from dojo_maps.description import Connection, RoadMap
from dojo_maps.geometry.polylines import Flags, Floats
from dojo_maps.index import MapIndex

SATURATION = 0.5
"""Share of its capacity that the scarcest lane of a route is used to. Above 0.85 to 0.9 queues grow without
end in some cycles (same manual, section on sustained spillback); well below, junctions are empty."""
_ROAD_FLOW = 1_500.0
_SHORT, _SHORT_FLOW = 100.0, 0.4
"""A road shorter than this, metres, that begins at a signal or at the map's edge cannot keep the next green
busy: its flow falls by its length to this share. Measured in SUMO: 0.49 at 15 m."""
_WEIGHTS = {"s": 1.0, "r": 0.4, "l": 0.4, "R": 0.4, "L": 0.4}
"""Turning traffic is about 15 to 30 % of an approach."""
_BUSES = 6.0
"""Buses per hour on a movement that only they may make, where they find room."""
_SIZES = {"bus": 2.0}
"""Cars that take as much of a road, by class. Source: Highway Capacity Manual, 7th edition, chapter 19."""
_FEWEST = 1.0
"""Vehicles per hour of a movement that no other route passes, even if there is no room for them."""
_ROUNDS = 6
_Links = dict[Arc, list[Connection]]
"""The connections that vehicles take from each road to the next, one per lane."""


def fill_routes(
    road_map: RoadMap, routes: Sequence[Route], *, total: float | None = None
) -> tuple[Floats, float]:
    """Give each route its volume.

    Args:
        road_map: lanes, links and programs.
        routes: of `find_routes`.
        total: vehicles per hour of all routes together; None for what the roads can take.

    Returns:
        (n,) vehicles per hour, and the degree of saturation of the fullest lane.
    """
    model, links = Capacities(road_map), _links_by_arc(road_map, routes)
    weights = np.array([_WEIGHTS.get(route.direction, 0.4) for route in routes])
    fixed = np.array([route.vehicle_class == "bus" for route in routes])
    flows: dict[str, float] = {}
    for _ in range(_ROUNDS):
        usage = _Usage(road_map, routes, links, model, flows)
        buses = np.minimum(_fill(usage, np.ones(len(routes)), np.zeros(len(routes)), fixed), _BUSES)
        rates = _fill(usage, weights * usage.capacities(len(routes)), buses, ~fixed)
        found = _flows(routes, rates, links)
        flows = {link: (flow + flows.get(link, flow)) / 2 for link, flow in found.items()}
    rates = _with_every_movement(routes, rates)
    usage = _Usage(road_map, routes, links, model, found)
    if total is not None:
        rates *= total / rates.sum()
    return rates, usage.fullest(rates)


def _with_every_movement(routes: Sequence[Route], rates: Floats) -> Floats:
    """See that each movement is used, by its own route where none of the others passes it."""
    used = {arc for route, rate in zip(routes, rates, strict=True) if rate >= _FEWEST for arc in route.arcs}
    alone = np.array([route.movement not in used for route in routes])
    return np.where(alone, np.maximum(rates, _FEWEST), rates)


def compute_saturation(road_map: RoadMap, routes: Sequence[Route], rates: Floats) -> float:
    """Tell the degree of saturation of the fullest lane.

    Args:
        road_map: lanes, links and programs.
        routes: what is driven.
        rates: (n,) vehicles per hour of each route.

    Returns:
        Its volume as a share of its capacity; 0 where there are no routes.
    """
    links = _links_by_arc(road_map, routes)
    flows = _flows(routes, rates, links)
    return _Usage(road_map, routes, links, Capacities(road_map), flows).fullest(rates)


def _fill(usage: "_Usage", weights: Floats, rates: Floats, growing: Flags) -> Floats:
    """Let routes grow by their weights until each has a resource that is used to `SATURATION`."""
    growing = growing.copy()
    while growing.any():
        pace = usage.of(np.where(growing, weights, 0.0))
        room = np.maximum(SATURATION - usage.of(rates), 0.0)
        steps = np.full(len(pace), np.inf)
        np.divide(room, pace, out=steps, where=pace > 0)
        step = steps.min()
        rates = rates + np.where(growing, weights * step, 0.0)
        growing[usage.routes[(steps <= step * (1 + 1e-9))[usage.resources]]] = False
    return rates


class _Usage:
    """What share of each resource, a lane before a junction or a road, a vehicle per hour of a route takes.

    Few routes use a resource, so only the shares that are not 0 are kept: (n,) each.

    Attributes:
        resources: indices.
        routes: indices.
        shares: what is taken.
    """

    def __init__(
        self,
        road_map: RoadMap,
        routes: Sequence[Route],
        links: _Links,
        model: Capacities,
        flows: Mapping[str, float],
    ) -> None:
        capacities = model.of(flows)
        rows: dict[str, int] = {}
        entries: list[tuple[int, int, float]] = []
        carried, kept = _road_flows(road_map, routes)
        for column, route in enumerate(routes):
            size = _SIZES.get(route.vehicle_class, 1.0)
            for road in route.roads:
                row = rows.setdefault(f"road {road}", len(rows))
                entries.append((row, column, size / carried[road]))
            for arc in route.arcs:
                for link in links[arc]:
                    row = rows.setdefault(f"lane {link.from_lane}", len(rows))
                    entries.append(
                        (row, column, size / (len(links[arc]) * capacities[link.id] * kept[arc[0]]))
                    )
            for road, room in model.rooms([links[arc] for arc in route.arcs]):
                entries.append((rows.setdefault(f"room {road}", len(rows)), column, size / room))
        self.resources = np.array([row for row, _, _ in entries], dtype=np.intp)
        self.routes = np.array([column for _, column, _ in entries], dtype=np.intp)
        self.shares = np.array([share for _, _, share in entries])
        self._count = len(rows)

    def fullest(self, rates: Floats) -> float:
        """Tell how far the fullest resource is used."""
        return float(self.of(rates).max(initial=0.0))

    def capacities(self, count: int) -> Floats:
        """Tell how many vehicles per hour each route could have alone: (count,)."""
        scarcest: Floats = np.zeros(count)
        np.maximum.at(scarcest, self.routes, self.shares)
        return 1.0 / scarcest

    def of(self, rates: Floats) -> Floats:
        """Add up how far each resource is used by routes of some vehicles per hour: (resources,)."""
        used: Floats = np.zeros(self._count)
        np.add.at(used, self.resources, self.shares * rates[self.routes])
        return used


def _road_flows(road_map: RoadMap, routes: Sequence[Route]) -> tuple[dict[str, float], dict[str, float]]:
    """Tell how many vehicles per hour each road can carry, and the share of a green that it keeps busy."""
    lanes = MapIndex(road_map).lanes
    entries = {route.roads[0] for route in routes}
    classes = {*CLASSES, *(route.vehicle_class for route in routes)}
    signalled = {junction for signal in road_map.signals for junction in signal.junctions}
    flows, kept = {}, {}
    for road in road_map.roads:
        driven = [lanes[lane] for lane in road.lanes if classes & set(lanes[lane].allow)]
        between = road.from_junction in signalled and road.to_junction in signalled
        kept[road.id] = 1.0
        if driven and (road.id in entries or between):
            kept[road.id] = min(1.0, _SHORT_FLOW + (1 - _SHORT_FLOW) * driven[0].length / _SHORT)
        flows[road.id] = _ROAD_FLOW * max(1, len(driven)) * kept[road.id]
    return flows, kept


def _links_by_arc(road_map: RoadMap, routes: Sequence[Route]) -> _Links:
    """List the connections that vehicles of a route may take from each road to the next, one per lane."""
    index = MapIndex(road_map)
    found: dict[Arc, dict[str, Connection]] = defaultdict(dict)
    for name in sorted({route.vehicle_class for route in routes}, reverse=True):
        for arc, links in index.road_links.items():
            for link in links:
                if name in index.users(link):
                    found[arc].setdefault(link.from_lane, link)
    return {arc: list(links.values()) for arc, links in found.items()}


def _flows(routes: Sequence[Route], rates: Floats, links: _Links) -> dict[str, float]:
    """Add up the vehicles per hour on each connection."""
    flows: dict[str, float] = defaultdict(float)
    for route, rate in zip(routes, rates.tolist(), strict=True):
        for arc in route.arcs:
            for link in links[arc]:
                flows[link.id] += rate / len(links[arc])
    return flows
