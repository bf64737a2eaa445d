"""Draw departures by chance, and write who departs as a SUMO route file."""

from collections import Counter
from collections.abc import Iterable, Iterator, Sequence, Set
from dataclasses import dataclass
from pathlib import Path
from xml.sax.saxutils import quoteattr

import numpy as np

from dojo_maps.demand.movements import Route
from dojo_maps.demand.walkers import Walk
from dojo_maps.description import RoadMap
from dojo_maps.geometry.polylines import Floats
from dojo_maps.index import MapIndex
from dojo_maps.whole_file import replaced

_TYPES = {"passenger": "car"}
"""What types are called, where not after the class of their vehicles."""
_ROOM = 15.0
"""Metres that a bus takes as it stands, and a little."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Stop:
    """Where a vehicle stands still for a while: the metre of a lane, those that it takes, and seconds."""

    lane: str
    place: float
    length: float
    seconds: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Trip:
    """A vehicle: when it departs, seconds, its roads, SUMO's word for who it is, and where it stops."""

    depart: float
    roads: tuple[str, ...]
    vehicle_class: str
    stops: tuple[Stop, ...] = ()


@dataclass(frozen=True, slots=True, kw_only=True)
class Stroll:
    """Somebody on foot: when, seconds, and which of the `walks` of the map, by its number."""

    depart: float
    walk: Walk
    number: int


def draw_trips(
    routes: Sequence[Route], rates: Floats, chance: np.random.Generator, *, begin: float, end: float
) -> Iterator[Trip]:
    """Let vehicles depart, evenly by chance.

    Args:
        routes: what they drive.
        rates: (n,) vehicles per hour of each route.
        chance: draws the departures.
        begin: seconds.
        end: seconds.

    Yields:
        The vehicles, route by route, each route's in the order of their departures.
    """
    hours = (end - begin) / 3600
    for route, rate in zip(routes, rates, strict=True):
        wanted = float(rate) * hours
        count = round(wanted) if wanted >= 1 else int(rate >= 1 or chance.random() < wanted)
        for depart in _draw(count, chance, begin, end):
            yield Trip(depart=depart, roads=route.roads, vehicle_class=route.vehicle_class)


def draw_strolls(
    walks: Sequence[Walk], counts: Sequence[int], chance: np.random.Generator, *, begin: float, end: float
) -> Iterator[Stroll]:
    """Let people depart, evenly by chance.

    Args:
        walks: the map's.
        counts: how many go on each.
        chance: draws the departures.
        begin: the first second.
        end: the second after the last.

    Yields:
        The people, walk by walk, each walk's in the order of their departures.
    """
    for number, (walk, count) in enumerate(zip(walks, counts, strict=True)):
        for depart in _draw(count, chance, begin, end):
            yield Stroll(depart=depart, walk=walk, number=number)


def find_stubs(road_map: RoadMap) -> frozenset[str]:
    """Find the roads on which no two vehicles have room behind each other.

    Args:
        road_map: whose roads are measured by their outermost lanes.

    Returns:
        The roads' ids.
    """
    lanes = MapIndex(road_map).lanes
    return frozenset(road.id for road in road_map.roads if lanes[road.lanes[0]].length < _ROOM)


def write_route_file(
    trips: Sequence[Trip],
    strolls: Iterable[Stroll],
    path: Path,
    stubs: Set[str] = frozenset(),
    *,
    impatience: float = 0.0,
) -> None:
    """Write vehicles and people in the order of their departures; the file appears whole.

    Args:
        trips: the vehicles.
        strolls: the people on foot.
        path: of the file.
        stubs: as for `format_routes`.
        impatience: likewise.

    Raises:
        UsageError: the path is a folder, or lies in none.
        WriteError: the file cannot be written.
    """
    with replaced(path) as fresh:
        fresh.write_text(format_routes(trips, strolls, stubs, impatience=impatience), encoding="utf-8")


def format_routes(
    trips: Sequence[Trip],
    strolls: Iterable[Stroll],
    stubs: Set[str] = frozenset(),
    *,
    impatience: float = 0.0,
) -> str:
    """Write vehicles and people in the order of their departures as SUMO's XML.

    Args:
        trips: the vehicles.
        strolls: the people on foot.
        stubs: roads that are shorter than a vehicle: one departs behind the last one there, as SUMO would
            otherwise put it on top of that.
        impatience: 0 to 1, of drivers who have not waited yet: how far they make those brake who go first.

    Returns:
        The text of a route file.
    """
    classes = dict.fromkeys(("passenger", "bus", *(trip.vehicle_class for trip in trips)))
    types = [(_TYPES.get(name, name), name) for name in classes]
    routes = {key: number for number, key in enumerate(dict.fromkeys(trip.roads for trip in trips))}
    haste = f' impatience="{impatience:g}"' if impatience else ""
    lines = [f'    <vType id="{id_}" vClass="{name}"{haste}/>' for id_, name in types]
    lines.append('    <vType id="walker" vClass="pedestrian"/>')
    lines += [
        f'    <route id="route_{number}" edges={quoteattr(" ".join(roads))}/>'
        for roads, number in routes.items()
    ]
    departures = [
        (trip.depart, _vehicle(trip, *key, is_stub=trip.roads[0] in stubs))
        for trip, key in _numbered(trips, routes)
    ]
    departures += [(stroll.depart, person) for stroll, person in _people(strolls)]
    lines += [f"    {line}" for _, line in sorted(departures)]
    return "\n".join(["<routes>", *lines, "</routes>", ""])


def _draw(count: int, chance: np.random.Generator, begin: float, end: float) -> list[float]:
    times: list[float] = (begin + np.sort(chance.random(count)) * (end - begin)).tolist()
    return times


def _numbered(
    trips: Iterable[Trip], routes: dict[tuple[str, ...], int]
) -> Iterator[tuple[Trip, tuple[int, int]]]:
    """Give each trip the number of its route, and its own among those."""
    used: Counter[int] = Counter()
    for trip in trips:
        number = routes[trip.roads]
        yield trip, (number, used[number])
        used[number] += 1


def _vehicle(trip: Trip, route: int, number: int, *, is_stub: bool) -> str:
    kind = _TYPES.get(trip.vehicle_class, trip.vehicle_class)
    text = (
        f'<vehicle id="v{route}.{number}" type="{kind}" route="route_{route}" depart="{trip.depart:.2f}" '
        'departLane="best" departSpeed="max"'
    )
    if is_stub:
        text += ' departPos="last"'
    if not trip.stops:
        return f"{text}/>"
    stops = "".join(
        f'<stop lane={quoteattr(stop.lane)} startPos="{stop.place - stop.length:.1f}" '
        f'endPos="{stop.place:.1f}" duration="{stop.seconds:g}"/>'
        for stop in trip.stops
    )
    return f"{text}>{stops}</vehicle>"


def _people(strolls: Iterable[Stroll]) -> Iterator[tuple[Stroll, str]]:
    used: Counter[int] = Counter()
    for stroll in strolls:
        walk, number = stroll.walk, stroll.number
        yield (
            stroll,
            f'<person id="p{number}.{used[number]}" type="walker" depart="{stroll.depart:.2f}" '
            f'departPos="{walk.start_place:.2f}"><walk '
            f'edges={quoteattr(f"{walk.start} {walk.end}")} arrivalPos="{walk.end_place:.2f}"/></person>',
        )
        used[number] += 1
