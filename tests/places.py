"""Where the elements of a map lie, for tests of positions."""

from collections.abc import Iterator, Sequence

import shapely

from dojo_maps.description import RoadMap
from dojo_maps.geometry.pieces import lane_strips


class Places:
    """Where the elements of a map lie."""

    def __init__(self, road_map: RoadMap) -> None:
        self.lanes = dict(zip((x.id for x in road_map.lanes), lane_strips(road_map.lanes), strict=True))
        self.lines = {c.id: shapely.LineString(c.shape[:, :2]) for c in road_map.connections}
        self.roads = {road.id: road for road in road_map.roads}
        self.junctions = {junction.id: junction for junction in road_map.junctions}
        self.signals = {signal.id: signal for signal in road_map.signals}
        areas = (*road_map.crossings, *road_map.walking_areas)
        self.areas = {thing.id: shapely.MultiPoint(thing.polygon[:, :2]).convex_hull for thing in areas}

    def __contains__(self, element: tuple[str, str]) -> bool:
        kind, id_ = element
        tables = {
            "lane": self.lanes,
            "connection": self.lines,
            "road": self.roads,
            "junction": self.junctions,
        }
        return id_ in {**tables, "signal": self.signals}.get(kind, self.areas)

    def of(self, kind: str, id_: str) -> Iterator[shapely.Geometry]:
        if kind == "road":
            yield from (self.lanes[lane] for lane in self.roads[id_].lanes)
        elif kind == "junction":
            junction = self.junctions[id_]
            yield shapely.Point(junction.position[:2])
            yield shapely.MultiPoint(junction.polygon[:, :2]).convex_hull
        elif kind == "signal":
            for link in self.signals[id_].links:
                yield from self.of("lane", link.from_id) if link.from_id in self.lanes else ()
                yield from self.of("crossing", link.to_id) if link.to_id in self.areas else ()
            for junction in self.signals[id_].junctions:
                yield from self.of("junction", junction)
        else:
            yield {"lane": self.lanes, "connection": self.lines}.get(kind, self.areas)[id_]

    def distance(self, kind: str, id_: str, position: Sequence[float]) -> float:
        """Measure from a position to an element; the map has to have it."""
        return min(shape.distance(shapely.Point(position[:2])) for shape in self.of(kind, id_))
