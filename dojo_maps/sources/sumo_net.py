"""A SUMO network's records become a RoadMap: roads, lanes, connections, junctions and paths to walk.

Signals are read in `sumo_signals`. Nothing is repaired in silence: what cannot be kept becomes an issue.
"""

from collections import defaultdict
from collections.abc import Iterable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import TypeVar

from dojo_maps.description import (
    Crossing,
    Junction,
    Lane,
    Points,
    Projection,
    Road,
    RoadMap,
    Source,
    WalkingArea,
    points,
)  # fmt: skip
from dojo_maps.errors import SourceError
from dojo_maps.issue import Element, Issue, Severity
from dojo_maps.safe_xml import Attributes
from dojo_maps.sources.limits import check_limits, measure_bounds
from dojo_maps.sources.lost_connections import find_lost_connections
from dojo_maps.sources.permissions import allowed_classes, lane_kind, unknown_classes
from dojo_maps.sources.right_of_way import read_right_of_way
from dojo_maps.sources.sumo_connections import ConnectionReader
from dojo_maps.sources.sumo_pavement import (
    read_crossings,
    read_walking_area,
    sidewalks_of,
    walk_connections,
)
from dojo_maps.sources.sumo_signals import read_signals
from dojo_maps.sources.sumo_xml import EdgeRecord, NetRecords, read_records
from dojo_maps.sources.unusable_values import replace_unusable
from dojo_maps.sources.values import MIN_WIDTH, read_float, read_int, read_offset, read_shape, read_text

_LANE_WIDTH = 3.2
"""SUMO's default, metres, where a lane names none."""
_ROAD_FUNCTIONS = ("normal", "connector")
_SERVICES = {"emergency", "authority", "army", "vip"}

T = TypeVar("T")


def read_network(data: bytes, *, path: Path, name: str, sha256: str) -> tuple[RoadMap, tuple[Issue, ...]]:
    """Describe a SUMO network.

    Args:
        data: the network's bytes, unpacked.
        path: where they came from, for errors and for the description.
        name: the map's name.
        sha256: of the file as it lies on disk.

    Returns:
        The description, and an issue for each thing in the file that could not be kept.

    Raises:
        SourceError: the bytes are not a SUMO network, or an element of it has no usable value.
    """
    return _mend_and_describe(read_records(data, path), path, name, sha256)


def read_roads(data: bytes, *, path: Path, name: str, sha256: str) -> RoadMap:
    """Describe nothing of a SUMO network but its roads and junctions, in half the time.

    Args:
        data: the network's bytes, unpacked.
        path: where they came from, for errors and for the description.
        name: the map's name.
        sha256: of the file as it lies on disk.

    Returns:
        The description, without ways across junctions, signals, crossings and walking areas.

    Raises:
        SourceError: the bytes are not a SUMO network, or an element of it has no usable value.
    """
    records = read_records(data, path)
    roads = [edge for edge in records.edges if edge.attributes.get("function", "normal") in _ROAD_FUNCTIONS]
    alone = replace(records, edges=roads, connections=[], logics=[], requests=defaultdict(list))
    return _mend_and_describe(alone, path, name, sha256)[0]


def _mend_and_describe(
    records: NetRecords, path: Path, name: str, sha256: str
) -> tuple[RoadMap, tuple[Issue, ...]]:
    try:
        return _describe(records, path, name, sha256)
    except SourceError:
        replaced = replace_unusable(records, path)
        if not replaced:
            raise
        road_map, issues = _describe(records, path, name, sha256)
        return road_map, (*replaced, *issues)


def _describe(records: NetRecords, path: Path, name: str, sha256: str) -> tuple[RoadMap, tuple[Issue, ...]]:
    reader = _Reader(path, records)
    if not reader.roads:
        raise SourceError(path, "the network has no roads")
    bounds = reader.bounds()
    centre = tuple(round((low + high) / 2) for low, high in zip(*bounds, strict=True))
    lanes = tuple(reader.lanes.values())
    areas: list[Junction | WalkingArea] = [*reader.junctions.values(), *reader.walking_areas.values()]
    check_limits([*lanes, *reader.crossings.values()], areas, path)
    ways = reader.ways
    junctions, mismatches = read_right_of_way(reader.junctions.values(), ways.connections, records)
    road_map = RoadMap(
        name=name,
        source=Source(
            kind="sumo",
            file=path.name,
            sha256=sha256,
            sumo_version=records.net.get("version", ""),
        ),
        projection=_read_projection(records.location, path),
        origin=(float(centre[0]), float(centre[1])),
        bounds=bounds,
        left_hand=records.net.get("lefthand") in ("true", "1"),
        roads=tuple(reader.roads.values()),
        lanes=lanes,
        connections=tuple(ways.connections),
        junctions=junctions,
        sidewalks=tuple(sidewalks_of(lanes)),
        crossings=tuple(reader.crossings.values()),
        walking_areas=tuple(reader.walking_areas.values()),
        signals=read_signals(path, records.logics, ways.connections, ways.signalled, reader.roads_of()),
        walks=tuple(ways.walks),
    )
    lost = find_lost_connections(records, reader.lanes, reader.internal, ways.connections)
    return road_map, (*reader.issues, *ways.issues, *mismatches, *lost)


