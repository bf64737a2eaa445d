"""Ways across junctions that a network draws, and counts in its rules, but that no connection names."""

from collections.abc import Iterator, Mapping, Sequence

import numpy as np

from dojo_maps.description import Connection, Lane, Points
from dojo_maps.issue import Element, Issue, Severity
from dojo_maps.sources.sumo_xml import NetRecords

_TOUCHES = 1.0
"""Metres between a lane's end and the start of a way that leaves it."""


def find_lost_connections(
    records: NetRecords,
    lanes: Mapping[str, Lane],
    internal: Mapping[str, Points],
    connections: Sequence[Connection],
) -> Iterator[Issue]:
    """Report each internal lane of a junction that leads to a lane though nothing leads onto it.

    Args:
        records: the network's elements.
        lanes: its roads' lanes by id.
        internal: (n, 3), metres, the shape of each internal lane by id.
        connections: those that could be read.

    Yields:
        A warning for each such way that starts within a metre of an incoming lane's end.
    """
    named = {lane for connection in connections for lane in connection.via}
    leads_to, comes_from = _inner_ways(records)
    for junction in records.junctions:
        for lane in junction.get("intLanes", "").split():
            if lane not in internal or lane in named:
                continue
            start = lane
            while start in comes_from and comes_from[start] in internal and comes_from[start] != lane:
                start = comes_from.pop(start)
            target, at = leads_to.get(lane, ""), internal[start][0]
            source = _lane_ending_at(
                at, [lanes[x] for x in junction.get("incLanes", "").split() if x in lanes]
            )
            if target in lanes and source is not None:
                yield _lost(source.id, target, junction.get("id", ""), lane, source.shape[-1])


def _inner_ways(records: NetRecords) -> tuple[dict[str, str], dict[str, str]]:
    """Find which lane each internal lane leads to, and which internal lane comes before it."""
    leads_to, comes_from = {}, {}
    for a in records.connections:
        source = f"{a.get('from')}_{a.get('fromLane')}"
        if source.startswith(":"):
            leads_to[source] = f"{a.get('to')}_{a.get('toLane')}"
            if "via" in a:
                comes_from[a["via"]] = source
    return leads_to, comes_from


def _lane_ending_at(at: Points, lanes: Sequence[Lane]) -> Lane | None:
    gaps = [float(np.hypot(*(lane.shape[-1] - at)[:2])) for lane in lanes]
    nearest = int(np.argmin(gaps)) if gaps else -1
    return lanes[nearest] if gaps and gaps[nearest] < _TOUCHES else None


def _lost(source: str, target: str, junction: str, way: str, at: Points) -> Issue:
    return Issue(
        check="topology.missing_turn",
        severity=Severity.WARNING,
        elements=(
            Element(kind="connection", id=f"{source}->{target}"),
            *(Element(kind="lane", id=lane) for lane in (source, target)),
            Element(kind="junction", id=junction),
        ),
        position=(float(at[0]), float(at[1]), float(at[2])),
        message=f"the way {way} is drawn from the lane {source} to {target}, but no connection names it",
        hint="add the connection, or rebuild the network with netconvert, which removes the way",
    )
