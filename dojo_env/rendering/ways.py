"""Where lanes lead at each place: what tells how far a vehicle is on its way round a corner."""

from dataclasses import dataclass
from math import atan2, pi

import numpy as np
from numpy.typing import NDArray

from dojo_env.rendering.compiling import inner
from dojo_maps.description import RoadMap

Floats = NDArray[np.float64]
Ints = NDArray[np.int32]

_STRAY = 1.0
"""Radians; who has turned further from his lane does not follow it."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Ways:
    """The middles of lanes, and of the ways across junctions.

    Attributes:
        numbers: of each lane, by id, internal ones too.
        points: (n, 2) metres, map frame.
        spans: (k, 2) first and last point of each lane; the last is exclusive.
    """

    numbers: dict[str, int]
    points: Floats
    spans: Ints

    def find(self, lanes: tuple[str, ...]) -> Ints:
        """Number the lanes that road users are on.

        Args:
            lanes: id of each one's lane.

        Returns:
            (n,) int32 rows of `spans`, in the same order, -1 where one is on none that is known.
        """
        return np.fromiter((self.numbers.get(lane, -1) for lane in lanes), np.int32, len(lanes))


NO_WAYS = Ways(numbers={}, points=np.empty((0, 2)), spans=np.empty((0, 2), np.int32))


def lay_ways(road_map: RoadMap) -> Ways:
    """Note where the lanes of a map lead.

    Args:
        road_map: the map.

    Returns:
        The middles of its lanes, and of its connections under the ids of SUMO's internal lanes.
    """
    lines = {lane.id: lane.shape for lane in road_map.lanes}
    for connection in road_map.connections:
        lines.update(dict.fromkeys(connection.via, connection.shape))
    ends = np.cumsum([0] + [len(line) for line in lines.values()])
    return Ways(
        numbers={lane: number for number, lane in enumerate(lines)},
        points=np.concatenate([NO_WAYS.points, *(line[:, :2] for line in lines.values())]),
        spans=np.column_stack([ends[:-1], ends[1:]]).astype(np.int32),
    )


@inner
def turn_on(points, first, last, x, y, heading):
    """Tell how far a lane has turned from a heading at the place nearest to (x, y).

    Args:
        points: (n, 2) of `Ways`, metres, map frame.
        first: the lane's first point.
        last: its last point, exclusive.
        x: metres, map frame.
        y: the same.
        heading: radians, counter-clockwise from east.

    Returns:
        Radians, positive to the left; 0 where it is a radian or more, as of who does not follow the lane.
    """
    least, turned = 1e18, 0.0
    for k in range(first, last - 1):
        along, aside = points[k + 1, 0] - points[k, 0], points[k + 1, 1] - points[k, 1]
        square = along * along + aside * aside
        if square == 0.0:
            continue
        dx, dy = x - points[k, 0], y - points[k, 1]
        share = min(1.0, max(0.0, (dx * along + dy * aside) / square))
        distance = (dx - share * along) ** 2 + (dy - share * aside) ** 2
        if distance < least:
            least, turned = distance, atan2(aside, along) - heading
    turned = (turned + pi) % (2.0 * pi) - pi
    return turned if abs(turned) < _STRAY else 0.0
