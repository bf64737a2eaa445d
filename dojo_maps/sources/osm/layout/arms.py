"""What is to be built, seen from the arms of its junctions: how far they are drawn back, crossings there."""

from collections import defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from dojo_maps.geometry.polylines import Floats, along
from dojo_maps.sources.osm.graph.edge_id import EdgeId
from dojo_maps.sources.osm.graph.road_graph import RoadGraph, Section
from dojo_maps.sources.osm.junctions.grouping import Junctions
from dojo_maps.sources.osm.junctions.mapped_crossings import MappedCrossing
from dojo_maps.sources.osm.layout.ground import Ground
from dojo_maps.sources.osm.read.lane_tags import LaneTags
from dojo_maps.sources.osm.rules import ImportRules

if TYPE_CHECKING:
    from dojo_maps.sources.osm.layout.track_layout import TrackLayout


_STRAIGHT = 1.5
"""m of a road that lead straight to where it is drawn back to: a bend there would twist its outer lanes."""


class Arm(NamedTuple):
    """A road of a junction: a section's id, and whether its end lies there rather than its start."""

    section: str
    at_end: bool

    @property
    def incoming(self) -> EdgeId:
        """The edge that arrives through it."""
        return EdgeId(self.section, self.at_end)

    @property
    def outgoing(self) -> EdgeId:
        """The edge that leaves through it."""
        return EdgeId(self.section, not self.at_end)


@dataclass(frozen=True, slots=True, kw_only=True)
class Layout:
    """What is to be built.

    Attributes:
        graph: the roads, as they are built.
        junctions: which vertices are one, and their signals.
        crossings: where people cross, as it is mapped.
        inner: sections that lie inside a junction and vanish.
        cuts: metres by which a section's end is drawn back from its vertex.
        hosted: the crossing at each arm.
        lost: crossings with no place, and why.
        asides: metres by which a section is moved to its left: by its placement, or for another that is near.
        heights: metres above the ground, of the nodes that are not on it.
        ground: how high that lies; None where it is flat.
        sidewalks: metres across those on the left and the right of each section that is built; 0 for none.
        outlined: junctions, each by its vertices, that reach to the ends of their roads, whatever netconvert
            would draw.
        tracks: of trams, trains and bicycles; None where there are none.
    """

    graph: RoadGraph
    junctions: Junctions
    crossings: tuple[MappedCrossing, ...]
    inner: frozenset[str]
    cuts: Mapping[Arm, float] = field(default_factory=dict)
    hosted: Mapping[Arm, MappedCrossing] = field(default_factory=dict)
    lost: Sequence[tuple[MappedCrossing, str]] = ()
    asides: Mapping[str, float] = field(default_factory=dict)
    heights: Mapping[int, float] = field(default_factory=dict)
    ground: Ground | None = None
    sidewalks: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    outlined: frozenset[frozenset[int]] = frozenset()
    tracks: "TrackLayout | None" = None

    @property
    def rules(self) -> ImportRules:
        """The limits to go by."""
        return self.graph.rules

    def height(self, vertex: int) -> float:
        """Give the height of a vertex, metres.

        Args:
            vertex: of a junction.

        Returns:
            Metres above the lowest place of the ground; above the ground itself where that is flat.
        """
        return self.heights.get(vertex, 0.0) + (self.ground.vertices[vertex] if self.ground else 0.0)

    def trimmed(self, name: str) -> Floats:
        """Give a section's line, drawn back at its ends.

        Args:
            name: the section's id.

        Returns:
            (n, 2), metres, map frame, in the order of its nodes.
        """
        cuts = [self.cuts.get(Arm(name, at_end), 0.0) for at_end in (False, True)]
        return trim(self.graph.line(self.graph.sections[name]), *cuts, straight=_STRAIGHT)

    def junction(self, arm: Arm) -> int:
        """Name the junction that an arm ends at.

        Args:
            arm: of any junction.

        Returns:
            The junction's lowest vertex.
        """
        section = self.graph.sections[arm.section]
        return self.junctions.of[section.end if arm.at_end else section.start]

    def arms(self) -> dict[int, list[Arm]]:
        """List the arms of each junction."""
        found: dict[int, list[Arm]] = defaultdict(list)
        for name in sorted(self.graph.sections):
            if name not in self.inner:
                for arm in (Arm(name, at_end=False), Arm(name, at_end=True)):
                    found[self.junction(arm)].append(arm)
        return dict(found)

    def arriving(self, arm: Arm) -> tuple[LaneTags, ...]:
        """Give the lanes that lead into the junction of an arm.

        Args:
            arm: of any junction.

        Returns:
            The lanes, outermost first; none where all traffic leaves.
        """
        return self.graph.sections[arm.section].lanes_towards(end=arm.at_end)

    def leaving(self, arm: Arm) -> tuple[LaneTags, ...]:
        """Give the lanes that lead out of the junction of an arm.

        Args:
            arm: of any junction.

        Returns:
            The lanes, outermost first; none where all traffic arrives.
        """
        return self.graph.sections[arm.section].lanes_towards(end=not arm.at_end)

    def walk(self, edge: EdgeId) -> float:
        """Measure the sidewalk at the outer side of an edge, metres.

        Args:
            edge: of a section that is built, and whose sidewalks are laid.

        Returns:
            Metres across; 0 where there is none.
        """
        left, right = self.sidewalks[edge.section]
        return left if self.graph.left_hand == edge.forward else right

    def half(self, name: str) -> float:
        """Measure half the width of a section's lanes.

        Args:
            name: the section's id.

        Returns:
            Metres, of the lanes of both directions.
        """
        return self.graph.sections[name].road.drives / 2

    def left_of(self, section: Section) -> float:
        """Measure what is left of a road between its junctions.

        Args:
            section: that is built.

        Returns:
            Metres; below 0 where its cuts overlap.
        """
        arms = Arm(section.id, at_end=False), Arm(section.id, at_end=True)
        lost = sum(max(self.cuts.get(arm, 0.0), self.rules.forks.others) for arm in arms)
        return self.graph.length(section) - lost

    def room(self, arm: Arm, cuts: Mapping[Arm, float], *, left: float) -> float:
        """Measure how far an arm may be drawn back, beside other cuts, so that so much of it is left.

        Args:
            arm: of any junction.
            cuts: metres by which arms are drawn back; at the other end of the road, if it has none there,
                what a road loses at a junction anyway.
            left: metres of the road to keep.

        Returns:
            Metres; below 0 where the road is too short already.
        """
        length = self.graph.length(self.graph.sections[arm.section])
        return length - cuts.get(Arm(arm.section, not arm.at_end), self.rules.crossings.corner) - left


