"""Where vehicles wait inside junctions for those that go first: clear of the ways of these.

netconvert lets them wait where the middles of two ways meet, or beyond. But vehicles are wide: the corner of
a bus stands over a crossing, and one that joins a stream at a small angle stands in it.
"""

import re
from xml.sax.saxutils import unescape

import numpy as np

from dojo_maps.description import RoadMap
from dojo_maps.geometry.polylines import Floats, along
from dojo_maps.signals.waiting import find_meetings
from dojo_maps.sources.osm.network.net_shapes import (
    Course,
    read_internal_lanes,
    replace_internal_lanes,
)
from dojo_maps.sources.osm.rules import WaitingRules

_PLACE = re.compile(r'(<junction id="(:[^"]*)" type="internal" )x="[^"]*" y="[^"]*"( z="[^"]*")?')
_PROGRAM = re.compile(r'<tlLogic id="([^"]*)"[^>]*>(.*?)</tlLogic>', re.DOTALL)
_STATE = re.compile(r'state="([^"]*)"')


def move_waiting_places(data: bytes, road_map: RoadMap, rules: WaitingRules) -> bytes:
    """Move the places where vehicles wait inside junctions back, until they stand in nobody's way.

    Args:
        data: the network, with the programs of its signals.
        road_map: the same, read; its programs do not matter.
        rules: the limits to go by.

    Returns:
        The network with other places where internal lanes are split.
    """
    text = data.decode("utf-8")
    states = {unescape(found[1]): _STATE.findall(found[2]) for found in _PROGRAM.finditer(text)}
    parts = read_internal_lanes(text)
    changed: dict[str, Course] = {}
    meetings = find_meetings(road_map, states, widest=rules.widest, nearest=rules.nearest, walkers=True)
    for meeting in meetings:
        before, after = meeting.connection.via
        (length, shape), (rest, onward) = parts[before], parts[after]
        place = meeting.place * length / max(float(along(shape)[-1]), 1e-6)
        if place < length:
            first, second = _split(shape, meeting.place)
            changed[before] = place, first
            changed[after] = rest + length - place, np.concatenate([second, onward[1:]])

    def moved(found: re.Match[str]) -> str:
        if found[2] not in changed:
            return found[0]
        x, y, z = changed[found[2]][1][0]
        height = f' z="{z:.2f}"' if found[3] else ""
        return f'{found[1]}x="{x:.2f}" y="{y:.2f}"{height}'

    return _PLACE.sub(moved, replace_internal_lanes(text, changed)).encode("utf-8")


def _split(shape: Floats, place: float) -> tuple[Floats, Floats]:
    """Split a line at some metres from its start."""
    lengths = along(shape)
    at = np.array([[np.interp(place, lengths, values) for values in shape.T]])
    return (
        np.concatenate([shape[lengths < place], at]),
        np.concatenate([at, shape[lengths > place]]),
    )
