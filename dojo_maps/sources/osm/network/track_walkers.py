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
_CROSSED = re.compile(r'<connection from="(:[^"]+_w\d+)" to=":[^"]+_c\d+"')
_CROSSED_ONTO = re.compile(r'<connection from=":[^"]+_c\d+" to="(:[^"]+_w\d+)"')


def part_walkers_from_cyclists(data: bytes) -> bytes:
    """Let nobody walk off a two-way cycle track's lane that leads to a crossing, where its other lane serves.

    Args:
        data: the network.

    Returns:
        The network without these connections; one-way tracks keep theirs, and those without a crossing at
        either end.
    """
    text = data.decode("utf-8")
    shared = {EdgeId.read(name) for name in _SHARED.findall(text)}
    crossed = {*_CROSSED.findall(text), *_CROSSED_ONTO.findall(text)}
    busy: dict[EdgeId, bool] = defaultdict(bool)
    for name, area in _OFF.findall(text):
        busy[EdgeId.read(name)] |= area in crossed

    def is_spared(edge: EdgeId) -> bool:
        back = edge._replace(forward=not edge.forward)
        both = edge in shared and back in shared and edge in busy and back in busy
        return both and busy[edge] and (not busy[back] or not edge.forward)

    return _OFF.sub(lambda found: "" if is_spared(EdgeId.read(found[1])) else found[0], text).encode("utf-8")
