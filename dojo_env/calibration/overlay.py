"""The map drawn over a photograph: lanes, stop lines and crossings as a camera sees them, and the points."""

import cv2
import numpy as np
from numpy.typing import NDArray

from dojo_env.calibration.fitting import find_seen
from dojo_env.camera import Camera
from dojo_maps.description import Lane, LaneKind, RoadMap

Floats = NDArray[np.float64]
Image = NDArray[np.uint8]
Colour = tuple[int, int, int]

_LANE, _CENTRE, _STOP, _CROSSING = (255, 214, 60), (90, 200, 255), (255, 70, 60), (120, 240, 140)
_MARKED, _PROJECTED = (255, 60, 200), (255, 255, 255)
_REACH = 150.0
"""Metres from the camera beyond which nothing is drawn."""
_STEP = 0.5
"""Metres; lines are drawn in pieces as short, for lenses bend them."""
_FIXED = 4
"""Bits of a pixel's fraction that OpenCV draws with."""
_DRIVEN = (LaneKind.DRIVING, LaneKind.BUS, LaneKind.BICYCLE, LaneKind.OTHER)


def draw_overlay(
    picture: Image,
    camera: Camera,
    road_map: RoadMap,
    *,
    pixels: Floats | None = None,
    places: Floats | None = None,
) -> Image:
    """Draw what a map says over what a camera sees; nothing is hidden behind anything.

    Args:
        picture: (h, w, 3) uint8 RGB, of the camera.
        camera: that took it.
        road_map: the map.
        pixels: (n, 2) control points as they were marked.
        places: (n, 3) metres, their places on the map.

    Returns:
        A copy of the picture with lanes in yellow, their middles in blue, stop lines in red, crossings in
        green; control points as rings, and crosses where the camera sees them.
    """
    drawn = picture.copy()
    width = max(1, round(picture.shape[1] / 900))
    for lane in road_map.lanes:
        if lane.kind in _DRIVEN and _is_near(lane.shape, camera):
            _draw_lane(drawn, camera, lane, width)
    for crossing in road_map.crossings:
        if _is_near(crossing.polygon, camera):
            ring = np.vstack([crossing.polygon, crossing.polygon[:1]])
            _draw_line(drawn, camera, ring, _CROSSING, width)
    for line in road_map.stop_lines:
        if _is_near(line.shape, camera):
            _draw_line(drawn, camera, line.shape, _STOP, 2 * width)
    if pixels is not None and places is not None:
        _draw_points(drawn, pixels, camera.project(places)[0], width)
    return drawn


def _is_near(line: Floats, camera: Camera) -> bool:
    return bool((np.hypot(*(line[:, :2] - camera.position[:2]).T) < 10 * _REACH).any())


def _draw_lane(drawn: Image, camera: Camera, lane: Lane, width: int) -> None:
    line = _divided(lane.shape)
    if len(line) < 2:
        return
    ways = np.gradient(line[:, :2], axis=0)
    ways /= np.maximum(np.hypot(*ways.T), 1e-9)[:, None]
    left = np.column_stack([-ways[:, 1], ways[:, 0], np.zeros(len(ways))])
    for side in (0.5, -0.5):
        _draw_line(drawn, camera, line + side * lane.width * left, _LANE, width)
    _draw_line(drawn, camera, line, _CENTRE, 1)


def _draw_line(drawn: Image, camera: Camera, line: Floats, colour: Colour, width: int) -> None:
    line = _divided(line)
    pixels, seen = find_seen(camera, line, -50.0)
    seen &= np.hypot(*(line[:, :2] - camera.position[:2]).T) < _REACH
    ends = np.flatnonzero(np.diff(np.concatenate([[0], seen.astype(np.int8), [0]])))
    for start, end in ends.reshape(-1, 2).tolist():
        run = _fixed(pixels[start:end])
        cv2.polylines(drawn, [run], False, colour, width, cv2.LINE_AA, _FIXED)


def _divided(line: Floats) -> Floats:
    """Divide a line into pieces of at most `_STEP` metres."""
    lengths = np.linalg.norm(np.diff(line, axis=0), axis=1)
    along = np.append(0.0, np.cumsum(lengths))
    at = np.union1d(along, np.arange(0.0, along[-1], _STEP))
    return np.column_stack([np.interp(at, along, line[:, axis]) for axis in range(3)])


def _draw_points(drawn: Image, marked: Floats, seen: Floats, width: int) -> None:
    for number, (at, there) in enumerate(zip(marked, seen, strict=True), 1):
        ring = _fixed(at)
        cv2.circle(drawn, ring.tolist(), (6 * width) << _FIXED, _MARKED, width, cv2.LINE_AA, _FIXED)
        cv2.putText(
            drawn,
            str(number),
            (int(at[0]) + 8 * width, int(at[1]) - 8 * width),
            cv2.FONT_HERSHEY_SIMPLEX,
            0.5 * width,
            _MARKED,
            width,
            cv2.LINE_AA,
        )
        if np.isfinite(there).all() and np.abs(there).max() < 1e5:
            for way in ((1, 1), (1, -1)):
                reach = 5.0 * width * np.array(way)
                cv2.line(
                    drawn,
                    _fixed(there - reach).tolist(),
                    _fixed(there + reach).tolist(),
                    _PROJECTED,
                    1,
                    cv2.LINE_AA,
                    _FIXED,
                )


def _fixed(pixels: Floats) -> NDArray[np.int32]:
    """Bring pixels whose first covers 0 to 1 into OpenCV's, whose first is centred on 0, as fixed numbers."""
    return np.rint((pixels - 0.5) * (1 << _FIXED)).astype(np.int32)
