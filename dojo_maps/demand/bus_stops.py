"""Where buses stop on their way: at the map's bus stops."""

import math
from collections import defaultdict
from dataclasses import replace

import shapely

from dojo_maps.demand.movements import BUS
from dojo_maps.demand.route_file import Stop, Trip
from dojo_maps.description import RoadMap
from dojo_maps.index import MapIndex

_BESIDE = 10.0
"""Metres from the middle of its lane at which a bus stop may stand."""
_BUS = 15.0
"""Metres of a lane that a bus takes where it stands."""
_TO_CHANGE = 60.0
"""Metres that a bus needs after a stop to get to another lane."""
_SECONDS = 15.0
"""How long a bus stands: a choice of ours, not a measurement."""


class BusStops:
    """The bus stops of a map, by the lanes at which they are."""

    def __init__(self, road_map: RoadMap) -> None:
        """Find the lane of each stop: the nearest one on which buses may drive."""
        index = MapIndex(road_map)
        lanes = [lane for lane in road_map.lanes if "bus" in lane.allow and len(lane.shape) > 1]
        lines = [shapely.LineString(lane.shape[:, :2]) for lane in lanes]
        tree = shapely.STRtree(lines)
        self._stops: dict[str, list[Stop]] = defaultdict(list)
        for prop in road_map.props if lanes else ():
            if prop.kind != "bus_stop" or prop.position is None:
                continue
            pole = shapely.Point(prop.position[:2])
            nearest = int(tree.nearest(pole))
            lane, line = lanes[nearest], lines[nearest]
            place = max(float(line.project(pole, normalized=True)) * lane.length, _BUS)
            if line.distance(pole) <= _BESIDE and place <= lane.length:
                # Down to the decimetre that is written: SUMO refuses a stop beyond the lane's end.
                stop = Stop(lane=lane.id, place=math.floor(place * 10) / 10, length=_BUS, seconds=_SECONDS)
                self._stops[lane.road].append(stop)
        self._room = {lane.id: lane.length for lane in lanes}
        self._leads_to = {
            lane.id: {index.lanes[each.to_lane].road for each in index.leaving.get(lane.id, ())}
            for lane in lanes
        }

    def call(self, trip: Trip) -> Trip:
        """Let a bus stop at the stops on its way from which it gets to where it wants to go.

        Args:
            trip: of any vehicle.

        Returns:
            The trip; a bus has its stops in order.
        """
        if trip.vehicle_class != BUS:
            return trip
        stops = [
            stop
            for road, after in zip(trip.roads, (*trip.roads[1:], None), strict=True)
            for stop in sorted(self._stops.get(road, ()), key=lambda stop: stop.place)
            if after is None
            or after in self._leads_to[stop.lane]
            or self._room[stop.lane] - stop.place >= _TO_CHANGE
        ]
        return replace(trip, stops=tuple(stops)) if stops else trip
