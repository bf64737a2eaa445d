"""Lanelet2 in OpenStreetMap's format: lanelets that share borders, and the rules that hold on them.

Each lane, each connection and each crossing is a lanelet; neighbours share the line between them, and what
follows each other shares the nodes where it meets, so that a routing graph has the network's connections.
Ways and relations carry the network's ids as `sumo_id`. Nodes are in WGS84, around 0° N 0° E if the network
has no projection, and carry the network's coordinates as `local_x` and `local_y`.
"""

import xml.etree.ElementTree as ET
from collections import defaultdict
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import shapely

from dojo_maps.description import (
    Connection,
    Crossing,
    Lane,
    LaneKind,
    LinkKind,
    Origin,
    Points,
    Road,
    RoadMap,
    Signal,
    points,
)  # fmt: skip
from dojo_maps.exports import file_stem
from dojo_maps.exports.earth import Earth
from dojo_maps.exports.reference_lines import curve, sample
from dojo_maps.geometry.polylines import Floats, drop_repeats, lift, place_on
from dojo_maps.index import MapIndex

_SUBTYPES = {
    LaneKind.DRIVING: "road",
    LaneKind.BUS: "bus_lane",
    LaneKind.BICYCLE: "bicycle_lane",
    LaneKind.SIDEWALK: "walkway",
}
"""Of lanes; who may use the others is said one by one."""
_PARTICIPANTS = {
    "passenger": "vehicle:car",
    "bus": "vehicle:bus",
    "truck": "vehicle:truck",
    "motorcycle": "vehicle:motorcycle",
    "taxi": "vehicle:taxi",
    "emergency": "vehicle:emergency",
    "bicycle": "bicycle",
    "pedestrian": "pedestrian",
    "tram": "train",
    "rail": "train",
    "ship": "ship",
}
_TURNS = {"s": "straight", "l": "left", "L": "left", "r": "right", "R": "right", "t": "left"}
_AROUND_ZERO = "+proj=tmerc +lat_0=0 +lon_0=0 +ellps=WGS84"
_NARROWEST = 0.1
"""Metres; a network may hold lanes of no or of negative width."""
_HEAD_WIDTH = 0.3
_LONGEST_MITRE = 2.0
"""How much farther than its distance a corner may lie from the one that it runs beside."""
_MOST_HALVINGS = 5
_CLOSE = 0.1
"""Metres; a bound that gets no farther ahead goes around a loop, so that it has two sides."""
_LOOPS = ((0.0, 0.05), (0.5, 0.05), (0.5, 0.5), (0.5, 1.0))
"""Ways to draw a bound, the next where the one before does not do: the share of its reach that it must
get ahead to go without a loop, and how far the loop goes aside as a share of how far it goes ahead."""
_SAMPLING = 2.0
"""Metres between positions of a bound across a junction."""

_Tags = dict[str, str]
_Members = list[tuple[str, str, str]]
"""Kind, number and role of each."""


def write_lanelet2(road_map: RoadMap, folder: Path) -> None:
    """Write `<name>.osm`.

    Args:
        road_map: what to write; without a projection, it lies around 0° N 0° E.
        folder: exists; a file of that name in it is replaced.

    Raises:
        ExportError: the network's projection is unknown or does not fit its coordinates.
        OSError: the file cannot be written.
    """
    root = _Document(road_map).build()
    ET.indent(root)
    path = folder / f"{file_stem(road_map)}.osm"
    ET.ElementTree(root).write(path, encoding="UTF-8", xml_declaration=True)


@dataclass(frozen=True, slots=True)
class _Line:
    """A way: its number, and the numbers of its first and its last node."""

    number: int
    first: int
    last: int


@dataclass(frozen=True, slots=True)
class _Lanelet:
    """A lanelet's relation and its bounds."""

    element: ET.Element
    left: _Line
    right: _Line

    @property
    def number(self) -> str:
        return self.element.get("id", "")


def _width(lane: Lane) -> float:
    return max(lane.width, _NARROWEST)


