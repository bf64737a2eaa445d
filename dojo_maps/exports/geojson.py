"""GeoJSON (RFC 7946): everything on the map as features in WGS84 longitude and latitude.

A network without a geographic projection is written in its own coordinates, metres, and says so in the
collection's member `coordinates`.

A feature's `kind` is one of map.json's list names in the singular, or `signal_head`; an element's own kind is
called `lane_kind`, `road_kind` and so on. A third coordinate, metres, stands only where the map has heights.
"""

import json
from collections.abc import Iterator, Sequence
from dataclasses import fields
from pathlib import Path
from typing import Any

import numpy as np
import shapely

from dojo_maps.description import Points, RoadMap
from dojo_maps.exports import file_stem
from dojo_maps.exports.earth import Earth
from dojo_maps.geometry.pieces import flat_polygons

Geometry = dict[str, Any]

_LEFT_OUT = {"shape", "polygon", "holes", "position", "right_of_way"}
"""Shapes, which the geometries hold, and matrices, which attribute tables cannot."""
_LISTS = ("roads", "lanes", "junctions", "sidewalks", "crossings", "walking_areas", "stop_lines", "props")
_DECIMALS = 8
"""Of degrees: about a millimetre."""


def write_geojson(road_map: RoadMap, folder: Path) -> None:
    """Write `<name>.geojson`, one feature a line.

    Args:
        road_map: what to write; without a projection, positions stay in metres.
        folder: exists; a file of that name in it is replaced.

    Raises:
        ExportError: the network's projection is unknown or does not fit its coordinates.
        OSError: the file cannot be written.
    """
    places = _Places(road_map)
    features = [
        json.dumps(feature, ensure_ascii=False, separators=(",", ":"), allow_nan=False)
        for feature in _features(road_map, places)
    ]
    name = json.dumps(road_map.name, ensure_ascii=False)
    frame = '"coordinates":"metres, x east, y north",' if road_map.projection.proj is None else ""
    start = f'{{"type":"FeatureCollection","name":{name},{frame}"features":[\n'
    text = start + ",\n".join(features) + "\n]}\n"
    (folder / f"{file_stem(road_map)}.geojson").write_text(text, encoding="utf-8")


class _Places:
    """Turns map positions into geometries, in degrees or, without a projection, in metres."""

    def __init__(self, road_map: RoadMap) -> None:
        proj = road_map.projection.proj
        self._earth = None if proj is None else Earth(proj, road_map.projection.net_offset)
        self._with_heights = any(lane.shape[:, 2].any() for lane in road_map.lanes)

    def point(self, position: Sequence[float]) -> Geometry:
        """Make a point of (x, y, z), metres."""
        return {"type": "Point", "coordinates": self._places(np.array([position]))[0]}

    def line(self, shape: Points) -> Geometry:
        """Make a line of (n, 3) metres; one without length is a point."""
        places = self._places(shape)
        if not _has_length(places):
            return {"type": "Point", "coordinates": places[0]}
        return {"type": "LineString", "coordinates": places}

    def lines(self, shapes: Sequence[Points]) -> Geometry:
        """Make one geometry of several lines; where none has length it is a point."""
        drawn = [places for places in map(self._places, shapes) if _has_length(places)]
        return {"type": "MultiLineString", "coordinates": drawn} if drawn else self.point(shapes[0][0])

    def polygon(self, ring: Points, holes: Sequence[Points] = ()) -> Geometry | None:
        """Make a polygon: closed rings, the outer one counter-clockwise; None where there is no area.

        A ring that crosses itself becomes the ground that it runs around, without heights.
        """
        if len(ring) < 3:
            return None
        rings = [self._ring(ring, outer=True)]
        rings += [self._ring(hole, outer=False) for hole in holes if len(hole) > 2]
        drawn = shapely.Polygon(rings[0], rings[1:])
        if drawn.is_valid:
            return {"type": "Polygon", "coordinates": rings}
        parts, _ = flat_polygons(np.array([shapely.make_valid(shapely.force_2d(drawn))]), larger_than=0.0)
        if not len(parts):
            return None
        mended = shapely.orient_polygons(parts[0] if len(parts) == 1 else shapely.multipolygons(parts))
        geometry: Geometry = json.loads(shapely.to_geojson(mended))
        return geometry

    def _ring(self, ring: Points, *, outer: bool) -> list[list[float]]:
        x, y = ring[:, 0], ring[:, 1]
        counter_clockwise = np.sum((np.roll(x, -1) - x) * (np.roll(y, -1) + y)) < 0
        places = self._places(ring if counter_clockwise == outer else ring[::-1])
        return [*places, places[0]]

    def _places(self, positions: Any) -> list[list[float]]:
        if self._earth is None:
            columns = [*np.round(positions[:, :2], 3).T]
        else:
            columns = [*np.round(self._earth.degrees(positions), _DECIMALS)]
        if self._with_heights:
            columns.append(np.round(positions[:, 2], 3))
        values: list[list[float]] = np.column_stack(columns).tolist()
        return values


def _has_length(places: Sequence[Sequence[float]]) -> bool:
    return any(place[:2] != places[0][:2] for place in places)


def _features(road_map: RoadMap, places: _Places) -> Iterator[dict[str, Any]]:
    lanes = {lane.id: lane.shape for lane in road_map.lanes}
    for name in _LISTS:
        kind = name.removesuffix("s")
        for element in getattr(road_map, name):
            properties = {"kind": kind, **_properties(element, kind)}
            geometry = (
                places.lines([lanes[lane] for lane in element.lanes if lane in lanes])
                if kind == "road"
                else _geometry(element, kind, places)
            )
            yield {"type": "Feature", "geometry": geometry, "properties": properties}
    for signal in road_map.signals:
        for number, head in enumerate(signal.heads):
            properties = {"kind": "signal_head", "id": f"{signal.id}/{number}", "signal": signal.id}
            properties.update(_properties(head, "signal_head"))
            yield {"type": "Feature", "geometry": places.point(head.position), "properties": properties}


def _geometry(element: Any, kind: str, places: _Places) -> Geometry | None:
    """Draw an element as its polygon if it has one, else as its line or its position."""
    ring = getattr(element, "polygon", None)
    polygon = places.polygon(ring, getattr(element, "holes", ())) if ring is not None else None
    if polygon is not None:
        return polygon
    if kind in ("lane", "stop_line", "crossing"):
        return places.line(element.shape)
    position = getattr(element, "position", None)
    if position is not None:
        return places.point(position)
    return places.line(ring) if ring is not None and len(ring) else None


def _properties(element: Any, kind: str) -> dict[str, Any]:
    """Take every field that a table can hold, under its name in map.json."""
    found: dict[str, Any] = {}
    for field in fields(element):
        if field.name in _LEFT_OUT:
            continue
        key = f"{kind}_kind" if field.name == "kind" else field.metadata.get("json", field.name)
        value = getattr(element, field.name)
        found[key] = dict(value) if field.name == "tags" else value
    if kind == "stop_line":
        found["id"] = found["lane"]
    return found
