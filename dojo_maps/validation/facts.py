"""An indexed description with what several checks measure on it; each is made once, when first asked for."""

import math
from collections.abc import Sequence
from functools import cached_property
from typing import Any

import numpy as np
import shapely

from dojo_maps.description import CARRIAGEWAY, Junction, Lane, Points, Road, RoadMap, Signal
from dojo_maps.geometry.pieces import lane_strips
from dojo_maps.geometry.polylines import Floats, Ints, Shapes, lift
from dojo_maps.index import MapIndex
from dojo_maps.meshes.mesh import Mesh
from dojo_maps.railways import street_signals
from dojo_maps.sumo_loading import Loading

_STUB = 1.0
"""Metres: shorter pieces are rounding of coordinates and have no direction."""
_LOOK = 15.0
"""Metres of a road that tell where it leads at a junction."""
_BACK_DEG = 160.0
"""A road that leaves at more than this from straight on leads back."""


class Facts(MapIndex):
    """A map's index with what checks measure on it; shapes are shapely, metres, in the frame of `origin`."""

    def __init__(
        self, road_map: RoadMap, meshes: Sequence[Mesh] | None = None, sumo: Loading | None = None
    ) -> None:
        """Take a description, furnished or not, with its scene and SUMO's word on it if there are any."""
        super().__init__(road_map)
        self.meshes = meshes or ()
        self.sumo = sumo
        self.origin = np.array([*road_map.origin, 0.0])
        self.kept: dict[str, Any] = {}
        self._headings: dict[tuple[str, bool], tuple[float, float]] = {}

    @cached_property
    def drivable(self) -> tuple[Lane, ...]:
        """The lanes for cars and buses."""
        return tuple(lane for lane in self.map.lanes if lane.kind in CARRIAGEWAY)

    @cached_property
    def signals(self) -> tuple[Signal, ...]:
        """The signals of the street: those that control railways only are left out."""
        return street_signals(self.map)

    def classes(self, road: str) -> frozenset[str]:
        """Tell which vehicles may use a road.

        Args:
            road: its id.

        Returns:
            SUMO's vehicle classes, each of which may use at least one of its lanes.
        """
        return self._classes[road]

    @cached_property
    def _classes(self) -> dict[str, frozenset[str]]:
        return {road: frozenset().union(*(lane.allow for lane in self.lanes_of(road))) for road in self.roads}

    def ways_on(self, road: Road, junction: Junction | None) -> list[Road]:
        """List the roads for its vehicles that leave a road's end, other than back to where it comes from.

        Args:
            road: that leads to the junction; roads for none of its vehicle classes are left out.
            junction: at its end; None where the map has none.

        Returns:
            The roads in the junction's order, without those that turn by 160 degrees or more or end where
            this one begins; none where there is no junction.
        """
        if junction is None:
            return []
        onward = (self.roads[id_] for id_ in junction.outgoing)
        arriving = self.heading(road, at_end=True)
        return [
            other
            for other in onward
            if other.to_junction != road.from_junction
            and self.classes(other.id) & self.classes(road.id)
            and abs(turn_deg(arriving, self.heading(other, at_end=False))) < _BACK_DEG
        ]

    def heading(self, road: Road, *, at_end: bool) -> tuple[float, float]:
        """Take the direction in which a road begins or ends, over its 15 metres there.

        Args:
            road: its innermost lane counts.
            at_end: take the direction at the road's end, not at its start.

        Returns:
            (x, y), metres, in driving direction, over as many points of the shape as make 15 metres, or over
            all of them on a shorter lane; not of unit length.
        """
        key = (road.id, at_end)
        if key not in self._headings:
            shape = self.lanes_of(road.id)[-1].shape[:: -1 if at_end else 1, :2].tolist()
            x, y = shape[0]
            far = next((p for p in shape if math.hypot(p[0] - x, p[1] - y) >= _LOOK), shape[-1])
            self._headings[key] = (x - far[0], y - far[1]) if at_end else (far[0] - x, far[1] - y)
        return self._headings[key]

    @cached_property
    def flat(self) -> bool:
        """Whether the map has no heights."""
        return all(not lane.shape[:, 2].any() for lane in self.map.lanes)

    @cached_property
    def road_strips(self) -> Shapes:
        """The strips of the drivable lanes, in their order; broken ones are mended."""
        return self.strips_of(self.drivable)

    @cached_property
    def road_tree(self) -> shapely.STRtree:
        """An index over `road_strips`."""
        return shapely.STRtree(self.road_strips)

    def strips_of(self, lanes: Sequence[Lane]) -> Shapes:
        """Outline the strips of lanes.

        Args:
            lanes: of the map.

        Returns:
            (n,) shapes as wide as the lanes, in their order, metres, around `origin`; those of lanes without
            length are empty, broken ones are mended.
        """
        strips = shapely.transform(lane_strips(lanes), lambda xy: xy - self.origin[:2])
        return _mended(np.asarray(strips, dtype=object))

    def polygons_of(self, rings: Sequence[Points]) -> Shapes:
        """Make polygons of rings; broken ones are mended, those of fewer than three points are empty.

        Args:
            rings: (k, 3) each, metres, map frame; heights do not count.

        Returns:
            (n,) shapes in the rings' order, metres, around `origin`; a mended one may have several parts.
        """
        made = [
            shapely.Polygon(ring[:, :2] - self.origin[:2]) if len(ring) > 2 else shapely.Polygon()
            for ring in rings
        ]
        return _mended(np.array(made, dtype=object))

    def near_level(self, one: Points, other: Points, at: Floats, height: float) -> bool:
        """Tell whether two shapes lie on one level at a place.

        Args:
            one: (n, 3), metres, map frame.
            other: (m, 3), metres, map frame.
            at: (x, y), metres, map frame; where the nearest point of each shape counts.
            height: metres that they have to be apart to be on two levels.

        Returns:
            Whether they do; always where the map has no heights.
        """
        if self.flat:
            return True
        heights = [float(lift(at[None, :2], line)[0, 2]) for line in (one, other)]
        return abs(heights[0] - heights[1]) < height

    @cached_property
    def corners(self) -> tuple[Floats, Ints]:
        """All drivable lanes' positions in a row, (n, 3), and each one's lane as a place in `drivable`."""
        return in_a_row([lane.shape for lane in self.drivable])

    @cached_property
    def way_lengths(self) -> Floats:
        """The length of each connection's way, metres; gaps between its parts do not count."""
        places, owners = in_a_row([connection.shape for connection in self.map.connections])
        steps = np.hypot(*np.diff(places[:, :2], axis=0).T) * (owners[1:] == owners[:-1])
        lengths = np.zeros(len(self.map.connections))
        np.add.at(lengths, owners[1:], steps)
        return lengths - [sum(across for across, _ in c.joints) for c in self.map.connections]

    @cached_property
    def way_length(self) -> dict[str, float]:
        """`way_lengths` by the connections' ids."""
        return dict(zip((c.id for c in self.map.connections), self.way_lengths.tolist(), strict=True))


