"""MetaDrive's `map_features`: lanes, lines between them, pavements and crosswalks.

A lane keeps its id from the network; the way through a junction is a lane too, under its connection's id.
Everything else is named by what it is: `line/...`, `sidewalk/...`, `walking_area/...`, `crossing/...`.
Rails, waterways and lanes for other traffic have no type in MetaDrive and are left out.
"""

from collections import defaultdict
from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
import shapely

from dojo_maps.description import CARRIAGEWAY, Connection, Lane, LaneKind, Points, Road, RoadMap
from dojo_maps.geometry.polylines import Floats, drop_repeats

Feature = dict[str, Any]

_LANE_TYPES = {
    LaneKind.DRIVING: "LANE_SURFACE_STREET",
    LaneKind.BUS: "LANE_SURFACE_STREET",
    LaneKind.SHOULDER: "LANE_UNKNOWN",
    LaneKind.BICYCLE: "LANE_BIKE_LANE",
}
_JUNCTION_LANE = "LANE_SURFACE_UNSTRUCTURE"
_BROKEN, _SOLID, _EDGE = (
    "ROAD_LINE_BROKEN_SINGLE_WHITE",
    "ROAD_LINE_SOLID_SINGLE_WHITE",
    "ROAD_EDGE_BOUNDARY",
)
_SAME_EDGE = 1.0
"""Edges of opposite roads that are nearer to each other, metres, share one centre line."""
_LEVEL_GAP = 2.0
"""A lane this far above or below a pavement, metres, passes over or under it."""


def build_features(road_map: RoadMap) -> dict[str, Feature]:
    """Build every feature, in the order of the map's lists.

    Args:
        road_map: what to describe.

    Returns:
        Features by id; positions in metres around the map's origin.
    """
    origin = np.array([*road_map.origin, 0.0])
    lines = {
        lane.id: drop_repeats(lane.shape) - origin for lane in road_map.lanes if lane.kind in _LANE_TYPES
    }
    lanes = {lane.id: lane for lane in road_map.lanes if len(lines.get(lane.id, ())) > 1}
    features = {
        lane_id: _lane_feature(_LANE_TYPES[lane.kind], lines[lane_id], lane.width, lane.speed)
        for lane_id, lane in lanes.items()
    }
    _add_connections(features, road_map.connections, lanes, origin)
    inward = -1 if road_map.left_hand else 1
    _add_neighbours(features, road_map.roads, lanes, inward)
    features.update(_line_features(road_map, lanes, lines, inward))
    features.update(_surface_features(road_map, {name: lines[name] for name in lanes}, lanes, origin))
    return features


def _lane_feature(kind: str, line: Points, width: float, speed: float) -> Feature:
    return {
        "type": kind,
        "polyline": line,
        "polygon": lane_polygon(line, width),
        "entry_lanes": [],
        "exit_lanes": [],
        "left_neighbor": [],
        "right_neighbor": [],
        "speed_limit_kmh": speed * 3.6,
        "width": width,
    }


def _add_connections(
    features: dict[str, Feature], connections: Sequence[Connection], lanes: dict[str, Lane], origin: Floats
) -> None:
    """Add a lane per connection; lanes that touch already follow each other without one."""
    for connection in connections:
        source, target = lanes.get(connection.from_lane), lanes.get(connection.to_lane)
        if source is None or target is None or connection.id in features:
            continue
        line = drop_repeats(connection.shape) - origin
        before, after = source.id, target.id
        if len(line) > 1:
            width, speed = min(source.width, target.width), min(source.speed, target.speed)
            features[connection.id] = _lane_feature(_JUNCTION_LANE, line, width, speed)
            features[connection.id]["entry_lanes"].append(source.id)
            features[connection.id]["exit_lanes"].append(target.id)
            before = after = connection.id
        features[source.id]["exit_lanes"].append(after)
        features[target.id]["entry_lanes"].append(before)


