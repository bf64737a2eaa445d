"""ASAM OpenDRIVE 1.7: a road for each road and each connection, junctions, signals, things on the ground.

A road's reference line is the centre line of its innermost lane, with half that lane's width as `laneOffset`.
Lanes run with it: on its right, or on its left where traffic keeps left. Roads, lanes and connections carry
the network's ids as `userData` of the code `sumoId`, junctions, controllers and objects in their names.
"""

import xml.etree.ElementTree as ET
from collections import defaultdict
from collections.abc import Iterable, Iterator
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
import shapely

from dojo_maps.description import (
    Connection,
    Lane,
    LaneKind,
    LinkKind,
    Origin,
    Points,
    Road,
    RoadMap,
    SignalHead,
    points,
)  # fmt: skip
from dojo_maps.exports import file_stem
from dojo_maps.exports.reference_lines import (
    Piece,
    Place,
    ReferenceLine,
    curve,
    heights_along,
    outline_of,
)  # fmt: skip
from dojo_maps.geometry.polylines import Floats, lift, strip_outline, strip_outlines
from dojo_maps.index import MapIndex

_LANE_TYPES = {
    LaneKind.DRIVING: "driving",
    LaneKind.BUS: "bus",
    LaneKind.BICYCLE: "biking",
    LaneKind.SIDEWALK: "sidewalk",
    LaneKind.SHOULDER: "shoulder",
    LaneKind.RAIL: "rail",
    LaneKind.WATERWAY: "none",
    LaneKind.OTHER: "restricted",
}
_RESTRICTIONS = {
    "bus": "bus",
    "delivery": "delivery",
    "emergency": "emergency",
    "taxi": "taxi",
    "truck": "truck",
    "bicycle": "bicycle",
    "motorcycle": "motorcycle",
    "pedestrian": "pedestrian",
}
_PROPS = {
    "island": "trafficIsland",
    "building": "building",
    "tree": "tree",
    "hedge": "vegetation",
    "pole": "pole",
    "lamp": "streetLamp",
    "parking": "parkingSpace",
}
_STOP_LINE = 0.4
"""The width of a stop line, metres."""
_NARROWEST = 0.1
"""Metres; a network may hold lanes of no or of negative width, and OpenDRIVE cannot link such."""
_DRIVER_HEAD, _WALKER_HEAD = "1000001", "1000002"
"""OpenDRIVE's numbers for a signal of three lamps and for one of two."""


def write_opendrive(road_map: RoadMap, folder: Path) -> None:
    """Write `<name>.xodr`.

    Args:
        road_map: what to write.
        folder: exists; a file of that name in it is replaced.

    Raises:
        OSError: the file cannot be written.
    """
    root = _Document(road_map).root
    ET.indent(root)
    path = folder / f"{file_stem(road_map)}.xodr"
    ET.ElementTree(root).write(path, encoding="UTF-8", xml_declaration=True)


def _add(parent: ET.Element, tag: str, /, **attributes: Any) -> ET.Element:
    """Add an element; decimals are written to a nanometre."""
    texts = {k: _decimal(v) if isinstance(v, float) else str(v) for k, v in attributes.items()}
    return ET.SubElement(parent, tag, texts)


def _decimal(value: float) -> str:
    return np.format_float_positional(value, precision=9, trim="-")


def _width(lane: Lane) -> float:
    return max(lane.width, _NARROWEST)


