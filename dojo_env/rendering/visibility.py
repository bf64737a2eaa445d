"""Who is visible: road users as the boxes around them, which tell as much for a fraction of the drawing."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from dojo_env.camera import Camera
from dojo_env.rendering.compiling import inner, kernel
from dojo_env.rendering.drawing import users_in_view
from dojo_env.rendering.raster import COUNT, NEARER, draw_face
from dojo_env.rendering.target import Target, project, touch, turn

_SIDES = np.array(
    [[[4, 5, 7], [4, 7, 6]], [[0, 2, 3], [0, 3, 1]], [[2, 6, 7], [2, 7, 3]], [[0, 1, 5], [0, 5, 4]],
     [[1, 3, 7], [1, 7, 5]], [[0, 4, 6], [0, 6, 2]]]
)  # fmt: skip
"""Corners of the two triangles of each side: nose, tail, left, right, top and bottom."""
_REACHES = (0.0, 1.0, 0.5, 0.5, 1.0, 0.0)
"""How far each side lies from the front's middle on the ground, outwards, as a share of the box."""

Ints = NDArray[np.int32]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Visible:
    """The simulated road users of whose boxes at least one pixel is visible: less than `Boxes`, for less.

    Attributes:
        rows: (k,) of the snapshot, ascending.
        picture: (k, 4) left, top, right, bottom of the visible pixels; right and bottom are exclusive.
        pixels: (k,) visible pixels.
        visible: (k,) their share of those that would show if nothing stood in front; the part outside of the
            picture does not count.
    """

    rows: Ints
    picture: Ints
    pixels: Ints
    visible: NDArray[np.float64]

    def turned(self, camera: Camera, homography: NDArray[np.float64]) -> "Visible":
        """Keep those that are still in the picture when it is turned; see `Boxes.turned`.

        Args:
            camera: the turned one, at the same place.
            homography: (3, 3) from pixels of the picture to its.

        Returns:
            Those, their boxes moved and clipped to the picture; pixels and shares are those before the turn.
        """
        picture, kept = turn_boxes(self.picture, camera, homography)
        return Visible(
            rows=self.rows[kept], picture=picture[kept], pixels=self.pixels[kept], visible=self.visible[kept]
        )


def measure_visible(target: Target, alone: Ints) -> Visible:
    """Measure how much of each road user shows in a picture of boxes.

    Args:
        target: the picture's buffers, which `draw_boxes` has filled.
        alone: (n,) the pixels that each would cover if nothing stood in front.

    Returns:
        Those of whose boxes at least one pixel is visible.
    """
    users = len(alone)
    # Nobody moves outside of the spans.
    nothing = np.empty((0, 0), np.int32)
    pixels, picture = measure_pixels(target.tags, target.owners, target.spans, nothing, 0, users, users)
    rows = np.flatnonzero(pixels).astype(np.int32)
    visible = np.minimum(1.0, pixels[rows] / np.maximum(alone[rows], 1))
    return Visible(rows=rows, picture=picture[rows], pixels=pixels[rows], visible=visible)


@kernel
def draw_boxes(users, view, target):
    """Draw the box around each road user.

    Args:
        users: the road users.
        view: the camera.
        target: what to draw into, with nothing drawn yet; changed. Tags become the users' rows.

    Returns:
        (n,) int32 how many pixels each box would cover alone; 0 where it is out of view.
    """
    alone = np.zeros(len(users.places), dtype=np.int32)
    seen, screen, corners = np.empty((8, 3)), np.empty((8, 3)), np.empty((3, 3))
    corner = np.empty(3)
    for k in users_in_view(users, 0.0, view):
        frame = users.frames[k]
        for c in range(8):
            for axis in range(3):
                corner[axis] = users.places[k, axis] + (c // 4 - 1.0) * frame[axis, 0]
                corner[axis] += (c // 2 % 2 - 0.5) * frame[axis, 1] + (c % 2) * frame[axis, 2]
            turn(corner, view, seen[c])
        touch(screen, project(seen, view, screen), target)
        target.owners[k] = k
        for side in range(6):
            if _faces_away(users, k, side, view):
                continue
            for half in range(2):
                for c in range(3):
                    for axis in range(3):
                        corners[c, axis] = seen[_SIDES[side, half, c], axis]
                alone[k] += draw_face(corners, view.lens, k, COUNT, target.depths, target.tags)
                draw_face(corners, view.lens, k, NEARER, target.depths, target.tags)
    return alone


@inner
def _faces_away(users, k, side, view):
    """Tell whether the eye is behind a side of a box: such sides are hidden by the others."""
    axis, along, square = side // 2, 0.0, 0.0
    for row in range(3):
        part = users.frames[k, row, axis]
        along += part * (view.eye[row] - users.places[k, row])
        square += part * part
    outwards = 1.0 if side % 2 == 0 else -1.0
    return outwards * along / square <= _REACHES[side]


@kernel
def measure_pixels(tags, owners, columns, standing, first, count, total):
    """Count each road user's visible pixels, and find the box they lie in.

    Args:
        tags: of the picture.
        owners: of its faces.
        columns: (h, 2) first and last column to look at in each row; the last is exclusive.
        standing: (h, w) numbers of the parked cars, which come after `count`; empty where they do not count.
        first: of these numbers.
        count: of road users that move.
        total: with the parked cars.

    Returns:
        (total,) int32 pixels, and (total, 4) int32 left, top, right, bottom of these; right and bottom are
        exclusive, and the boxes of those without a pixel mean nothing.
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


def turn_boxes(boxes: Ints, camera: Camera, homography: NDArray[np.float64]) -> tuple[Ints, NDArray[np.intp]]:
    """Move boxes along with a turned picture.

    Args:
        boxes: (n, 4) left, top, right, bottom, pixels; right and bottom are exclusive.
        camera: the turned one; its width and height count.
        homography: (3, 3) from pixels of the picture to its.

    Returns:
        (n, 4) int32 the boxes around the turned ones, clipped to the picture, and (k,) the rows of those that
        are still in it.
    """
    corners = np.stack([boxes[:, [0, 0, 2, 2]], boxes[:, [1, 3, 1, 3]]], axis=2)
    moved = np.concatenate([corners, np.ones_like(corners[..., :1])], axis=2) @ homography.T
    pixels = np.rint(moved[..., :2] / moved[..., 2:]).clip(0, (camera.width, camera.height))
    turned = np.concatenate([pixels.min(axis=1), pixels.max(axis=1)], axis=1).astype(np.int32)
    return turned, np.flatnonzero((turned[:, 2:] > turned[:, :2]).all(axis=1))