class _Document:
    """The file's nodes, ways and relations, and the numbers that they have in it."""

    def __init__(self, road_map: RoadMap) -> None:
        self._map, self._index = road_map, MapIndex(road_map)
        self._last_number = 0
        self._nodes: dict[int, Floats] = {}
        self._ways: list[ET.Element] = []
        self._relations: list[ET.Element] = []
        self._lanelets: dict[str, _Lanelet] = {}
        self._stop_lines: dict[str, int] = {}
        self._middles = {lane.id: _straighten_hooks(lane.shape, _width(lane)) for lane in road_map.lanes}

    def build(self) -> ET.Element:
        """Put everything together."""
        for road in self._map.roads:
            self._add_road(road)
        for connection in self._map.connections:
            self._add_connection(connection)
        for crossing in self._map.crossings:
            self._add_crossing(crossing)
        for area in self._map.walking_areas:
            self._add_area(area.id, area.polygon)
        for sidewalk in self._map.sidewalks:
            if sidewalk.origin is Origin.GENERATED and sidewalk.road is not None:
                self._add_area(sidewalk.id, sidewalk.polygon)
        for stop in self._map.stop_lines:
            line = self._add_line(stop.shape, {"type": "stop_line", "sumo_id": stop.lane})
            self._stop_lines[stop.lane] = line.number
        for signal in self._map.signals:
            self._add_signal(signal)
        self._add_right_of_way()
        root = ET.Element("osm", version="0.6", generator="TrafficDojo")
        root.extend(list(self._node_elements()))
        root.extend(self._ways)
        root.extend(self._relations)
        return root

    def _node_elements(self) -> Iterator[ET.Element]:
        places = np.array([*self._nodes.values()]).reshape(-1, 3)
        projection = self._map.projection
        offset = projection.net_offset if projection.proj else (0.0, 0.0)
        degrees = Earth(projection.proj or _AROUND_ZERO, offset).degrees(places)
        for number, (x, y, z), longitude, latitude in zip(self._nodes, places, *degrees, strict=True):
            element = _element("node", number, lat=f"{latitude:.10f}", lon=f"{longitude:.10f}")
            _tag(element, {"ele": f"{z:.3f}", "local_x": f"{x:.4f}", "local_y": f"{y:.4f}"})
            yield element

    def _number(self) -> int:
        self._last_number += 1
        return self._last_number

    def _add_line(
        self, shape: Floats, tags: _Tags, *, first: int | None = None, last: int | None = None
    ) -> _Line:
        """Add a way along positions (n, 3), n >= 2; its ends are nodes that are there, or new ones."""
        numbers = [self._number() for _ in shape[1:-1]]
        ends = []
        for node, place in ((first, shape[0]), (last, shape[-1])):
            ends.append(self._number() if node is None else node)
            self._nodes.setdefault(ends[-1], place)
        self._nodes.update(zip(numbers, shape[1:-1], strict=True))
        way = _element("way", self._number())
        for number in (ends[0], *numbers, ends[1]):
            ET.SubElement(way, "nd", ref=str(number))
        _tag(way, tags)
        self._ways.append(way)
        return _Line(int(way.get("id", "")), *ends)

    def _add_lanelet(self, name: str, left: _Line, right: _Line, tags: _Tags) -> None:
        element = _element("relation", self._number())
        _member(element, "way", left.number, "left")
        _member(element, "way", right.number, "right")
        _tag(element, {"type": "lanelet", "sumo_id": name, **tags})
        self._relations.append(element)
        self._lanelets[name] = _Lanelet(element, left, right)

    def _add_road(self, road: Road) -> None:
        """Add a road's lanelets, and between them the lines that neighbours share."""
        lanes = self._index.lanes_of(road.id)
        outward = 1.0 if self._map.left_hand else -1.0
        lines = []
        for k in range(len(lanes) + 1):
            lane = lanes[min(k, len(lanes) - 1)]
            aside = (outward if k < len(lanes) else -outward) * _width(lane) / 2
            lines.append(self._add_line(_beside(self._middles[lane.id], aside), self._border(lanes, k)))
        for lane, outer, inner in zip(lanes, lines, lines[1:], strict=False):
            left, right = (outer, inner) if self._map.left_hand else (inner, outer)
            self._add_lanelet(lane.id, left, right, _lane_tags(lane))

    def _border(self, lanes: Sequence[Lane], k: int) -> _Tags:
        """Describe the line outside of a road's lane k, or inside of the last one."""
        if k == 0:
            return {"type": "road_border"}
        if k == len(lanes):
            return {"type": "line_thin", "subtype": "solid"}
        outer, inner = lanes[k - 1], lanes[k]
        if outer.kind is LaneKind.SIDEWALK:
            return {"type": "curbstone", "subtype": "high"}
        # From the lane on the line's left to the one on its right, and back.
        changes = [inner.change_outward, outer.change_inward]
        left_to_right, right_to_left = changes[::-1] if self._map.left_hand else changes
        dashes = ["dashed" if may else "solid" for may in (left_to_right, right_to_left)]
        return {"type": "line_thin", "subtype": dashes[0] if len(set(dashes)) == 1 else "_".join(dashes)}

    def _add_connection(self, connection: Connection) -> None:
        before, after = self._lanelets[connection.from_lane], self._lanelets[connection.to_lane]
        lane, next_lane = self._index.lanes[connection.from_lane], self._index.lanes[connection.to_lane]
        start = place_on(_with_length(self._middles[lane.id]), np.inf)
        end = place_on(_with_length(self._middles[next_lane.id]), 0.0)
        pieces = curve((start[0][:2], start[1]), (end[0][:2], end[1]), connection.shape[1:-1, :2])
        places = sample(pieces, apart=_SAMPLING)
        middle = points(np.column_stack([places, np.linspace(start[0][2], end[0][2], len(places))]))
        width = (_width(lane) + _width(next_lane)) / 2
        ends = [(before.left, after.left, width / 2), (before.right, after.right, -width / 2)]
        left, right = (self._bound(*pair, beside=middle) for pair in ends)
        for loop in _LOOPS:
            if _lie_beside(left, right):
                break
            left, right = (self._bound(*pair, headings=(start[1], end[1]), loop=loop) for pair in ends)
        lines = [
            self._add_line(bound, {"type": "virtual"}, first=first.last, last=last.first)
            for bound, (first, last, _) in zip((left, right), ends, strict=True)
        ]
        tags = _lane_tags(lane if lane.kind is not LaneKind.DRIVING else next_lane)
        if connection.direction in _TURNS:
            tags["turn_direction"] = _TURNS[connection.direction]
        self._add_lanelet(connection.id, lines[0], lines[1], tags)

    def _bound(
        self,
        before: _Line,
        after: _Line,
        distance: float,
        *,
        beside: Points | None = None,
        headings: tuple[float, float] = (0.0, 0.0),
        loop: tuple[float, float] = (0.0, 0.0),
    ) -> Floats:
        """Draw a bound from a line's end to another one's start: (n, 3).

        Args:
            before: the line.
            after: the other one.
            distance: metres to the left of the way's middle.
            beside: (n, 3), the way's middle; None for a curve with the headings at its ends.
            headings: radians.
            loop: one of `_LOOPS`.
        """
        start, end = self._nodes[before.last], self._nodes[after.first]
        if beside is not None:
            return np.vstack([start, _beside(beside, distance)[1:-1], end])
        ahead = np.array([np.cos(headings[0]), np.sin(headings[0]), 0.0])
        reach = max(float(np.hypot(*(end - start)[:2])), _CLOSE)
        share, swing = loop
        if (end - start) @ ahead < max(share * reach, _CLOSE):
            out = ahead * reach
            inward = np.array([-out[1], out[0], 0.0]) * np.sign(distance) * swing
            return np.vstack([start, start + out - inward, end + out + inward, end])
        pieces = curve((start[:2], headings[0]), (end[:2], headings[1]), np.empty((0, 2)))
        places = sample(pieces, apart=_SAMPLING)
        return np.column_stack([places, np.linspace(start[2], end[2], len(places))])

    def _add_crossing(self, crossing: Crossing) -> None:
        left, right = (
            self._add_line(_beside(crossing.shape, side * crossing.width / 2), {"type": "pedestrian_marking"})
            for side in (1.0, -1.0)
        )
        tags = {"subtype": "crosswalk", "one_way": "no", "location": "urban"}
        self._add_lanelet(crossing.id, left, right, tags)

    def _add_area(self, name: str, ring: Points) -> None:
        """Add pavement with an outline (n, 3); one that crosses itself becomes its parts."""
        whole = shapely.make_valid(shapely.Polygon(ring[:, :2])) if len(ring) > 2 else shapely.Polygon()
        for part in shapely.get_parts(whole):
            if not isinstance(part, shapely.Polygon) or part.area < _NARROWEST:
                continue
            clockwise = shapely.get_coordinates(shapely.orient_polygons(part, exterior_cw=True).exterior)
            first = self._number()
            tags = {"type": "curbstone", "subtype": "low"}
            line = self._add_line(lift(clockwise, ring), tags, first=first, last=first)
            element = _element("relation", self._number())
            _member(element, "way", line.number, "outer")
            _tag(
                element, {"type": "multipolygon", "subtype": "walkway", "location": "urban", "sumo_id": name}
            )
            self._relations.append(element)

    def _add_rule(self, regulated: Sequence[_Lanelet], members: _Members, tags: _Tags) -> None:
        """Add a regulatory element, and name it on the lanelets that it holds on."""
        element = _element("relation", self._number())
        for kind, number, role in members:
            _member(element, kind, number, role)
        _tag(element, {"type": "regulatory_element", **tags})
        self._relations.append(element)
        for lanelet in {lanelet.number: lanelet for lanelet in regulated}.values():
            _member(lanelet.element, "relation", element.get("id", ""), "regulatory_element")

    def _stop_line(self, lane: str) -> _Members:
        line = self._stop_lines.get(lane)
        return [] if line is None else [("way", str(line), "ref_line")]

    def _add_signal(self, signal: Signal) -> None:
        """Add a rule for each lane and each crossing and the heads that show it what to do."""
        heads = []
        for head in signal.heads:
            across = np.array([-np.sin(head.heading), np.cos(head.heading), 0.0]) * _HEAD_WIDTH / 2
            shape = np.array([np.array(head.position) + across, np.array(head.position) - across])
            line = self._add_line(shape, {"type": "traffic_light", "subtype": "red_yellow_green"})
            heads.append((set(head.link_indices), str(line.number)))
        ways: dict[tuple[str, str], set[int]] = defaultdict(set)
        for link in signal.links:
            if link.kind is LinkKind.VEHICLE:
                ways[link.from_id, f"{link.from_id}->{link.to_id}"].add(link.index)
            else:
                ways["", link.to_id].add(link.index)
        rules: dict[tuple[str, tuple[str, ...]], list[str]] = defaultdict(list)
        for (lane, way), indices in ways.items():
            seen = tuple(number for shown, number in heads if indices & shown)
            if seen and way in self._lanelets:
                rules[lane, seen].append(way)
        for (lane, seen), regulated in rules.items():
            members = [("way", number, "refers") for number in seen] + self._stop_line(lane)
            lanelets = [self._lanelets[name] for name in (lane, *regulated) if name in self._lanelets]
            self._add_rule(lanelets, members, {"subtype": "traffic_light", "sumo_id": signal.id})

    def _add_right_of_way(self) -> None:
        """Add a rule for each way across a junction that must let others go first."""
        for junction in self._map.junctions:
            ways = [self._lanelets.get(way.link) for way in junction.right_of_way]
            for yielding, way in zip(ways, junction.right_of_way, strict=True):
                first = [ways[k] for k in way.response]
                going = [lanelet for lanelet in first if lanelet is not None]
                if yielding is None or not going:
                    continue
                members = [("relation", yielding.number, "yield")]
                members += [("relation", lanelet.number, "right_of_way") for lanelet in going]
                members += self._stop_line(way.link.partition("->")[0])
                tags = {"subtype": "right_of_way", "sumo_id": junction.id}
                self._add_rule([yielding, *going], members, tags)


