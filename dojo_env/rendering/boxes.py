"""Boxes of the road users that a camera sees, in the picture and in the world."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from dojo_env.camera import Camera
from dojo_env.rendering.compiling import kernel
from dojo_env.rendering.target import Target
from dojo_env.rendering.traffic import Users
from dojo_env.snapshot import Snapshot

Ints = NDArray[np.int32]

_CORNERS = np.array([(x, y, z) for x in (0.0, -1.0) for y in (-0.5, 0.5) for z in (0.0, 1.0)])


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Boxes:
    """The road users of which at least one pixel is visible; arrays have one row each.

    Attributes:
        ids: SUMO's ids.
        numbers: (k,) the numbers that the instance picture shows.
        kinds: (k,) `Kind`.
        picture: (k, 4) left, top, right, bottom of the visible pixels; right and bottom are exclusive.
        pixels: (k,) visible pixels.
        visible: (k,) visible share of the pixels that would show if nothing stood in front; the part outside
            of the picture does not count.
        corners: (k, 8, 3) of the box in the world, metres, map frame: nose before tail, right before left,
            bottom before top. Mirrors, feet and umbrellas stand out of it.
        projected: (k, 8, 2) the same corners in the picture, pixels; nan behind the camera.
    """

    ids: tuple[str, ...]
    numbers: NDArray[np.int32]
    kinds: NDArray[np.uint8]
    picture: NDArray[np.int32]
    pixels: NDArray[np.int32]
    visible: NDArray[np.float64]
    corners: NDArray[np.float64]
    projected: NDArray[np.float64]

    def turned(self, camera: Camera, homography: NDArray[np.float64]) -> "Boxes":
        """Move boxes along with a picture that is turned into another camera's.

        Args:
            camera: the other one, at the same place.
            homography: (3, 3) from pixels of the picture to its.

        Returns:
            Those that are still in the picture, clipped to it.
        """
        corners = np.stack([self.picture[:, [0, 0, 2, 2]], self.picture[:, [1, 3, 1, 3]]], axis=2)
        moved = np.concatenate([corners, np.ones_like(corners[..., :1])], axis=2) @ homography.T
        pixels = np.rint(moved[..., :2] / moved[..., 2:]).clip(0, (camera.width, camera.height))
        picture = np.concatenate([pixels.min(axis=1), pixels.max(axis=1)], axis=1).astype(np.int32)
        kept = np.flatnonzero((picture[:, 2:] > picture[:, :2]).all(axis=1))
        projected, _ = camera.project(self.corners[kept].reshape(-1, 3))
        return Boxes(
            ids=tuple(self.ids[k] for k in kept),
            numbers=self.numbers[kept],
            kinds=self.kinds[kept],
            picture=picture[kept],
            pixels=self.pixels[kept],
            visible=self.visible[kept],
            corners=self.corners[kept],
            projected=projected.reshape(-1, 8, 2),
        )


def measure_boxes(
    target: Target, count_alone: Callable[[Ints], Ints], users: Users, snapshot: Snapshot, camera: Camera
) -> Boxes:
    """Measure every visible road user in a picture that was just drawn.

    Args:
        target: the picture's buffers.
        count_alone: tells how many pixels some road users would cover if each were alone.
        users: the road users.
        snapshot: where they come from.
        camera: the camera.
    """
    pixels, spans = _measure(target.tags, target.owners, len(snapshot.ids))
    shown = np.flatnonzero(pixels).astype(np.int32)
    alone = count_alone(shown)
    places = users.places[shown] + users.origin
    corners = np.einsum("kij,cj->kci", users.frames[shown], _CORNERS) + places[:, None]
    projected, _ = camera.project(corners.reshape(-1, 3))
    return Boxes(
        ids=tuple(snapshot.ids[k] for k in shown),
        numbers=snapshot.numbers[shown],
        kinds=snapshot.kinds[shown],
        picture=spans[shown],
        pixels=pixels[shown],
        visible=np.minimum(1.0, pixels[shown] / np.maximum(alone, 1)),
        corners=corners,
        projected=projected.reshape(-1, 8, 2),
    )


@kernel
def _measure(tags, owners, count):
    """Count each road user's visible pixels, and find the box they lie in."""
    height, width = tags.shape
    pixels = np.zeros(count, dtype=np.int32)
    spans = np.zeros((count, 4), dtype=np.int32)
    for k in range(count):
        spans[k, 0], spans[k, 1] = width, height
    for row in range(height):
        for column in range(width):
            tag = tags[row, column]
            if tag >= 0 and owners[tag] >= 0:
                k = owners[tag]
                pixels[k] += 1
                spans[k, 0], spans[k, 1] = min(spans[k, 0], column), min(spans[k, 1], row)
                spans[k, 2], spans[k, 3] = max(spans[k, 2], column + 1), max(spans[k, 3], row + 1)
    return pixels, spans