def in_a_row(lines: Sequence[Points]) -> tuple[Floats, Ints]:
    """Put lines into one array.

    Args:
        lines: (k, 3) each, of any length.

    Returns:
        (n, 3) their positions, line after line, and (n,) the place in `lines` of the line that each is of.
    """
    if not lines:
        return np.empty((0, 3)), np.empty(0, dtype=np.int64)
    return np.concatenate(lines), np.repeat(np.arange(len(lines)), [len(line) for line in lines])


def turn_deg(before: Sequence[float] | Floats, after: Sequence[float] | Floats) -> float:
    """Measure the turn from one direction to another.

    Args:
        before: (x, y), of any length.
        after: (x, y), of any length.

    Returns:
        Degrees from -180 to 180, positive to the left; meaningless where one of them has no length.
    """
    cross, dot = before[0] * after[1] - before[1] * after[0], before[0] * after[0] + before[1] * after[1]
    return math.degrees(math.atan2(cross, dot))


def direction(shape: Floats) -> Floats:
    """Take the direction of a line's first metres, past the stubs that rounding leaves.

    Args:
        shape: (n, 2) or (n, 3), metres, n >= 1.

    Returns:
        (2,), metres, from the start to the first point that is a metre or more away, or to the farthest one
        of a smaller line; not of unit length, and zero where all points lie on one place.
    """
    distances = np.hypot(*(shape[:, :2] - shape[0, :2]).T)
    far = int(np.argmax(distances >= min(_STUB, float(distances.max()))))
    return shape[far, :2] - shape[0, :2]


def twisted_share(polygon: shapely.Polygon, mended: float | None = None) -> float:
    """Measure the share of a ring's ground that it runs around the wrong way, or again.

    Args:
        polygon: as drawn; its holes do not count.
        mended: its ground in square metres once it is mended; None to mend it here.

    Returns:
        0 for a ring that does not cross itself, 1 where all of its ground cancels out, is run around
        twice, or is none.
    """
    ground = shapely.make_valid(polygon).area if mended is None else mended
    return min(abs(1.0 - shapely.Polygon(polygon.exterior).area / ground), 1.0) if ground > 0 else 1.0


def _mended(shapes: Shapes) -> Shapes:
    broken = ~shapely.is_valid(shapes)
    shapes[broken] = shapely.make_valid(shapes[broken])
    return shapes