class _Document:
    """The document, put together part by part, and the numbers that its parts have in it."""

    def __init__(self, road_map: RoadMap) -> None:
        self._map, self._index = road_map, MapIndex(road_map)
        self._side = 1 if road_map.left_hand else -1
        self._last_number = 0
        self._lines = {road.id: ReferenceLine(self._lanes(road.id)[0].shape) for road in road_map.roads}
        self._numbers = {road.id: self._number() for road in road_map.roads}
        self._connecting = {c.id: self._number() for c in road_map.connections}
        meeting = dict.fromkeys(map(self._junction_of, road_map.connections))
        self._junctions = {junction: self._number() for junction in meeting}
        self.root = ET.Element("OpenDRIVE")
        self._add_header()
        self._objects: dict[str, ET.Element] = {}
        self._signals: dict[str, ET.Element] = {}
        for road in road_map.roads:
            self._add_road(road)
        for connection in road_map.connections:
            self._add_connecting_road(connection)
        self._add_ground()
        self._add_junctions(self._add_signals())

    def _number(self) -> int:
        self._last_number += 1
        return self._last_number

    def _lanes(self, road: str) -> list[Lane]:
        """List a road's lanes, the innermost first."""
        return self._index.lanes_of(road)[::-1]

    def _junction_of(self, connection: Connection) -> str:
        return self._index.roads[self._index.lanes[connection.from_lane].road].to_junction

    def _lane_number(self, lane: str) -> int:
        found = self._index.lanes[lane]
        return self._side * (len(self._index.roads[found.road].lanes) - found.index)

    def _add_header(self) -> None:
        (west, south), (east, north) = self._map.bounds
        box = {"north": float(north), "south": float(south), "east": float(east), "west": float(west)}
        header = _add(self.root, "header", revMajor=1, revMinor=7, name=self._map.name, version="1.00", **box)
        if self._map.projection.proj is not None:
            _add(header, "geoReference").text = self._map.projection.proj
        x, y = self._map.projection.net_offset
        _add(header, "offset", x=-float(x), y=-float(y), z=0.0, hdg=0.0)

    def _start_road(self, number: int, name: str, length: float, junction: int) -> ET.Element:
        rule = "LHT" if self._map.left_hand else "RHT"
        return _add(self.root, "road", name=name, length=length, id=number, junction=junction, rule=rule)

    def _add_road(self, road: Road) -> None:
        line, lanes = self._lines[road.id], self._lanes(road.id)
        element = self._start_road(self._numbers[road.id], road.name, line.length, -1)
        link = _add(element, "link")
        for tag, junction in (("predecessor", road.from_junction), ("successor", road.to_junction)):
            if junction in self._junctions:
                _add(link, tag, elementType="junction", elementId=self._junctions[junction])
        _add(element, "type", s=0.0, type="motorway" if "motorway" in road.kind else "town")
        _add_plan(element, line.pieces, line.heights)
        inner, outer = self._pavement(road)
        side, other = self._add_section(element, -self._side * _width(lanes[0]) / 2)
        for lane in lanes:
            _add(self._add_lane(side, lane), "userData", code="sumoId", value=lane.id)
        _add_pavement(side, self._side * (len(lanes) + 1), outer)
        _add_pavement(other, -self._side, inner)
        _finish_lanes(element)
        self._objects[road.id] = _add(element, "objects")
        self._signals[road.id] = _add(element, "signals")
        _add(element, "userData", code="sumoId", value=road.id)

    def _add_connecting_road(self, connection: Connection) -> None:
        before, after = (self._index.lanes[lane] for lane in (connection.from_lane, connection.to_lane))
        pieces = curve(self._end(before, last=True), self._end(after), connection.shape[1:-1, :2])
        length = pieces[-1].s + pieces[-1].length
        junction = self._junctions[self._junction_of(connection)]
        element = self._start_road(self._connecting[connection.id], "", length, junction)
        link = _add(element, "link")
        for tag, lane, contact in (("predecessor", before, "end"), ("successor", after, "start")):
            _add(link, tag, elementType="road", elementId=self._numbers[lane.road], contactPoint=contact)
        shape = connection.shape.copy()
        shape[0, 2] = self._lines[before.road].heights[-1, 1]
        shape[-1, 2] = self._lines[after.road].heights[0, 1]
        _add_plan(element, pieces, heights_along(shape, length))
        slope = (_width(after) - _width(before)) / length
        side, _ = self._add_section(element, -self._side * _width(before) / 2, -self._side * slope / 2)
        lane_element = self._add_lane(side, before, connection, slope)
        _add(lane_element, "userData", code="sumoId", value=" ".join(connection.via))
        _finish_lanes(element)

    def _end(self, lane: Lane, *, last: bool = False) -> Place:
        """Find where a lane's middle begins or ends, and its heading there."""
        lanes, line = self._lanes(lane.road), self._lines[lane.road]
        widths = [_width(other) for other in lanes[: len(lanes) - lane.index]]
        return line.beside(
            line.length if last else 0.0, self._side * (sum(widths) - widths[0] / 2 - widths[-1] / 2)
        )

    def _add_section(
        self, road: ET.Element, offset: float, slope: float | None = None
    ) -> tuple[ET.Element, ET.Element]:
        """Add the lanes' parents: the side that traffic runs on, and the other one.

        Args:
            road: what they belong to.
            offset: metres from the reference line to the lanes' inner border, to the left.
            slope: what the offset grows by each metre of a connecting road; None for other roads.
        """
        lanes = _add(road, "lanes")
        _add(lanes, "laneOffset", s=0.0, a=offset, b=slope or 0.0, c=0.0, d=0.0)
        section = _add(lanes, "laneSection", s=0.0)
        left = _add(section, "left")
        centre = _add(_add(section, "center"), "lane", id=0, type="none")
        mark = "solid" if slope is None else "none"
        _add(centre, "roadMark", sOffset=0.0, type=mark, color="standard")
        right = _add(section, "right")
        return (left, right) if self._side > 0 else (right, left)

    def _add_lane(
        self, side: ET.Element, lane: Lane, connection: Connection | None = None, slope: float = 0.0
    ) -> ET.Element:
        """Add a road's lane, or that of a connection that begins at the lane."""
        number = self._lane_number(lane.id) if connection is None else self._side
        element = _add(side, "lane", id=number, type=_LANE_TYPES[lane.kind])
        if connection is not None:
            link = _add(element, "link")
            _add(link, "predecessor", id=self._lane_number(connection.from_lane))
            _add(link, "successor", id=self._lane_number(connection.to_lane))
        _add(element, "width", sOffset=0.0, a=float(_width(lane)), b=slope, c=0.0, d=0.0)
        mark = "broken" if lane.index and lane.change_outward else "solid"
        _add(element, "roadMark", sOffset=0.0, type=mark if connection is None else "none", color="standard")
        _add(element, "speed", sOffset=0.0, max=float(max(lane.speed, 0.0)), unit="m/s")
        if "passenger" not in lane.allow:
            for allowed in filter(None, map(_RESTRICTIONS.get, lane.allow)):
                _add(element, "access", sOffset=0.0, rule="allow", restriction=allowed)
        return element

    def _pavement(self, road: Road) -> tuple[float, float]:
        """Tell how wide the generated sidewalks on a road's inner and outer side are, metres."""
        widths = [0.0, 0.0]
        line = self._lines[road.id]
        for ring in self._generated[road.id]:
            aside = np.median([line.locate(position)[1] for position in ring])
            widths[int(aside * self._side > 0)] += shapely.Polygon(ring[:, :2]).area / line.length
        return widths[0], widths[1]

    @cached_property
    def _generated(self) -> dict[str | None, list[Points]]:
        """The outlines of generated sidewalks by road, those around corners under None."""
        found: dict[str | None, list[Points]] = defaultdict(list)
        for sidewalk in self._map.sidewalks:
            if sidewalk.origin is Origin.GENERATED:
                found[sidewalk.road].append(sidewalk.polygon)
        return found

    def _add_ground(self) -> None:
        """Add what lies or stands on the ground, as objects of its road or of the one next to it."""
        for crossing in self._map.crossings:
            run = crossing.shape[-1] - crossing.shape[0]
            road = next(filter(self._lines.__contains__, crossing.roads), None)
            across = float(np.arctan2(run[1], run[0]))
            self._add_object(crossing.id, "crosswalk", crossing.polygon, road=road, across=across)
        for line in self._map.stop_lines:
            ring, road = strip_outline(line.shape, _STOP_LINE), self._index.lanes[line.lane].road
            self._add_object(line.lane, "roadMark", ring, road=road, subtype="stopLine")
        for area in self._map.walking_areas:
            self._add_object(area.id, "none", area.polygon, subtype="sidewalk")
        for corner in self._corners():
            self._add_object("", "none", corner, subtype="sidewalk")
        for prop in self._map.props:
            ring = points([prop.position] if prop.polygon is None else prop.polygon)
            kind = _PROPS.get(prop.kind, "none")
            self._add_object(prop.id, kind, ring, subtype=prop.kind, height=max(prop.height, 0.0))

    def _corners(self) -> Iterator[Points]:
        """Outline generated pavement around corners, without the ground that vehicles have."""
        lanes = self._map.lanes
        outlines = strip_outlines([lane.shape for lane in lanes], [_width(lane) for lane in lanes])
        strips = [shapely.Polygon(outline[:, :2]) for outline in outlines]
        floors = [shapely.Polygon(j.polygon[:, :2]) for j in self._map.junctions if len(j.polygon) > 2]
        ground = shapely.make_valid(np.array([*strips, *floors]))
        tree = shapely.STRtree(ground)
        for ring in self._generated[None]:
            whole = shapely.make_valid(shapely.Polygon(ring[:, :2]))
            left = whole.difference(shapely.union_all(ground[tree.query(whole)]))
            for part in shapely.get_parts(left):
                if isinstance(part, shapely.Polygon) and part.area > _NARROWEST:
                    yield lift(shapely.get_coordinates(part.exterior)[:-1], ring)

    def _add_object(
        self,
        name: str,
        kind: str,
        ring: Points,
        *,
        road: str | None = None,
        subtype: str = "",
        across: float | None = None,
        height: float = 0.0,
    ) -> None:
        """Add an object with an outline (n, 3), or at one position; nothing where there is none.

        Args:
            name: the id of what it stands for.
            kind: its type.
            ring: metres, map frame.
            road: what it belongs to; None for the next one.
            subtype: what kind of its type it is.
            across: the heading of a crossing; its width runs along it, as readers expect.
            height: metres above the ground.
        """
        if not len(ring) or not self._lines:
            return
        road = road or self._nearest(ring)
        line = self._lines[road]
        s, t = line.locate(ring.mean(axis=0))
        (x, y), heading = line.beside(s, t)
        turned = 0.0 if across is None else across - np.pi / 2 - heading
        corners = outline_of(ring, np.array([x, y, line.height(s)]), heading + turned)
        base = float(corners[:, 2].mean())
        length, width = np.maximum(np.ptp(corners[:, :2], axis=0), _NARROWEST).tolist()
        element = _add(
            self._objects[road], "object", id=self._number(), name=name, type=kind,
            subtype=subtype, s=s, t=t, zOffset=base, hdg=turned, orientation="none",
            length=length, width=width, height=height,
        )  # fmt: skip
        if len(ring) > 2:
            paved = {"laneType": "sidewalk", "fillType": "pavement"} if subtype == "sidewalk" else {}
            outline = _add(_add(element, "outlines"), "outline", id=0, outer="true", closed="true", **paved)
            for number, (u, v, z) in enumerate(corners.tolist()):
                _add(outline, "cornerLocal", id=number, u=u, v=v, z=z - base, height=height)

    def _nearest(self, ring: Points) -> str:
        names, tree = self._near
        return names[int(tree.nearest(shapely.Point(ring.mean(axis=0))))]

    @cached_property
    def _near(self) -> tuple[list[str], shapely.STRtree]:
        return list(self._lines), shapely.STRtree([line.chords for line in self._lines.values()])

    def _add_signals(self) -> dict[str, list[int]]:
        """Add signal heads, and a controller for all that always show alike.

        Returns:
            The controllers' numbers by junction.
        """
        controllers: dict[str, list[int]] = defaultdict(list)
        for signal in self._map.signals:
            approaches: dict[int, list[str]] = defaultdict(list)
            for link in signal.links:
                if link.kind is LinkKind.VEHICLE:
                    approaches[link.index].append(link.from_id)
            groups: dict[tuple[int, ...], list[int]] = defaultdict(list)
            for head in signal.heads:
                lanes = [lane for index in head.link_indices for lane in approaches[index]]
                groups[head.link_indices].append(self._add_head(head, lanes))
            for indices, heads in groups.items():
                number, name = self._number(), " ".join([signal.id, *map(str, indices)])
                controller = _add(self.root, "controller", id=number, name=name)
                for head_number in heads:
                    _add(controller, "control", signalId=head_number, type="0")
                for junction in signal.junctions:
                    controllers[junction].append(number)
        return controllers

    def _add_head(self, head: SignalHead, approach: list[str]) -> int:
        """Add a signal head for the lanes of an approach, or for walkers if there are none."""
        place, number = points([head.position]), self._number()
        road = self._index.lanes[approach[0]].road if approach else self._nearest(place)
        line = self._lines[road]
        s, t = line.locate(place[0])
        turned = head.heading - line.place(s)[1] + (0.0 if approach else np.pi)
        signal = _add(
            self._signals[road], "signal", id=number, s=s, t=t,
            zOffset=float(place[0, 2]) - line.height(s), hOffset=turned % (2 * np.pi) - np.pi,
            orientation="+" if approach else "none", dynamic="yes", country="OpenDRIVE",
            type=_DRIVER_HEAD if approach else _WALKER_HEAD, subtype="-1",
            height=0.9 if approach else 0.6, width=0.3,
        )  # fmt: skip
        own = sorted(self._lane_number(lane) for lane in approach if self._index.lanes[lane].road == road)
        if own:
            _add(signal, "validity", fromLane=own[0], toLane=own[-1])
        if head.far_side:
            # Beyond the end of the road that it is for, where s and t do not reach.
            x, y, z = head.position
            _add(signal, "positionInertial", x=x, y=y, z=z, hdg=head.heading)
        return number

    def _add_junctions(self, controllers: dict[str, list[int]]) -> None:
        elements = {
            junction: _add(self.root, "junction", id=number, name=junction)
            for junction, number in self._junctions.items()
        }
        for connection in self._map.connections:
            number = self._connecting[connection.id]
            element = _add(
                elements[self._junction_of(connection)], "connection", id=number,
                incomingRoad=self._numbers[self._index.lanes[connection.from_lane].road],
                connectingRoad=number, contactPoint="start",
            )  # fmt: skip
            _add(element, "laneLink", **{"from": self._lane_number(connection.from_lane), "to": self._side})
        for junction in self._map.junctions:
            if junction.id not in elements:
                continue
            ways = [self._connecting.get(way.link) for way in junction.right_of_way]
            for low, way in zip(ways, junction.right_of_way, strict=True):
                for high in (ways[other] for other in way.response):
                    if low is not None and high is not None:
                        _add(elements[junction.id], "priority", high=high, low=low)
            for number in controllers[junction.id]:
                _add(elements[junction.id], "controller", id=number, type="0")


