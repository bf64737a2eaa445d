"""Ways through junctions, and for each one a route that comes from the map's edge and leaves over it."""

import heapq
from collections import defaultdict
from collections.abc import Iterator
from dataclasses import dataclass

from dojo_maps.description import Connection, LaneKind, RoadMap
from dojo_maps.index import MapIndex

BUS = "bus"
CLASSES = ("passenger", BUS)
"""Who drives a movement: cars, or buses where cars may not."""
CYCLISTS = "bicycle"
TURNAROUNDS = ("t", "T")
"""SUMO's letters for them, where traffic keeps right and left."""
_LONGEST = 2_000.0
"""Metres from a junction to where a route may begin or end."""
_FARTHEST = 2 * _LONGEST
"""Metres that a route across the map may have."""

Arc = tuple[str, str]
"""A road and the next one."""
Streets = dict[str, list[str]]
"""What follows each road, or what each follows."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Route:
    """A way across the map made for one movement.

    Attributes:
        roads: ids in driving order.
        movement: the road before and the road after the junction that it is for.
        vehicle_class: SUMO's word for who drives it.
        direction: SUMO's letter for the movement's turn.
    """

    roads: tuple[str, ...]
    movement: Arc
    vehicle_class: str
    direction: str

    @property
    def arcs(self) -> tuple[Arc, ...]:
        """Each road with its next."""
        return tuple(zip(self.roads, self.roads[1:], strict=False))


def find_routes(road_map: RoadMap) -> tuple[Route, ...]:
    """Make a route for each movement through a signal, or, on a map without signals, through any junction.

    Turnarounds are left out: hardly anybody turns around at a signal, and it holds up all others.

    Args:
        road_map: with signals, or at least with junctions.

    Returns:
        A route for each movement that cars may make, or buses where cars may not; in the order of the map's
        connections.
    """
    return _find_routes(road_map, CLASSES)


def find_rides(road_map: RoadMap, *, own_lanes: bool) -> tuple[Route, ...]:
    """Make a route for each such movement that bicycles may make.

    Args:
        road_map: with signals, or at least with junctions.
        own_lanes: only for movements out of roads that have a lane for bicycles alone; among cars, cyclists
            hold them up.

    Returns:
        The routes, in the order of the map's connections.
    """
    rides = _find_routes(road_map, (CYCLISTS,))
    roads = {lane.road for lane in road_map.lanes if lane.kind is LaneKind.BICYCLE}
    return tuple(ride for ride in rides if ride.movement[0] in roads or not own_lanes)


def _find_routes(road_map: RoadMap, classes: tuple[str, ...]) -> tuple[Route, ...]:
    nets = {name: RoadNet(road_map, name) for name in classes}
    wanted: dict[Arc, Connection] = {}
    lane_road = {lane.id: lane.road for lane in road_map.lanes}
    for connection in road_map.connections:
        if connection.direction not in TURNAROUNDS and (
            connection.signal is not None or not road_map.signals
        ):
            arc = (lane_road[connection.from_lane], lane_road[connection.to_lane])
            wanted.setdefault(arc, connection)
    routes = []
    for arc, connection in wanted.items():
        name = next((name for name in classes if arc in nets[name].arcs), None)
        if name is not None:
            roads = nets[name].through(arc)
            routes.append(
                Route(roads=roads, movement=arc, vehicle_class=name, direction=connection.direction)
            )
    return tuple(routes)


class RoadNet:
    """The roads as one class of vehicles can follow each other, without turnarounds.

    Attributes:
        arcs: each road with each next one.
    """

    def __init__(self, road_map: RoadMap, vehicle_class: str) -> None:
        """Take the roads with lanes that are open to a class, by SUMO's word for it."""
        index = MapIndex(road_map)
        self.arcs = {
            arc
            for arc, links in index.road_links.items()
            if any(vehicle_class in index.users(c) and c.direction not in TURNAROUNDS for c in links)
        }
        self._before: dict[str, list[str]] = defaultdict(list)
        self._after: dict[str, list[str]] = defaultdict(list)
        for start, end in sorted(self.arcs):
            self._after[start].append(end)
            self._before[end].append(start)
        self._length = {road.id: index.lanes[road.lanes[0]].length for road in road_map.roads if road.lanes}
        self._ends = {road.id: (road.from_junction, road.to_junction) for road in road_map.roads}
        self._to_entry = self._distances(self._before, self._after)
        self._to_exit = self._distances(self._after, self._before)

    def through(self, arc: Arc) -> tuple[str, ...]:
        """Lead a route from the nearest edge of the map through a movement to another edge.

        Where no edge is near, the route begins or ends at the movement's own roads.

        Args:
            arc: one of `arcs`.

        Returns:
            The ids of its roads in driving order, among them those of the movement.
        """
        seen = {self._ends[road] for road in arc} | {self._ends[road][::-1] for road in arc}
        back = self._search(arc[0], self._before, self._to_entry, seen)
        seen |= {self._ends[road] for road in back} | {self._ends[road][::-1] for road in back}
        ahead = self._search(arc[1], self._after, self._to_exit, seen - {self._ends[arc[1]]})
        return (*reversed(back), *ahead)

    def across(self) -> Iterator[tuple[str, ...]]:
        """Lead the shortest route from each edge of the map to each other one that is not too far."""
        for start in sorted(self._after.keys() - self._before.keys()):
            came, reached = self._spread(start)
            yield from (tuple(_trace(came, road)) for road in reached if not self._after.get(road))

    def _spread(self, start: str) -> tuple[dict[str, str | None], list[str]]:
        """Reach all roads from one, nearest first. Source: Dijkstra, 1959."""
        queue: list[tuple[float, str, str]] = [(0.0, start, "")]
        came: dict[str, str | None] = {}
        while queue:
            length, road, before = heapq.heappop(queue)
            if road in came:
                continue
            came[road] = before or None
            for other in self._after.get(road, ()):
                if other not in came and length < _FARTHEST:
                    heapq.heappush(queue, (length + self._length[other], other, road))
        return came, list(came)

    def _distances(self, following: Streets, followed: Streets) -> dict[str, float]:
        """Measure from each road to the nearest that nothing follows; only those that lead to one."""
        queue = [(0.0, road) for road in sorted(self._length) if not following.get(road)]
        found: dict[str, float] = {}
        while queue:
            length, road = heapq.heappop(queue)
            if road not in found:
                found[road] = length
                for other in followed.get(road, ()):
                    heapq.heappush(queue, (length + self._length[road], other))
        return found

    def _search(
        self, start: str, following: Streets, left: dict[str, float], barred: set[tuple[str, str]]
    ) -> list[str]:
        """Find the nearest road that nothing follows; from `start` to it, through no barred street.

        Source: A*, Hart, Nilsson and Raphael, 1968. `left` is the way to go where nothing is barred.
        """
        queue: list[tuple[float, float, str]] = [(left.get(start, _LONGEST), 0.0, start)]
        came: dict[str, str | None] = {start: None}
        best = {start: 0.0}
        while queue:
            _, length, road = heapq.heappop(queue)
            if not following.get(road):
                return _trace(came, road)
            for other in following[road]:
                total = length + self._length[other]
                ahead = total + left.get(other, _LONGEST)
                if self._ends[other] not in barred and ahead < _LONGEST and total < best.get(other, _LONGEST):
                    best[other], came[other] = total, road
                    heapq.heappush(queue, (ahead, total, other))
        return [start]


def _trace(came: dict[str, str | None], road: str) -> list[str]:
    """List the roads from where a search began to one that it came to."""
    path = [road]
    while (previous := came[path[-1]]) is not None:
        path.append(previous)
    return path[::-1]