def _element(kind: str, number: int, **attributes: str) -> ET.Element:
    return ET.Element(kind, {"id": str(number), "visible": "true", "version": "1", **attributes})


def _tag(element: ET.Element, tags: _Tags) -> None:
    for key, value in tags.items():
        ET.SubElement(element, "tag", k=key, v=value)


def _member(relation: ET.Element, kind: str, number: int | str, role: str) -> None:
    ET.SubElement(relation, "member", type=kind, ref=str(number), role=role)


def _lane_tags(lane: Lane) -> _Tags:
    tags = {
        "subtype": _SUBTYPES.get(lane.kind, "road"),
        "location": "urban",
        "one_way": "yes",
        "speed_limit": f"{max(lane.speed, 0.0) * 3.6:.4g} km/h",
    }
    if lane.kind not in _SUBTYPES:
        allowed = dict.fromkeys(_PARTICIPANTS[name] for name in lane.allow if name in _PARTICIPANTS)
        tags |= {f"participant:{name}": "yes" for name in allowed} or {"participant:vehicle": "no"}
    return tags


def _with_length(shape: Points) -> Points:
    line = drop_repeats(shape)
    return line if len(line) > 1 else points(np.vstack([line, line + np.array([_NARROWEST, 0.0, 0.0])]))


def _straighten_hooks(shape: Points, width: float) -> Points:
    """Leave out the sharpest corners of a lane's middle until a border has room on each side of it."""
    while len(shape) > 2 and not _lie_beside(*(_beside(shape, side * width / 2) for side in (1.0, -1.0))):
        steps = np.diff(shape[:, :2], axis=0)
        straightness = (steps[:-1] * steps[1:]).sum(axis=1) / np.maximum(
            np.hypot(*steps[:-1].T) * np.hypot(*steps[1:].T), 1e-12
        )
        shape = points(np.delete(shape, 1 + int(straightness.argmin()), axis=0))
    return shape


