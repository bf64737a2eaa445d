"""Boxes of the road users that a camera sees, in the picture and in the world."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from dojo_env.camera import Camera
from dojo_env.rendering.parked import Parked
from dojo_env.rendering.target import Target
from dojo_env.rendering.traffic import Users
from dojo_env.rendering.visibility import measure_pixels, turn_boxes
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
        picture, kept = turn_boxes(self.picture, camera, homography)
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

    Returns:
        Those of which at least one pixel is visible: who moves in the snapshot's order, then the parked cars.
    """
    target, standing = seen
    count, cars = len(snapshot.ids), parked.cars
    first = int(cars.numbers[0]) if len(cars.ids) else 0
    rows = np.tile(np.array([0, standing.shape[1]], np.int32), (len(standing), 1))
    pixels, spans = measure_pixels(
        target.tags, target.owners, rows, standing, first, count, count + len(cars.ids)
    )
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
