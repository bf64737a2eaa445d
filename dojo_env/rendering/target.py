"""What frames are drawn into: the visibility buffer, the way to it, and what is made of it."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from dojo_env.rendering.background import SAMPLES
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
    """Put the background's depths back where the last frame changed them.

    Args:
        target: its depths, tags and spans are changed: afterwards nothing has been drawn into it.
        clean: (h, w) float32 inverse depths of the background.
    """
    height, width = target.tags.shape
    for row in range(height):
        for column in range(target.spans[row, 0], target.spans[row, 1]):
            target.depths[row, column] = clean[row, column]
            target.tags[row, column] = STATIC
        target.spans[row, 0], target.spans[row, 1] = width, 0


@kernel
def bend(depths, tags, rows, columns):
    """Look at a frame through a lens.

    Args:
        depths: of the straight view.
        tags: of the straight view.
        rows: (h, w) its row that each pixel of the picture shows.
        columns: (h, w) its column.

    Returns:
        Depths (h, w), tags (h, w) and spans (h, 2) of the picture, as a `Target` has them.
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
    """Note that a shape with these corners on the screen may change what lies within them.

    Args:
        screen: (k, 3) corners that `project` has filled.
        is_ahead: what `project` has returned; otherwise all of the picture may change.
        target: its spans are widened.

    Returns:
        Whether they may change anything.
    """
    height, width = target.tags.shape
    left, top, right, bottom = 0.0, 0.0, float(width), float(height)
    if is_ahead:
        left, top, right, bottom = width, height, 0.0, 0.0
        for k in range(len(screen)):
            left, right = min(left, screen[k, 0]), max(right, screen[k, 0])
            top, bottom = min(top, screen[k, 1]), max(bottom, screen[k, 1])
    first, last = int(max(0.0, left)), int(min(float(width), right + 1.0))
    upper, lower = int(max(0.0, top)), int(min(float(height), bottom + 1.0))
    if first >= last or upper >= lower:
        return False
    for row in range(upper, lower):
        keep_span(target, row, first, last)
    return True


@inner
def keep_span(target, row, first, last):
    """Note that these columns of a row may change.

    Args:
        target: its span of this row is widened.
        row: the row.
        first: first column.
        last: last column, exclusive.
    """
    target.spans[row, 0] = min(target.spans[row, 0], first)
    target.spans[row, 1] = max(target.spans[row, 1], last)


@inner
def project(seen, view, screen):
    """Project corners to pixels and inverse depths.

    Args:
        seen: (k, 3) metres: right, down, forward.
        view: the camera.
        screen: (k, 3) to fill: column, row, both in pixels, and inverse depth.

    Returns:
        Whether no corner is nearer than the near plane; otherwise `screen` is filled in part.
    """
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
    """Bring a place of the scene into camera space.

    Args:
        place: (3,) metres, scene frame.
        view: the camera.
        seen: (3,) to fill, metres: right, down, forward.
    """
    x, y, z = place[0] - view.eye[0], place[1] - view.eye[1], place[2] - view.eye[2]
    for row in range(3):
        seen[row] = view.axes[row, 0] * x + view.axes[row, 1] * y + view.axes[row, 2] * z


@kernel
def resolve_pixels(tags, spans, shades, shaded, headlit, picture):
    """Put the colours of what moves, of shadows and of head lamps into a copy of the lit background.

    Args:
        tags: (h, w) of the target.
        spans: (h, 2) of the target.
        shades: (m, 3) of the target's faces.
        shaded: (h, w, 3) the background where something that moves keeps the sun away.
        headlit: (h, w, 3) the background in the full light of head lamps.
        picture: (h, w, 3) the copy, changed.
    """
    for row in range(tags.shape[0]):
        for column in range(spans[row, 0], spans[row, 1]):
            tag = tags[row, column]
            if tag >= 0:
                for c in range(3):
                    picture[row, column, c] = shades[tag, c]
            elif tag != STATIC:
                for c in range(3):
                    dark, bright = shaded[row, column, c], headlit[row, column, c]
                    picture[row, column, c] = _shaded(tag, picture[row, column, c], dark, bright)


@kernel
def resolve_samples(tags, spans, shades, shaded, headlit, picture):
    """Do the same where each pixel has `SAMPLES` x `SAMPLES` tags: it gets their mean.

    Args:
        tags: (h * SAMPLES, w * SAMPLES) of the target.
        spans: (h * SAMPLES, 2) of the target.
        shades: (m, 3) of the target's faces.
        shaded: (h, w, 3) see `resolve_pixels`.
        headlit: (h, w, 3) see `resolve_pixels`.
        picture: (h, w, 3) the copy of the lit background, changed.
    """
    for row in range(picture.shape[0]):
        top = row * SAMPLES
        first, last = picture.shape[1] * SAMPLES, 0
        for v in range(top, top + SAMPLES):
            first, last = min(first, spans[v, 0]), max(last, spans[v, 1])
        for column in range(first // SAMPLES, (last + SAMPLES - 1) // SAMPLES):
            left = column * SAMPLES
            moving = 0
            for v in range(top, top + SAMPLES):
                for u in range(left, left + SAMPLES):
                    moving += tags[v, u] != STATIC
            if moving == 0:
                continue
            for c in range(3):
                plain, dark, bright = picture[row, column, c], shaded[row, column, c], headlit[row, column, c]
                total = (SAMPLES**2 - moving) * int(plain) + SAMPLES**2 // 2
                for v in range(top, top + SAMPLES):
                    for u in range(left, left + SAMPLES):
                        tag = tags[v, u]
                        if tag >= 0:
                            total += int(shades[tag, c])
                        elif tag != STATIC:
                            total += _shaded(tag, plain, dark, bright)
                picture[row, column, c] = total // SAMPLES**2


@inner
def _shaded(tag, lit, shaded, headlit):
    """Give a channel of the background in the shadow or light of what moves."""
    held = STATIC - tag
    shadow, light = (held & LEVELS) / LEVELS, (held >> 10) / LEVELS
    left = 1.0 - _CONTACT * (held >> 5 & LEVELS) / LEVELS
    plain = float(lit)
    value = (plain + shadow * (float(shaded) - plain)) * left
    value += light * (float(headlit) - plain)
    return int(min(255.0, max(0.0, value)) + 0.5)


@kernel
def label(tags, owners, values, background):
    """Give every pixel of a road user its value.

    Args:
        tags: (h, w) of the target.
        owners: (m,) of the target's faces.
        values: (n + 1,) by road user; the last one is for signal lamps.
        background: (h, w) values of all other pixels.

    Returns:
        (h, w) a new array of the background's kind.
    """
    labels = background.copy()
    for row in range(tags.shape[0]):
        for column in range(tags.shape[1]):
            tag = tags[row, column]
            if tag >= 0 and owners[tag] >= LAMP:
                labels[row, column] = values[owners[tag]]
    return labels
