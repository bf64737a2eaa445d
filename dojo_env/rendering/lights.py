"""Kernels that draw signal lamps, and link paths in their colours."""

from math import cos, pi, sin

import numpy as np

from dojo_env.rendering.compiling import inner, kernel
from dojo_env.rendering.lighting import SRGB
from dojo_env.rendering.raster import NEARER, draw_face
from dojo_env.rendering.scene import LAMP_COLOURS
from dojo_env.rendering.target import LAMP, PATH, project, touch, turn

_LAMP_RADIUS, _LAMP_CORNERS, _LAMP_OUT = 0.115, 12, 0.015
"""A lit lamp lies this far before the unlit one, metres."""
_LEAST_LAMP, _SMALL_LAMP = 1.2, 2.5
"""Pixels: no lit lamp shows smaller than the first, so that cameras see it; up to the second as a spot."""


@kernel
def draw_lamps(lamps, view, target, count):
    """Draw the lit lamps that shine this way as discs.

    Args:
        lamps: those that are lit.
        view: the camera.
        target: what to draw into; changed.
        count: the number of faces in it so far.

    Returns:
        The number of faces in it now: one more for each lamp of which something shows.
    """
    seen, corners = np.empty(3), np.empty((3, 3))
    for k in range(len(lamps.centres)):
        facing = 0.0
        for axis in range(3):
            facing += (view.eye[axis] - lamps.centres[k, axis]) * lamps.directions[k, axis]
        turn(lamps.centres[k], view, seen)
        if facing <= 0.0 or seen[2] < view.lens[3] or seen[2] > view.lens[4]:
            continue
        if _LAMP_RADIUS * view.lens[0] < _SMALL_LAMP * seen[2]:
            changed = _draw_spot(seen, view, count, target)
        else:
            changed = _draw_disc(lamps.centres[k], lamps.directions[k], corners, view, count, target)
        if changed:
            _plain(lamps.colours[k], target.shades[count])
            target.owners[count] = LAMP
            count += 1
    return count


@kernel
def draw_flat(paths, view, target):
    """Draw triangles in plain colours, from both sides.

    Args:
        paths: the triangles, and what each link shows.
        view: the camera.
        target: what to draw into, with no faces in it yet; changed.

    Returns:
        The number of faces in it now: as many as there are triangles.
    """
    corners, screen, seen = np.empty((3, 3)), np.empty((3, 3)), np.empty(3)
    for k in range(len(paths.triangles)):
        for c in range(3):
            turn(paths.triangles[k, c], view, seen)
            corners[c] = seen
        touch(screen, project(corners, view, screen), target)
        draw_face(corners, view.lens, k, NEARER, target.depths, target.tags)
        _plain(paths.colours[k], target.shades[k])
        target.owners[k] = PATH
    return len(paths.triangles)


@inner
def _plain(colour, shade):
    for c in range(3):
        shade[c] = SRGB[int(LAMP_COLOURS[colour, c] * 4095.0 + 0.5)]


@kernel
def _draw_disc(centre, direction, corners, view, tag, target):
    """Draw a disc that faces a level direction; returns how many pixels changed."""
    place, seen, screen = np.empty(3), np.empty(3), np.empty((3, 3))
    changed = 0
    for k in range(_LAMP_CORNERS):
        angle = 2.0 * pi * k / _LAMP_CORNERS
        aside, up = _LAMP_RADIUS * cos(angle), _LAMP_RADIUS * sin(angle)
        place[0] = centre[0] + _LAMP_OUT * direction[0] - aside * direction[1]
        place[1] = centre[1] + _LAMP_OUT * direction[1] + aside * direction[0]
        place[2] = centre[2] + up
        turn(place, view, seen)
        corners[min(k, 2)] = seen
        if k >= 2:
            touch(screen, project(corners, view, screen), target)
            changed += draw_face(corners, view.lens, tag, NEARER, target.depths, target.tags)
            corners[1] = corners[2]
    return changed


@kernel
def _draw_spot(seen, view, tag, target):
    """Draw a spot that faces the camera, large enough to be seen; returns how many pixels changed."""
    height, width = target.tags.shape
    scale = view.lens[0] / seen[2]
    column, row = view.lens[1] + seen[0] * scale, view.lens[2] + seen[1] * scale
    radius = max(_LEAST_LAMP, _LAMP_RADIUS * scale)
    w = 1.0 / (seen[2] - 0.06)
    changed = 0
    for v in range(max(0, int(row - radius)), min(height, int(row + radius) + 1)):
        for u in range(max(0, int(column - radius)), min(width, int(column + radius) + 1)):
            square = (u + 0.5 - column) ** 2 + (v + 0.5 - row) ** 2
            if square <= radius * radius and w > target.depths[v, u]:
                target.depths[v, u] = w
                target.tags[v, u] = tag
                target.spans[v, 0], target.spans[v, 1] = (
                    min(target.spans[v, 0], u),
                    max(target.spans[v, 1], u + 1),
                )
                changed += 1
    return changed
