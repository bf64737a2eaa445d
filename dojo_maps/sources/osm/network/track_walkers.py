"""Keep walkers and cyclists out of each other's way where a cycle track meets a pavement.

A track has a lane each way, and people may walk on both. Where a lane leads onto a walking area, SUMO has its
vehicles stop for everybody who stands, or will be, within about 2 m of their way over it; and people who
cannot get past a vehicle wait until it has gone. So they wait for each other. People need one lane of a
track only: the one that leads to the quieter end.
"""

import re
from collections import defaultdict

from dojo_maps.sources.osm.graph.edge_id import EdgeId

_SHARED = re.compile(r'<lane id="([^":]+)_0" index="0" allow="pedestrian bicycle"')
_OFF = re.compile(r'[ \t]*<connection from="([^":]+)" to="(:[^"]+_w\d+)"[^>]*/>\n')
_CROSSED = re.compile(
    r'<connection from="(:[^"]+_w\d+)" to="(:[^"]+_c\d+)"([^>]*)/>|'
    r'<connection from="(:[^"]+_c\d+)" to="(:[^"]+_w\d+)"'
)


def part_walkers_from_cyclists(data: bytes) -> bytes:
    """Let nobody walk off one lane of each two-way cycle track: that which leads to more walkers who wait.

    They wait before crossings, and longer where there is a signal.

    Args:
        data: the network.

    Returns:
        The network without these connections; one-way tracks keep theirs, and those without a crossing at
        either end.
    """
    text = data.decode("utf-8")
    shared = {EdgeId.read(name) for name in _SHARED.findall(text)}
    waiting = _rank_areas(text)
    busy: dict[EdgeId, int] = defaultdict(int)
    for name, area in _OFF.findall(text):
        edge = EdgeId.read(name)
        busy[edge] = max(busy[edge], waiting.get(area, 0))

    def is_parted(edge: EdgeId) -> bool:
        pair = {edge, edge._replace(forward=not edge.forward)}
        busiest = max(pair, key=lambda each: (busy.get(each, 0), not each.forward))
        return pair <= shared & busy.keys() and edge == busiest and busy[edge] > 0

    return _OFF.sub(lambda found: "" if is_parted(EdgeId.read(found[1])) else found[0], text).encode("utf-8")


def _rank_areas(text: str) -> dict[str, int]:
    """Tell of the walking areas at crossings how long people wait there: 1, or 2 for a signal."""
    areas: dict[str, set[str]] = defaultdict(set)
    signals = set()
    for area, crossing, more, left, entered in _CROSSED.findall(text):
        areas[area or entered].add(crossing or left)
        if ' tl="' in more:
            signals.add(crossing)
    return {area: 1 + bool(crossings & signals) for area, crossings in areas.items()}
