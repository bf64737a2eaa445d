"""Places of a map that can be found in a photograph, by name: ends of stop lines, corners of crossings."""

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from dojo_maps.description import RoadMap

Floats = NDArray[np.float64]
Place = tuple[float, float, float]


def list_landmarks(road_map: RoadMap) -> dict[str, Place]:
    """Name the places that one may mark in a photograph, metres, map frame.

    `stop_line:LANE:left` and `right` are a stop line's ends as its drivers see them; `crossing:ID:0`,
    `junction:ID:0` and on are corners, counted around; `prop:ID` is where a pole or tree stands, and
    `prop:ID:0` and on are the corners of a building or an island.

    Args:
        road_map: the map.

    Returns:
        x, y and z by name, metres, map frame.
    """
    return {name: (float(x), float(y), float(z)) for name, (x, y, z) in _landmarks(road_map)}


def _landmarks(road_map: RoadMap) -> Iterator[tuple[str, Floats]]:
    lanes = {lane.id: lane for lane in road_map.lanes}
    for line in road_map.stop_lines:
        first, last = line.shape[0], line.shape[-1]
        ahead = lanes[line.lane].shape[-1] - lanes[line.lane].shape[-2]
        across = last - first
        if ahead[0] * across[1] - ahead[1] * across[0] > 0:
            first, last = last, first
        yield f"stop_line:{line.lane}:left", first
        yield f"stop_line:{line.lane}:right", last
    for kind, listed in (("crossing", road_map.crossings), ("junction", road_map.junctions)):
        for each in listed:
            for number, corner in enumerate(each.polygon):
                yield f"{kind}:{each.id}:{number}", corner
    for prop in road_map.props:
        if prop.position is not None:
            yield f"prop:{prop.id}", np.array(prop.position)
        for number, corner in enumerate(prop.polygon if prop.polygon is not None else ()):
            yield f"prop:{prop.id}:{number}", corner


class Ground:
    """How high a map's roads lie."""

    def __init__(self, road_map: RoadMap) -> None:
        """Take the centre lines of all lanes."""
        lines = [lane.shape for lane in road_map.lanes if len(lane.shape) > 1]
        self._starts = np.concatenate([np.empty((0, 3)), *(line[:-1] for line in lines)])
        self._ways = np.concatenate([np.empty((0, 3)), *(np.diff(line, axis=0) for line in lines)])

    def height(self, x: float, y: float) -> float:
        """Find the height of the lane that is nearest to a place.

        Args:
            x: metres, map frame.
            y: metres, map frame.

        Returns:
            Metres; 0 where the map has no lanes.
        """
        if not len(self._starts):
            return 0.0
        to, ways = np.array([x, y]) - self._starts[:, :2], self._ways[:, :2]
        length = np.maximum(np.einsum("ij,ij->i", ways, ways), 1e-12)
        share = np.clip(np.einsum("ij,ij->i", to, ways) / length, 0.0, 1.0)
        nearest = int(np.argmin(np.hypot(*(to - share[:, None] * ways).T)))
        return float(self._starts[nearest, 2] + share[nearest] * self._ways[nearest, 2])
