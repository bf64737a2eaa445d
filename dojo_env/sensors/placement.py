"""Where cameras hang, from the map alone: one per approach of a signal, and one straight above it.

A preset says where a camera should hang. Where something stands before it there, other places are tried,
nearer ones first, and the first is taken that sees the approach, or else the one that sees most of it.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from math import atan2, cos, degrees, radians, sin, tan

import numpy as np
from numpy.typing import NDArray

from dojo_env.camera import BEV, Camera
from dojo_env.camera_presets import PAPER, CameraPreset, find_preset
from dojo_env.errors import ConfigError
from dojo_env.rendering.raster import draw_mesh
from dojo_env.rendering.scene import Scene
from dojo_env.rendering.view import view_of
from dojo_maps.description import Lane, LaneKind, LinkKind, RoadMap, Signal
from dojo_maps.index import MapIndex

Floats = NDArray[np.float64]

BEV_FIELD_OF_VIEW_DEG = 60.0
QUEUE_IN_VIEW = 75.0
"""Metres of queue before each stop line that a bird's eye view holds, where the road is that long."""
_INNER_ROAD = 25.0
"""Shorter roads between two junctions of one signal are part of its middle, not an approach, metres."""
_AHEAD, _FAR_AHEAD = (0.0, 1.5, -1.5, 3.0, 5.0, 7.0, 10.0), (-8.0, -14.0)
_ASIDE, _FAR_ASIDE = (0.0, 1.5, -1.5, 3.0, -3.0, 5.0, -5.0), (8.0, -8.0)
"""Metres along and across the approach from where a camera should hang, tried in this order."""
_LEAST_AHEAD = 2.5
_POST_AHEAD = (0.0, -1.5, 1.5, -3.0, 3.0, -5.0, 5.0, -8.0, 8.0, 11.0, 14.0, 17.0, 20.0, 24.0, 28.0)
_POST_ASIDE = (0.0, 1.0, 2.0, 3.5, 5.0)
"""The same for posts, across away from the road: where nobody drives, if need be across the junction."""
_POST_CLEARANCE = 2.2
"""Metres from a post to the centre of every lane and of every way across the junction."""
_AIM = 20.0
"""Metres before the stop line; cameras that hang aside turn to this place."""
_PROBE_STEP = 2.5
_PROBE_HEIGHT = 0.7
_PROBE_SIZE = (64, 89)
_SEEN_ENOUGH, _WORTH_MOVING = 0.98, 0.02
"""Shares of the lanes in view that end the search, and that make another place better."""
_NEAR, _SEEN_FAR = len(_AHEAD) * len(_ASIDE), 0.9
"""So many places are tried for all of the view; those after them only where much less of it is free."""
_DISTORTED_FIELD_DEG = 40.0
"""How much more than a pinhole of its nominal field of view a lens that bends may see."""
_LINE_LENGTH = 100.0
"""Metres before the stop line to which lanes are followed backwards."""
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

    Args:
        road_map: the map.
        signal: one of the map's.

    Returns:
        One for each road with lanes that vehicles drive up to it on; empty where there is none.
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
    feeders = find_feeders(road_map)
    found = [
        _approach(road, sorted(held.values(), key=lambda lane: lane.index), lanes, feeders)
        for road, held in stops.items()
        if road not in inner or len(inner) == len(stops)
    ]
    if not found:
        return ()
    middle = np.mean([approach.stop[:2] for approach in found], axis=0)
    return tuple(sorted(found, key=lambda a: ((atan2(*(a.stop[:2] - middle)) + 1e-6) % (2 * np.pi), a.road)))


def place_cameras(
    scene: Scene, signal_id: str, *, preset: str = PAPER, width: int = 356, height: int = 256
) -> tuple[Camera, ...]:
    """Place one camera per approach of a signal and, last, one straight above it named `bev`.

    The approach cameras are named `approach_0` and so on, in the order of `find_approaches`, and look at the
    lanes that come in.

    Args:
        scene: the static world.
        signal_id: the signal.
        preset: how the approach cameras hang, a name of `CAMERA_PRESETS`.
        width: pixels.
        height: pixels.

    Returns:
        The cameras, in this order.

    Raises:
        ConfigError: the map has no such signal, no vehicles drive up to it, or there is no such preset.
    """
    mount = find_preset(preset)
    signal = find_signal(scene.road_map, signal_id)
    approaches = find_approaches(scene.road_map, signal)
    if not approaches:
        raise ConfigError(f"signal {signal_id!r}: no lane leads to it, so no camera can look at one")
    cameras = [
        replace(_approach_camera(scene, approach, mount, width, height), name=f"approach_{k}")
        for k, approach in enumerate(approaches)
    ]
    return (*cameras, _bev_camera(scene.road_map, signal, approaches, width, height))