def _add_neighbours(
    features: dict[str, Feature], roads: Sequence[Road], lanes: dict[str, Lane], inward: int
) -> None:
    """Name the lanes for cars on either side of each, nearest first."""
    sides = ("left_neighbor", "right_neighbor")[::inward]
    for road in roads:
        row = [lane for lane in road.lanes if lane in lanes and lanes[lane].kind in CARRIAGEWAY]
        for index, lane in enumerate(row):
            features[lane][sides[0]] = row[index + 1 :]
            features[lane][sides[1]] = row[:index][::-1]


def _line_features(
    road_map: RoadMap, lanes: dict[str, Lane], lines: dict[str, Points], inward: int
) -> Iterator[tuple[str, Feature]]:
    shared = _SharedEdges(road_map.roads, lanes, lines, inward)
    for road in road_map.roads:
        row = [lanes.get(lane) for lane in road.lanes]
        for index, (outer, inner) in enumerate(zip([None, *row], [*row, None], strict=True)):
            lane, side = (outer, inward) if outer else (inner, -inward)
            if lane is None:
                continue
            edge = offset_line(lines[lane.id], side * lane.width / 2)
            kind = _line_kind(outer, inner)
            if index == len(row) and (partner := shared.partner(road)):
                if partner < road.id:
                    continue
                kind = _BROKEN if lane.opposite else _SOLID
            yield f"line/{road.id}/{index}", {"type": kind, "polyline": edge}


def _line_kind(outer: Lane | None, inner: Lane | None) -> str:
    """Choose the line between two lanes of a road, or at its edge."""
    if outer is None or inner is None:
        return _EDGE
    if (outer.kind in CARRIAGEWAY) != (inner.kind in CARRIAGEWAY):
        return _SOLID
    return _BROKEN if outer.change_inward or inner.change_outward else _SOLID


class _SharedEdges:
    """Finds the road of the opposite direction whose innermost edge is also a road's own."""

    def __init__(
        self, roads: Sequence[Road], lanes: dict[str, Lane], lines: dict[str, Points], inward: int
    ) -> None:
        self._edges: dict[str, shapely.LineString] = {}
        self._between: dict[tuple[str, str], list[str]] = defaultdict(list)
        for road in roads:
            lane = lanes.get(road.lanes[-1])
            if lane:
                edge = offset_line(lines[lane.id], inward * lane.width / 2)
                self._edges[road.id] = shapely.LineString(edge[:, :2])
                self._between[road.from_junction, road.to_junction].append(road.id)

    def partner(self, road: Road) -> str | None:
        """Name the road on the other side of the centre line, if there is one."""
        own = self._edges[road.id]
        for other in self._between[road.to_junction, road.from_junction]:
            if other != road.id and _gap(own, self._edges[other]) < _SAME_EDGE:
                return other
        return None


def _gap(one: shapely.LineString, other: shapely.LineString) -> float:
    """Measure how far the ends of one line, the one that fits better, lie from the other; metres."""
    return float(
        min(
            shapely.distance(line, shapely.get_point(ends, [0, -1])).max()
            for line, ends in ((one, other), (other, one))
        )
    )


def _surface_features(
    road_map: RoadMap, lines: dict[str, Points], lanes: dict[str, Lane], origin: Floats
) -> Iterator[tuple[str, Feature]]:
    """Make pavements, with the lanes cut out of them, and crosswalks; MetaDrive's rings have no holes."""
    strips = [shapely.Polygon(lane_polygon(line, lanes[name].width)) for name, line in lines.items()]
    roadway = _Roadway(shapely.make_valid(np.array(strips, dtype=object)), list(lines.values()))
    pavements = [("sidewalk", walk.id, walk.polygon, walk.holes) for walk in road_map.sidewalks]
    pavements += [("walking_area", area.id, area.polygon, ()) for area in road_map.walking_areas]
    for kind, source, ring, holes in pavements:
        if len(ring) < 3:
            continue
        polygon = shapely.Polygon((ring - origin)[:, :2], [(hole - origin)[:, :2] for hole in holes])
        rest = roadway.cut_out_of(shapely.make_valid(polygon), float(ring[:, 2].mean()))
        for number, part in enumerate(_without_holes(rest)):
            name = f"{kind}/{source}" + (f"/{number}" if number else "")
            yield name, {"type": "ROAD_EDGE_SIDEWALK", "polygon": shapely.get_coordinates(part.exterior)[:-1]}
    for crossing in road_map.crossings:
        if len(crossing.polygon) > 2:
            ring = (crossing.polygon - origin)[:, :2]
            yield f"crossing/{crossing.id}", {"type": "CROSSWALK", "polygon": ring}


