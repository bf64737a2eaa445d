"""Who yields to whom at a junction, from the requests of a SUMO network."""

from collections import defaultdict
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace

from dojo_maps.description import Connection, Junction, RightOfWay
from dojo_maps.issue import Element, Issue, Severity
from dojo_maps.safe_xml import Attributes
from dojo_maps.sources.sumo_xml import NetRecords


def read_right_of_way(
    junctions: Iterable[Junction], connections: Sequence[Connection], records: NetRecords
) -> tuple[tuple[Junction, ...], list[Issue]]:
    """Give each junction its request matrix, with the links' names.

    A request's index is the place of the link's last internal lane in the junction's `intLanes`, crossings
    last. Networks without internal lanes number the connections of each incoming lane in turn.

    Args:
        junctions: those of the network, without their matrices.
        connections: those between the roads' lanes, in file order.
        records: the network's elements, each of `junctions` among them.

    Returns:
        The junctions, and an issue for each whose matrix does not fit its links; it stays without one.
    """
    by_lane = {c.via[-1]: c.id for c in connections if c.via}
    by_origin: dict[str, list[str]] = defaultdict(list)
    for connection in connections:
        by_origin[connection.from_lane].append(connection.id)
    attributes = {a.get("id", ""): a for a in reversed(records.junctions)}
    found, issues = [], []
    for junction in junctions:
        requests = sorted(records.requests.get(junction.id, []), key=_index)
        names = _name_links(attributes[junction.id], by_lane, by_origin)
        if requests and len(names) != len(requests):
            issues.append(_mismatch(junction, len(requests), len(names)))
            requests = []
        rules = tuple(
            RightOfWay(
                link=name,
                foes=_places(request.get("foes", ""), len(names)),
                response=_places(request.get("response", ""), len(names)),
                cont=request.get("cont") in ("1", "true"),
            )
            for name, request in zip(names, requests, strict=False)
        )
        found.append(replace(junction, right_of_way=rules))
    return tuple(found), issues


def _mismatch(junction: Junction, requests: int, links: int) -> Issue:
    return Issue(
        check="topology.request_mismatch",
        severity=Severity.ERROR,
        elements=(Element(kind="junction", id=junction.id),),
        position=junction.position,
        message=f"the junction {junction.id} has {requests} requests for {links} links",
        measured=float(requests),
        limit=float(links),
        hint="rebuild the network with netconvert, which computes who yields to whom anew",
    )


def _name_links(
    junction: Attributes, by_lane: Mapping[str, str], by_origin: Mapping[str, list[str]]
) -> list[str]:
    lanes = junction.get("intLanes", "").split()
    if not lanes:
        return [name for lane in junction.get("incLanes", "").split() for name in by_origin.get(lane, ())]
    crossing = f":{junction.get('id')}_c"
    return [lane.rpartition("_")[0] if lane.startswith(crossing) else by_lane.get(lane, "") for lane in lanes]


def _index(request: Attributes) -> int:
    text = request.get("index", "")
    return int(text) if text.isdecimal() and len(text) < 10 else 0


def _places(bits: str, count: int) -> tuple[int, ...]:
    """List the links whose bit is set; SUMO writes link 0 rightmost."""
    return tuple(place for place, bit in enumerate(reversed(bits)) if bit == "1" and place < count)