def find_signal(road_map: RoadMap, signal_id: str) -> Signal:
    """Look a signal up.

    Args:
        road_map: the map.
        signal_id: the signal.

    Returns:
        The signal.

    Raises:
        ConfigError: the map has no such signal.
    """
    for signal in road_map.signals:
        if signal.id == signal_id:
            return signal
    known = ", ".join(signal.id for signal in road_map.signals[:10]) or "none"
    raise ConfigError(f"{road_map.name}: no signal {signal_id!r}; it has {known}")


def find_feeders(road_map: RoadMap) -> dict[str, str]:
    """For each lane, find the lane that leads straight into it.

    Args:
        road_map: the map.

    Returns:
        Ids of these lanes by the id of the lane that they lead into, the first one where there are several;
        lanes without one are left out.
    """
    straight = [c for c in road_map.connections if c.direction in ("s", "S")]
    return {c.to_lane: c.from_lane for c in reversed(straight)}


def _approach(road: str, held: Sequence[Lane], lanes: dict[str, Lane], feeders: dict[str, str]) -> Approach:
    lines = []
    for lane in held:
        line, last = lane.shape, lane.id
        for _ in range(8):
            length = float(np.hypot(*np.diff(line[:, :2], axis=0).T).sum())
            last = feeders.get(last, "")
            if length >= _LINE_LENGTH or last not in lanes:
                break
            line = np.vstack([lanes[last].shape, line])
        lines.append(np.array(line))
    stop = np.mean([line[-1] for line in lines], axis=0)
    back = np.mean([point_before_end(line, 25.0) for line in lines], axis=0)
    heading = atan2(stop[1] - back[1], stop[0] - back[0])
    return Approach(
        road=road, lanes=tuple(lane.id for lane in held), stop=stop, heading=heading, lines=tuple(lines)
    )


def point_before_end(line: Floats, distance: float) -> Floats:
    """Find the point of a line some way before its end, or its start.

    Args:
        line: (n, 3) metres, n >= 2.
        distance: metres before the end, along the line and on the level; where the line is shorter, its start
            is taken.

    Returns:
        (3,) metres, between the line's own points.
    """
    along = np.append(0.0, np.cumsum(np.hypot(*np.diff(line[:, :2], axis=0).T)))
    at = max(0.0, along[-1] - distance)
    return np.array([np.interp(at, along, line[:, axis]) for axis in range(3)])


def _approach_camera(
    scene: Scene, approach: Approach, preset: CameraPreset, width: int, height: int
) -> Camera:
    """Hang a camera ahead of the stop line, looking back along the lanes, where the view is free."""
    probes = np.concatenate(
        [
            [point_before_end(line, distance) for line in approach.lines]
            for distance in np.arange(0.0, preset.reach, _PROBE_STEP)
        ]
    ) + np.array([0.0, 0.0, _PROBE_HEIGHT])
    candidates = (
        Camera(
            name=approach.road,
            position=place,
            heading_deg=heading,
            pitch_deg=preset.pitch_deg,
            field_of_view_deg=preset.field_of_view_deg,
            distortion=preset.distortion,
            width=width,
            height=height,
        )
        for place, heading in _places(scene.road_map, approach, preset)
    )
    best = next(candidates)
    free = _share(_find_inside(_small(best), probes)[0])
    most = _share(find_seen(scene, _small(best), probes))
    for tried, camera in enumerate(candidates, start=1):
        if most >= free * (_SEEN_ENOUGH if tried < _NEAR else _SEEN_FAR):
            break
        seen = _share(find_seen(scene, _small(camera), probes))
        if seen > most + _WORTH_MOVING:
            best, most = camera, seen
    return best


def _places(
    road_map: RoadMap, approach: Approach, preset: CameraPreset
) -> Iterator[tuple[tuple[float, float, float], float]]:
    """List where a camera may hang, and its heading there in degrees, the best place first."""
    ahead = np.array([cos(approach.heading), sin(approach.heading)])
    left = np.array([-ahead[1], ahead[0]])
    for forward, aside in _shifts(road_map, approach, preset, ahead, left):
        x, y = approach.stop[:2] + forward * ahead + aside * left
        turn = atan2(aside, forward + _AIM)
        place = (float(x), float(y), float(approach.stop[2]) + preset.height)
        heading = round((degrees(approach.heading + turn) + 180.0) % 360.0, 3)
        yield (round(place[0], 3), round(place[1], 3), round(place[2], 3)), heading


