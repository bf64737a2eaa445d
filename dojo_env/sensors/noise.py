"""What cameras deliver of perfect pictures: what weather, lens, sensor and compression do to them, seeded."""

from collections import defaultdict
from collections.abc import Callable
from dataclasses import replace
from math import exp, log2

import cv2
import numpy as np
from numpy.typing import NDArray

from dojo_env.camera import Camera
from dojo_env.conditions import Conditions
from dojo_env.imaging import Imaging
from dojo_env.rendering.lighting import compute_light
from dojo_env.rendering.scene import Scene
from dojo_env.sensors.h264 import Stream
from dojo_env.sensors.mounts import random_of
from dojo_env.sensors.optics import darken_corners, dim, draw_rain, refract, scatter_dirt, scatter_sun
from dojo_env.sensors.pixels import Light, Picture, add_grain, add_noise, to_light, to_picture

_GREY = 0.18
"""Mean of the linear light that automatic exposure wants: what a grey card reflects."""
_MOST_STOPS = 4.0
_DARKEST = 1e-4
_LEVELS = 255.0
_REC_709 = (0.2126, 0.7152, 0.0722)
"""How bright red, green and blue light are. Source: ITU-R BT.709."""


class Lens:
    """Spoils the pictures of one episode.

    Keeps of each camera the last picture, for frames that are dropped, the exposure and the stream.
    """

    def __init__(
        self, conditions: Conditions, imaging: Imaging | None = None, scene: Scene | None = None
    ) -> None:
        """Take an episode's conditions and the camera body.

        Args:
            conditions: of these only what happens at the lens; light and weather are the renderer's.
            imaging: how cameras work; None for perfect ones.
            scene: what may hide the sun from a camera; None for an open sky.
        """
        self._conditions, self._imaging, self._scene = conditions, imaging or Imaging(), scene
        self._light = compute_light(replace(conditions, exposure=0.0))
        self._night = min(1.0, self._light.headlights)
        self._last: dict[str, Picture] = {}
        self._stops: dict[str, tuple[float, float]] = {}
        self._streams = defaultdict[str, Stream](lambda: Stream(self._imaging.h264_kbps))
        self._layers: dict[tuple[str, str, int, int], NDArray[np.float32]] = {}

    def spoil(self, rgb: Picture, camera: Camera, time: float) -> Picture:
        """Make of a perfect picture the one that this camera delivers.

        Args:
            rgb: (h, w, 3).
            camera: whose it is.
            time: simulated seconds; with the camera's name and the seed it decides everything random.

        Returns:
            (h, w, 3), a new picture, or the last one again where a frame is dropped.
        """
        state = self._conditions
        random = random_of(state, camera.name, time, "frame")
        if camera.name in self._last and random.random() < state.dropped:
            return self._last[camera.name].copy()
        rgb = self._look_out(rgb, camera, time, random)
        if self._imaging.changes_light:
            rgb = to_picture(self._record(to_light(rgb), camera, time))
        if state.noise > 0:
            rgb = add_noise(rgb, random, state.noise)
        if self._imaging.jpeg_quality >= 1:
            rgb = _compress(rgb, round(self._imaging.jpeg_quality))
        if self._imaging.h264_kbps >= 1:
            rgb = self._streams[camera.name].compress(rgb)
        self._last[camera.name] = rgb.copy()
        return rgb

    def _look_out(self, rgb: Picture, camera: Camera, time: float, random: np.random.Generator) -> Picture:
        """Look through the rain, and what it and the road leave on the lens."""
        state, (height, width) = self._conditions, rgb.shape[:2]
        if state.rain > 0:
            rgb = draw_rain(rgb, state.rain, random)
        if state.drops > 0:
            rgb = refract(rgb, state.drops, time, random_of(state, camera.name, 0.0, "drops"))
        if state.dirt > 0:
            own = random_of(state, camera.name, 0.0, "dirt")
            rgb = dim(rgb, self._layer("dirt", camera, lambda: scatter_dirt(height, width, state.dirt, own)))
        if state.blur > 0:
            rgb = np.asarray(cv2.GaussianBlur(rgb, (0, 0), state.blur), dtype=np.uint8)
        return rgb

    def _record(self, light: Light, camera: Camera, time: float) -> Light:
        """Let light through the lens onto a sensor; (h, w, 3) is changed in place."""
        body = self._imaging
        if body.glare > 0:
            stray = self._layer("glare", camera, lambda: scatter_sun(camera, self._light, self._scene))
            light += np.float32(body.glare) * stray
        if body.vignetting > 0:
            light *= self._layer("vignetting", camera, lambda: darken_corners(camera, body.vignetting))
        gain = 1.0
        if body.auto_exposure > 0:
            gain = 2.0 ** self._expose(light, camera.name, time)
            light *= np.float32(gain)
        if body.shot_noise > 0 or body.read_noise > 0:
            gain *= body.night_gain**self._night
            random = random_of(self._conditions, camera.name, time, "sensor")
            shot, read = (body.shot_noise / _LEVELS) ** 2 * gain, (body.read_noise / _LEVELS * gain) ** 2
            add_grain(light, random, shot, read)
        return light

    def _expose(self, light: Light, camera: str, time: float) -> float:
        """Follow the mean light of a camera's pictures, the first one at once; returns stops."""
        body = self._imaging
        mean = float(np.dot(cv2.mean(light)[:3], _REC_709))
        wanted = body.auto_exposure * log2(_GREY / max(mean, _DARKEST))
        wanted = min(_MOST_STOPS, max(-_MOST_STOPS, wanted))
        before, stops = self._stops.get(camera, (time, wanted))
        passed = max(0.0, time - before)
        left = exp(-passed / body.adaptation_s) if body.adaptation_s > 0 else 0.0
        stops = wanted + (stops - wanted) * left
        self._stops[camera] = (time, stops)
        return stops

    def _layer(
        self, what: str, camera: Camera, make: Callable[[], NDArray[np.float32]]
    ) -> NDArray[np.float32]:
        """Give what stays the same in all pictures of a camera."""
        key = (what, camera.name, camera.height, camera.width)
        if key not in self._layers:
            self._layers[key] = make()
        return self._layers[key]


def _compress(rgb: Picture, quality: int) -> Picture:
    """Compress a picture as JPEG, and unpack it again."""
    blue_first = cv2.cvtColor(rgb, cv2.COLOR_RGB2BGR)
    _, packed = cv2.imencode(".jpg", blue_first, [cv2.IMWRITE_JPEG_QUALITY, quality])
    unpacked = np.asarray(cv2.imdecode(packed, cv2.IMREAD_COLOR))
    return np.asarray(cv2.cvtColor(unpacked, cv2.COLOR_BGR2RGB), dtype=np.uint8)
