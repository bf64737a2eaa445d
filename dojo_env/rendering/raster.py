"""The rasteriser: triangles into a visibility buffer, which keeps each pixel's nearest depth and whose it is.

Depth is kept as 1 / (distance along the optical axis), which is linear on the screen, so it is right in
perspective. Edges are stepped from their upper end, the same for both triangles that share one, and pixels
belong to a triangle by their centre: no gaps, nothing drawn twice. Every kernel is single-threaded and free
of fast-math: the same input gives the same bits.
"""

from math import ceil

import numpy as np

from dojo_env.rendering.compiling import inner, kernel

NEARER, COVER, COUNT = 0, 1, 2
"""What a triangle does to pixels it covers: NEARER takes those it is in front of, COVER all, COUNT none."""
STATIC = -1
"""Tag of pixels that show the static world as it is; lower ones are shaded or lit by something that moves."""


@inner
def fill_triangle(x0, y0, w0, x1, y1, w1, x2, y2, w2, tag, mode, depths, tags):
    """Fill one triangle given by pixel positions and inverse depths.

    Args:
        x0: of the first corner, pixels from the left edge; the middle of the first pixel is at 0.5.
        y0: of the first corner, pixels from the upper edge.
        w0: of the first corner, its inverse depth; larger is nearer.
        x1: of the second corner.
        y1: of the second corner.
        w1: of the second corner.
        x2: of the third corner.
        y2: of the third corner.
        w2: of the third corner.
        tag: what to leave in the pixels taken.
        mode: NEARER, COVER or COUNT.
        depths: (h, w) float32 inverse depths, changed by NEARER.
        tags: (h, w) int32, changed by NEARER and COVER.

    Returns:
        How many pixels it took; for COUNT how many it covers.
    """
    if y1 < y0:
        x0, y0, w0, x1, y1, w1 = x1, y1, w1, x0, y0, w0
    if y2 < y0:
        x0, y0, w0, x2, y2, w2 = x2, y2, w2, x0, y0, w0
    if y2 < y1:
        x1, y1, w1, x2, y2, w2 = x2, y2, w2, x1, y1, w1
    height, width = tags.shape
    top, bottom = max(0, ceil(y0 - 0.5)), min(height, ceil(y2 - 0.5))
    first, last = max(0, ceil(min(x0, x1, x2) - 0.5)), min(width, ceil(max(x0, x1, x2) - 0.5))
    area = (x1 - x0) * (y2 - y0) - (x2 - x0) * (y1 - y0)
    if top >= bottom or first >= last or area == 0.0:
        return 0
    slope_x = ((w1 - w0) * (y2 - y0) - (w2 - w0) * (y1 - y0)) / area
    slope_y = ((w2 - w0) * (x1 - x0) - (w1 - w0) * (x2 - x0)) / area
    long_step = (x2 - x0) / (y2 - y0)
    upper_step = (x1 - x0) / (y1 - y0) if y1 > y0 else 0.0
    lower_step = (x2 - x1) / (y2 - y1) if y2 > y1 else 0.0
    changed = 0
    for row in range(top, bottom):
        y = row + 0.5
        a = x0 + (y - y0) * long_step
        b = x0 + (y - y0) * upper_step if y < y1 else x1 + (y - y1) * lower_step
        if area < 0.0:
            a, b = b, a
        start, stop = max(first, ceil(a - 0.5)), min(last, ceil(b - 0.5))
        if mode == COUNT:
            changed += max(0, stop - start)
            continue
        w = w0 + (y - y0) * slope_y + (start + 0.5 - x0) * slope_x
        for column in range(start, stop):
            if mode == NEARER:
                if w > depths[row, column]:
                    depths[row, column] = w
                    tags[row, column] = tag
                    changed += 1
            elif tags[row, column] != tag:
                tags[row, column] = tag
                changed += 1
            w += slope_x
    return changed


@inner
def draw_face(corners, lens, tag, mode, depths, tags):
    """Draw a triangle of camera space, clipped at the near plane.

    Args:
        corners: (3, 3) metres: right, down, forward.
        lens: focal length (pixels), middle of the picture (x, y), near, far.
        tag: what to leave in the pixels taken.
        mode: NEARER, COVER or COUNT.
        depths: (h, w) float32 inverse depths.
        tags: (h, w) int32.

    Returns:
        How many pixels it took; for COUNT how many it covers.
    """
    focal, middle_x, middle_y, near = lens[0], lens[1], lens[2], lens[3]
    if corners[0, 2] >= near and corners[1, 2] >= near and corners[2, 2] >= near:
        w0, w1, w2 = 1.0 / corners[0, 2], 1.0 / corners[1, 2], 1.0 / corners[2, 2]
        return fill_triangle(
            middle_x + focal * corners[0, 0] * w0, middle_y + focal * corners[0, 1] * w0, w0,
            middle_x + focal * corners[1, 0] * w1, middle_y + focal * corners[1, 1] * w1, w1,
            middle_x + focal * corners[2, 0] * w2, middle_y + focal * corners[2, 1] * w2, w2,
            tag, mode, depths, tags,
        )  # fmt: skip
    return _draw_clipped(corners, lens, tag, mode, depths, tags)


