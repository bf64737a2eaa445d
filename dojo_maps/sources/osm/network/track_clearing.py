"""Take people off tracks where nobody walks.

netconvert's input lets them onto all of trams' and bicycles', so that pavements lead over.
"""

import re
from collections import Counter
from collections.abc import Iterable, Sequence, Set

import numpy as np
import shapely

from dojo_maps.description import Lane, LaneKind, RoadMap
from dojo_maps.geometry.polylines import along, places_on
from dojo_maps.sources.osm.graph.edge_id import EdgeId
from dojo_maps.sources.osm.layout.track_layout import TrackLayout
from dojo_maps.sources.osm.read.lane_tags import LaneUse
from dojo_maps.sources.osm.rules import TrackRules

_RAIL_EDGE = re.compile(rb'<edge id="([^"]*)"[^>]*type="railway\.')
_EDGE = re.compile(rb'<edge id="([^"]*)".*?</edge>', re.DOTALL)
_LINK = re.compile(rb' *<connection from="([^"]*)" to="([^"]*)"(?:[^>]* via="([^"]*)_\d+")?[^>]*/>\n')
_PAVEMENT = re.compile(rb' *<edge id="(:[^"]*_w\d+)" function="walkingarea">.*?</edge>\n', re.DOTALL)
_IS_PAVEMENT = re.compile(rb":.*_w\d+")
_NAME = re.compile(rb'"(:[^"]*_w\d+)"')
_STEP = 5.0
"""Metres between the places at which pavement is looked for beside a track."""


def clear_rails(network: bytes) -> bytes:
    """Take people off the tracks of trams in a network of netconvert's; they cross them at junctions.

    Args:
        network: the file's bytes.

    Returns:
        The network with nobody there but trams; the same object where it has no rails.
    """
    return _clear(network, set(_RAIL_EDGE.findall(network)))


def clear_cycle_tracks(network: bytes, road_map: RoadMap, tracks: TrackLayout, rules: TrackRules) -> bytes:
    """Take people off the cycle tracks where they may not walk, or have pavement beside.

    Args:
        network: the file's bytes.
        road_map: the same, read.
        tracks: that it was built with.
        rules: the limits to go by.

    Returns:
        The network with nobody there but bicycles; tracks with pavement beside stay where they alone join it.
    """
    roads = {lane.id: lane.road for lane in road_map.lanes}
    return _clear(network, {roads[lane].encode() for lane in _list_cleared(road_map, tracks, rules)})


def _list_cleared(road_map: RoadMap, tracks: TrackLayout, rules: TrackRules) -> set[str]:
    """List the lanes of cycle tracks where nobody walks."""
    lanes = {lane.id: lane for lane in road_map.lanes if EdgeId.read(lane.road).section in tracks.built}
    uses = {name: _use(lane, tracks) for name, lane in lanes.items()}
    paved = [lane.shape[:, :2] for lane in road_map.lanes if lane.kind is LaneKind.SIDEWALK]
    tree = shapely.STRtree([shapely.LineString(line) for line in paved])
    beside = [
        name
        for name, use in uses.items()
        if use is LaneUse.SEGREGATED
        and _share_beside(lanes[name], tree, rules.pavement_beside) >= rules.pavement_share
    ]
    closed = {name for name, use in uses.items() if use is LaneUse.BICYCLE}
    return closed | _list_spare(road_map, closed, beside)


def _use(lane: Lane, tracks: TrackLayout) -> LaneUse:
    edge = EdgeId.read(lane.road)
    (tags,) = tracks.graph.sections[edge.section].lanes_towards(end=edge.forward)
    return tags.use


def _share_beside(lane: Lane, pavement: shapely.STRtree, distance: float) -> float:
    """Measure along how much of a lane there is pavement within some metres."""
    length = float(along(lane.shape)[-1])
    places, _ = places_on(lane.shape, np.linspace(0.0, length, max(int(length / _STEP), 2)))
    found = pavement.query(shapely.points(places[:, :2]), "dwithin", distance)
    return len(np.unique(found[0])) / len(places)


def _list_spare(road_map: RoadMap, closed: Set[str], lanes: Sequence[str]) -> set[str]:
    """List the lanes without which people still get everywhere; some are closed to them already."""
    steps = [(walk.from_id, walk.to_id) for walk in road_map.walks]
    steps = [step for step in steps if not closed & {*step}]
    owners: dict[str, str] = {}

    def join(places: Iterable[str]) -> int:
        """Make one part of several places; give the number of parts that they were in."""
        parts = set()
        for place in places:
            part = place
            while part in owners:
                part = owners[part]
            parts.add(part)
        first, *others = sorted(parts)
        owners.update(dict.fromkeys(others, first))
        return len(parts)

    around: dict[str, set[str]] = {lane: set() for lane in lanes}
    for one, other in steps:
        if one in around or other in around:
            around.get(one, set()).add(other)
            around.get(other, set()).add(one)
        else:
            join((one, other))
    return {lane for lane, places in around.items() if not places or join(places) == 1}


def _clear(network: bytes, tracks: Set[bytes]) -> bytes:
    """Take people off edges, and off the ways across junctions from or to them."""
    if not tracks:
        return network
    inside: set[bytes] = set()

    def unlinked(found: re.Match[bytes]) -> bytes:
        source, target, via = found.groups()
        if not tracks & {source, target}:
            return found[0]
        if via:
            inside.add(via)
        is_walked = _IS_PAVEMENT.fullmatch(source) or _IS_PAVEMENT.fullmatch(target)
        return b"" if is_walked else found[0]

    def cleared(found: re.Match[bytes]) -> bytes:
        taken = found[1] in tracks or found[1] in inside
        return found[0].replace(b'allow="pedestrian ', b'allow="') if taken else found[0]

    network = _EDGE.sub(cleared, _LINK.sub(unlinked, network))
    used = Counter(_NAME.findall(network))
    return _PAVEMENT.sub(lambda found: found[0] if used[found[1]] > 1 else b"", network)
