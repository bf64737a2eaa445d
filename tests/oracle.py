"""A second, separate reading of a SUMO network, to compare the converter with.

Nothing here comes from `dojo_maps`: the XML is walked directly, attributes are taken as SUMO documents them.
"""

import math
import xml.etree.ElementTree as ET
from dataclasses import dataclass, field
from functools import cached_property, lru_cache
from pathlib import Path

import numpy as np
import shapely
from networks import read_network_bytes
from numpy.typing import NDArray
from shapely import LineString, MultiPolygon, Polygon
from shapely.geometry.base import BaseGeometry

Point3 = tuple[float, float, float]

DEFAULT_WIDTH = 3.2
RAIL = frozenset({"tram", "rail_urban", "rail", "rail_electric", "rail_fast", "subway", "cable_car"})
WATER = frozenset({"ship"})
WALKERS = frozenset({"pedestrian", "wheelchair"})
PUBLIC = frozenset({"bus", "coach"})
BICYCLES = frozenset({"bicycle"})
_CLASS_NAMES = """
    private emergency authority army vip passenger hov taxi bus coach delivery truck trailer tram rail_urban
    rail rail_electric rail_fast motorcycle moped bicycle pedestrian evehicle ship container cable_car
    subway aircraft wheelchair scooter drone custom1 custom2
"""
ALL_CLASSES = frozenset(_CLASS_NAMES.split())
ALL_KINDS = frozenset({"driving", "bus", "bicycle", "sidewalk", "shoulder", "rail", "waterway", "other"})


@dataclass(frozen=True)
class ExpectedLane:
    id: str
    edge: str
    index: int
    width: float
    speed: float
    length: float
    allow: frozenset[str]
    shape: list[Point3]

    @property
    def kinds(self) -> set[str]:
        """Every kind a reasonable reader could give the lane."""
        if not self.allow:
            return {"shoulder", "other"}
        if self.is_driving:
            return {"driving"}
        only = {RAIL: "rail", WATER: "waterway", WALKERS: "sidewalk", PUBLIC: "bus", BICYCLES: "bicycle"}
        return {kind for classes, kind in only.items() if self.allow <= classes} or set(ALL_KINDS)

    @property
    def has_ground(self) -> bool:
        """Whether the lane is part of the paved ground: all but rail and water."""
        return not self.allow or not (self.allow <= RAIL or self.allow <= WATER)

    @property
    def is_driving(self) -> bool:
        return "passenger" in self.allow

    @property
    def is_sidewalk(self) -> bool:
        return bool(self.allow) and self.allow <= WALKERS

    @property
    def strip(self) -> BaseGeometry:
        """The ground of the lane, seen from above."""
        line = LineString([(x, y) for x, y, _ in self.shape])
        if line.length == 0.0:
            return Polygon()
        return line.buffer(self.width / 2, cap_style="flat", join_style="mitre", mitre_limit=2)

    @property
    def end_direction(self) -> NDArray[np.float64]:
        """The unit direction in which traffic reaches the lane's end, over its last five metres."""
        line = LineString([(x, y) for x, y, _ in self.shape])
        end = line.interpolate(line.length)
        before = line.interpolate(max(0.0, line.length - 5.0))
        step = np.array([end.x - before.x, end.y - before.y])
        return step / np.linalg.norm(step)


@dataclass(frozen=True)
class ExpectedConnection:
    from_lane: str
    to_lane: str
    via: tuple[str, ...]
    direction: str
    state: str
    signal: str | None
    link_index: int | None


@dataclass(frozen=True)
class ExpectedJunction:
    id: str
    kind: str
    position: Point3
    shape: list[Point3]


@dataclass(frozen=True)
class ExpectedCrossing:
    id: str
    roads: frozenset[str]
    width: float
    shape: list[Point3]
    outline: list[Point3]
    signal: str | None
    link_index: int | None


@dataclass(frozen=True)
class ExpectedProgram:
    id: str
    kind: str
    offset: float
    phases: tuple[tuple[float, float | None, float | None, str], ...]


