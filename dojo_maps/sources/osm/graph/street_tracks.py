"""Where a tram runs in a street, and on which of its lanes.

A tram in the street shares the road's lane. An edge of its own would lie on the road's, and cars and trams
would drive through each other.
"""

import itertools
from collections.abc import Iterable, Iterator
from dataclasses import dataclass

import numpy as np
import shapely

from dojo_maps.geometry.polylines import Floats, Shapes
from dojo_maps.sources.osm.graph.road_graph import RoadGraph, Section
from dojo_maps.sources.osm.read.lane_tags import LaneTags
from dojo_maps.sources.osm.read.track_tags import TRAM
from dojo_maps.sources.osm.read.way_tags import RoadTags

_STEP = 4.0
"""Metres from one place on a track that is looked at to the next."""
_LEAST = 2
"""Places in a street that make a part of the track that runs in it."""


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
    """Finds the streets that tracks run in.

    Args:
        graph: the roads.
        sections: those of them that count.
    """

    def __init__(self, graph: RoadGraph, sections: Iterable[Section]) -> None:
        self._graph, self._rules = graph, graph.rules.tracks
        self._sections = sorted(sections, key=lambda section: section.id)
        self._layers = np.array([section.road.layer for section in self._sections], dtype=int)
        self._lines = np.array([shapely.LineString(graph.line(s)) for s in self._sections], dtype=object)
        halves = [section.road.drives / 2 + self._rules.in_street for section in self._sections]
        self._strips = shapely.STRtree(shapely.buffer(self._lines, halves, cap_style="flat"))

    def parts(self, track: Section) -> list[StreetPart]:
        """List the parts of a track that run in a street, in its direction.

        Args:
            track: a section on nodes of the graph.

        Returns:
            The parts, from its start on; none of a track that is not a tram's.
        """
        if track.road.kind != TRAM:
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
        points = shapely.line_interpolate_point(line, at)
        place, number = self._strips.query(points, predicate="intersects")
        level = self._layers[number] == layer
        place, number = place[level], number[level]
        streets, points = self._lines[number], points[place]
        headings = _ways(streets, shapely.line_locate_point(streets, points))
        beside = np.abs((headings * ways[place]).sum(axis=1)) >= self._rules.street_parallel
        apart = np.round(shapely.distance(streets, points), 3)
        order = np.lexsort((number, apart))[::-1]
        return {int(place[k]): int(number[k]) for k in order if beside[k]}

    def _joined(
        self, line: shapely.LineString, runs: list[tuple[int, list[int]]], step: float, ways: Floats
    ) -> Iterator[StreetPart]:
        joined: list[tuple[int, list[int]]] = []
        for number, places in runs:
            if (
                joined
                and joined[-1][0] == number
                and (places[0] - joined[-1][1][-1]) * step <= self._rules.street_gap
            ):
                joined[-1][1].extend(places)
            else:
                joined.append((number, places))
        for number, places in joined:
            if len(places) < _LEAST:
                continue
            street = self._lines[number]
            points = shapely.line_interpolate_point(line, (np.array(places) + 0.5) * step)
            along = shapely.line_locate_point(street, points)
            on_street = shapely.get_coordinates(shapely.line_interpolate_point(street, along))
            heading = _ways(street, along)
            apart = shapely.get_coordinates(points) - on_street
            left = heading[:, 0] * apart[:, 1] - heading[:, 1] * apart[:, 0]
            same = float((heading * ways[places]).sum()) > 0
            yield StreetPart(
                start=places[0] * step, end=(places[-1] + 1) * step, street=self._sections[number].id,
                left=float(np.median(left)), same=same,
            )  # fmt: skip


def tram_lanes(graph: RoadGraph, track: Section, part: StreetPart) -> list[tuple[bool, int]]:
    """Choose the lanes of a street that a tram shares: whether forward, and the number from the outermost.

    A two-way track in the middle shares both inner lanes; one at a side is taken for that side's direction.

    Args:
        graph: the roads.
        track: that the tram runs on.
        part: of the track, in a street.

    Returns:
        None of them where the street lacks a lane in a direction that the track is for.
    """
    street = graph.sections[part.street].road
    single = track.road.oneway or abs(part.left) > graph.rules.tracks.street_middle
    directions = [forward == part.same for forward in (True, False) if track.lanes_towards(end=forward)]
    offsets = {
        (forward, k): offset
        for forward in (True, False)
        for k, offset in _offsets(street, forward=forward, left_hand=graph.left_hand)
    }
    if not track.road.oneway and single and offsets:
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


def _ways(lines: shapely.LineString | Shapes, at: Floats) -> Floats:
    """Give the unit vectors along lines, or one line, at places on them, (n, 2)."""
    ends = np.maximum(at - 1.0, 0.0), np.minimum(at + 1.0, shapely.length(lines))
    behind, ahead = (shapely.get_coordinates(shapely.line_interpolate_point(lines, end)) for end in ends)
    way = ahead - behind
    return way / np.maximum(np.hypot(*way.T), 1e-9)[:, None]
