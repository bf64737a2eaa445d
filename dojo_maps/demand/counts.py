"""Traffic counts: read from a CSV file, held against the map, and compared with what a demand makes of them.

A row is a turn (`from_edge`, `to_edge`), an edge (`from_edge` alone), or, for people, a crossing of the
network by its id. `count` is how many passed between `begin` and `end`, `class` is SUMO's word for who.
"""

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path

from dojo_maps.description import RoadMap
from dojo_maps.errors import SourceError
from dojo_maps.index import MapIndex
from dojo_maps.input_files import read_table
from dojo_maps.signals.programs import read_seconds
from dojo_maps.wording import counted, did_you_mean

WALKERS = "pedestrian"
VEHICLES = (
    *("passenger", "bus", "coach", "delivery", "truck", "trailer", "taxi", "motorcycle", "moped"),
    *("emergency", "hov", "evehicle", "bicycle", "tram"),
)
"""Who can be counted on edges."""
GOOD_GEH = 5.0
"""A count is met well below it. Source: Design Manual for Roads and Bridges, volume 12, section 2."""
_COLUMNS = ("from_edge", "count")
_MOST_ROWS = 100_000
_MOST = 1_000_000
"""Vehicles and people in all."""
_BRIEFEST = 60
"""Seconds; counts of less are chance."""
_MOST_INTERVALS = 1_440


@dataclass(frozen=True, slots=True, kw_only=True)
class Count:
    """Who passed an edge, a turn or a crossing.

    Attributes:
        from_edge: the edge, or for people a crossing.
        to_edge: where they turned to; "" where that was not counted.
        vehicle_class: SUMO's word for who.
        begin: seconds.
        end: seconds.
        count: how many.
    """

    from_edge: str
    to_edge: str
    vehicle_class: str
    begin: float
    end: float
    count: int

    @property
    def place(self) -> tuple[str, ...]:
        """The edge, or the two edges of the turn."""
        return (self.from_edge, self.to_edge) if self.to_edge else (self.from_edge,)


@dataclass(frozen=True, slots=True, kw_only=True)
class CountMet:
    """A count and what a demand makes of it: `modelled` vehicles or people, and their GEH."""

    count: Count
    modelled: int
    geh: float


def compute_geh(modelled: float, counted: float) -> float:
    """Compare two flows as engineers do.

    Args:
        modelled: vehicles per hour, 0 or more.
        counted: vehicles per hour, 0 or more.

    Returns:
        Their GEH: 0 is equal, below 5 is close.
    """
    total = modelled + counted
    return math.sqrt(2 * (modelled - counted) ** 2 / total) if total else 0.0


def compare(counts: Iterable[Count], modelled: Iterable[int]) -> tuple[CountMet, ...]:
    """Give each count its GEH, both flows taken per hour.

    Args:
        counts: with the time that each took.
        modelled: how many a demand has of each count in that time, in the same order.

    Returns:
        Each count with both, in the same order.

    Raises:
        ValueError: there are more of one than of the other.
    """
    return tuple(
        CountMet(
            count=each,
            modelled=found,
            geh=compute_geh(*(n * 3600 / (each.end - each.begin) for n in (found, each.count))),
        )
        for each, found in zip(counts, modelled, strict=True)
    )


def read_counts(path: Path, road_map: RoadMap, *, begin: float, end: float) -> tuple[Count, ...]:
    """Read counts and see that the map has their places.

    Args:
        path: a CSV file with a head: `from_edge`, `count`, and as needed `to_edge`, `begin`, `end`, `class`.
        road_map: the map that they are of.
        begin: seconds, for rows that name no begin.
        end: seconds, for rows that name no end.

    Returns:
        The counts, in the file's order; at least one.

    Raises:
        SourceError: the file cannot be read, a value is wrong, a place is not on the map, nobody of the class
            can pass there, or there are too many rows, vehicles or intervals.
    """
    rows = read_table(path, _COLUMNS)
    if not rows or len(rows) > _MOST_ROWS:
        raise SourceError(path, f"has {counted(len(rows), 'count')}, expected 1 to {_MOST_ROWS}")
    places = _Places(road_map)
    found: dict[tuple[object, ...], Count] = {}
    for number, row in enumerate(rows, 1):
        try:
            count = _read_row(row, begin, end)
            places.check(count)
        except ValueError as problem:
            raise SourceError(path, str(problem), f"row {number}") from None
        key = (count.place, count.vehicle_class, count.begin, count.end)
        if key in found:
            raise SourceError(path, "counts the same as a row before; leave one of them out", f"row {number}")
        found[key] = count
    counts = tuple(found.values())
    if sum(count.count for count in counts) > _MOST:
        raise SourceError(path, f"counts more than {_MOST} in all; give fewer hours")
    try:
        interval_of(counts)
    except ValueError as problem:
        raise SourceError(path, str(problem)) from None
    return counts


