"""Boxes of the road users that a camera sees, in the picture and in the world."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from dojo_env.camera import Camera
from dojo_env.rendering.compiling import kernel
from dojo_env.rendering.parked import Parked
from dojo_env.rendering.target import Target
from dojo_env.rendering.traffic import Users
from dojo_env.snapshot import Snapshot

Ints = NDArray[np.int32]

_CORNERS = np.array([(x, y, z) for x in (0.0, -1.0) for y in (-0.5, 0.5) for z in (0.0, 1.0)])


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Boxes:
    """The road users of which at least one pixel is visible; arrays have one row each.

    Attributes:
        ids: SUMO's ids, or those of the map.
        numbers: (k,) the numbers that the instance picture shows.
        kinds: (k,) `Kind`.
        parked: (k,) whether they are parked cars of the map, which SUMO does not know.
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
    parked: NDArray[np.bool_]
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
            parked=self.parked[kept],
            picture=picture[kept],
            pixels=self.pixels[kept],
            visible=self.visible[kept],
            corners=self.corners[kept],
            projected=projected.reshape(-1, 8, 2),
        )


def measure_boxes(
    seen: tuple[Target, Ints],
    count_alone: Callable[[Ints], Ints],
    users: Users,
    snapshot: Snapshot,
    parked: Parked,
    camera: Camera,
) -> Boxes:
    """Measure every visible road user in a picture that was just drawn.

    Args:
        seen: the picture's buffers, and (h, w) the numbers of the parked cars behind what moves.
        count_alone: tells how many pixels some road users would cover if each were alone.
        users: the road users.
        snapshot: where they come from.
        parked: the parked cars.
        camera: the camera.
    """
    target, standing = seen
    count, cars = len(snapshot.ids), parked.cars
    first = int(cars.numbers[0]) if len(cars.ids) else 0
    pixels, spans = _measure(target.tags, target.owners, standing, first, count, count + len(cars.ids))
    shown = np.flatnonzero(pixels).astype(np.int32)
    moving, still = shown[shown < count], shown[shown >= count] - count
    alone = np.concatenate([count_alone(moving), parked.alone[still]])
    frames = np.concatenate([users.frames[moving], parked.users.frames[still]])
    places = np.concatenate([users.places[moving], parked.users.places[still]]) + users.origin
    corners = np.einsum("kij,cj->kci", frames, _CORNERS) + places[:, None]
    projected, _ = camera.project(corners.reshape(-1, 3))
    return Boxes(
        ids=(*(snapshot.ids[k] for k in moving), *(cars.ids[k] for k in still)),
        numbers=np.concatenate([snapshot.numbers[moving], cars.numbers[still]]),
        kinds=np.concatenate([snapshot.kinds[moving], cars.kinds[still]]),
        parked=shown >= count,
        picture=spans[shown],
        pixels=pixels[shown],
        visible=np.minimum(1.0, pixels[shown] / np.maximum(alone, 1)),
        corners=corners,
        projected=projected.reshape(-1, 8, 2),
    )


@kernel
def _measure(tags, owners, standing, first, count, total):
    """Count each road user's visible pixels, and find the box they lie in; parked cars come after `count`."""
    height, width = tags.shape
    pixels = np.zeros(total, dtype=np.int32)
    spans = np.zeros((total, 4), dtype=np.int32)
    for k in range(total):
        spans[k, 0], spans[k, 1] = width, height
    for row in range(height):
        for column in range(width):
            tag, k = tags[row, column], -1
            if tag >= 0:
                k = owners[tag]
            elif standing[row, column] > 0:
                k = count + standing[row, column] - first
            if k >= 0:
                pixels[k] += 1
                spans[k, 0], spans[k, 1] = min(spans[k, 0], column), min(spans[k, 1], row)
                spans[k, 2], spans[k, 3] = max(spans[k, 2], column + 1), max(spans[k, 3], row + 1)
    return pixels, spans
