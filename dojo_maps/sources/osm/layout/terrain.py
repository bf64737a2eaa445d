"""How high the ground lies under streets and tracks: from a raster or from tags; else the map is flat.

Streets follow the ground, but smoothly, no steeper than their kind allows, and level within a junction. What
bridges and tunnels pass over or under is not their ground: they run straight from end to end.
"""

import heapq
import itertools
import math
import re
from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import pyproj
import shapely
from numpy.typing import NDArray

from dojo_maps.errors import SourceError
from dojo_maps.geometry.polylines import Floats, Ints, along
from dojo_maps.sources.geotiff import ElevationGrid
from dojo_maps.sources.osm.graph.road_graph import RoadGraph, Section
from dojo_maps.sources.osm.layout.arms import Arm, Layout
from dojo_maps.sources.osm.layout.ground import Ground
from dojo_maps.sources.osm.read.lengths import read_length
from dojo_maps.sources.osm.rules import TerrainRules

_INCLINE = re.compile(r"\s*(-?\d{1,2}(?:[.,]\d{1,2})?)\s*(%|°)\s*", re.ASCII)
_CONVERGED, _MOST_ROUNDS = 1e-6, 5_000


@dataclass(frozen=True, slots=True, kw_only=True)
class _Streets:
    """The streets as places and the pieces between them; all vertices of a junction are one place.

    Attributes:
        where: (n, 2), metres.
        on_ground: (n,), whether a raster shows the street's own ground there.
        ends: (m, 2), the places that each piece joins.
        lengths: (m,), metres.
        limits: (m,), the steepest slope of each piece.
        rises: (m,), slopes that tags tell, NaN for none.
        sections: for each section, metres from its start and the places there.
        vertices: the place of each junction's vertices.
        tagged: the places that have elevations in tags.
    """

    where: Floats
    on_ground: NDArray[np.bool_]
    ends: Ints
    lengths: Floats
    limits: Floats
    rises: Floats
    sections: dict[str, tuple[Floats, Ints]]
    vertices: dict[int, int]
    tagged: dict[int, float]


def find_ground(layout: Layout, raster: ElevationGrid | None) -> Ground | None:
    """Find the ground under the streets of a layout.

    Args:
        layout: the streets.
        raster: elevations; None for those in tags (`ele` of a road's nodes, `incline` of roads).

    Returns:
        None where nothing is known.

    Raises:
        SourceError: the raster lies elsewhere.
    """
    tagged = any("ele" in tags for tags in layout.graph.tags.values())
    if raster is None and not tagged and not any("incline" in way.tags for way in layout.graph.ways.values()):
        return None
    streets = _read_streets(layout, step=np.inf if raster is None else layout.rules.terrain.step)
    heights = np.full(len(streets.where), np.nan)
    if raster is not None:
        heights = _ask(raster, layout.graph, streets)
        told_by = f"the raster {raster.name}"
    elif streets.tagged or not np.isnan(streets.rises).all():
        for place, height in streets.tagged.items():
            heights[place] = height
        slopes = int((~np.isnan(streets.rises)).sum())
        told_by = f"the tags ele of {len(streets.tagged)} places and incline of {slopes} pieces of road"
    else:
        return None
    known_sea = bool(np.isfinite(heights).any())
    heights = _limit(streets, _settle(streets, heights, layout.rules.terrain, by_tags=raster is None))
    lowest = float(heights.min())
    heights = np.round(heights - lowest, 2)
    steep = np.abs(np.diff(heights[streets.ends], axis=1)[:, 0]) / np.maximum(streets.lengths, 1.0)
    return Ground(
        vertices={vertex: float(heights[place]) for vertex, place in streets.vertices.items()},
        profiles={name: (at, heights[places]) for name, (at, places) in streets.sections.items()},
        told_by=told_by,
        lowest=lowest if known_sea else None,
        steepest=float(steep.max(initial=0.0)),
    )


