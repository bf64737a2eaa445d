"""Draw departures by chance, from a seed, and write them as a SUMO route file."""

from collections.abc import Iterator, Sequence
from pathlib import Path
from xml.sax.saxutils import quoteattr

import numpy as np

from dojo_maps.demand.movements import Route
from dojo_maps.demand.walkers import Walk
from dojo_maps.geometry.polylines import Floats
from dojo_maps.whole_file import replaced

_FEWEST = 3
"""Vehicles on a route in an hour, so that every movement is used."""
_TYPES = (
    '<vType id="car" vClass="passenger"/>',
    '<vType id="bus" vClass="bus"/>',
    '<vType id="walker" vClass="pedestrian"/>',
)

_Departure = tuple[float, str]


def write_route_file(
    routes: Sequence[Route],
    rates: Floats,
    walks: Sequence[Walk],
    path: Path,
    *,
    seed: int,
    duration: int,
) -> tuple[int, int]:
    """Write vehicles and walkers in the order of their departures.

    Args:
        routes: what vehicles drive.
        rates: (n,) vehicles per hour of each route.
        walks: what people walk.
        path: the file; it appears whole.
        seed: of the departures.
        duration: seconds over which they are spread, evenly by chance.

    Returns:
        How many vehicles and how many walkers.
    """
    chance = np.random.default_rng(seed)
    hours = duration / 3600
    vehicles: list[_Departure] = []
    for number, (route, rate) in enumerate(zip(routes, rates, strict=True)):
        count = max(_FEWEST, round(float(rate) * hours)) if rate > 0 else 0
        vehicles += _vehicles(number, route, np.sort(chance.random(count)) * duration)
    walkers: list[_Departure] = []
    for number, walk in enumerate(walks):
        walkers += _walkers(number, walk, np.sort(chance.random(round(walk.rate * hours))) * duration)
    lines = [f"    {line}" for line in _TYPES]
    lines += [
        f'    <route id="route_{number}" edges={quoteattr(" ".join(route.roads))}/>'
        for number, route in enumerate(routes)
    ]
    lines += [f"    {line}" for _, line in sorted(vehicles + walkers)]
    with replaced(path) as fresh:
        fresh.write_text("\n".join(["<routes>", *lines, "</routes>", ""]), encoding="utf-8")
    return len(vehicles), len(walkers)


def _vehicles(number: int, route: Route, departures: Floats) -> Iterator[_Departure]:
    kind = "bus" if route.vehicle_class == "bus" else "car"
    for k, depart in enumerate(departures):
        yield (
            float(depart),
            f'<vehicle id="v{number}.{k}" type="{kind}" route="route_{number}" depart="{depart:.2f}" '
            'departLane="best" departSpeed="max"/>',
        )


def _walkers(number: int, walk: Walk, departures: Floats) -> Iterator[_Departure]:
    start, end = quoteattr(walk.start), quoteattr(walk.end)
    for k, depart in enumerate(departures):
        yield (
            float(depart),
            f'<person id="p{number}.{k}" type="walker" depart="{depart:.2f}" '
            f'departPos="{walk.start_place:.2f}"><walk from={start} to={end} '
            f'arrivalPos="{walk.end_place:.2f}"/></person>',
        )
