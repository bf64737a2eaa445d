"""What frames are drawn into: the visibility buffer, the way to it, and what is made of it."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from dojo_env.rendering.compiling import inner, kernel
from dojo_env.rendering.raster import STATIC

LAMP, PATH = -1, -2
"""Owners of faces that belong to no road user."""
LEVELS = 31
"""Steps from none to full shadow, contact or light; each takes five bits of a tag."""
_CONTACT = 0.72
"""Share of the light that a road user keeps from the ground right under it."""


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


@kernel
def resolve(tags, spans, shades, shaded, headlit, picture):
    """Put the colours of what moves, of shadows and of head lamps into a copy of the lit background."""
    for row in range(tags.shape[0]):
        for column in range(spans[row, 0], spans[row, 1]):
            tag = tags[row, column]
            if tag == STATIC:
                continue
            if tag >= 0:
                for c in range(3):
                    picture[row, column, c] = shades[tag, c]
            else:
                held = STATIC - tag
                shadow, light = (held & LEVELS) / LEVELS, (held >> 10) / LEVELS
                left = 1.0 - _CONTACT * (held >> 5 & LEVELS) / LEVELS
                for c in range(3):
                    plain = float(picture[row, column, c])
                    value = (plain + shadow * (shaded[row, column, c] - plain)) * left
                    value += light * (headlit[row, column, c] - plain)
                    picture[row, column, c] = int(min(255.0, max(0.0, value)) + 0.5)


@kernel
def label(tags, owners, values, background):
    """Give every pixel of a road user its value; a lamp has the last one, anything else the background's."""
    labels = background.copy()
    for row in range(tags.shape[0]):
        for column in range(tags.shape[1]):
            tag = tags[row, column]
            if tag >= 0 and owners[tag] >= LAMP:
                labels[row, column] = values[owners[tag]]
    return labels
