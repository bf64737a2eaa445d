"""What frames are drawn into, and how places get there: the visibility buffer and the way to the screen."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from dojo_env.rendering.compiling import inner, kernel
from dojo_env.rendering.raster import STATIC


class Target(NamedTuple):
    """What is drawn into: the visibility buffer, and colour and owner of the faces in it.

    Attributes:
        depths: (h, w) float32 inverse depths.
        tags: (h, w) int32 index of the face at a pixel, or `STATIC` and below.
        shades: (m, 3) uint8 sRGB.
        owners: (m,) int32 index of the road user, `LAMP` or `PATH`.
        spans: (h, 2) int32 first and last column that may have changed in each row; the last is exclusive.
    """

    depths: NDArray[np.float32]
    tags: NDArray[np.int32]
    shades: NDArray[np.uint8]
    owners: NDArray[np.int32]
    spans: NDArray[np.int32]


@kernel
def restore(target, clean):
    """Put the background's depths back where the last frame changed them."""
    height, width = target.tags.shape
    for row in range(height):
        for column in range(target.spans[row, 0], target.spans[row, 1]):
            target.depths[row, column] = clean[row, column]
            target.tags[row, column] = STATIC
        target.spans[row, 0], target.spans[row, 1] = width, 0


@kernel
def bend(depths, tags, rows, columns):
    """Look at a frame through a lens: depths, tags and spans of the picture.

    Args:
        depths: of the straight view.
        tags: of the straight view.
        rows: (h, w) its row that each pixel of the picture shows.
        columns: (h, w) its column.
    """
    height, width = rows.shape
    bent_depths, bent_tags = np.empty((height, width), np.float32), np.empty((height, width), np.int32)
    spans = np.empty((height, 2), np.int32)
    for row in range(height):
        spans[row, 0], spans[row, 1] = width, 0
        for column in range(width):
            v, u = rows[row, column], columns[row, column]
            bent_depths[row, column] = depths[v, u]
            bent_tags[row, column] = tags[v, u]
            if tags[v, u] != STATIC:
                spans[row, 0], spans[row, 1] = min(spans[row, 0], column), column + 1
    return bent_depths, bent_tags, spans


@inner
def touch(screen, is_ahead, target):
    """Note that a shape with these corners on the screen may change what lies within them."""
    height, width = target.tags.shape
    left, top, right, bottom = 0.0, 0.0, float(width), float(height)
    if is_ahead:
        left, top, right, bottom = width, height, 0.0, 0.0
        for k in range(len(screen)):
            left, right = min(left, screen[k, 0]), max(right, screen[k, 0])
            top, bottom = min(top, screen[k, 1]), max(bottom, screen[k, 1])
    first, last = int(max(0.0, left)), int(min(float(width), right + 1.0))
    for row in range(int(max(0.0, top)), int(min(float(height), bottom + 1.0))):
        keep_span(target, row, first, last)


@inner
def keep_span(target, row, first, last):
    """Note that these columns of a row may change; the last is exclusive."""
    target.spans[row, 0] = min(target.spans[row, 0], first)
    target.spans[row, 1] = max(target.spans[row, 1], last)


@inner
def project(seen, view, screen):
    """Project corners to pixels and inverse depths; tells whether all lie before the near plane."""
    is_ahead = True
    for k in range(len(seen)):
        if seen[k, 2] < view.lens[3]:
            is_ahead = False
            break
        w = 1.0 / seen[k, 2]
        screen[k, 0] = view.lens[1] + view.lens[0] * seen[k, 0] * w
        screen[k, 1] = view.lens[2] + view.lens[0] * seen[k, 1] * w
        screen[k, 2] = w
    return is_ahead


@inner
def turn(place, view, seen):
    """Bring a place of the scene into camera space."""
    x, y, z = place[0] - view.eye[0], place[1] - view.eye[1], place[2] - view.eye[2]
    for row in range(3):
        seen[row] = view.axes[row, 0] * x + view.axes[row, 1] * y + view.axes[row, 2] * z
