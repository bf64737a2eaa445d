"""The renderer: a snapshot through cameras. The static world comes from a cache; only what moves is drawn."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dojo_env.conditions import Conditions
from dojo_env.errors import ConfigError
from dojo_env.rendering.background import SAMPLES, Background
from dojo_env.rendering.boxes import Boxes, measure_boxes
from dojo_env.rendering.classes import SEMANTIC_OF_KIND, Semantic
from dojo_env.rendering.compiling import kernel
from dojo_env.rendering.eye import Eye, open_eye
from dojo_env.rendering.lighting import compute_light
from dojo_env.rendering.lights import LAMP, LIGHT_STEPS
from dojo_env.rendering.raster import SHADED, STATIC
from dojo_env.rendering.scene import NO_PATHS, Scene, SignalFaces
from dojo_env.rendering.target import Target
from dojo_env.rendering.traffic import Users, place_users
from dojo_env.sensors.camera import Camera
from dojo_env.snapshot import Snapshot

OUTPUTS = ("rgb", "depth", "semantic", "instance", "boxes")


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Picture:
    """What a camera saw; outputs that were not asked for are None.

    Attributes:
        camera: the camera.
        rgb: (h, w, 3) uint8, sRGB.
        depth: (h, w) float32, metres along the camera's axis; the camera's `far` where there is only sky.
        semantic: (h, w) uint8, `Semantic`.
        instance: (h, w) int32, the road user's number in the snapshot, 0 where there is none.
        boxes: the road users in view.
    """

    camera: Camera
    rgb: NDArray[np.uint8] | None = None
    depth: NDArray[np.float32] | None = None
    semantic: NDArray[np.uint8] | None = None
    instance: NDArray[np.int32] | None = None
    boxes: Boxes | None = None


class Renderer:
    """Draws snapshots of one scene under one state of light and weather."""

    def __init__(
        self,
        scene: Scene,
        *,
        conditions: Conditions | None = None,
        smooth: bool = False,
        show_links: bool = False,
    ) -> None:
        """Prepare to draw.

        Args:
            scene: the static world.
            conditions: light and weather; what they say of lenses belongs to `sensors.noise`.
            smooth: anti-alias what moves, too; costs a few times as much.
            show_links: draw each signal link's path as a green, yellow or red line, as the paper does.
        """
        self.scene = scene
        self.smooth = smooth
        self.show_links = show_links
        self._light = compute_light(conditions or Conditions())
        self._faces = SignalFaces(scene)
        self._eyes: dict[tuple[Camera, int], Eye] = {}

    def render(
        self, snapshot: Snapshot, cameras: Iterable[Camera], outputs: Sequence[str] = ("rgb",)
    ) -> tuple[Picture, ...]:
        """Draw one instant through each camera.

        Args:
            snapshot: the instant.
            cameras: one picture each, in this order.
            outputs: which of `rgb`, `depth`, `semantic`, `instance`, `boxes` to make.

        Raises:
            ConfigError: an output has no such name.
        """
        wanted = frozenset(outputs)
        if unknown := wanted - set(OUTPUTS):
            raise ConfigError(f"no output {sorted(unknown)}; choose from {', '.join(OUTPUTS)}")
        users = place_users(snapshot, self.scene.origin)
        return tuple(self._picture(snapshot, users, camera, wanted) for camera in cameras)

    def forget(self, cameras: Iterable[Camera] | None = None) -> None:
        """Drop the backgrounds of cameras that are no longer used; of all if none are named."""
        gone = None if cameras is None else set(cameras)
        for key in [key for key in self._eyes if gone is None or key[0] in gone]:
            del self._eyes[key]

    def close(self) -> None:
        """Forget every background; the renderer may still be used."""
        self.forget()

    def _picture(self, snapshot: Snapshot, users: Users, camera: Camera, wanted: frozenset[str]) -> Picture:
        made: dict[str, Any] = {}
        if "rgb" in wanted and self.smooth:
            eye, target = self._draw(snapshot, users, camera, SAMPLES)
            made["rgb"] = _averaged(_paint(target, eye.background))
        if wanted - made.keys():
            eye, target = self._draw(snapshot, users, camera, 1)
            if "rgb" in wanted and not self.smooth:
                made["rgb"] = _paint(target, eye.background)
            if "boxes" in wanted:
                alone = partial(eye.canvas.count_pixels, users)
                made["boxes"] = measure_boxes(target, alone, users, snapshot, camera)
            made |= _labels(target, eye.background, snapshot, camera, wanted)
        return Picture(camera=camera, **made)

    def _draw(self, snapshot: Snapshot, users: Users, camera: Camera, factor: int) -> tuple[Eye, Target]:
        """Fill the visibility buffer."""
        key = (camera, factor)
        eye = self._eyes.get(key)
        if eye is None:
            eye = self._eyes[key] = open_eye(self.scene, camera, self._light, factor)
        states = tuple(snapshot.signals.items())
        paths = self._faces.paths(states) if self.show_links else NO_PATHS
        return eye, eye.bend(eye.canvas.draw(users, self._faces.lit(states), paths))


def _labels(
    target: Target, background: Background, snapshot: Snapshot, camera: Camera, wanted: frozenset[str]
) -> dict[str, Any]:
    made: dict[str, Any] = {}
    if "depth" in wanted:
        nearest = np.float32(1 / camera.far)
        made["depth"] = np.minimum(1 / np.maximum(target.depths, nearest), np.float32(camera.far))
    if "semantic" in wanted:
        classes = np.append(SEMANTIC_OF_KIND[snapshot.kinds], np.uint8(Semantic.SIGNAL))
        made["semantic"] = _label(target.tags, target.owners, classes, background.semantics)
    if "instance" in wanted:
        numbers = np.append(snapshot.numbers, np.int32(0))
        made["instance"] = _label(target.tags, target.owners, numbers, np.zeros_like(target.tags))
    return made


def _paint(target: Target, background: Background) -> NDArray[np.uint8]:
    picture = background.lit.copy()
    _resolve(target.tags, target.spans, target.shades, background.shaded, background.headlit, picture)
    return picture


@kernel
def _averaged(fine):
    """Give each pixel the mean of its block of samples."""
    picture = np.empty((fine.shape[0] // SAMPLES, fine.shape[1] // SAMPLES, 3), np.uint8)
    for row in range(picture.shape[0]):
        for column in range(picture.shape[1]):
            for c in range(3):
                total = SAMPLES**2 // 2
                for i in range(SAMPLES):
                    for j in range(SAMPLES):
                        total += fine[row * SAMPLES + i, column * SAMPLES + j, c]
                picture[row, column, c] = total // SAMPLES**2
    return picture


@kernel
def _resolve(tags, spans, shades, shaded, headlit, picture):
    """Put the colours of what moves, of shadows and of head lamps into a copy of the lit background."""
    for row in range(tags.shape[0]):
        for column in range(spans[row, 0], spans[row, 1]):
            tag = tags[row, column]
            if tag == STATIC:
                continue
            if tag >= 0:
                for c in range(3):
                    picture[row, column, c] = shades[tag, c]
            elif tag == SHADED:
                for c in range(3):
                    picture[row, column, c] = shaded[row, column, c]
            else:
                share = (SHADED - tag) / LIGHT_STEPS
                for c in range(3):
                    dark = picture[row, column, c]
                    picture[row, column, c] = int(dark + share * (headlit[row, column, c] - dark) + 0.5)


@kernel
def _label(tags, owners, values, background):
    """Give every pixel of a road user its value; a lamp has the last one, anything else the background's."""
    labels = background.copy()
    for row in range(tags.shape[0]):
        for column in range(tags.shape[1]):
            tag = tags[row, column]
            if tag >= 0 and owners[tag] >= LAMP:
                labels[row, column] = values[owners[tag]]
    return labels
