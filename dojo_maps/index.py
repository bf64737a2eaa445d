"""One index of a description: its elements by id, and what leads where."""

from collections import defaultdict
from functools import cached_property

from dojo_maps.description import (
    Connection,
    Crossing,
    Junction,
    Lane,
    Origin,
    Road,
    RoadMap,
    Signal,
    WalkingArea,
)  # fmt: skip


class MapIndex:
    """The network's own part of a description, indexed; each table is made when it is first asked for."""

    def __init__(self, road_map: RoadMap) -> None:
        """Take a description, furnished or not."""
        self.map = road_map

    @cached_property
    def lanes(self) -> dict[str, Lane]:
        """Lanes by id."""
        return {lane.id: lane for lane in self.map.lanes}

    @cached_property
    def roads(self) -> dict[str, Road]:
        """Roads by id."""
        return {road.id: road for road in self.map.roads}

    @cached_property
    def junctions(self) -> dict[str, Junction]:
        """Junctions by id."""
        return {junction.id: junction for junction in self.map.junctions}

    @cached_property
    def signals_by_id(self) -> dict[str, Signal]:
        """Every signal by id, those of railways, too."""
        return {signal.id: signal for signal in self.map.signals}

    @cached_property
    def crossings(self) -> dict[str, Crossing]:
        """The network's own crossings by id."""
        return {c.id: c for c in self.map.crossings if c.origin is Origin.NETWORK}

    @cached_property
    def walking_areas(self) -> dict[str, WalkingArea]:
        """The network's own walking areas by id."""
        return {area.id: area for area in self.map.walking_areas if area.origin is Origin.NETWORK}

    @cached_property
    def connections(self) -> dict[str, Connection]:
        """Connections by id."""
        return {connection.id: connection for connection in self.map.connections}

    @cached_property
    def leaving(self) -> dict[str, list[Connection]]:
        """The connections that leave each lane."""
        found: dict[str, list[Connection]] = defaultdict(list)
        for connection in self.map.connections:
            found[connection.from_lane].append(connection)
        return found

    @cached_property
    def entering(self) -> dict[str, list[Connection]]:
        """The connections that enter each lane."""
        found: dict[str, list[Connection]] = defaultdict(list)
        for connection in self.map.connections:
            found[connection.to_lane].append(connection)
        return found

    @cached_property
    def controlled(self) -> dict[tuple[str, int], list[Connection | Crossing]]:
        """The ways that each letter of each signal controls."""
        found: dict[tuple[str, int], list[Connection | Crossing]] = defaultdict(list)
        ways: list[Connection | Crossing] = [*self.map.connections, *self.crossings.values()]
        for way in ways:
            if way.signal is not None and way.link_index is not None:
                found[way.signal, way.link_index].append(way)
        return found

    @cached_property
    def road_links(self) -> dict[tuple[str, str], list[Connection]]:
        """The connections from road to road."""
        found: dict[tuple[str, str], list[Connection]] = defaultdict(list)
        for connection in self.map.connections:
            pair = (self.lanes[connection.from_lane].road, self.lanes[connection.to_lane].road)
            found[pair].append(connection)
        return found

    def users(self, link: Connection) -> frozenset[str]:
        """Tell who may take a connection.

        Args:
            link: between two lanes of the map.

        Returns:
            SUMO's vehicle classes that may use both lanes and are not barred from the connection itself.
        """
        both = frozenset(self.lanes[link.from_lane].allow) & frozenset(self.lanes[link.to_lane].allow)
        return both if link.allow is None else both.intersection(link.allow)

    def kind(self, junction: str) -> str:
        """Name a junction's type; an unknown junction has none.

        Args:
            junction: its id.

        Returns:
            The type, or an empty text.
        """
        return self.junctions[junction].kind if junction in self.junctions else ""

    def legs(self, junction: str) -> int:
        """Count a junction's neighbours.

        Args:
            junction: its id.

        Returns:
            How many there are.
        """
        if junction not in self.junctions:
            return 0
        found = self.junctions[junction]
        ends = {self.roads[road].from_junction for road in found.incoming}
        return len(ends | {self.roads[road].to_junction for road in found.outgoing})

    def lanes_of(self, road: str) -> list[Lane]:
        """List a road's lanes, the outermost first.

        Args:
            road: its id.

        Returns:
            The lanes.
        """
        return [self.lanes[lane] for lane in self.roads[road].lanes if lane in self.lanes]
