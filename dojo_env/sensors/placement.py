"""Where cameras hang, from the map alone: one per approach of a signal, and one straight above it."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from math import atan2, cos, degrees, radians, sin, tan

import numpy as np
from numpy.typing import NDArray

from dojo_env.camera import BEV, Camera
from dojo_env.errors import ConfigError
from dojo_env.rendering.raster import draw_mesh
from dojo_env.rendering.scene import Scene
from dojo_env.rendering.view import view_of
from dojo_maps.description import Lane, LinkKind, RoadMap, Signal
from dojo_maps.index import MapIndex

Floats = NDArray[np.float64]

MOUNT_HEIGHT = 10.0
"""Metres above the stop line."""
PITCH_DEG = -35.0
FIELD_OF_VIEW_DEG = 75.0
BEV_FIELD_OF_VIEW_DEG = 60.0
QUEUE_IN_VIEW = 75.0
"""Metres of queue before each stop line that a bird's eye view holds, where the road is that long."""
_INNER_ROAD = 25.0
"""Shorter roads between two junctions of one signal are part of its middle, not an approach, metres."""
_AHEAD = (8.0, 9.5, 6.5, 11.0, 13.0, 15.0, 18.0)
_ASIDE = (0.0, 1.5, -1.5, 3.0, -3.0, 5.0, -5.0)
"""Metres from the middle of the stop line to where a camera may hang, tried in this order."""
_PROBE_STEP = 2.5
_PROBE_LENGTH = 40.0
_PROBE_HEIGHT = 0.7
_PROBE_SIZE = (64, 89)
_SEEN_ENOUGH, _WORTH_MOVING = 0.98, 0.02
"""Shares of the lanes in view that end the search, and that make another place better."""
_HIGHEST = 400.0


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Approach:
    """One way into a signal's junctions.

    Attributes:
        road: id of the road.
        lanes: ids of its signalled lanes, in index order.
        stop: (3,) middle of the stop lines, metres, map frame.
        heading: the way traffic drives there, radians, counter-clockwise from east.
        lines: centre lines of the lanes and of what leads straight into them, back to front.
    """

    road: str
    lanes: tuple[str, ...]
    stop: Floats
    heading: float
    lines: tuple[Floats, ...]


def find_approaches(road_map: RoadMap, signal: Signal) -> tuple[Approach, ...]:
    """List a signal's approaches, clockwise from north as seen from its middle.

    A short road between two of its own junctions is part of the middle, unless all its roads are such.
    """
    lanes = MapIndex(road_map).lanes
    starts = {road.id: road.from_junction for road in road_map.roads}
    stops: dict[str, dict[str, Lane]] = {}
    for link in signal.links:
        lane = lanes.get(link.from_id)
        if link.kind is LinkKind.VEHICLE and lane is not None and len(lane.shape) > 1:
            stops.setdefault(lane.road, {})[lane.id] = lane
    inner = {
        road
        for road, held in stops.items()
        if starts.get(road) in signal.junctions and max(lane.length for lane in held.values()) < _INNER_ROAD
    }
    feeders = _feeders(road_map)
    found = [
        _approach(road, sorted(held.values(), key=lambda lane: lane.index), lanes, feeders)
        for road, held in stops.items()
        if road not in inner or len(inner) == len(stops)
    ]
    if not found:
        return ()
    middle = np.mean([approach.stop[:2] for approach in found], axis=0)
    return tuple(sorted(found, key=lambda a: ((atan2(*(a.stop[:2] - middle)) + 1e-6) % (2 * np.pi), a.road)))


def place_cameras(scene: Scene, signal_id: str, *, width: int = 356, height: int = 256) -> tuple[Camera, ...]:
    """Place one camera per approach of a signal and, last, one straight above it named `bev`.

    The approach cameras are named `approach_0` and so on, in the order of `find_approaches`. They hang 10 m
    up and look down by 35 degrees at the lanes that come in; of several places the one that sees most of
    them is taken.

    Raises:
        ConfigError: the map has no such signal, or no vehicles drive up to it.
    """
    signal = find_signal(scene.road_map, signal_id)
    approaches = find_approaches(scene.road_map, signal)
    if not approaches:
        raise ConfigError(f"signal {signal_id!r}: no lane leads to it, so no camera can look at one")
    cameras = [
        replace(_approach_camera(scene, approach, width, height), name=f"approach_{k}")
        for k, approach in enumerate(approaches)
    ]
    return (*cameras, _bev_camera(scene.road_map, signal, approaches, width, height))


def find_signal(road_map: RoadMap, signal_id: str) -> Signal:
    """Look a signal up.

    Raises:
        ConfigError: the map has no such signal.
    """
    for signal in road_map.signals:
        if signal.id == signal_id:
            return signal
    known = ", ".join(signal.id for signal in road_map.signals[:10]) or "none"
    raise ConfigError(f"{road_map.name}: no signal {signal_id!r}; it has {known}")


def _feeders(road_map: RoadMap) -> dict[str, str]:
    """For each lane, the lane that leads straight into it."""
    straight = [c for c in road_map.connections if c.direction in ("s", "S")]
    return {c.to_lane: c.from_lane for c in reversed(straight)}