@dataclass
class ExpectedMap:
    """What a network holds, under its own ids."""

    left_hand: bool
    net_offset: tuple[float, float]
    projection: str | None
    edges: dict[str, dict[str, str]] = field(default_factory=dict)
    lanes: dict[str, ExpectedLane] = field(default_factory=dict)
    connections: list[ExpectedConnection] = field(default_factory=list)
    junctions: dict[str, ExpectedJunction] = field(default_factory=dict)
    crossings: dict[str, ExpectedCrossing] = field(default_factory=dict)
    walking_areas: dict[str, list[Point3]] = field(default_factory=dict)
    programs: dict[str, list[ExpectedProgram]] = field(default_factory=dict)

    @property
    def is_flat(self) -> bool:
        """Whether no lane or junction has a height."""
        return all(z == 0.0 for lane in self.lanes.values() for _, _, z in lane.shape)

    @property
    def has_sidewalks(self) -> bool:
        return any(lane.is_sidewalk for lane in self.lanes.values())

    @cached_property
    def ground(self) -> BaseGeometry:
        """The ground of lanes, junctions and walking areas together, seen from above."""
        strips = [lane.strip for lane in self.lanes.values() if lane.has_ground]
        floors = [floor(junction.shape) for junction in self.junctions.values()]
        return shapely.union_all([*strips, *floors, self.walking_ground], grid_size=1e-4)

    @cached_property
    def walking_ground(self) -> BaseGeometry:
        return shapely.union_all([floor(shape) for shape in self.walking_areas.values()], grid_size=1e-4)

    @cached_property
    def driving_ground(self) -> BaseGeometry:
        """The strips of all lanes open to cars."""
        strips = [lane.strip for lane in self.lanes.values() if lane.is_driving]
        return shapely.union_all(strips, grid_size=1e-4)

    @cached_property
    def vehicle_ground(self) -> BaseGeometry:
        """The strips of all paved lanes that are not sidewalks."""
        lanes = [lane for lane in self.lanes.values() if lane.has_ground and not lane.is_sidewalk]
        return shapely.union_all([lane.strip for lane in lanes], grid_size=1e-4)

    @cached_property
    def traffic_ground(self) -> BaseGeometry:
        """Wherever vehicles drive: lanes, tracks, and the junctions' floors without their pavement."""
        used = [lane for lane in self.lanes.values() if lane.allow and not lane.allow <= WALKERS | WATER]
        floors = [floor(junction.shape) for junction in self.junctions.values()]
        floors_left = shapely.union_all(floors, grid_size=1e-4).difference(self.walking_ground)
        return shapely.union_all([*(lane.strip for lane in used), floors_left], grid_size=1e-4)

    @cached_property
    def signalised_lanes(self) -> dict[str, set[tuple[str, int]]]:
        """Each vehicle lane that a signal with a program controls, with its (signal, link index) pairs."""
        found: dict[str, set[tuple[str, int]]] = {}
        for link in self.connections:
            lane = self.lanes[link.from_lane]
            if link.signal in self.programs and link.link_index is not None and not lane.is_sidewalk:
                found.setdefault(lane.id, set()).add((link.signal, link.link_index))
        return found


def floor(shape: list[Point3]) -> BaseGeometry:
    """Turn a ring as written in a network into an area, however twisted it is."""
    if len(shape) < 3:
        return Polygon()
    area = shapely.make_valid(Polygon([(x, y) for x, y, _ in shape]))
    return polygons_of(area)


def polygons_of(geometry: BaseGeometry) -> MultiPolygon:
    """Keep the areas of a geometry, drop its lines and points."""
    parts = shapely.get_parts(shapely.get_parts(geometry))
    return MultiPolygon([part for part in parts if part.geom_type == "Polygon" and part.area > 0.0])


def parse_shape(text: str | None) -> list[Point3]:
    """Read "x,y x,y,z ..." as SUMO writes it."""
    points = []
    for item in (text or "").split():
        x, y, *z = (float(number) for number in item.split(","))
        points.append((x, y, z[0] if z else 0.0))
    return points


def parse_allowed(lane: ET.Element) -> frozenset[str]:
    """Work out which classes may use a lane; `allow` wins over `disallow`, neither means everybody."""
    allow, disallow = lane.get("allow"), lane.get("disallow")
    if allow:
        return ALL_CLASSES if allow == "all" else frozenset(allow.split()) & ALL_CLASSES
    if disallow == "all":
        return frozenset()
    return ALL_CLASSES - frozenset((disallow or "").split())


def _optional(element: ET.Element, name: str) -> float | None:
    text = element.get(name)
    return None if text is None else float(text)


def _link(element: ET.Element) -> tuple[str | None, int | None]:
    """The signal and index of a connection; index -1 is SUMO's way to say that no lamp shows it."""
    index = int(element.get("linkIndex", "-1"))
    return (element.get("tl"), index) if index >= 0 else (None, None)


def _read_lane(edge: str, lane: ET.Element) -> ExpectedLane:
    return ExpectedLane(
        id=lane.attrib["id"],
        edge=edge,
        index=int(lane.attrib["index"]),
        width=float(lane.get("width", DEFAULT_WIDTH)),
        speed=float(lane.attrib["speed"]),
        length=float(lane.attrib["length"]),
        allow=parse_allowed(lane),
        shape=parse_shape(lane.get("shape")),
    )


