"""Who goes first where ways would wait for each other, in SUMO for ever, and where neither waits.

netconvert lets equal ways give way to the right. Cycle tracks that meet at a road are all equal, and three
bicycles are enough. Of two ways of a signal into one lane it lets each wait for the other: who is left in the
junction from the last green and who starts in the next stand nose to nose. Of a cycle lane that goes straight
on and a car that turns across it neither waits: they would ride into each other, and no signal may show both.
A cyclist who must let a car pass rides into it where it waits inside the junction: nobody looks there.
"""

import re
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import combinations
from xml.sax.saxutils import unescape

from dojo_maps.description import LaneKind, RightOfWay, RoadMap

_JUNCTION = re.compile(
    r'<junction id="([^"]*)"[^>]*? type="(?:priority|traffic_light)"[^>]*[^/]>.*?</junction>', re.DOTALL
)
_FIRST = {LaneKind.RAIL: 0, LaneKind.BICYCLE: 1}
"""Whose ways go first where the network does not say; those of other lanes come after."""
_REQUEST = re.compile(r'(<request index="(\d+)"\s+response=")([01]+)("\s+foes=")([01]+)')


def settle_precedence(data: bytes, road_map: RoadMap) -> bytes:
    """Let one way of each circle at a junction with priorities go first, and one of two into a signal's lane.

    Of two ways that cross without either waiting, the one of a track or else of bicycles goes first; so do
    bicycles, at a signal, before cars that may wait inside the junction.

    Args:
        data: the network.
        road_map: the same, read.

    Returns:
        The network, in which the others wait for that way, and it for none of them.
    """
    kinds = {lane.id: lane.kind for lane in road_map.lanes}
    targets = {connection.id: connection.to_lane for connection in road_map.connections}
    ranks = {each.id: _FIRST.get(kinds[each.from_lane], len(_FIRST)) for each in road_map.connections}
    turned: dict[str, list[tuple[int, int]]] = {}
    for junction in road_map.junctions:
        if junction.kind in ("priority", "traffic_light"):
            is_signal = junction.kind == "traffic_light"
            settled = list(_list_unsettled(junction.right_of_way, ranks))
            settled += _list_unseen(junction.right_of_way, ranks) if is_signal else ()
            ways = _settled(junction.right_of_way, settled)
            pairs = list(_list_merges(ways, targets) if is_signal else _list_circles(ways))
            pairs += [pair for pair in settled if pair[::-1] not in pairs]
            if pairs:
                turned[junction.id] = pairs

    def turn(found: re.Match[str]) -> str:
        pairs = turned.get(unescape(found[1]))
        return found[0] if pairs is None else _REQUEST.sub(lambda request: _turn(request, pairs), found[0])

    return _JUNCTION.sub(turn, data.decode("utf-8")).encode("utf-8") if turned else data


def _list_unsettled(ways: Sequence[RightOfWay], ranks: Mapping[str, int]) -> Iterator[tuple[int, int]]:
    """List the pairs of ways of vehicles that cross without either waiting; the first is to go first."""
    for pair in combinations(range(len(ways)), 2):
        one, other = (ways[way] for way in pair)
        meet = pair[1] in one.foes and pair[0] in other.foes and {one.link, other.link} <= ranks.keys()
        if meet and pair[1] not in one.response and pair[0] not in other.response:
            first = min(pair, key=lambda way: ranks[ways[way].link])
            yield first, sum(pair) - first


def _list_unseen(ways: Sequence[RightOfWay], ranks: Mapping[str, int]) -> Iterator[tuple[int, int]]:
    """List the ways of bicycles, each with a car's that it waits for and that waits inside the junction.

    Who waits there has passed his stop line: nobody looks for him, but he looks for those whom he lets pass.
    """
    for number, way in enumerate(ways):
        if ranks.get(way.link) == _FIRST[LaneKind.BICYCLE]:
            for other in way.response:
                if ways[other].cont and ranks.get(ways[other].link) == len(_FIRST):
                    yield number, other


def _settled(ways: Sequence[RightOfWay], pairs: Sequence[tuple[int, int]]) -> list[RightOfWay]:
    """Let the second way of each pair wait for the first, and the first not for the second."""
    return [
        replace(
            way,
            response=tuple(
                ({*way.response} | {first for first, other in pairs if other == number})
                - {other for first, other in pairs if first == number}
            ),
        )
        for number, way in enumerate(ways)
    ]


def _list_circles(ways: Sequence[RightOfWay]) -> Iterator[tuple[int, int]]:
    """List the pairs of ways of which the first waits for the second, and must let it wait instead."""
    left = {number: set(way.response) for number, way in enumerate(ways)}
    while left:
        free = [way for way, others in left.items() if not others & left.keys()]
        if not free:
            first = min(left, key=lambda way: (len(left[way] & left.keys()), way))
            yield from ((first, other) for other in left[first] & left.keys())
            free = [first]
        for way in free:
            del left[way]


def _list_merges(ways: Sequence[RightOfWay], targets: Mapping[str, str]) -> Iterator[tuple[int, int]]:
    """List the same pairs where two ways into one lane wait for each other.

    Who may wait inside the junction waits, since he looks for the other there; or else who waits for more.
    """
    for pair in combinations(range(len(ways)), 2):
        one, other = (ways[way] for way in pair)
        lane = targets.get(one.link)
        if lane and lane == targets.get(other.link) and pair[0] in other.response and pair[1] in one.response:
            first = min(pair, key=lambda way: (ways[way].cont, len(ways[way].response)))
            yield first, sum(pair) - first


def _turn(request: re.Match[str], pairs: Collection[tuple[int, int]]) -> str:
    """Write whom a way waits for, and whom it meets, when pairs have been turned."""
    way = int(request[2])
    # The last digit is that of the first way.
    response, foes = ([digit == "1" for digit in reversed(request[group])] for group in (3, 5))
    for first, other in pairs:
        if first == way:
            response[other] = False
        elif other == way:
            response[first] = foes[first] = True
    written = ["".join("01"[bit] for bit in reversed(bits)) for bits in (response, foes)]
    return f"{request[1]}{written[0]}{request[4]}{written[1]}"