@kernel
def _draw_clipped(corners, lens, tag, mode, depths, tags):
    focal, middle_x, middle_y, near = lens[0], lens[1], lens[2], lens[3]
    kept = np.empty((4, 3))
    count = 0
    for k in range(3):
        m = (k + 1) % 3
        here, there = corners[k, 2], corners[m, 2]
        if here >= near:
            w = 1.0 / here
            kept[count, 0] = middle_x + focal * corners[k, 0] * w
            kept[count, 1] = middle_y + focal * corners[k, 1] * w
            kept[count, 2] = w
            count += 1
        if (here >= near) != (there >= near):
            share = (near - here) / (there - here)
            kept[count, 0] = (
                middle_x + focal * (corners[k, 0] + share * (corners[m, 0] - corners[k, 0])) / near
            )
            kept[count, 1] = (
                middle_y + focal * (corners[k, 1] + share * (corners[m, 1] - corners[k, 1])) / near
            )
            kept[count, 2] = 1.0 / near
            count += 1
    changed = 0
    for k in range(2, count):
        changed += fill_triangle(
            kept[0, 0], kept[0, 1], kept[0, 2], kept[k - 1, 0], kept[k - 1, 1], kept[k - 1, 2],
            kept[k, 0], kept[k, 1], kept[k, 2], tag, mode, depths, tags,
        )  # fmt: skip
    return changed


@kernel
def draw_mesh(vertices, faces, turn, eye, lens, depths, tags):
    """Draw static faces, seen from both sides; each leaves its own index as its tag.

    Args:
        vertices: (n, 3) metres, scene frame.
        faces: (m, 3) vertex indices.
        turn: (3, 3) rows: the camera's right, down and forward.
        eye: (3,) the camera's place.
        lens: see `draw_face`.
        depths: (h, w) float32 inverse depths.
        tags: (h, w) int32.
    """
    height, width = tags.shape
    side = max(lens[1], width - lens[1]) / lens[0]
    rise = max(lens[2], height - lens[2]) / lens[0]
    seen = np.empty((len(vertices), 3))
    for k in range(len(vertices)):
        x, y, z = vertices[k, 0] - eye[0], vertices[k, 1] - eye[1], vertices[k, 2] - eye[2]
        for axis in range(3):
            seen[k, axis] = turn[axis, 0] * x + turn[axis, 1] * y + turn[axis, 2] * z
    corners = np.empty((3, 3))
    for k in range(len(faces)):
        for c in range(3):
            for axis in range(3):
                corners[c, axis] = seen[faces[k, c], axis]
        if _is_outside(corners, side, rise, lens[3], lens[4]):
            continue
        draw_face(corners, lens, k, NEARER, depths, tags)


@inner
def _is_outside(corners, side, rise, near, far):
    """Tell whether all corners lie beyond one plane of the view's frustum."""
    left = right = up = down = behind = beyond = 0
    for c in range(3):
        x, y, z = corners[c, 0], corners[c, 1], corners[c, 2]
        left += x < -side * z
        right += x > side * z
        up += y < -rise * z
        down += y > rise * z
        behind += z < near
        beyond += z > far
    return left == 3 or right == 3 or up == 3 or down == 3 or behind == 3 or beyond == 3


@kernel
def draw_from_above(vertices, faces, frame, heights, tags):
    """Draw faces as parallel light along -z sees them; the highest wins, and leaves its index as its tag.

    Args:
        vertices: (n, 3) metres, in a frame whose +z points to the light.
        faces: (m, 3) vertex indices.
        frame: pixels per metre, x and y of the middle, all in that frame.
        heights: (h, w) float32, the highest z so far, -inf at first.
        tags: (h, w) of any integer; what does not fit is cut off.
    """
    size_y, size_x = heights.shape
    scale = frame[0]
    left, top = size_x / 2 - frame[1] * scale, size_y / 2 + frame[2] * scale
    for k in range(len(faces)):
        a, b, c = vertices[faces[k, 0]], vertices[faces[k, 1]], vertices[faces[k, 2]]
        fill_triangle(
            left + a[0] * scale, top - a[1] * scale, a[2],
            left + b[0] * scale, top - b[1] * scale, b[2],
            left + c[0] * scale, top - c[1] * scale, c[2],
            k, NEARER, heights, tags,
        )  # fmt: skip
