"""From boxes in a picture to lanes and places along them, by the camera's geometry and the map.

A box's foot is no good guide: it is the near end of a vehicle, and the queue hides it. So it is asked the
other way round. For every place where a vehicle's front may be, half a metre apart along each lane, it is
computed which box a vehicle of that kind would have in the picture, lens and slopes included. A detection is
where its box fits best. What fits nowhere is not on the road.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from dojo_env.camera import Camera
from dojo_env.detectors.base import Detections, Floats
from dojo_env.snapshot import Kind
from dojo_maps.description import LaneKind, RoadMap

STEP = 0.5
"""Metres along a lane from place to place."""
_NOSE, _BODY = 1.0, 3.0
"""Metres before and behind a vehicle's front between which its direction is taken."""
FARTHEST = 160.0
"""Metres from a camera to the last place."""
_LANE_KINDS = (LaneKind.DRIVING, LaneKind.BUS, LaneKind.BICYCLE, LaneKind.RAIL)
_LEAST_HEIGHT = 8.0
"""Pixels of a car's box; no detector finds less."""
_LEAST_IN_VIEW = 0.4
"""Share of a car's box inside of the picture."""
_EDGE_ERROR, _EDGE_PIXELS = 0.06, 1.5
"""Standard error of a box's edge: a share of its size, and pixels."""
_HIDDEN_ERROR = 6.0
"""By how much it grows for an edge that lies behind a nearer road user."""
_HIDDEN_MARGIN = 0.15
"""Share of its size by which a nearer box is grown to see what it hides."""
_WORST_FIT = 60.0
"""Sum of squared errors, in standard errors, above which a box is on no lane."""
_NEAR = 4.0
"""Metres around the best place over which it is averaged."""
_PLACE_ERROR = 0.3
"""Metres; no place is known better."""

