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
        picture, kept = _turn_boxes(self.picture, camera, homography)
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


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Visible:
    """The simulated road users of which at least one pixel is visible: less than `Boxes`, for less.

    Attributes:
        rows: (k,) of the snapshot, ascending.
        picture: (k, 4) as of `Boxes`.
        pixels: (k,) as of `Boxes`.
        visible: (k,) as of `Boxes`.
    """

    rows: NDArray[np.int32]
    picture: NDArray[np.int32]
    pixels: NDArray[np.int32]
    visible: NDArray[np.float64]

    def turned(self, camera: Camera, homography: NDArray[np.float64]) -> "Visible":
        """Keep those that are still in the picture when it is turned; see `Boxes.turned`."""
        picture, kept = _turn_boxes(self.picture, camera, homography)
        return Visible(
            rows=self.rows[kept], picture=picture[kept], pixels=self.pixels[kept], visible=self.visible[kept]
        )


def _turn_boxes(
    boxes: Ints, camera: Camera, homography: NDArray[np.float64]
) -> tuple[Ints, NDArray[np.intp]]:
    """Move boxes along with a turned picture; returns them clipped to it, and which are still in it."""
    corners = np.stack([boxes[:, [0, 0, 2, 2]], boxes[:, [1, 3, 1, 3]]], axis=2)
    moved = np.concatenate([corners, np.ones_like(corners[..., :1])], axis=2) @ homography.T
    pixels = np.rint(moved[..., :2] / moved[..., 2:]).clip(0, (camera.width, camera.height))
    turned = np.concatenate([pixels.min(axis=1), pixels.max(axis=1)], axis=1).astype(np.int32)
    return turned, np.flatnonzero((turned[:, 2:] > turned[:, :2]).all(axis=1))


def measure_visible(target: Target, count_alone: Callable[[Ints], Ints], users: int) -> Visible:
    """Measure how much of each road user shows in a picture that was just drawn.

    Args:
        target: the picture's buffers.
        count_alone: tells how many pixels some road users would cover if each were alone.
        users: how many road users there are.
    """
    # Nobody moves outside of the spans.
    nothing = np.empty((0, 0), np.int32)
    pixels, picture = _measure(target.tags, target.owners, target.spans, nothing, 0, users, users)
    rows = np.flatnonzero(pixels).astype(np.int32)
    pixels = pixels[rows]
    visible = np.minimum(1.0, pixels / np.maximum(count_alone(rows), 1))
    return Visible(rows=rows, picture=picture[rows], pixels=pixels, visible=visible)


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
    rows = np.tile(np.array([0, standing.shape[1]], np.int32), (len(standing), 1))
    pixels, spans = _measure(target.tags, target.owners, rows, standing, first, count, count + len(cars.ids))
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
def _measure(tags, owners, columns, standing, first, count, total):
    """Count each road user's visible pixels, and find the box they lie in.

    Args:
        tags: of the picture.
        owners: of its faces.
        columns: (h, 2) first and last column to look at in each row; the last is exclusive.
        standing: (h, w) numbers of the parked cars, which come after `count`; empty where they do not count.
        first: of these numbers.
        count: of road users that move.
        total: with the parked cars.
    """
    height, width = tags.shape
    pixels = np.zeros(total, dtype=np.int32)
    spans = np.zeros((total, 4), dtype=np.int32)
    for k in range(total):
        spans[k, 0], spans[k, 1] = width, height
    for row in range(height):
        for column in range(columns[row, 0], columns[row, 1]):
            tag, k = tags[row, column], -1
            if tag >= 0:
                k = owners[tag]
            elif len(standing) > 0 and standing[row, column] > 0:
                k = count + standing[row, column] - first
            if k >= 0:
                pixels[k] += 1
                spans[k, 0], spans[k, 1] = min(spans[k, 0], column), min(spans[k, 1], row)
                spans[k, 2], spans[k, 3] = max(spans[k, 2], column + 1), max(spans[k, 3], row + 1)
    return pixels, spans
