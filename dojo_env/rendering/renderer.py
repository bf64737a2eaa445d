"""The renderer: a snapshot through cameras. The static world comes from a cache; only what moves is drawn."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from math import radians

import cv2
import numpy as np
from numpy.typing import NDArray

from dojo_env.conditions import Conditions
from dojo_env.errors import ConfigError
from dojo_env.rendering.background import Background, View, draw_background
from dojo_env.rendering.boxes import Boxes, measure_boxes
from dojo_env.rendering.classes import SEMANTIC_OF_KIND, Semantic
from dojo_env.rendering.lighting import compute_light, srgb_table
from dojo_env.rendering.raster import SHADED, kernel
from dojo_env.rendering.scene import Scene, SignalFaces, states_key
from dojo_env.rendering.traffic import (
    LAMP,
    LIGHT_STEPS,
    Canvas,
    Users,
    draw_lamps,
    draw_paths,
    draw_users,
    most_faces,
    place_users,
)
from dojo_env.sensors.camera import Camera
from dojo_env.snapshot import Snapshot

OUTPUTS = ("rgb", "depth", "semantic", "instance", "boxes")
_FINE = 2
"""Samples along each side of a pixel where the moving part is drawn smooth."""


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
            smooth: anti-alias what moves, too; costs about four times as much.
            show_links: draw each signal link's path as a green, yellow or red line, as the paper does.
        """
        self.scene = scene
        self.smooth = smooth
        self.show_links = show_links
        self._light = compute_light(conditions or Conditions())
        self._faces = SignalFaces(scene)
        self._table = srgb_table()
        self._backgrounds: dict[tuple[Camera, int], tuple[View, Background]] = {}
        self._canvases: dict[tuple[int, int], Canvas] = {}
        self._lenses: dict[Camera, tuple[NDArray[np.float32], NDArray[np.float32]]] = {}

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
        for key in [key for key in self._backgrounds if gone is None or key[0] in gone]:
            del self._backgrounds[key]

    def _picture(self, snapshot: Snapshot, users: Users, camera: Camera, wanted: frozenset[str]) -> Picture:
        made: dict[str, object] = {}
        if "rgb" in wanted and self.smooth:
            canvas, _, background = self._draw(snapshot, users, camera, _FINE)
            fine = _paint(canvas, background)
            made["rgb"] = cv2.resize(fine, (camera.width, camera.height), interpolation=cv2.INTER_AREA)
        if wanted - made.keys():
            canvas, view, background = self._draw(snapshot, users, camera, 1)
            made |= self._labels(canvas, view, background, snapshot, users, camera, wanted)
            if "rgb" in wanted and not self.smooth:
                made["rgb"] = _paint(canvas, background)
        if camera.distortion:
            made = {name: self._bend(camera, name, value) for name, value in made.items()}
        return replace(Picture(camera=camera), **made)  # type: ignore[arg-type]

    def _draw(
        self, snapshot: Snapshot, users: Users, camera: Camera, factor: int
    ) -> tuple[Canvas, View, Background]:
        """Fill the visibility buffer."""
        view, background = self._background(camera, factor)
        key = (view.height, view.width)
        canvas = self._canvases.setdefault(key, Canvas(*key))
        states = states_key(snapshot.signals)
        lamps = self._faces.lit(states)
        paths, path_colours = self._faces.painted(states) if self.show_links else ((), ())
        canvas.restore(background.depths, most_faces(users, lamps, len(path_colours)))
        if self.show_links:
            draw_paths(canvas, view, paths, path_colours, self._table)
        draw_users(canvas, view, users, self._light, self._table)
        draw_lamps(canvas, view, lamps, self._table)
        return canvas, view, background

    def _background(self, camera: Camera, factor: int) -> tuple[View, Background]:
        key = (camera, factor)
        if key not in self._backgrounds:
            view = view_of(camera, self.scene).scaled(factor)
            self._backgrounds[key] = (view, draw_background(self.scene, view, self._light))
        return self._backgrounds[key]

    def _labels(
        self,
        canvas: Canvas,
        view: View,
        background: Background,
        snapshot: Snapshot,
        users: Users,
        camera: Camera,
        wanted: frozenset[str],
    ) -> dict[str, object]:
        made: dict[str, object] = {}
        owners = canvas.owners[: canvas.count]
        if "depth" in wanted:
            made["depth"] = np.minimum(1 / np.maximum(canvas.depths, 1 / camera.far), camera.far)
        if "semantic" in wanted:
            classes = np.append(SEMANTIC_OF_KIND[snapshot.kinds], Semantic.SIGNAL).astype(np.uint8)
            made["semantic"] = _label(canvas.tags, owners, classes, background.semantics, LAMP)
        if "instance" in wanted:
            numbers = np.append(snapshot.numbers, 0).astype(np.int32)
            made["instance"] = _label(canvas.tags, owners, numbers, np.zeros_like(canvas.tags), LAMP)
        if "boxes" in wanted:
            made["boxes"] = measure_boxes(canvas, view, users, snapshot, camera)
        return made

    def _bend(self, camera: Camera, name: str, value: object) -> object:
        """Look through the lens: move every pixel to where the lens bends its ray to."""
        if name == "boxes":
            return value
        if camera not in self._lenses:
            self._lenses[camera] = _lens_map(camera)
        smooth = cv2.INTER_LINEAR if name == "rgb" else cv2.INTER_NEAREST
        return cv2.remap(value, *self._lenses[camera], smooth, borderMode=cv2.BORDER_REPLICATE)


def view_of(camera: Camera, scene: Scene) -> View:
    """Bring a camera into the scene's frame."""
    focal = camera.focal_length
    return View(
        eye=np.array(camera.position) - scene.origin,
        axes=np.ascontiguousarray(camera.axes),
        lens=np.array([focal, camera.width / 2, camera.height / 2, camera.near, camera.far]),
        height=camera.height,
        width=camera.width,
    )


def _lens_map(camera: Camera) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """For each pixel of the bent picture, where in the straight one its ray falls. Source: OpenCV calib3d."""
    y, x = np.mgrid[0 : camera.height, 0 : camera.width].astype(np.float64) + 0.5
    pixels = np.column_stack([x.ravel(), y.ravel()]).reshape(-1, 1, 2)
    straight = cv2.undistortPointsIter(
        pixels, camera.intrinsics, np.array(camera.distortion), np.eye(3), camera.intrinsics,
        (cv2.TERM_CRITERIA_COUNT | cv2.TERM_CRITERIA_EPS, 40, 1e-4),
    )  # fmt: skip
    places = straight.reshape(camera.height, camera.width, 2).astype(np.float32) - np.float32(0.5)
    return np.ascontiguousarray(places[..., 0]), np.ascontiguousarray(places[..., 1])


def _paint(canvas: Canvas, background: Background) -> NDArray[np.uint8]:
    picture = background.lit.copy()
    _resolve(canvas.tags, canvas.shades, background.shaded, background.headlit, picture)
    return picture


@kernel
def _resolve(tags, shades, shaded, headlit, picture):
    """Put the colours of what moves, of shadows and of head lamps into a copy of the lit background."""
    for row in range(tags.shape[0]):
        for column in range(tags.shape[1]):
            tag = tags[row, column]
            if tag == -1:
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
def _label(tags, owners, values, background, lamp):
    """Give every pixel of a road user its value; a lamp has the last one, anything else the background's."""
    labels = background.copy()
    for row in range(tags.shape[0]):
        for column in range(tags.shape[1]):
            tag = tags[row, column]
            if tag >= 0 and owners[tag] >= lamp:
                labels[row, column] = values[owners[tag]]
    return labels