def interval_of(counts: Iterable[Count]) -> int:
    """Find the longest interval, in seconds, that all counts begin and end with.

    Args:
        counts: whose times are whole seconds.

    Returns:
        Seconds; every count begins and ends a multiple of them after the earliest begin.

    Raises:
        ValueError: it is shorter than a minute, or there would be more than 1,440 of them.
    """
    times = sorted({time for count in counts for time in (count.begin, count.end)})
    interval = math.gcd(*(round(time - times[0]) for time in times))
    if interval < _BRIEFEST or (times[-1] - times[0]) / interval > _MOST_INTERVALS:
        raise ValueError(f"its intervals do not fit each other; let all begin at multiples of {_BRIEFEST} s")
    return interval


def _read_row(row: Mapping[str, str], begin: float, end: float) -> Count:
    named = {name: (value or "").strip() for name, value in row.items() if isinstance(value, str)}
    first = read_seconds(named["begin"]) if named.get("begin") else begin
    last = read_seconds(named["end"]) if named.get("end") else end
    if not 0 <= first < last or not (first.is_integer() and last.is_integer()):
        raise ValueError(f"begin {first:g} and end {last:g}: expected whole seconds, the end after the begin")
    try:
        count = float(named["count"])
    except ValueError:
        raise ValueError(f"count {named['count'][:80]!r} is no number") from None
    if not (0 <= count <= _MOST and count.is_integer()):
        raise ValueError(f"count {named['count'][:80]} is not a whole number from 0 to {_MOST}")
    return Count(
        from_edge=named["from_edge"],
        to_edge=named.get("to_edge", ""),
        vehicle_class=named.get("class") or "passenger",
        begin=first,
        end=last,
        count=int(count),
    )


class _Places:
    """What can be counted on a map."""

    def __init__(self, road_map: RoadMap) -> None:
        index = MapIndex(road_map)
        self._crossings = set(index.crossings)
        self._open = {
            road.id: {name for lane in index.lanes_of(road.id) for name in lane.allow}
            for road in road_map.roads
        }
        self._turns = {
            pair: {name for link in links for name in index.users(link)}
            for pair, links in index.road_links.items()
        }

    def check(self, count: Count) -> None:
        """Refuse a count of what cannot be.

        Raises:
            ValueError: the map has no such edge or crossing, or it is closed to the class.
        """
        name = count.vehicle_class
        if name == WALKERS:
            self._check_known(count.from_edge, self._crossings, "crossing")
            if count.to_edge:
                raise ValueError("people are counted on crossings, which have no to_edge; leave it empty")
            return
        if name not in VEHICLES:
            raise ValueError(f"class {name[:80]!r} is not one of {', '.join((*VEHICLES, WALKERS))}")
        for edge in count.place:
            self._check_known(edge, self._open, "edge")
        if count.to_edge and name not in self._turns.get((count.from_edge, count.to_edge), ()):
            raise ValueError(f"no connection leads {name} from {count.from_edge!r} to {count.to_edge!r}")
        if name not in self._open[count.from_edge]:
            raise ValueError(f"no lane of {count.from_edge!r} is open to {name}")

    def _check_known(self, id_: str, known: Iterable[str], what: str) -> None:
        if id_ not in known:
            raise ValueError(f"the map has no {what} {id_[:80]!r}{did_you_mean(id_, known)}")