def _shifts(
    road_map: RoadMap, approach: Approach, preset: CameraPreset, ahead: Floats, left: Floats
) -> Iterator[tuple[float, float]]:
    """List metres ahead of the middle of the stop line, and to its left."""
    if preset.beside is None:
        yield from ((preset.ahead + forward, aside) for forward in _AHEAD for aside in _ASIDE)
        yield from ((preset.ahead + forward, aside) for forward in _AHEAD for aside in _FAR_ASIDE)
        nearer = [preset.ahead + forward for forward in _FAR_AHEAD]
        far = (*_ASIDE, *_FAR_ASIDE)
        yield from ((forward, aside) for forward in nearer if forward > _LEAST_AHEAD for aside in far)
        return
    lanes = MapIndex(road_map).lanes
    side = 1.0 if road_map.left_hand else -1.0
    kerb = max(
        side * float((line[-1] - approach.stop)[:2] @ left) + lanes[lane].width / 2
        for lane, line in zip(approach.lanes, approach.lines, strict=True)
    )
    driven = _driven(road_map)
    shifts = [
        (preset.ahead + forward, side * (kerb + preset.beside + aside))
        for forward in _POST_AHEAD
        for aside in _POST_ASIDE
    ]
    free = [
        (forward, aside)
        for forward, aside in shifts
        if _distance(approach.stop[:2] + forward * ahead + aside * left, driven) >= _POST_CLEARANCE
    ]
    yield from free or shifts[:1]


def _driven(road_map: RoadMap) -> Floats:
    """List where something drives: (n, 2, 2) ends of pieces of centre lines."""
    walked = (LaneKind.SIDEWALK, LaneKind.SHOULDER)
    lines = [lane.shape[:, :2] for lane in road_map.lanes if lane.kind not in walked]
    lines += [connection.shape[:, :2] for connection in road_map.connections]
    return np.concatenate([np.stack([line[:-1], line[1:]], axis=1) for line in lines])


def _distance(place: Floats, pieces: Floats) -> float:
    """Measure how far a place is from the nearest of some pieces of lines."""
    starts, along = pieces[:, 0], pieces[:, 1] - pieces[:, 0]
    share = ((place - starts) * along).sum(axis=1) / np.maximum((along**2).sum(axis=1), 1e-12)
    nearest = starts + np.clip(share, 0.0, 1.0)[:, None] * along
    return float(np.hypot(*(place - nearest).T).min())


def find_seen(scene: Scene, camera: Camera, points: Floats) -> NDArray[np.bool_]:
    """Tell which points a camera sees, with nothing static in front.

    Args:
        scene: the static world.
        camera: the camera; depths are compared at its own pixels.
        points: (n, 3) metres, map frame.

    Returns:
        (n,) whether each is in the picture, and at most a metre behind what is seen there.
    """
    inside, _, _ = _find_inside(camera, points)
    straight = camera
    if camera.distortion:
        wide = min(150.0, camera.field_of_view_deg + _DISTORTED_FIELD_DEG)
        straight = replace(camera, distortion=(), field_of_view_deg=wide)
    within, pixels, distance = _find_inside(straight, points)
    view = view_of(straight, scene.origin)
    depths = np.zeros((view.height, view.width), dtype=np.float32)
    tags = np.full((view.height, view.width), -1, dtype=np.int32)
    draw_mesh(scene.vertices, scene.faces, view.axes, view.eye, view.lens, depths, tags)
    seen = inside & within
    columns, rows = np.floor(pixels[seen]).astype(int).T
    seen[seen] = 1 / np.maximum(depths[rows, columns], 1e-6) > distance[seen] - 1.0
    return seen


def _find_inside(camera: Camera, points: Floats) -> tuple[NDArray[np.bool_], Floats, Floats]:
    """Tell which points fall into a picture: (n,), their pixels (n, 2) and their distances (n,)."""
    pixels, distance = camera.project(points)
    size = [camera.width, camera.height]
    return (distance > camera.near) & (pixels > 0).all(axis=1) & (pixels < size).all(axis=1), pixels, distance


def _small(camera: Camera) -> Camera:
    """Look through a camera at few pixels, the same whatever its own size."""
    height, width = _PROBE_SIZE
    return replace(camera, width=width, height=height)


def _share(seen: NDArray[np.bool_]) -> float:
    return float(seen.sum() / len(seen))


def _bev_camera(
    road_map: RoadMap, signal: Signal, approaches: Sequence[Approach], width: int, height: int
) -> Camera:
    """Hang a camera straight above, turned and raised so that the junction and its queues just fit."""
    points = [line[-1] for approach in approaches for line in approach.lines]
    points += [point_before_end(line, QUEUE_IN_VIEW) for approach in approaches for line in approach.lines]
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