class _Reader:
    """Collects a network's elements by id; duplicates and dangling references become issues."""

    def __init__(self, path: Path, records: NetRecords) -> None:
        self.path = path
        self.issues: list[Issue] = []
        self.roads: dict[str, Road] = {}
        self.lanes: dict[str, Lane] = {}
        self.junctions: dict[str, Junction] = {}
        self.crossings: dict[str, Crossing] = {}
        self.walking_areas: dict[str, WalkingArea] = {}
        self.internal: dict[str, Points] = {}
        for record in records.edges:
            self._read_edge(record)
        self._read_crossings(records)
        incoming, outgoing = _roads_by_junction(self.roads.values())
        for attributes in records.junctions:
            if attributes.get("type") != "internal":
                self._read_junction(attributes, incoming, outgoing)
        pavement = {*self.crossings, *self.walking_areas}
        self.ways = ConnectionReader(path, self.lanes, self.internal, pavement)
        self.ways.read(records.connections)

    def roads_of(self) -> dict[str, Road]:
        """Find the road of each lane and crossing by the lane's id."""
        return {lane: road for road in self.roads.values() for lane in road.lanes}

    def bounds(self) -> tuple[tuple[float, float], tuple[float, float]]:
        """Measure the rectangle around every shape of the network."""
        shapes = [lane.shape for lane in self.lanes.values()]
        shapes += [junction.polygon for junction in self.junctions.values()]
        shapes += [area.polygon for area in self.walking_areas.values()]
        measure_bounds([*shapes, *(crossing.shape for crossing in self.crossings.values())], self.path)
        return measure_bounds(shapes, self.path)

    def _read_edge(self, record: EdgeRecord) -> None:
        attributes = record.attributes
        edge, function = (
            read_text(attributes, "id", self.path, "an edge"),
            attributes.get("function", "normal"),
        )
        if function in _ROAD_FUNCTIONS:
            self._read_road(edge, record)
        elif function == "walkingarea" and record.lanes:
            area = read_walking_area(edge, record, self.path)
            self._keep(self.walking_areas, edge, "walking_area", area, area.polygon)
        elif function == "internal":
            for lane in record.lanes:
                lane_id = read_text(lane, "id", self.path, "a lane")
                self.internal[lane_id] = self._shape(lane, f"lane {lane_id}")

    def _read_crossings(self, records: NetRecords) -> None:
        crossings = [e for e in records.edges if e.attributes.get("function") == "crossing" and e.lanes]
        for crossing in read_crossings(crossings, walk_connections(records.connections), self.path):
            self._keep(self.crossings, crossing.id, "crossing", crossing, crossing.shape)

    def _read_road(self, edge: str, record: EdgeRecord) -> None:
        if not record.lanes:
            raise SourceError(self.path, "the edge has no lanes", element=f"edge {edge}")
        attributes, what = record.attributes, f"edge {edge}"
        lanes = sorted((self._read_lane(edge, record, lane) for lane in record.lanes), key=lambda e: e.index)
        if [lane.index for lane in lanes] != list(range(len(lanes))):
            raise SourceError(self.path, "its lanes are not numbered 0, 1, 2...", element=what)
        road = Road(
            id=edge,
            name=attributes.get("name", ""),
            from_junction=read_text(attributes, "from", self.path, what),
            to_junction=read_text(attributes, "to", self.path, what),
            kind=attributes.get("type", ""),
            priority=read_int(attributes, "priority", self.path, what, default=-1),
            lanes=tuple(lane.id for lane in lanes),
            bidi=attributes.get("bidi"),
        )
        if self._keep(self.roads, edge, "road", road, lanes[0].shape):
            for lane in lanes:
                self._keep(self.lanes, lane.id, "lane", lane, lane.shape)
            self._report_oddities(record)

    def _report_oddities(self, record: EdgeRecord) -> None:
        """Report what SUMO ignores in lanes: vehicle classes that are none, repeated stop offsets."""
        for attributes in record.lanes:
            id_ = attributes["id"]
            for name in unknown_classes(attributes.get("allow"), attributes.get("disallow")):
                problem = f"names the vehicle class {name}, which SUMO does not know"
                self._report_lane("topology.unknown_class", id_, problem, "correct the lane's permissions")
            if record.stop_offsets.count(id_) > 1:
                problem = f"has {record.stop_offsets.count(id_)} stop offsets, of which SUMO keeps one"
                self._report_lane("topology.stop_offset_repeated", id_, problem, "leave one of them")

    def _report_lane(self, check: str, lane: str, problem: str, hint: str) -> None:
        x, y, z = self.lanes[lane].shape[-1].tolist()
        self.issues.append(
            Issue(
                check=check,
                severity=Severity.WARNING,
                elements=(Element(kind="lane", id=lane),),
                position=(x, y, z),
                message=f"the lane {lane} {problem}",
                hint=hint,
            )
        )

    def _read_lane(self, edge: str, record: EdgeRecord, attributes: Attributes) -> Lane:
        lane_id = read_text(attributes, "id", self.path, "a lane")
        what = f"lane {lane_id}"
        allow = allowed_classes(attributes.get("allow"), attributes.get("disallow"))
        ordinary = set(allow) - _SERVICES
        shape = self._shape(attributes, what)
        if len(shape) < 2:
            raise SourceError(self.path, "its shape has one position, expected at least two", element=what)
        return Lane(
            id=lane_id,
            road=edge,
            index=read_int(attributes, "index", self.path, what),
            kind=lane_kind(allow),
            width=read_float(attributes, "width", self.path, what, default=_LANE_WIDTH, least=MIN_WIDTH),
            speed=read_float(attributes, "speed", self.path, what, least=0.0),
            length=read_float(attributes, "length", self.path, what, least=0.0),
            allow=allow,
            shape=shape,
            change_inward=_may_change(attributes.get("changeLeft"), ordinary),
            change_outward=_may_change(attributes.get("changeRight"), ordinary),
            opposite=record.opposites.get(lane_id) or None,
        )

    def _read_junction(
        self, attributes: Attributes, incoming: Mapping[str, list[str]], outgoing: Mapping[str, list[str]]
    ) -> None:
        junction = read_text(attributes, "id", self.path, "a junction")
        what = f"junction {junction}"
        x, y, z = (
            read_float(attributes, key, self.path, what, default=0.0 if key == "z" else None) for key in "xyz"
        )
        polygon = self._shape(attributes, what) if attributes.get("shape") else points([])
        found = Junction(
            id=junction,
            kind=attributes.get("type", "unknown"),
            position=(x, y, z),
            polygon=polygon,
            incoming=tuple(incoming.get(junction, ())),
            outgoing=tuple(outgoing.get(junction, ())),
        )
        self._keep(self.junctions, junction, "junction", found, points([found.position]))

    def _keep(self, table: dict[str, T], key: str, kind: str, value: T, at: Points) -> bool:
        if key not in table:
            table[key] = value
            return True
        self.issues.append(
            Issue(
                check="topology.duplicate_id",
                severity=Severity.ERROR,
                elements=(Element(kind=kind, id=key),),
                position=(float(at[0, 0]), float(at[0, 1]), float(at[0, 2])),
                message=f"the {kind} {key} is defined more than once; the first is kept",
                hint="give each its own id",
            )
        )
        return False

    def _shape(self, attributes: Attributes, what: str, *, key: str = "shape") -> Points:
        return read_shape(attributes.get(key, ""), self.path, what)


def _read_projection(location: Attributes, path: Path) -> Projection:
    proj = location.get("projParameter", "!").strip()
    return Projection(
        proj=None if proj in ("!", "-", ".", "") else proj,
        net_offset=read_offset(location.get("netOffset", "0,0"), path, "location"),
    )


def _may_change(classes: str | None, ordinary: set[str]) -> bool:
    """Tell whether ordinary traffic may leave its lane, by SUMO's changeLeft or changeRight."""
    if classes is None or classes == "all":
        return True
    return bool(ordinary & set(classes.split()))


def _roads_by_junction(roads: Iterable[Road]) -> tuple[dict[str, list[str]], dict[str, list[str]]]:
    incoming: dict[str, list[str]] = defaultdict(list)
    outgoing: dict[str, list[str]] = defaultdict(list)
    for road in roads:
        incoming[road.to_junction].append(road.id)
        outgoing[road.from_junction].append(road.id)
    return incoming, outgoing
