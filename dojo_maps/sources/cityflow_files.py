"""CityFlow's files as values: road network, traffic, and the configuration that names both."""

import math
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from dojo_maps.errors import SourceError
from dojo_maps.input_files import find_named
from dojo_maps.safe_json import read_json

_LARGEST = 1e7
"""Metres and seconds; beyond, SUMO's own numbers end."""
_DAY = 86400.0
_MOST = 2_000_000
"""Vehicles of one flow."""
_NAMES = {
    "length": "length", "width": "width", "maxSpeed": "maxSpeed", "usualPosAcc": "accel",
    "usualNegAcc": "decel", "maxNegAcc": "emergencyDecel", "minGap": "minGap", "headwayTime": "tau",
}  # fmt: skip
"""What SUMO calls what CityFlow tells of a vehicle."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Road:
    """A road in one direction: places at its ends, points of its left border, (width m, m/s) of each lane."""

    start: str
    end: str
    points: tuple[tuple[float, float], ...]
    lanes: tuple[tuple[float, float], ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class RoadLink:
    """A way from one road into another: `go_straight`, `turn_left`, ..., and its lanes, from the middle."""

    start: str
    end: str
    turn: str
    ways: tuple[tuple[int, int], ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class Place:
    """An intersection, and its signal's phases: seconds, and which of the links are green."""

    id: str
    x: float
    y: float
    width: float
    links: tuple[RoadLink, ...]
    phases: tuple[tuple[float, frozenset[int]], ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class RoadNetwork:
    """All roads by id, and all intersections."""

    roads: dict[str, Road]
    places: tuple[Place, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class Flow:
    """Vehicles of a kind, by SUMO's names of what they are, on a route, `interval` seconds apart."""

    vehicle: dict[str, float]
    route: tuple[str, ...]
    start: float
    interval: float
    count: int


@dataclass(frozen=True, slots=True, kw_only=True)
class Traffic:
    """All flows, and how many of them the file gives no end."""

    flows: tuple[Flow, ...]
    endless: int


class Fields:
    """A value out of JSON, read field by field; whatever is wrong is an error that names the place."""

    def __init__(self, value: Any, path: Path, place: str = "") -> None:
        """Take a value, where it came from, and where it stands there."""
        self._value, self.path, self._place = value, path, place

    def text(self, name: str) -> str:
        """Read a text.

        Args:
            name: of the field.

        Returns:
            The text; it may be empty.

        Raises:
            SourceError: there is no such field, or it is no text.
        """
        return self._take(name, str, "a text")

    def number(self, name: str, *, least: float = -_LARGEST, default: float | None = None) -> float:
        """Read a finite number of at least so much.

        Args:
            name: of the field.
            least: the smallest that is taken; the largest is 10 million, metres or seconds.
            default: taken where the object has no such field; None makes that an error.

        Returns:
            The number.

        Raises:
            SourceError: it is missing, no number, not finite, or out of bounds.
        """
        if default is not None and isinstance(self._value, dict) and name not in self._value:
            return default
        value = self._take(name, (int, float), "a number")
        if isinstance(value, bool) or not math.isfinite(value) or not least <= value <= _LARGEST:
            self._refuse(name, f"a number from {least:g} to {_LARGEST:g}", value)
        return float(value)

    def whole(self, name: str, below: int) -> int:
        """Read a whole number from 0, below another.

        Args:
            name: of the field.
            below: the first number that is too large.

        Returns:
            The number.

        Raises:
            SourceError: it is missing, no whole number, or out of bounds.
        """
        value = self._take(name, int, "a whole number")
        if isinstance(value, bool) or not 0 <= value < below:
            self._refuse(name, f"a whole number from 0, below {below}", value)
        return value

    def each(self, name: str) -> Iterator["Fields"]:
        """Go through a list of objects.

        Args:
            name: of the field.

        Yields:
            Each of its values, in order.

        Raises:
            SourceError: there is no such field, or it is no list.
        """
        for number, value in enumerate(self._take(name, list, "a list")):
            yield Fields(value, self.path, f"{self._place}{name}[{number}].")

    def list_values(self, name: str, kind: type) -> list[Any]:
        """Read a list of plain values.

        Args:
            name: of the field.
            kind: that every value must be of exactly, such as `int`; true and false are none.

        Returns:
            The values, in order.

        Raises:
            SourceError: there is no such field, it is no list, or a value is of another kind.
        """
        values = self._take(name, list, "a list")
        if not all(type(value) is kind for value in values):
            self._refuse(name, f"a list of {kind.__name__}", values)
        return values

    def part(self, name: str) -> "Fields":
        """Read an object.

        Args:
            name: of the field.

        Returns:
            Its fields.

        Raises:
            SourceError: there is no such field, or it is no object.
        """
        return Fields(self._take(name, dict, "an object"), self.path, f"{self._place}{name}.")

    def has(self, name: str) -> bool:
        """Tell whether there is a field of a name.

        Args:
            name: of the field.

        Returns:
            Whether there is; one that is null counts as none.
        """
        return isinstance(self._value, dict) and self._value.get(name) is not None

    def _take(self, name: str, kinds: Any, words: str) -> Any:
        value = self._value.get(name) if isinstance(self._value, dict) else None
        if not isinstance(value, kinds):
            self._refuse(name, words, value)
        return value

    def _refuse(self, name: str, words: str, value: Any) -> None:
        shown = "missing" if value is None else repr(value)[:60]
        raise SourceError(self.path, f"{self._place}{name} is {shown}; expected {words}")


def read_road_network(fields: Fields) -> RoadNetwork:
    """Read a road network.

    Args:
        fields: the whole of a road network's file.

    Returns:
        Its roads and intersections; what they name is there.

    Raises:
        SourceError: a value is missing, of another kind than CityFlow's, or names what is not there; or an
            id stands twice.
    """
    roads: dict[str, Road] = {}
    for road in fields.each("roads"):
        lanes = tuple(
            (lane.number("width", least=0.1), lane.number("maxSpeed", least=0.1))
            for lane in road.each("lanes")
        )
        points = tuple((point.number("x"), point.number("y")) for point in road.each("points"))
        name = road.text("id")
        if not lanes or len(points) < 2 or name in roads:
            raise SourceError(fields.path, f"road {name!r} has no lane, one point only, or its id twice")
        roads[name] = Road(
            start=road.text("startIntersection"), end=road.text("endIntersection"), points=points, lanes=lanes
        )
    places = tuple(_read_place(place, roads) for place in fields.each("intersections"))
    known = {place.id for place in places}
    if len(known) < len(places):
        raise SourceError(fields.path, "two intersections have the same id")
    for name, made in roads.items():
        if not {made.start, made.end} <= known:
            raise SourceError(fields.path, f"road {name!r} ends at an intersection that is not there")
    return RoadNetwork(roads=roads, places=places)


def _read_place(place: Fields, roads: dict[str, Road]) -> Place:
    links = []
    for link in place.each("roadLinks"):
        start, end = link.text("startRoad"), link.text("endRoad")
        for name in (start, end):
            if name not in roads:
                raise SourceError(place.path, f"a road link names road {name!r}, which is not there")
        ways = tuple(
            (
                way.whole("startLaneIndex", len(roads[start].lanes)),
                way.whole("endLaneIndex", len(roads[end].lanes)),
            )
            for way in link.each("laneLinks")
        )
        links.append(RoadLink(start=start, end=end, turn=link.text("type"), ways=ways))
    phases: list[tuple[float, frozenset[int]]] = []
    if place.has("trafficLight"):
        for phase in place.part("trafficLight").each("lightphases"):
            available = phase.list_values("availableRoadLinks", int)
            if any(not 0 <= number < len(links) for number in available):
                raise SourceError(place.path, f"a phase names road link {available}; there are {len(links)}")
            phases.append((phase.number("time", least=0.0), frozenset(available)))
    point = place.part("point")
    return Place(
        id=place.text("id"),
        x=point.number("x"),
        y=point.number("y"),
        width=place.number("width", least=0.0, default=0.0),
        links=tuple(links),
        phases=tuple(phases),
    )


def read_traffic(path: Path) -> Traffic:
    """Read a file of flows.

    Args:
        path: of the file.

    Returns:
        The flows that have a vehicle; one without an end lasts for a day from its start.

    Raises:
        SourceError: it cannot be read, a value is of another kind than CityFlow's, or a flow has too many
            vehicles.
    """
    flows, endless = [], 0
    for flow in Fields({"flows": read_json(path)}, path).each("flows"):
        vehicle = flow.part("vehicle")
        start, end = flow.number("startTime", least=0.0), flow.number("endTime", least=-1.0)
        endless += end < 0
        last = start + _DAY if end < 0 else end
        interval = flow.number("interval", least=0.001)
        count = int((last - start) / interval + 1e-6) + 1 if last >= start else 0
        if count > _MOST:
            raise SourceError(path, f"a flow has {count} vehicles; at most {_MOST} are read")
        if count:
            flows.append(
                Flow(
                    vehicle={
                        ours: vehicle.number(theirs, least=0.01)
                        for theirs, ours in _NAMES.items()
                        if vehicle.has(theirs)
                    },
                    route=tuple(flow.list_values("route", str)),
                    start=start,
                    interval=interval,
                    count=count,
                )
            )
    return Traffic(flows=tuple(flows), endless=endless)


def is_cityflow(path: Path) -> bool:
    """Tell whether a file is one of CityFlow's by its name, or a folder by a road network in it.

    Args:
        path: of a file, which need not be there, or of a folder.

    Returns:
        Whether it is; a folder with a `map.json` is a bundle and is not.
    """
    if path.is_dir():
        return not (path / "map.json").exists() and any(path.glob("*roadnet*.json"))
    return path.name.lower().endswith((".json", ".cfg"))


def find_files(path: Path) -> tuple[Path, Path | None]:
    """Find a road network and its traffic; a road network by its path comes alone.

    Args:
        path: a road network; a configuration with `dir`, `roadnetFile` and `flowFile`; or a folder with a
            road network and one file of flows.

    Returns:
        The road network, and the file of flows; None where none is named or found.

    Raises:
        SourceError: it is none of these, or a file that it names is not there.
    """
    if path.is_dir():
        return _find_in_folder(path)
    value = read_json(path)
    if isinstance(value, dict) and "intersections" in value:
        return path, None
    fields = Fields(value, path)
    if not fields.has("roadnetFile"):
        raise SourceError(path, "neither a road network of CityFlow's nor a configuration with roadnetFile")
    folder = fields.text("dir") if fields.has("dir") else ""
    traffic = find_named(path, folder, fields.text("flowFile")) if fields.has("flowFile") else None
    return find_named(path, folder, fields.text("roadnetFile")), traffic


def _find_in_folder(folder: Path) -> tuple[Path, Path | None]:
    networks, flows = [], []
    for path in sorted(folder.glob("*.json")):
        value = read_json(path)
        if isinstance(value, dict) and "intersections" in value and "roads" in value:
            networks.append(path)
        elif isinstance(value, list) and value and isinstance(value[0], dict) and "route" in value[0]:
            flows.append(path)
    if len(networks) != 1 or len(flows) > 1:
        names = ", ".join(path.name for path in (*networks, *flows)) or "nothing of CityFlow's"
        raise SourceError(
            folder,
            f"expected one road network and at most one file of flows, found {names}; name them in a "
            'configuration: {"roadnetFile": ..., "flowFile": ...}',
        )
    return networks[0], flows[0] if flows else None
