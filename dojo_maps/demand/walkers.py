"""People who walk over every crossing of the network, from a sidewalk on its one side to one on the other."""

from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import product
from pathlib import Path

from dojo_maps.description import Crossing, Lane, LaneKind, Origin, RoadMap
from dojo_maps.input_files import read_bytes
from dojo_maps.safe_xml import parse_xml

_SIGNALLED, _OTHER = 60.0, 20.0
"""Walkers per hour over a crossing."""
_WALK = 30.0
"""Metres of sidewalk before and after a crossing."""
_PASSING = 1.28
"""Metres of sidewalk on which people pass each other: two of SUMO's stripes."""
_MOST = 4_000.0
"""Walkers per hour on the whole map."""

_Joints = dict[str, set[str]]
_Door = tuple[Lane, bool]
"""A sidewalk and whether its end opens on a walking area, not its start."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Walk:
    """Two roads with sidewalks and the places on them, metres along each; `rate` in people per hour.

    Attributes:
        crossing: what it leads over.
    """

    crossing: str
    start: str
    end: str
    start_place: float
    end_place: float
    rate: float


def find_walks(road_map: RoadMap, network: Path) -> tuple[Walk, ...]:
    """Find a walk each way over each crossing that the network itself has.

    Where two people cannot pass each other on a sidewalk, all walk on it in one direction: in SUMO those who
    come off it and those who wait to get on it would stand still for minutes.

    Args:
        road_map: the description of the network.
        network: the SUMO network, which alone says what walking areas join.

    Returns:
        The walks, two for most crossings; none for those that do not lie between sidewalks of two different
        streets.

    Raises:
        SourceError: the network cannot be read.
    """
    crossings = [crossing for crossing in road_map.crossings if crossing.origin is Origin.NETWORK]
    if not crossings:
        return ()
    joined = _read_joints(network)
    sidewalks = {lane.road: lane for lane in road_map.lanes if lane.kind is LaneKind.SIDEWALK}
    doors = _doors(joined, sidewalks)
    ends = {road.id: {road.from_junction, road.to_junction} for road in road_map.roads}
    walks = []
    taken: dict[tuple[str, bool], bool] = {}
    for crossing in crossings:
        sides = _choose_sides(
            [doors[area] for area in sorted(joined.get(crossing.id, ())) if area in doors], ends
        )
        if sides is not None:
            ways = [pair for pair in (sides, sides[::-1]) if _has_room(pair, taken)]
            walks += [_walk(crossing, *pair) for pair in ways]
    share = min(1.0, _MOST / max(sum(walk.rate for walk in walks), 1.0))
    return tuple(replace(walk, rate=walk.rate * share) for walk in walks)


def _read_joints(network: Path) -> _Joints:
    """List what the network connects each walking area and crossing with, and which end of a road it is."""
    joined: _Joints = defaultdict(set)

    def start(name: str, attributes: dict[str, str]) -> None:
        ends = attributes.get("from", ""), attributes.get("to", "")
        if name == "connection" and any(end.startswith(":") for end in ends):
            joined[ends[0]].add(f"<{ends[1]}")
            joined[ends[1]].add(f">{ends[0]}")

    parse_xml(read_bytes(network), network, root="net", kind="SUMO network", start=start)
    return {place: {end[1:] if end[1:2] == ":" else end for end in ends} for place, ends in joined.items()}


def _doors(joined: _Joints, sidewalks: dict[str, Lane]) -> dict[str, list[_Door]]:
    """List the sidewalks that open on each walking area, those first on which people pass, longest first."""
    doors: dict[str, list[_Door]] = {}
    for area, ends in joined.items():
        lanes = [
            (sidewalks[end[1:]], end[0] == ">")
            for end in sorted(ends)
            if end[0] in "<>" and end[1:] in sidewalks
        ]
        if area.startswith(":") and lanes:
            doors[area] = sorted(lanes, key=lambda door: (door[0].width < _PASSING, -door[0].length))
    return doors


def _choose_sides(areas: Sequence[Sequence[_Door]], ends: dict[str, set[str]]) -> tuple[_Door, _Door] | None:
    """Choose a sidewalk on each side of a crossing.

    Those of the two directions of one street meet at both of its ends, and SUMO may lead people to the wrong
    one, where there is no crossing; they would stop the simulation there.

    Args:
        areas: the sidewalks of the walking area on each side.
        ends: each road's two junctions.

    Returns:
        One of each, or None where the crossing lies between no two different streets.
    """
    if len(areas) != 2:
        return None
    pairs = product(areas[0], areas[1])
    return next((pair for pair in pairs if ends[pair[0][0].road] != ends[pair[1][0].road]), None)


def _has_room(pair: Sequence[_Door], taken: dict[tuple[str, bool], bool]) -> bool:
    """Tell whether walks of a direction meet nobody on a narrow sidewalk; then they decide its direction.

    Walks of one crossing only end there: where more people come together at its mouth they block each other.
    At the sidewalk's other end others walk, see `_place`.

    Args:
        pair: where they start and where they end.
        taken: by narrow sidewalk and end, whether walks start there.
    """
    start, end = ((lane.road, at_end) for lane, at_end in pair)
    starts_narrow, ends_narrow = (lane.width < _PASSING for lane, _ in pair)
    if (starts_narrow and not taken.get(start, True)) or (ends_narrow and end in taken):
        return False
    if starts_narrow:
        taken[start] = True
    if ends_narrow:
        taken[end] = False
    return True


def _walk(crossing: Crossing, start: _Door, end: _Door) -> Walk:
    return Walk(
        crossing=crossing.id,
        start=start[0].road,
        end=end[0].road,
        start_place=_place(*start),
        end_place=_place(*end),
        rate=(_OTHER if crossing.signal is None else _SIGNALLED) / 2,
    )


def _place(lane: Lane, at_end: bool) -> float:
    """Choose the place on a sidewalk; on a narrow one nobody comes as far as those of its other end."""
    reach = min(_WALK, lane.length * (0.45 if lane.width < _PASSING else 0.9))
    return round(lane.length - reach if at_end else reach, 2)