def _add_plan(road: ET.Element, pieces: Iterable[Piece], heights: Floats) -> None:
    plan = _add(road, "planView")
    for piece in pieces:
        x, y = piece.start.tolist()
        geometry = _add(plan, "geometry", s=piece.s, x=x, y=y, hdg=piece.heading, length=piece.length)
        if piece.cubic is not None:
            names = [f"{power}{axis}" for axis in "UV" for power in "abcd"]
            values = dict(zip(names, piece.cubic.ravel().tolist(), strict=True))
            _add(geometry, "paramPoly3", **values, pRange="normalized")
        elif piece.curvature:
            _add(geometry, "arc", curvature=piece.curvature)
        else:
            _add(geometry, "line")
    profile = _add(road, "elevationProfile")
    rises = [*(np.diff(heights[:, 1]) / np.diff(heights[:, 0])).tolist(), 0.0]
    for (s, height), rise in list(zip(heights.tolist(), rises, strict=True))[: max(len(rises) - 1, 1)]:
        _add(profile, "elevation", s=s, a=height, b=rise, c=0.0, d=0.0)


def _add_pavement(side: ET.Element, number: int, width: float) -> None:
    if width > _NARROWEST:
        lane = _add(side, "lane", id=number, type="sidewalk")
        _add(lane, "width", sOffset=0.0, a=width, b=0.0, c=0.0, d=0.0)


def _finish_lanes(road: ET.Element) -> None:
    """Put a road's lanes in the order of their numbers, from left to right, and drop a side without any."""
    for section in road.iter("laneSection"):
        for side in list(section):
            side[:] = sorted(side, key=lambda lane: -int(lane.get("id", "0")))
            if not len(side):
                section.remove(side)