def _approach(road: str, held: Sequence[Lane], lanes: dict[str, Lane], feeders: dict[str, str]) -> Approach:
    lines = []
    for lane in held:
        line, last = lane.shape, lane.id
        for _ in range(8):
            length = float(np.hypot(*np.diff(line[:, :2], axis=0).T).sum())
            last = feeders.get(last, "")
            if length >= 2 * _PROBE_LENGTH or last not in lanes:
                break
            line = np.vstack([lanes[last].shape, line])
        lines.append(np.array(line))
    stop = np.mean([line[-1] for line in lines], axis=0)
    back = np.mean([_before_end(line, 25.0) for line in lines], axis=0)
    heading = atan2(stop[1] - back[1], stop[0] - back[0])
    return Approach(
        road=road, lanes=tuple(lane.id for lane in held), stop=stop, heading=heading, lines=tuple(lines)
    )


def _before_end(line: Floats, distance: float) -> Floats:
    """Find the point of a line some way before its end, or its start."""
    along = np.append(0.0, np.cumsum(np.hypot(*np.diff(line[:, :2], axis=0).T)))
    at = max(0.0, along[-1] - distance)
    return np.array([np.interp(at, along, line[:, axis]) for axis in range(3)])


def _approach_camera(scene: Scene, approach: Approach, width: int, height: int) -> Camera:
    """Hang a camera ahead of the stop line, looking back along the lanes, where the view is free."""
    probes = np.concatenate(
        [
            [_before_end(line, distance) for line in approach.lines]
            for distance in np.arange(0.0, _PROBE_LENGTH, _PROBE_STEP)
        ]
    ) + np.array([0.0, 0.0, _PROBE_HEIGHT])
    candidates = _candidates(approach, width, height)
    best = next(candidates)
    most = _visible_share(scene, best, probes)
    for camera in candidates:
        if most >= _SEEN_ENOUGH:
            break
        seen = _visible_share(scene, camera, probes)
        if seen > most + _WORTH_MOVING:
            best, most = camera, seen
    return best


def _candidates(approach: Approach, width: int, height: int) -> Iterator[Camera]:
    ahead = np.array([cos(approach.heading), sin(approach.heading)])
    left = np.array([-ahead[1], ahead[0]])
    for forward in _AHEAD:
        for aside in _ASIDE:
            x, y = approach.stop[:2] + forward * ahead + aside * left
            turn = atan2(aside, forward + 20.0)
            yield Camera(
                name=approach.road,
                position=(
                    round(float(x), 3),
                    round(float(y), 3),
                    round(float(approach.stop[2]) + MOUNT_HEIGHT, 3),
                ),
                heading_deg=round((degrees(approach.heading + turn) + 180.0) % 360.0, 3),
                pitch_deg=PITCH_DEG,
                field_of_view_deg=FIELD_OF_VIEW_DEG,
                width=width,
                height=height,
            )


def _visible_share(scene: Scene, camera: Camera, probes: Floats) -> float:
    """Share of some points that a camera sees, with nothing static in front."""
    height, width = _PROBE_SIZE
    small = replace(camera, width=width, height=height, name="probe")
    view = view_of(small, scene.origin)
    depths = np.zeros((height, width), dtype=np.float32)
    tags = np.full((height, width), -1, dtype=np.int32)
    draw_mesh(scene.vertices, scene.faces, view.axes, view.eye, view.lens, depths, tags)
    pixels, distance = small.project(probes)
    inside = (distance > small.near) & (pixels > 0).all(axis=1) & (pixels < [width, height]).all(axis=1)
    columns, rows = np.floor(pixels[inside]).astype(int).T
    held = 1 / np.maximum(depths[rows, columns], 1e-6)
    return float((held > distance[inside] - 1.0).sum() / len(probes))


def _bev_camera(
    road_map: RoadMap, signal: Signal, approaches: Sequence[Approach], width: int, height: int
) -> Camera:
    """Hang a camera straight above, turned and raised so that the junction and its queues just fit."""
    points = [line[-1] for approach in approaches for line in approach.lines]
    points += [_before_end(line, QUEUE_IN_VIEW) for approach in approaches for line in approach.lines]
    points += [
        corner
        for junction in road_map.junctions
        if junction.id in signal.junctions
        for corner in junction.polygon
    ]
    places = np.array(points)
    low, high = places.min(axis=0), places.max(axis=0)
    middle = (low + high) / 2
    slope = tan(radians(BEV_FIELD_OF_VIEW_DEG) / 2)
    need = max((high[0] - low[0]) / 2 / slope, (high[1] - low[1]) / 2 / (slope * height / width))
    above = min(_HIGHEST, 1.08 * need + 4.0)
    return Camera(
        name=BEV,
        position=(round(float(middle[0]), 3), round(float(middle[1]), 3), round(float(high[2]) + above, 3)),
        heading_deg=90.0,
        pitch_deg=-90.0,
        field_of_view_deg=BEV_FIELD_OF_VIEW_DEG,
        width=width,
        height=height,
        far=max(400.0, 2 * above),
    )
