"""What cameras add to a picture: shaken mounts, rain, dirt, blur, noise and dropped frames, all seeded."""

from collections.abc import Iterable
from dataclasses import replace
from zlib import crc32

import cv2
import numpy as np
from numpy.typing import NDArray

from dojo_env.camera import Camera
from dojo_env.conditions import Conditions

Picture = NDArray[np.uint8]

_SPOTS = 60
"""Spots of dirt on a very dirty lens."""
_STREAKS = 90
"""Streaks of heavy rain in a picture of 100,000 pixels."""


def shake_cameras(cameras: Iterable[Camera], conditions: Conditions) -> tuple[Camera, ...]:
    """Move and turn each camera a little, as a mount that was set up by hand; one draw per seed and name."""
    return tuple(_shaken(camera, conditions) for camera in cameras)


def _shaken(camera: Camera, conditions: Conditions) -> Camera:
    if conditions.shake_m == 0 and conditions.shake_deg == 0:
        return camera
    generator = _generator(conditions, camera.name, 0.0, "shake")
    x, y, z = np.array(camera.position) + generator.normal(0.0, conditions.shake_m, 3)
    heading, pitch, roll = generator.normal(0.0, conditions.shake_deg, 3)
    return replace(
        camera,
        position=(float(x), float(y), float(z)),
        heading_deg=camera.heading_deg + float(heading),
        pitch_deg=camera.pitch_deg + float(pitch),
        roll_deg=camera.roll_deg + float(roll),
    )


class Lens:
    """Spoils the pictures of one episode. Keeps each camera's last picture, for frames that are dropped."""

    def __init__(self, conditions: Conditions) -> None:
        """Take the conditions of an episode; what they say of light and weather belongs to the renderer."""
        self._conditions = conditions
        self._last: dict[str, Picture] = {}
        self._dirt: dict[tuple[str, int, int], NDArray[np.float32]] = {}

    def spoil(self, rgb: Picture, camera: str, time: float) -> Picture:
        """Make of a perfect picture the one that this camera delivers.

        Args:
            rgb: (h, w, 3).
            camera: its name.
            time: simulated seconds; together with the name and the seed it decides everything random.

        Returns:
            (h, w, 3), a new picture, or the last one again where a frame is dropped.
        """
        state = self._conditions
        generator = _generator(state, camera, time, "frame")
        if camera in self._last and generator.random() < state.dropped:
            return self._last[camera].copy()
        if state.rain > 0:
            rgb = _rained(rgb, state.rain, generator)
        if state.dirt > 0:
            rgb = _dimmed(rgb, self._dirt_on(camera, rgb.shape[0], rgb.shape[1]))
        if state.blur > 0:
            rgb = np.asarray(cv2.GaussianBlur(rgb, (0, 0), state.blur), dtype=np.uint8)
        if state.noise > 0:
            grain = generator.normal(0.0, state.noise, rgb.shape).astype(np.float32)
            rgb = np.clip(np.rint(rgb + grain), 0, 255).astype(np.uint8)
        self._last[camera] = rgb.copy()
        return rgb

    def _dirt_on(self, camera: str, height: int, width: int) -> NDArray[np.float32]:
        """Transparency of the dirt on a lens: (h, w), 1 where it is clean."""
        key = (camera, height, width)
        if key not in self._dirt:
            generator = _generator(self._conditions, camera, 0.0, "dirt")
            spots = np.zeros((height, width), dtype=np.float32)
            for _ in range(round(_SPOTS * self._conditions.dirt)):
                centre = (int(generator.integers(width)), int(generator.integers(height)))
                radius = int(height * generator.uniform(0.01, 0.05)) + 1
                cv2.circle(spots, centre, radius, float(generator.uniform(0.3, 0.9)), -1)
            soft = cv2.GaussianBlur(spots, (0, 0), height * 0.012)
            self._dirt[key] = np.asarray(1 - soft, dtype=np.float32)
        return self._dirt[key]


def _dimmed(rgb: Picture, clean: NDArray[np.float32]) -> Picture:
    mud = np.array([70.0, 62.0, 50.0], dtype=np.float32)
    return np.rint(rgb * clean[..., None] + mud * (1 - clean[..., None])).astype(np.uint8)


def _rained(rgb: Picture, rain: float, generator: np.random.Generator) -> Picture:
    """Draw falling drops as short slanted streaks."""
    height, width = rgb.shape[:2]
    streaks = np.zeros((height, width), dtype=np.uint8)
    count = round(rain * _STREAKS * height * width / 1e5)
    starts = generator.integers(0, [width, height], (count, 2))
    lengths = generator.uniform(0.02, 0.06, count) * height
    for (x, y), length in zip(starts.tolist(), lengths.tolist(), strict=True):
        cv2.line(streaks, (x, y), (round(x + 0.15 * length), round(y + length)), 90, 1, cv2.LINE_AA)
    veil = streaks[..., None].astype(np.float32) / 255 * 0.5
    return np.rint(rgb * (1 - veil) + 205.0 * veil).astype(np.uint8)


def _generator(conditions: Conditions, camera: str, time: float, purpose: str) -> np.random.Generator:
    """Make a generator that depends on nothing but its arguments."""
    instant = int(np.float64(time).view(np.uint64))
    return np.random.default_rng([conditions.seed, crc32(camera.encode()), instant, crc32(purpose.encode())])