class _Roadway:
    """The lanes' ground, to be cut out of what lies on the same level."""

    def __init__(self, strips: Any, lines: Sequence[Points]) -> None:
        self._strips, self._lines = strips, lines
        self._tree = shapely.STRtree(strips)

    def cut_out_of(self, polygon: Any, height: float) -> Any:
        """Take the lanes at about this height, metres, out of a polygon."""
        centre = shapely.get_coordinates(polygon.representative_point())[0]
        near = [
            index
            for index in sorted(self._tree.query(polygon, predicate="intersects"))
            if abs(_height_near(self._lines[index], centre) - height) < _LEVEL_GAP
        ]
        return polygon.difference(shapely.union_all(self._strips[near])) if near else polygon


def _height_near(line: Points, place: Floats) -> float:
    return float(line[np.hypot(*(line[:, :2] - place).T).argmin(), 2])


def _without_holes(shape: Any) -> Iterator[Any]:
    """Split a shape into polygons without holes, along a line through each hole; slivers are dropped."""
    for part in shapely.get_parts(shape):
        if part.geom_type == "GeometryCollection" or part.geom_type.startswith("Multi"):
            yield from _without_holes(part)
        elif part.geom_type == "Polygon" and part.interiors and part.area > 0.01:
            west, south, east, north = part.bounds
            middle = part.interiors[0].centroid.x
            yield from _without_holes(part.intersection(shapely.box(west, south, middle, north)))
            yield from _without_holes(part.intersection(shapely.box(middle, south, east, north)))
        elif part.geom_type == "Polygon" and part.area > 0.01:
            yield part


def lane_polygon(line: Points, width: float) -> Floats:
    """Outline a lane.

    Both sides keep the line's corners, so the corners' mean is the line's: MetaDrive refuses a lane where
    the two lie more than 100 m apart. Only where a side would cross itself the outline is a buffer's.

    Args:
        line: (n, 3), metres, the lane's middle, n >= 2, no two neighbours on one place.
        width: metres.

    Returns:
        (k, 2), metres, in the line's frame; the ring closes implicitly.
    """
    ring = np.concatenate([offset_line(line, width / 2), offset_line(line, -width / 2)[::-1]])[:, :2]
    if shapely.is_valid(shapely.Polygon(ring)):
        return ring
    strip = shapely.LineString(line[:, :2]).buffer(width / 2, cap_style="flat")
    strip = strip if strip.geom_type == "Polygon" else strip.convex_hull
    return np.asarray(shapely.get_coordinates(strip.exterior)[:-1])


def offset_line(line: Points, offset: float) -> Floats:
    """Move each corner of a line sideways; sharp corners are cut.

    Args:
        line: (n, 3), metres, n >= 2, no two neighbours on one place.
        offset: metres, positive to the left.

    Returns:
        (n, 3), metres, with the line's heights.
    """
    steps = np.diff(line[:, :2], axis=0)
    normals = np.column_stack([-steps[:, 1], steps[:, 0]]) / np.hypot(*steps.T)[:, None]
    before, after = np.vstack([normals[:1], normals]), np.vstack([normals, normals[-1:]])
    mitre = (before + after) / np.maximum(1.0 + (before * after).sum(axis=1), 0.5)[:, None]
    moved: Floats = line + np.column_stack([mitre * offset, np.zeros(len(line))])
    return moved