class _Reader:
    """Collects the places and pieces of streets."""

    def __init__(self, layout: Layout, step: float) -> None:
        self.layout, self.graph, self.step = layout, layout.graph, step
        self.rules = layout.rules.terrain
        self.members, self.ends = layout.junctions.members(), layout.graph.ends()
        self.of = {**layout.junctions.of}
        for node, meeting in layout.tracks.meetings.items() if layout.tracks else ():
            self.of.setdefault(node, meeting.junction)
        self.widest: dict[int, float] = defaultdict(float)
        for arm, cut in layout.cuts.items():
            self.widest[layout.junction(arm)] = max(self.widest[layout.junction(arm)], cut)
        self.places: dict[int, int] = {}
        self.where: list[Floats] = []
        self.layered: dict[int, bool] = defaultdict(lambda: True)
        self.pieces: list[tuple[int, int, float, float, float]] = []
        self.sections: dict[str, tuple[Floats, Ints]] = {}

    def read(self, section: Section) -> None:
        """Add a section, with places at its nodes and between them.

        netconvert builds junctions level, so the section is level up to their borders.
        """
        line = self.graph.line(section)
        lengths = along(line)
        whole = float(lengths[-1])
        cuts = [self._level(section, at_end=at_end) for at_end in (False, True)]
        first, last = cuts[0], whole - cuts[1]
        if last - first < self.rules.apart:
            first = last = whole * cuts[0] / sum(cuts)
        stops = [(first, self._place_of(section.start), 0)]
        for number, node in enumerate(section.nodes[1:-1], 1):
            if first + self.rules.apart < lengths[number] < last - self.rules.apart:
                stops.append((float(lengths[number]), self._place_of(node), number))
        stops.append((last, self._place_of(section.end), len(section.nodes) - 1))
        at, places = [0.0, first], [stops[0][1]] * 2
        for (before, _, number), (after, place, _) in itertools.pairwise(stops):
            parts = max(1, math.ceil((after - before) / self.step))
            for part in range(1, parts + 1):
                at.append(before + (after - before) * part / parts)
                here = [float(np.interp(at[-1], lengths, values)) for values in line.T]
                places.append(place if part == parts else self._new_place(np.array(here)))
                self._add_piece(section, places[-2:], at[-1] - at[-2], self._slope(section, number))
        for place in places:
            self.layered[place] &= bool(section.road.layer)
        self.sections[section.id] = (np.array([*at, whole]), np.array([*places, places[-1]]))

    def _level(self, section: Section, *, at_end: bool) -> float:
        """Measure how much of a section is level, for it lies within a junction or at its border."""
        vertex = section.end if at_end else section.start
        corner = self.layout.rules.crossings.corner
        if section.id in self.graph.sections:
            cut = self.layout.cuts.get(Arm(section.id, at_end), 0.0)
            return max(cut, corner if len(self.ends[vertex]) > 2 else self.rules.apart)
        # A track ends where the junction's roads do, which is known when the network is built.
        return max(corner, self.widest[self.of[vertex]]) if vertex in self.of else self.rules.apart

    def _add_piece(self, section: Section, ends: Sequence[int], metres: float, rise: float) -> None:
        limit = self.rules.steepest.get(section.road.kind.removesuffix("_link"), self.rules.steepest_other)
        self.pieces.append((ends[0], ends[1], max(metres, 0.1), limit, rise))

    def _place_of(self, node: int) -> int:
        """Number the place of a node; the vertices of a junction have one, in its middle."""
        key = self.of.get(node, node)
        if key not in self.places:
            where = np.array([self.graph.places[member] for member in self.members.get(key, [key])])
            self.places[key] = self._new_place((where.min(axis=0) + where.max(axis=0)) / 2)
        return self.places[key]

    def _new_place(self, where: Floats) -> int:
        self.where.append(where)
        return len(self.where) - 1

    def _slope(self, section: Section, number: int) -> float:
        """Read the slope that a piece's way is tagged with, along the section."""
        ways = self.graph.ways if section.id in self.graph.sections else self.graph.track_ways
        way = ways[section.ways[number]]
        slope = read_incline(way.tags.get("incline", ""), self.rules.steepest_tagged)
        at = [way.nodes.index(node) for node in section.nodes if node in way.nodes]
        if slope is None or len(at) < 2:
            return math.nan
        return slope if at[0] < at[-1] else -slope


def read_incline(text: str, steepest: float) -> float | None:
    """Read the tag incline, such as `5%` or `-3°`.

    Args:
        text: its value.
        steepest: metres up or down for each metre ahead, beyond which it is not believed.

    Returns:
        Metres up for each metre ahead, negative down; None for other words, and for what is not believed.
    """
    match = _INCLINE.fullmatch(text)
    if match is None:
        return None
    value = float(match[1].replace(",", "."))
    slope = value / 100 if match[2] == "%" else math.tan(math.radians(value))
    return slope if abs(slope) <= steepest else None