SIZES: dict[Kind, tuple[float, float, float]] = {
    Kind.CAR: (4.7, 1.8, 1.5),
    Kind.VAN: (5.5, 2.0, 2.2),
    Kind.TRUCK: (8.0, 2.5, 3.2),
    Kind.TRAILER: (16.5, 2.5, 4.0),
    Kind.BUS: (12.0, 2.5, 3.2),
    Kind.TRAM: (30.0, 2.4, 3.4),
    Kind.MOTORCYCLE: (2.2, 0.8, 1.6),
    Kind.BICYCLE: (1.8, 0.6, 1.7),
}
"""Length, width and height of those that are looked for, metres."""
_LIKE = {
    Kind.TAXI: Kind.CAR, Kind.POLICE: Kind.CAR, Kind.AMBULANCE: Kind.VAN, Kind.FIRE_ENGINE: Kind.TRUCK,
    Kind.COACH: Kind.BUS, Kind.TRAIN: Kind.TRAM, Kind.SCOOTER: Kind.BICYCLE,
}  # fmt: skip
"""Who has another's size."""
_TALL = 2.0
"""Metres; who is higher is a box, who is lower narrows towards the roof."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class LaneGrid:
    """The places where a vehicle's front may be; arrays have one row each.

    Attributes:
        lanes: ids of the lanes; the last one is "", for the ways across junctions and where cars park.
        lane: (n,) number of the lane.
        way: (n,) number of the lane or of the way across a junction: places of one way follow each other.
        place: (n,) metres from the way's start.
        left: (n,) metres to the way's end.
        fronts: (n, 3) metres, map frame.
        headings: (n, 2) unit vectors, the way traffic drives.
    """

    lanes: tuple[str, ...]
    lane: NDArray[np.intp]
    way: NDArray[np.intp]
    place: Floats
    left: Floats
    fronts: Floats
    headings: Floats


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Placements:
    """Where detections stand; arrays have one row for each that is on the road.

    Attributes:
        detections: (k,) their numbers.
        rows: (k,) the best place in the grid.
        fronts: (k, 3) middle of the vehicle's front, metres, map frame.
        errors: (k,) standard error along the lane, metres.
        lengths: (k,) of vehicles of that kind, metres.
    """

    detections: NDArray[np.intp]
    rows: NDArray[np.intp]
    fronts: Floats
    errors: Floats
    lengths: Floats


def build_grid(road_map: RoadMap, cameras: Sequence[Camera]) -> LaneGrid:
    """Lay places along lanes, ways across junctions and parking cars that are near enough to some camera.

    Args:
        road_map: the map.
        cameras: at least one.

    Returns:
        The places, half a metre apart and no more than 160 m from a camera, level.
    """
    eyes = np.array([camera.position[:2] for camera in cameras])
    ways = [(lane.id, lane.shape) for lane in road_map.lanes if lane.kind in _LANE_KINDS]
    ways += [("", connection.shape) for connection in road_map.connections]
    ways += [("", line) for line in _parking_lines(road_map)]
    found: list[tuple[str, Floats]] = []
    for name, shape in ways:
        places = _sample(shape)
        near = np.linalg.norm(places[:, None, :2] - eyes[None], axis=2).min(axis=1) <= FARTHEST
        if near.any():
            found.append((name, places[near]))
    names = (*dict.fromkeys(name for name, _ in found if name), "")
    number = {name: k for k, name in enumerate(names)}
    counts = [len(places) for _, places in found]
    table = np.vstack([np.empty((0, 7)), *(places for _, places in found)])
    return LaneGrid(
        lanes=names,
        lane=np.repeat(np.array([number[name] for name, _ in found], np.intp), counts),
        way=np.repeat(np.arange(len(found)), counts),
        fronts=table[:, :3],
        headings=table[:, 3:5],
        place=table[:, 5],
        left=table[:, 6],
    )


def _parking_lines(road_map: RoadMap) -> Iterator[Floats]:
    """List the middles of parking lanes, and of bays, whose outlines run along the kerb and back."""
    yield from (lane.shape for lane in road_map.lanes if lane.kind is LaneKind.SHOULDER and not lane.allow)
    for prop in road_map.props:
        if prop.kind == "parking" and prop.polygon is not None and len(prop.polygon) % 2 == 0:
            there, back = np.split(prop.polygon, 2)
            yield (there + back[::-1]) / 2


def _sample(shape: Floats) -> Floats:
    """Give places along a line, (n, 7): point, direction, metres from its start and to its end."""
    along = np.append(0.0, np.cumsum(np.hypot(*np.diff(shape[:, :2], axis=0).T)))
    place = np.arange(along[-1], 0.0, -STEP)[::-1]

    def find_points(at: Floats, axes: int) -> Floats:
        return np.column_stack([np.interp(at, along, shape[:, axis]) for axis in range(axes)])

    course = find_points(place + _NOSE, 2) - find_points(place - _BODY, 2)
    course /= np.maximum(np.linalg.norm(course, axis=1, keepdims=True), 1e-9)
    return np.hstack([find_points(place, 3), course, place[:, None], along[-1] - place[:, None]])


class Grounding:
    """Finds the lanes and places of what one camera's pictures show.

    Attributes:
        camera: the camera.
        heights: (n,) pixels of a car's box at each place of the grid; 0 where it is not in view.
    """

    def __init__(self, camera: Camera, grid: LaneGrid) -> None:
        """Look at the places through the camera."""
        self.camera, self._grid = camera, grid
        self._expected: dict[Kind, Floats] = {}
        whole, clipped = self._project(Kind.CAR), self.expect(Kind.CAR)
        sizes, shown = (np.prod(each[:, 2:] - each[:, :2], axis=1) for each in (whole, clipped))
        heights = clipped[:, 3] - clipped[:, 1]
        # Comparisons with nan, behind the camera, are False.
        self.heights = np.where((shown >= _LEAST_IN_VIEW * sizes) & (heights >= _LEAST_HEIGHT), heights, 0.0)

    def expect(self, kind: Kind) -> Floats:
        """Give the box that a vehicle of a kind has at each place.

        Args:
            kind: one of `SIZES`.

        Returns:
            (n, 4) left, top, right and bottom, pixels, cut at the picture's edges; nan where the vehicle is
            not wholly before the camera. It is kept: do not change it.
        """
        if kind not in self._expected:
            size = np.tile([self.camera.width, self.camera.height], 2)
            self._expected[kind] = np.clip(self._project(kind), 0.0, size)
        return self._expected[kind]

    def locate(self, detections: Detections) -> Placements:
        """Find where detections stand; people on foot and what fits nowhere are left out.

        Args:
            detections: in a whole picture of this camera.

        Returns:
            A row for each that stands on the road, in the detections' order.
        """
        found = []
        spread = _find_hidden_edges(detections.boxes)
        for number, kind in enumerate(detections.kinds.tolist()):
            like = _LIKE.get(Kind(kind), Kind(kind))
            fit = self._fit(detections.boxes[number], spread[number], like) if like in SIZES else None
            if fit is not None:
                found.append((number, *fit, SIZES[like][0]))
        columns = [list(column) for column in zip(*found, strict=True)] or [[]] * 5
        return Placements(
            detections=np.array(columns[0], np.intp),
            rows=np.array(columns[1], np.intp),
            fronts=np.array(columns[2], np.float64).reshape(-1, 3),
            errors=np.array(columns[3], np.float64),
            lengths=np.array(columns[4], np.float64),
        )

    def _fit(self, box: Floats, spread: Floats, kind: Kind) -> tuple[int, Floats, float] | None:
        """Find the place whose box is most like this one: its row, the front, the error in metres."""
        grid, expected = self._grid, self.expect(kind)
        error = (_EDGE_ERROR * np.tile(expected[:, 2:] - expected[:, :2], 2) + _EDGE_PIXELS) * spread
        cost = (((box - expected) / error) ** 2).sum(axis=1)
        cost = np.where((self.heights > 0) & np.isfinite(cost), cost, np.inf)
        best = int(cost.argmin()) if len(cost) else 0
        if not len(cost) or cost[best] > _WORST_FIT:
            return None
        around = round(_NEAR / STEP)
        near = np.arange(max(0, best - around), min(len(cost), best + around + 1))
        near = near[grid.way[near] == grid.way[best]]
        weight = np.exp((cost[best] - cost[near]) / 2)
        weight /= weight.sum()
        variance = float(weight @ (grid.place[near] - weight @ grid.place[near]) ** 2)
        return best, weight @ grid.fronts[near], float(np.sqrt(variance + _PLACE_ERROR**2))

    def _project(self, kind: Kind) -> Floats:
        grid = self._grid
        shape = _outline(*SIZES[kind])
        ahead = np.column_stack([grid.headings, np.zeros(len(grid.headings))])
        left = np.column_stack([-grid.headings[:, 1], grid.headings[:, 0], np.zeros(len(grid.headings))])
        corners = (
            grid.fronts[:, None]
            + shape[None, :, :1] * ahead[:, None]
            + shape[None, :, 1:2] * left[:, None]
            + shape[None, :, 2:] * np.array([0.0, 0.0, 1.0])
        )
        pixels, depth = self.camera.project(corners.reshape(-1, 3))
        pixels = np.where((depth > self.camera.near)[:, None], pixels, np.nan).reshape(*corners.shape[:2], 2)
        return np.hstack([pixels.min(axis=1), pixels.max(axis=1)])


def _outline(length: float, width: float, height: float) -> Floats:
    """Give points that span a vehicle: metres ahead of its front, to its left, and above the ground."""
    half = width / 2
    if height > _TALL:
        ends = [(x, z, 1.0) for x in (0.0, -length) for z in (0.3, height)]
        wheels = [(x * length, 0.0, 0.95) for x in (-0.12, -0.9)]
        return np.array([(x, side * half * w, z) for x, z, w in [*ends, *wheels] for side in (-1, 1)])
    ends = [(x * length, z * height, 0.95) for x in (0.0, -1.0) for z in (0.15, 0.5)]
    belt = [(x * length, 0.62 * height, 1.0) for x in (-0.15, -0.9)]
    roof = [(x * length, height, 0.72) for x in (-0.42, -0.75)]
    wheels = [(x * length, 0.0, 0.95) for x in (-0.12, -0.88)]
    return np.array(
        [(x, side * half * w, z) for x, z, w in [*ends, *belt, *roof, *wheels] for side in (-1, 1)]
    )


def _find_hidden_edges(boxes: Floats) -> Floats:
    """Tell by how much the error of each edge grows, (n, 4): an edge behind a nearer box may be anywhere.

    Who stands lower in the picture is nearer.
    """
    spread = np.ones((len(boxes), 4))
    middles = (boxes[:, :2] + boxes[:, 2:]) / 2
    size = boxes[:, 2:] - boxes[:, :2]
    grown = boxes + np.hstack([-size, size]) * _HIDDEN_MARGIN
    edges = (
        (0, np.column_stack([boxes[:, 0], middles[:, 1]])),
        (2, np.column_stack([boxes[:, 2], middles[:, 1]])),
        (3, np.column_stack([middles[:, 0], boxes[:, 3]])),
    )
    nearer = boxes[None, :, 3] > boxes[:, None, 3] + _EDGE_PIXELS
    for edge, points in edges:
        inside = (points[:, None] >= grown[None, :, :2]).all(axis=2) & (
            points[:, None] <= grown[None, :, 2:]
        ).all(axis=2)
        spread[(inside & nearer).any(axis=1), edge] = _HIDDEN_ERROR
    return spread
