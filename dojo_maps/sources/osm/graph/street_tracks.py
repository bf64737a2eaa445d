"""Where a tram runs in a street, and on which of its lanes.

A tram in the street shares the road's lane. An edge of its own would lie on the road's, and cars and trams
would drive through each other.
"""

import itertools
from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np
import shapely

from dojo_maps.geometry.polylines import Floats
from dojo_maps.sources.osm.graph.road_graph import RoadGraph, Section
from dojo_maps.sources.osm.read.lane_tags import LaneTags
from dojo_maps.sources.osm.read.track_tags import TRAM
from dojo_maps.sources.osm.read.way_tags import RoadTags

_STEP = 4.0
"""Metres from one place on a track that is looked at to the next."""
_BORDER = 1.2
"""Metres that a track's middle may lie outside of the carriageway that it runs in: half of a tram."""
_PARALLEL = 0.92
"""Least cosine of the angle between them."""
_GAP = 16.0
"""Metres without a street between two parts of a track in one street that are one."""
_LEAST = 2
"""Places in a street that make a part of the track that runs in it."""
_MIDDLE = 0.9
"""Metres from the middle of a street within which a two-way track is one for both directions."""


@dataclass(frozen=True, slots=True, kw_only=True)
class StreetPart:
    """A part of a track that runs in a street.

    Attributes:
        start, end: metres along the track.
        street: the road's section.
        left: metres from the road's line to the track, positive to the left of the section.
        same: the track's section and the road's run in one direction.
    """

    start: float
    end: float
    street: str
    left: float
    same: bool


class Streets:
    """Finds the streets that tracks run in."""

    def __init__(self, graph: RoadGraph, sections: Mapping[str, Section]) -> None:
        self._graph = graph
        self._sections = [sections[name] for name in sorted(sections)]
        self._lines = [shapely.LineString(graph.line(section)) for section in self._sections]
        halves = [section.road.drives / 2 + _BORDER for section in self._sections]
        self._strips = shapely.STRtree(shapely.buffer(self._lines, halves, cap_style="flat"))

    def parts(self, track: Section) -> list[StreetPart]:
        """List the parts of a track that run in a street, in its direction."""
        if track.road.kind != TRAM or not self._lines:
            return []
        line = shapely.LineString(self._graph.line(track))
        count = max(2, int(line.length / _STEP))
        step = line.length / count
        at = (np.arange(count) + 0.5) * step
        ways = _ways(line, at)
        found = self._nearest(line, at, ways, track.road.layer)
        runs = [(k, list(group)) for k, group in itertools.groupby(range(count), found.get)]
        return list(self._joined(line, [(k, g) for k, g in runs if k is not None], step, ways))

    def _nearest(self, line: shapely.LineString, at: Floats, ways: Floats, layer: int) -> dict[int, int]:
        """Find the nearest street along the track at each place, by their numbers."""
        places = shapely.line_interpolate_point(line, at)
        found: dict[int, tuple[float, int]] = {}
        for place, number in self._strips.query(places, predicate="intersects").T.tolist():
            if self._sections[number].road.layer != layer:
                continue
            street = self._lines[number]
            way = _ways(street, np.array([street.project(places[place])]))[0]
            if abs(float(way @ ways[place])) >= _PARALLEL:
                entry = (round(float(street.distance(places[place])), 3), number)
                found[place] = min(entry, found.get(place, entry))
        return {place: number for place, (_, number) in found.items()}

    def _joined(
        self, line: shapely.LineString, runs: list[tuple[int, list[int]]], step: float, ways: Floats
    ) -> Iterator[StreetPart]:
        joined: list[tuple[int, list[int]]] = []
        for number, places in runs:
            if joined and joined[-1][0] == number and (places[0] - joined[-1][1][-1]) * step <= _GAP:
                joined[-1][1].extend(places)
            else:
                joined.append((number, places))
        for number, places in joined:
            if len(places) < _LEAST:
                continue
            street = self._lines[number]
            points = shapely.line_interpolate_point(line, (np.array(places) + 0.5) * step)
            along = np.array([street.project(point) for point in points])
            on_street = shapely.get_coordinates(shapely.line_interpolate_point(street, along))
            heading = _ways(street, along)
            apart = shapely.get_coordinates(points) - on_street
            left = heading[:, 0] * apart[:, 1] - heading[:, 1] * apart[:, 0]
            same = float((heading * ways[places]).sum()) > 0
            yield StreetPart(
                start=places[0] * step, end=(places[-1] + 1) * step, street=self._sections[number].id,
                left=float(np.median(left)), same=same,
            )  # fmt: skip


def tram_lanes(
    street: RoadTags, track: RoadTags, part: StreetPart, *, left_hand: bool
) -> list[tuple[bool, int]]:
    """Choose the lanes of a street that a tram shares: whether forward, and the number from the outermost.

    A two-way track in the middle shares both inner lanes; one at a side is taken for that side's direction.

    Returns:
        None of them where the street lacks a lane in a direction that the track is for.
    """
    single = track.oneway or abs(part.left) > _MIDDLE
    ways = [way for way, lanes in ((True, track.forward), (False, track.backward)) if lanes]
    directions = [way == part.same for way in ways]
    offsets = {
        (forward, k): offset
        for forward in (True, False)
        for k, offset in _offsets(street, forward=forward, left_hand=left_hand)
    }
    if not track.oneway and single and offsets:
        nearest = min(offsets, key=lambda key: (abs(offsets[key] - part.left), key))
        directions = [nearest[0]]
    chosen = []
    for forward in directions:
        lanes = {key: offset for key, offset in offsets.items() if key[0] == forward}
        if not lanes:
            return []
        chosen.append(
            min(lanes, key=lambda key: (abs(lanes[key] - part.left), key)) if single else max(lanes)
        )
    return chosen


def _offsets(road: RoadTags, *, forward: bool, left_hand: bool) -> Iterator[tuple[int, float]]:
    """Give the middles of the lanes that trams may share, metres to the left of a road's line."""
    sign = -1.0 if forward != left_hand else 1.0
    lanes: tuple[LaneTags, ...] = road.forward if forward else road.backward
    outer = road.drives / 2
    for number, lane in enumerate(lanes):
        width = lane.width or road.width
        if lane.motor:
            yield number, sign * (outer - width / 2)
        outer -= width


def _ways(line: shapely.LineString, at: Floats) -> Floats:
    """Give the unit vectors along a line at places on it, (n, 2)."""
    behind = shapely.get_coordinates(shapely.line_interpolate_point(line, np.maximum(at - 1.0, 0.0)))
    ahead = shapely.get_coordinates(shapely.line_interpolate_point(line, np.minimum(at + 1.0, line.length)))
    way = ahead - behind
    return way / np.maximum(np.hypot(*way.T), 1e-9)[:, None]