def _lie_beside(left: Floats, right: Floats) -> bool:
    """Tell whether the left bound lies on the right one's left, and that one on its right."""
    return _lies_beside(left, right, -1.0) and _lies_beside(right, left, 1.0)


def _lies_beside(line: Floats, other: Floats, side: float) -> bool:
    """Tell whether the middle of another line lies on a line's left (1.0) or right (-1.0).

    Readers turn lines around by that.
    """
    middle = other[len(other) // 2, :2] if len(other) > 2 else other[:, :2].mean(axis=0)
    starts, steps = line[:-1, :2], np.diff(line[:, :2], axis=0)
    away = middle - starts
    share = (away * steps).sum(axis=1) / np.maximum((steps**2).sum(axis=1), 1e-12)
    distance = np.hypot(*(away - np.clip(share, 0.0, 1.0)[:, None] * steps).T)
    near = np.flatnonzero(distance < distance.min() + 1e-6)
    return bool((side * (steps[near, 0] * away[near, 1] - steps[near, 1] * away[near, 0]) > 1e-6).all())


def _beside(shape: Points, distance: float) -> Floats:
    """Draw the line beside another one, metres to its left, its ends across those of the other: (n, 3).

    Corners are mitred. Where the line turns so tightly that one beside it would run backwards, that one
    comes nearer; what still runs backwards is left out.
    """
    line = _with_length(shape)
    steps = np.diff(line[:, :2], axis=0)
    normals = np.column_stack([-steps[:, 1], steps[:, 0]]) / np.hypot(*steps.T)[:, None]
    sums = np.vstack([2 * normals[:1], normals[:-1] + normals[1:], 2 * normals[-1:]])
    mitres = sums * np.minimum(2 / np.maximum((sums**2).sum(axis=1), 1e-9), _LONGEST_MITRE)[:, None]
    distances = np.full(len(line), distance)
    for _ in range(_MOST_HALVINGS):
        moved = line + np.column_stack([distances[:, None] * mitres, np.zeros(len(line))])
        backward = (np.diff(moved[:, :2], axis=0) * steps).sum(axis=1) < 1e-6
        turning = np.concatenate([[False], backward[:-1] | backward[1:], [False]])
        if not turning.any():
            break
        distances[turning] /= 2
    return moved[~turning]
