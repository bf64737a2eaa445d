"""Who goes first where ways would wait for each other: in SUMO they would wait for ever.

netconvert lets equal ways give way to the right. Cycle tracks that meet at a road are all equal, and three
bicycles are enough. Of two ways of a signal into one lane it lets each wait for the other: who is left in the
junction from the last green and who starts in the next stand nose to nose.
"""

import re
from collections.abc import Collection, Iterator, Mapping, Sequence
from itertools import combinations
from xml.sax.saxutils import unescape

from dojo_maps.description import RightOfWay, RoadMap

_JUNCTION = re.compile(
    r'<junction id="([^"]*)"[^>]*? type="(?:priority|traffic_light)"[^>]*[^/]>.*?</junction>', re.DOTALL
)
_REQUEST = re.compile(r'(<request index="(\d+)"\s+response=")([01]+)("\s+foes=")([01]+)')


def break_circles(data: bytes, road_map: RoadMap) -> bytes:
    """Let one way of each circle at a junction with priorities go first, and one of two into a signal's lane.

    Args:
        data: the network.
        road_map: the same, read.

    Returns:
        The network, in which the others wait for that way, and it for none of them.
    """
    targets = {connection.id: connection.to_lane for connection in road_map.connections}
    turned: dict[str, set[tuple[int, int]]] = {}
    for junction in road_map.junctions:
        if junction.kind == "priority":
            turned[junction.id] = set(_list_circles(junction.right_of_way))
        elif junction.kind == "traffic_light":
            turned[junction.id] = set(_list_merges(junction.right_of_way, targets))
    turned = {name: pairs for name, pairs in turned.items() if pairs}

    def turn(found: re.Match[str]) -> str:
        pairs = turned.get(unescape(found[1]))
        return found[0] if pairs is None else _REQUEST.sub(lambda request: _turn(request, pairs), found[0])

    return _JUNCTION.sub(turn, data.decode("utf-8")).encode("utf-8") if turned else data


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
    """List the same of two ways into one lane that wait for each other.

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