def _read_streets(layout: Layout, step: float) -> _Streets:
    graph, reader = layout.graph, _Reader(layout, step)
    sections = [graph.sections[name] for name in sorted(graph.sections) if name not in layout.inner]
    if layout.tracks is not None:
        tracks = layout.tracks.graph.sections
        sections += [tracks[name] for name in sorted(tracks) if name not in layout.tracks.streets]
    for section in sections:
        reader.read(section)
    where = np.array(reader.where)
    on_ground = np.array([not reader.layered[place] for place in range(len(where))])
    bridges = [shapely.LineString(graph.line(section)) for section in sections if section.road.layer > 0]
    near = shapely.STRtree(bridges).query(
        shapely.points(where), "dwithin", distance=layout.rules.terrain.under_bridge
    )[0]
    on_ground[near] = False
    pieces = np.array(reader.pieces)
    tagged = {
        reader.places[key]: height
        for node, tags in graph.tags.items()
        if (key := reader.of.get(node, node)) in reader.places
        and (height := read_length(tags.get("ele", ""))) is not None
    }
    return _Streets(
        where=where,
        on_ground=on_ground,
        ends=pieces[:, :2].astype(np.int64),
        lengths=pieces[:, 2],
        limits=pieces[:, 3],
        rises=pieces[:, 4],
        sections=reader.sections,
        vertices={v: reader.places[key] for v, key in layout.junctions.of.items() if key in reader.places},
        tagged=tagged,
    )


def _ask(raster: ElevationGrid, graph: RoadGraph, streets: _Streets) -> Floats:
    """Look places up in a raster; NaN for those off the ground, and for those it does not know."""
    x, y = (streets.where - graph.projection.net_offset).T
    heights = raster.at(*pyproj.Proj(graph.projection.proj)(x, y, inverse=True))
    covered = float(np.isfinite(heights).mean())
    least = graph.rules.terrain.covered
    if covered < least:
        raise SourceError(raster.name, f"covers {covered:.0%} of the streets; {least:.0%} must be known")
    return np.where(streets.on_ground, heights, np.nan)


def _settle(streets: _Streets, heights: Floats, rules: TerrainRules, *, by_tags: bool) -> Floats:
    """Give every place a height that is near the known ones, with slopes that are even or as tagged.

    What the heights differ by from known ones, squared along all streets, and `smooth` squared times what
    the slopes differ by, are smallest together; solved by conjugate gradients.

    Args:
        streets: the streets.
        heights: (n,), metres, NaN where none is known.
        rules: how smooth streets are.
        by_tags: the heights are exact, and slopes are tagged.
    """
    one, other = streets.ends.T
    size, known = len(heights), np.isfinite(heights)
    tagged = ~np.isnan(streets.rises) & by_tags
    stiff = rules.smooth**2 * np.where(tagged, rules.tagged, 1.0) / np.maximum(streets.lengths, 0.1)
    rises = np.where(tagged, streets.rises * streets.lengths, 0.0)
    share = (np.bincount(one, streets.lengths, size) + np.bincount(other, streets.lengths, size)) / 2
    mass = np.where(known & (not by_tags), np.maximum(share, 0.1), 0.0)
    fixed = known & by_tags

    def bend(force: Floats) -> Floats:
        return np.subtract(np.bincount(other, force, size), np.bincount(one, force, size), dtype=np.float64)

    def apply(values: Floats) -> Floats:
        return np.where(fixed, 0.0, mass * values + bend(stiff * (values[other] - values[one])))

    found = np.where(fixed, heights, float(heights[known].mean()) if known.any() else 0.0)
    rest = mass * np.where(known, heights, 0.0) + bend(stiff * rises)
    rest = np.where(fixed, 0.0, rest) - apply(found)
    ahead, left = rest, float(rest @ rest)
    enough = _CONVERGED**2 * left
    for _ in range(_MOST_ROUNDS):
        if left <= enough:
            break
        against = apply(ahead)
        step = left / float(ahead @ against)
        found, rest = found + step * ahead, rest - step * against
        left, before = float(rest @ rest), left
        ahead = rest + left / before * ahead
    return found


def _limit(streets: _Streets, heights: Floats) -> Floats:
    """Keep every piece within its steepest slope, half by cutting, half by filling.

    The highest surface below all heights that is nowhere too steep, and the lowest above them, are that by
    what they are; so is their mean.
    """
    beside: dict[int, list[tuple[int, float]]] = defaultdict(list)
    for (one, other), metres in zip(streets.ends.tolist(), streets.lengths * streets.limits, strict=True):
        beside[one].append((other, float(metres)))
        beside[other].append((one, float(metres)))
    below = _spread(beside, heights)
    return (below - _spread(beside, -heights)) / 2


def _spread(beside: dict[int, list[tuple[int, float]]], heights: Floats) -> Floats:
    """Find the highest surface that lies nowhere above the heights and is nowhere too steep."""
    found = heights.copy()
    queue = [(height, place) for place, height in enumerate(heights.tolist())]
    heapq.heapify(queue)
    while queue:
        height, place = heapq.heappop(queue)
        if height > found[place]:
            continue
        for other, rise in beside[place]:
            if height + rise < found[other]:
                found[other] = height + rise
                heapq.heappush(queue, (height + rise, other))
    return found