def _read_program(logic: ET.Element) -> ExpectedProgram:
    phases = [
        (float(p.attrib["duration"]), _optional(p, "minDur"), _optional(p, "maxDur"), p.attrib["state"])
        for p in logic.findall("phase")
    ]
    return ExpectedProgram(
        id=logic.attrib["programID"],
        kind=logic.attrib["type"],
        offset=float(logic.get("offset", "0")),
        phases=tuple(phases),
    )


def _via_chain(first: str | None, onward: dict[str, str | None]) -> tuple[str, ...]:
    """Follow internal lanes to the far side; a waiting point inside a junction splits them in two."""
    chain: list[str] = []
    lane = first
    while lane is not None and lane not in chain:
        chain.append(lane)
        lane = onward.get(lane)
    return tuple(chain)


class _Reader:
    """Walks one network's XML once."""

    def __init__(self, root: ET.Element) -> None:
        location = root.find("location")
        place = location.attrib if location is not None else {}
        x, y = (float(number) for number in place.get("netOffset", "0,0").split(","))
        projection = place.get("projParameter", "!")
        self.map = ExpectedMap(
            left_hand=root.get("lefthand", root.get("leftHand", "false")) in {"true", "1"},
            net_offset=(x, y),
            projection=None if projection in {"!", "-", "."} else projection,
        )
        self.links: dict[str, tuple[str | None, int | None]] = {}
        self.lane_ids: dict[tuple[str, int], str] = {}
        for edge in root.findall("edge"):
            for lane in edge.findall("lane"):
                self.lane_ids[edge.attrib["id"], int(lane.attrib["index"])] = lane.attrib["id"]
        connections = root.findall("connection")
        for item in connections:
            if item.attrib["from"].startswith(":") and not item.attrib["to"].startswith(":"):
                continue
            self.links.setdefault(item.attrib["to"], _link(item))
        for edge in root.findall("edge"):
            self._read_edge(edge)
        self._read_connections(connections)
        for item in root.findall("junction"):
            self._read_junction(item)
        for logic in root.findall("tlLogic"):
            self.map.programs.setdefault(logic.attrib["id"], []).append(_read_program(logic))

    def _read_edge(self, edge: ET.Element) -> None:
        function, edge_id = edge.get("function", "normal"), edge.attrib["id"]
        lanes = edge.findall("lane")
        if function == "normal":
            self.map.edges[edge_id] = dict(edge.attrib)
            for lane in lanes:
                self.map.lanes[lane.attrib["id"]] = _read_lane(edge_id, lane)
        elif function == "crossing":
            signal, index = self.links.get(edge_id, (None, None))
            self.map.crossings[edge_id] = ExpectedCrossing(
                id=edge_id,
                roads=frozenset(edge.get("crossingEdges", "").split()),
                width=float(lanes[0].get("width", DEFAULT_WIDTH)),
                shape=parse_shape(lanes[0].get("shape")),
                outline=parse_shape(lanes[0].get("outlineShape")),
                signal=signal,
                link_index=index,
            )
        elif function == "walkingarea":
            self.map.walking_areas[edge_id] = parse_shape(lanes[0].get("shape"))

    def _read_connections(self, connections: list[ET.Element]) -> None:
        onward = {
            self.lane_ids.get((item.attrib["from"], int(item.attrib["fromLane"])), ""): item.get("via")
            for item in connections
            if item.attrib["from"].startswith(":")
        }
        for item in connections:
            if item.attrib["from"] not in self.map.edges or item.attrib["to"] not in self.map.edges:
                continue
            signal, index = _link(item)
            self.map.connections.append(
                ExpectedConnection(
                    from_lane=self.lane_ids[item.attrib["from"], int(item.attrib["fromLane"])],
                    to_lane=self.lane_ids[item.attrib["to"], int(item.attrib["toLane"])],
                    via=_via_chain(item.get("via"), onward),
                    direction=item.attrib["dir"],
                    state=item.attrib["state"],
                    signal=signal,
                    link_index=index,
                )
            )

    def _read_junction(self, item: ET.Element) -> None:
        if item.get("type") == "internal":
            return
        x, y, z = (float(item.get(name, "0")) for name in "xyz")
        self.map.junctions[item.attrib["id"]] = ExpectedJunction(
            id=item.attrib["id"],
            kind=item.attrib["type"],
            position=(x, y, z),
            shape=parse_shape(item.get("shape")),
        )


@lru_cache(maxsize=4)
def read_expected(path: Path) -> ExpectedMap:
    """Read a network, packed or not."""
    return _Reader(ET.fromstring(read_network_bytes(path))).map  # noqa: S314 - only networks of our own


def angle_between(a: float, b: float) -> float:
    """The unsigned angle between two headings, in radians."""
    return abs(math.remainder(a - b, 2 * math.pi))
