"""What moves while a shutter is open: motion blur, and rolling shutters that expose row after row.

A picture is the mean of several instants, for which road users are moved along their headings. Each row
takes those of its own exposure, all around the time of the snapshot, so depth, classes and boxes are those
of the middle.
"""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from dojo_env.camera import Camera
from dojo_env.imaging import Imaging
from dojo_env.rendering.outputs import Picture
from dojo_env.sensors.pixels import add_exposure, to_picture
from dojo_env.snapshot import Snapshot

_STEP = 1.5
"""Pixels that something may move from one instant to the next."""
_MOST_INSTANTS = 16
_SLOWEST = 0.05
"""Slower road users stand still, m/s."""


def expose(
    draw: Callable[[Snapshot, Camera], NDArray[np.uint8]],
    snapshot: Snapshot,
    picture: Picture,
    imaging: Imaging,
) -> Picture:
    """Keep the shutter open around an instant.

    Args:
        draw: gives the colours, (h, w, 3), that a camera sees of an instant.
        snapshot: the middle of the exposure.
        picture: of that instant, with its colours.
        imaging: says how long.

    Returns:
        The picture with other colours, or itself where nothing moves as much as a pixel.
    """
    camera = picture.camera
    duration = imaging.shutter_s + imaging.readout_s
    count = min(_MOST_INSTANTS, int(np.ceil(_count_pixels(snapshot, camera, duration) / _STEP)))
    if count < 2:
        return picture
    shares = _share_instants(imaging, camera.height, count)
    total = np.zeros((camera.height, camera.width, 3), dtype=np.float32)
    for k in range(count):
        moved = _move(snapshot, ((k + 0.5) / count - 0.5) * duration)
        add_exposure(total, draw(moved, camera), shares[k])
    return replace(picture, outputs={**picture.outputs, "rgb": to_picture(total)})


def _share_instants(imaging: Imaging, height: int, count: int) -> NDArray[np.float32]:
    """Tell how much of each row's exposure falls on each instant: (count, height)."""
    duration = imaging.shutter_s + imaging.readout_s
    each = duration / count
    rows = ((np.arange(height) + 0.5) / height - 0.5) * imaging.readout_s
    instants = (np.arange(count) - count / 2) * each
    # A shorter exposure than the time between two instants would fall between them.
    reach = max(imaging.shutter_s, each) / 2
    begins = np.maximum(rows[:, None] - reach, instants)
    ends = np.minimum(rows[:, None] + reach, instants + each)
    shares = np.maximum(0.0, ends - begins)
    return np.ascontiguousarray((shares / shares.sum(axis=1, keepdims=True)).T, dtype=np.float32)


def _velocities(snapshot: Snapshot) -> NDArray[np.float64]:
    """(n, 3) m/s, map frame."""
    level = np.cos(snapshot.slopes)
    ahead = [level * np.cos(snapshot.headings), level * np.sin(snapshot.headings), np.sin(snapshot.slopes)]
    return np.column_stack(ahead) * snapshot.speeds[:, None]


def _move(snapshot: Snapshot, seconds: float) -> Snapshot:
    positions = snapshot.positions + _velocities(snapshot) * seconds
    return Snapshot.trusted(**{**snapshot.__getstate__(), "positions": positions})


def _count_pixels(snapshot: Snapshot, camera: Camera, duration: float) -> float:
    """Measure how far the fastest road user in the picture moves in it."""
    moving = snapshot.speeds > _SLOWEST
    velocities = _velocities(snapshot)[moving]
    noses = snapshot.positions[moving]
    tails = noses - velocities * (snapshot.sizes[moving, 0] / snapshot.speeds[moving])[:, None]
    places, shift = np.concatenate([noses, tails]), np.tile(velocities, (2, 1)) * (duration / 2)
    (before, near), (after, far) = camera.project(places - shift), camera.project(places + shift)
    size = np.array([camera.width, camera.height])
    middle = (before + after) / 2
    # nan, behind the camera, is in no picture.
    inside = (np.minimum(near, far) > camera.near) & (np.abs(middle - size / 2) < 0.75 * size).all(axis=1)
    return float(np.hypot(*(after - before)[inside].T).max(initial=0.0))
