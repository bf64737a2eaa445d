"""Where vehicles that wait inside a junction come into the way of those that they let go first."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import shapely

from dojo_maps.description import Connection, RoadMap
from dojo_maps.index import MapIndex

_GOING = frozenset("gGyY")
"""Letters of links on which somebody may be under way."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Meeting:
    """A way on which vehicles may wait inside a junction, and the first way of others that it touches.

    Attributes:
        connection: the way.
        other: a connection's id or a crossing's; "" where it touches none.
        place: metres from the stop line to where the front of a vehicle comes into the other's way.
    """

    connection: Connection
    other: str
    place: float


def find_meetings(
    road_map: RoadMap, states: Mapping[str, Sequence[str]], *, widest: float, nearest: float, walkers: bool
) -> Iterator[Meeting]:
    """Find for each way on which vehicles may wait inside a junction where they first stand in others' way.

    Others are those that it must let go first and that may go at the same time: no signal parts them. The
    crossing of its own road, which it passes before, does not count.

    Args:
        road_map: the map.
        states: of each signal's programs.
        widest: metres across a vehicle; on narrower lanes there are narrower ones.
        nearest: metres from the stop line; whose way is met before, cannot be kept clear and does not count.
        walkers: people on crossings are others, too.

    Yields:
        A meeting for each such way, in the order of the junctions; at the way's end where it touches none.
    """
    ways = _Ways(road_map if walkers else replace(road_map, crossings=()), states, widest)
    for junction in road_map.junctions:
        for way in junction.right_of_way:
            connection = ways.connections.get(way.link)
            if connection is None or not way.cont or connection.waits is None:
                continue
            line = shapely.LineString(connection.shape[:, :2])
            first = Meeting(connection=connection, other="", place=float(line.length))
            for foe in way.response:
                other = junction.right_of_way[foe].link
                if ways.may_meet(connection, other):
                    place = _reach(line, ways.ground(way.link), ways.ground(other))
                    if nearest <= place < first.place:
                        first = Meeting(connection=connection, other=other, place=place)
            yield first


class _Ways:
    """The ways across junctions, the ground that vehicles and people take on them, and their signals."""

    def __init__(self, road_map: RoadMap, states: Mapping[str, Sequence[str]], widest: float) -> None:
        self.connections = {connection.id: connection for connection in road_map.connections}
        self._crossings = {crossing.id: crossing for crossing in road_map.crossings}
        self._lanes = MapIndex(road_map).lanes
        self._states, self._widest = states, widest
        self._grounds: dict[str, shapely.Geometry] = {}

    def ground(self, name: str) -> shapely.Geometry:
        """Outline what a way takes, metres."""
        if name not in self._grounds:
            crossing, connection = self._crossings.get(name), self.connections.get(name)
            if crossing is not None and len(crossing.polygon) > 2:
                self._grounds[name] = shapely.make_valid(shapely.Polygon(crossing.polygon[:, :2]))
            elif connection is not None:
                ends = (self._lanes[lane].width for lane in (connection.from_lane, connection.to_lane))
                self._grounds[name] = shapely.LineString(connection.shape[:, :2]).buffer(
                    min(self._widest, *ends) / 2, cap_style="flat", join_style="mitre"
                )
            else:
                self._grounds[name] = shapely.Polygon()
        return self._grounds[name]

    def may_meet(self, connection: Connection, other: str) -> bool:
        """Tell whether others may be under way while somebody waits on a connection."""
        foe = self._crossings.get(other) or self.connections.get(other)
        if foe is None:
            return False
        crossing = self._crossings.get(other)
        if crossing is not None and self._lanes[connection.from_lane].road in crossing.roads:
            return False
        links = connection.link_index, foe.link_index
        if connection.signal is None or connection.signal != foe.signal or None in links:
            return True
        return any(
            all(state[link : link + 1] in _GOING for link in links if link is not None)
            for state in self._states.get(connection.signal, ())
        )


def _reach(line: shapely.LineString, strip: shapely.Geometry, ground: shapely.Geometry) -> float:
    """Measure along a way to where a vehicle on it first touches some ground, metres."""
    corners = shapely.get_coordinates(strip.intersection(ground))
    if not len(corners):
        return float(line.length)
    return float(shapely.line_locate_point(line, shapely.points(corners)).min())