def outward(graph: RoadGraph, arm: Arm) -> Floats:
    """Give the line of an arm's road from its vertex on.

    Args:
        graph: that has the road.
        arm: of a junction.

    Returns:
        (n, 2), metres, map frame, its vertex first.
    """
    line = graph.line(graph.sections[arm.section])
    return line[::-1] if arm.at_end else line


def ray(graph: RoadGraph, arm: Arm) -> tuple[Floats, Floats]:
    """Give an arm's vertex and the unit vector away from it, along its first 20 m.

    Args:
        graph: that has the road.
        arm: of a junction.

    Returns:
        (2,) metres, map frame; and (2,), to the place 20 m ahead, or to the road's end.
    """
    line = outward(graph, arm)
    lengths = along(line)
    ahead = np.array([np.interp(min(20.0, float(lengths[-1])), lengths, values) for values in line.T])
    way = ahead - line[0]
    return line[0], way / max(float(np.hypot(*way)), 1e-6)


def trim(line: Floats, start: float, end: float, *, straight: float = 0.3) -> Floats:
    """Draw a line back at its ends, as far as a metre of it is left.

    Args:
        line: (n, 2), or (n, 3) with heights; metres, n >= 2.
        start: metres along it to draw its start back.
        end: metres along it to draw its end back.
        straight: metres next to an end that is drawn back, within which it does not bend.

    Returns:
        As many columns, with new ends; both are drawn back less, in proportion, where too little would be
        left.
    """
    lengths = along(line)
    total = float(lengths[-1])
    if start + end > max(total - 1.0, 0.0):
        share = max(total - 1.0, 0.0) / max(start + end, 1e-9)
        start, end = start * share, end * share
    clear = [straight if drawn_back else 0.3 for drawn_back in (start, end)]
    inner = (lengths > start + clear[0]) & (lengths < total - end - clear[1])
    wanted = np.concatenate([[start], lengths[inner], [total - end]])
    return np.column_stack([np.interp(wanted, lengths, values) for values in line.T])


def divider(layout: Layout, section: Section) -> Floats:
    """Find the line between the two directions, drawn back at both ends as their arms are.

    The way is taken for the middle of the carriageway, unless its placement says otherwise.

    Args:
        layout: with its cuts, asides, heights and ground.
        section: of it.

    Returns:
        (n, 3), metres, map frame, along the section.
    """
    line = np.column_stack(
        [layout.graph.line(section), [layout.heights.get(node, 0.0) for node in section.nodes]]
    )
    line = layout.ground.under(section.id, line) if layout.ground else line
    cuts = [layout.cuts.get(Arm(section.id, at_end), 0.0) for at_end in (False, True)]
    line = trim(line, *cuts, straight=_STRAIGHT)
    road = section.road
    aside = (road.across(road.forward) - road.across(road.backward)) / 2
    aside = -aside if layout.graph.left_hand else aside
    return shift(line, aside + layout.asides.get(section.id, 0.0))


def shift(line: Floats, distance: float) -> Floats:
    """Move a line to its left, corners mitred.

    Args:
        line: (n, 2), or (n, 3) with heights, which stay; metres, n >= 2.
        distance: metres, negative to the right.

    Returns:
        As many rows and columns; the same object for a distance of 0.
    """
    if not distance:
        return line
    step = np.diff(line[:, :2], axis=0)
    step /= np.maximum(np.hypot(*step.T), 1e-9)[:, None]
    left = np.column_stack([-step[:, 1], step[:, 0]])
    before, after = np.vstack([left[:1], left]), np.vstack([left, left[-1:]])
    middle = before + after
    size = np.maximum((middle**2).sum(axis=1), 0.5)
    aside = distance * 2 * middle / size[:, None]
    return np.column_stack([line[:, :2] + aside, line[:, 2:]])
