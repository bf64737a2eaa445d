"""Traffic that meets counts: SUMO's routeSampler chooses among candidate routes.

Candidates lead across the map, from edge to edge, and through each counted place. Where counts do not fit
each other, as where cars park in between, what is left is met by vehicles that appear just before the place
and vanish behind it.
"""

import subprocess
from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from heapq import nsmallest
from itertools import pairwise
from pathlib import Path
from xml.sax.saxutils import quoteattr

from dojo_maps.demand.counts import Count, interval_of
from dojo_maps.demand.movements import RoadNet
from dojo_maps.demand.route_file import Trip
from dojo_maps.description import RoadMap
from dojo_maps.errors import DojoError
from dojo_maps.input_files import read_bytes
from dojo_maps.safe_xml import Attributes, parse_xml
from dojo_maps.sumo_programs import find_tool, running_program
from dojo_maps.whole_file import scratch_folder

_PATIENCE = 300.0
"""Seconds."""
_MOST_CANDIDATES = 2_000
_FAVOUR, _RARE = 10.0, 1e-4
"""How much more probable a route is for each counted place that it passes; and how probable one is that is
only a counted place, in the middle of the map."""
_ROUTES, _TURNS, _EDGES, _CHOSEN = "routes.xml", "turns.xml", "edges.xml", "chosen.rou.xml"

_Roads = tuple[str, ...]


def sample_trips(road_map: RoadMap, counts: Sequence[Count], *, seed: int) -> tuple[Trip, ...]:
    """Choose vehicles of one class that meet its counts.

    Args:
        road_map: the map, which has all counted places.
        counts: of edges and turns.
        seed: the same one gives the same trips.

    Returns:
        The vehicles, as the tool wrote them; none where nobody was counted.

    Raises:
        ToolMissingError: SUMO's tools are not installed.
        DojoError: the tool fails, or takes too long.
    """
    if not any(count.count for count in counts):
        return ()
    name, interval = counts[0].vehicle_class, interval_of(counts)
    with scratch_folder() as folder:
        (folder / _ROUTES).write_text(_write_candidates(road_map, counts), encoding="utf-8")
        arguments = ["-r", _ROUTES, "-o", _CHOSEN, "-s", str(seed), "--weighted"]
        arguments += ["-i", str(interval)]
        for option, file, chosen in (
            ("-t", _TURNS, [count for count in counts if count.to_edge]),
            ("-d", _EDGES, [count for count in counts if not count.to_edge]),
        ):
            if chosen:
                (folder / file).write_text(_write_counts(chosen, interval), encoding="utf-8")
                arguments += [option, file]
        _run(arguments, folder)
        return tuple(Trip(depart=t, roads=roads, vehicle_class=name) for t, roads in _read(folder / _CHOSEN))


def model_counts(counts: Sequence[Count], trips: Iterable[Trip]) -> list[int]:
    """Tell for each count how many trips that depart in its interval pass its place.

    Args:
        counts: of edges, turns and crossings.
        trips: of all classes; a count's own class counts. Somebody on foot is a trip whose one road is a
            crossing.

    Returns:
        Vehicles or people, in the order of the counts.
    """
    times = sorted({time for count in counts for time in (count.begin, count.end)})
    passed: Counter[tuple[_Roads, str, float]] = Counter()
    for trip in trips:
        start = max((time for time in times if time <= trip.depart), default=-1.0)
        passed.update((place, trip.vehicle_class, start) for place in _passed(trip.roads))
    return [
        sum(
            passed[count.place, count.vehicle_class, time]
            for time in times
            if count.begin <= time < count.end
        )
        for count in counts
    ]


def _write_candidates(road_map: RoadMap, counts: Iterable[Count]) -> str:
    net = RoadNet(road_map, next(iter(counts)).vehicle_class)
    places = {count.place for count in counts}
    edges = {place[0] for place in places if len(place) == 1}
    arcs = sorted(arc for arc in net.arcs if arc in places or edges.intersection(arc))
    led = dict.fromkeys([*map(net.through, arcs), *_most_counted(net.across(), places)])
    routes = dict.fromkeys(places, _RARE) | {roads: _FAVOUR ** len(_passed(roads) & places) for roads in led}
    lines = [
        f'<route id="r{number}" edges={quoteattr(" ".join(roads))} probability="{weight}"/>'
        for number, (roads, weight) in enumerate(sorted(routes.items()))
    ]
    return "\n".join(["<routes>", *lines, "</routes>", ""])


def _most_counted(routes: Iterable[_Roads], places: set[_Roads]) -> list[_Roads]:
    """List the routes that pass most of the counted places, as far as they are not too many."""
    ranked = ((-len(_passed(roads) & places), len(roads), roads) for roads in routes)
    return [roads for *_, roads in nsmallest(_MOST_CANDIDATES, (each for each in ranked if each[0]))]


def _passed(roads: _Roads) -> set[_Roads]:
    """List the edges and turns of a route."""
    return {*((road,) for road in roads), *pairwise(roads)}


def _write_counts(counts: Iterable[Count], interval: int) -> str:
    """Write counts as SUMO's tool reads them; it would round the parts of a count down."""
    lines = ["<data>"]
    for count in counts:
        start = quoteattr(count.from_edge)
        parts = round(count.end - count.begin) // interval
        for part in range(parts):
            begin = count.begin + part * interval
            share = count.count * (part + 1) // parts - count.count * part // parts
            element = (
                f'edgeRelation from={start} to={quoteattr(count.to_edge)} count="{share}"'
                if count.to_edge
                else f'edge id={start} entered="{share}"'
            )
            lines.append(
                f'<interval id="counts" begin="{begin:g}" end="{begin + interval:g}"><{element}/></interval>'
            )
    return "\n".join([*lines, "</data>", ""])


def _run(arguments: Sequence[str], folder: Path) -> None:
    tool = find_tool("routeSampler.py")
    try:
        with running_program(tool, arguments, folder, subprocess.PIPE) as child:
            _, words = child.communicate(timeout=_PATIENCE)
    except subprocess.TimeoutExpired:
        raise DojoError(
            f"{tool.name} was stopped after {_PATIENCE:g} s, its time limit; give it fewer counts"
        ) from None
    if child.returncode or not (folder / _CHOSEN).is_file():
        said = words.decode("utf-8", "replace").strip().splitlines()[-1:] or ["no reason"]
        raise DojoError(f"{tool.name} failed with exit status {child.returncode}; it gave {said[0][:300]}")


def _read(path: Path) -> Iterator[tuple[float, _Roads]]:
    """Read the vehicles of a route file that carry their routes."""
    departures: list[float] = []
    routes: list[_Roads] = []

    def start(name: str, attributes: Attributes) -> None:
        if name == "vehicle":
            departures.append(float(attributes["depart"]))
        elif name == "route":
            routes.append(tuple(attributes["edges"].split()))

    parse_xml(read_bytes(path), path, root="routes", kind="route file", start=start)
    return zip(departures, routes, strict=True)
