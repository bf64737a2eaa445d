"""Kernels that draw road users and their shadows."""

from math import exp, sqrt

import numpy as np

from dojo_env.rendering.compiling import kernel
from dojo_env.rendering.lighting import to_linear
from dojo_env.rendering.raster import COVER, NEARER, SHADED, SHADOW, draw_face, fill_triangle
from dojo_env.rendering.shapes import Part
from dojo_env.rendering.target import project, touch, turn
from dojo_env.snapshot import Lights

_FINE, _MIDDLE = 27.0, 12.0
"""Pixels from which a road user is drawn at the finest and the middle level of detail."""
_MOST_VERTICES = 1024
_LOW_SUN = 0.12
_SHADOW_WIDTH, _SHADOW_HEIGHT = 0.96, 0.9
"""Shares of a road user's box that throw its shadow."""
_BODY, _GLASS, _HEADLAMP, _BRAKE, _LEFT, _RIGHT, _BLUE = (
    int(part) for part in (Part.BODY, Part.GLASS, Part.HEADLAMP, Part.BRAKE, Part.LEFT, Part.RIGHT, Part.BLUE)
)
_LIT_BRAKE, _LIT_LEFT, _LIT_RIGHT, _LIT_BLUE = (
    int(light) for light in (Lights.BRAKE, Lights.LEFT, Lights.RIGHT, Lights.BLUE)
)
_PALETTE = to_linear(
    np.array(
        [
            (0, 0, 0), (38, 46, 54), (20, 20, 22), (44, 46, 50), (236, 238, 228), (120, 16, 14),
            (190, 110, 30), (190, 110, 30), (40, 80, 230), (205, 160, 130), (46, 52, 76), (232, 232, 230),
        ],
        dtype=np.uint8,
    )
)  # fmt: skip
"""Linear colour by `Part`; the body's own is each road user's."""
_EMITTED = np.minimum(1.0, _PALETTE * 1.2)
"""Linear light of a lit part."""
_EMITTED[_HEADLAMP] = (1.0, 0.97, 0.86)
_EMITTED[_BRAKE] = (1.0, 0.06, 0.04)
_EMITTED[_LEFT] = _EMITTED[_RIGHT] = (1.0, 0.5, 0.04)
_EMITTED[_BLUE] = (0.2, 0.4, 1.0)
_STREET = (0.11, 0.08, 0.046)
"""What street lamps add to road users at night."""
_SUN_COLOUR, _SKY_COLOUR, _GROUND_COLOUR, _HORIZON, _WEATHER = 1, 2, 3, 5, 6
"""Rows of a packed light."""


@kernel
def users_in_view(users, view):
    """Find the road users whose bounding spheres, shadows or beams reach into the view: (k,) indices."""
    kept = np.empty(len(users.places), dtype=np.int32)
    count = 0
    lens = view.lens
    side, rise = view.width / 2 / lens[0], view.height / 2 / lens[0]
    side_length, rise_length = sqrt(1.0 + side * side), sqrt(1.0 + rise * rise)
    middle, seen = np.empty(3), np.empty(3)
    for k in range(len(users.places)):
        frame = users.frames[k]
        square = 0.0
        for axis in range(3):
            middle[axis] = users.places[k, axis] - 0.5 * frame[axis, 0] + 0.5 * frame[axis, 2]
            square += frame[axis, 0] ** 2 + frame[axis, 1] ** 2 + frame[axis, 2] ** 2
        turn(middle, view, seen)
        reach = sqrt(square) + 3.0
        if seen[2] + reach < lens[3] or seen[2] - reach > lens[4]:
            continue
        beside = abs(seen[0]) - reach * side_length > side * seen[2]
        if not beside and abs(seen[1]) - reach * rise_length <= rise * seen[2]:
            kept[count] = k
            count += 1
    return kept[:count]


@kernel
def draw_users(near, users, models, light, sun, table, view, target, count):
    """Draw road users; returns the number of faces in the target.

    Args:
        near: (k,) which ones.
        users: all of them.
        models: the library.
        light: (7, 3) packed.
        sun: (3,) towards the sun, camera frame.
        table: (4096,) uint8, sRGB by linear light.
        view: the camera.
        target: what to draw into.
        count: the number of faces in it so far.
    """
    seen, screen = np.empty((_MOST_VERTICES, 3)), np.empty((_MOST_VERTICES, 3))
    corners, normal, up = np.empty((3, 3)), np.empty(3), view.axes[:, 2].copy()
    for k in near:
        span = models.spans[users.models[k], _detail(users.frames[k], users.places[k], view)]
        _see(models.vertices, span, users.frames[k], users.places[k], view, seen)
        is_ahead = project(seen, span[1] - span[0], view, screen)
        touch(screen, span[1] - span[0], is_ahead, target)
        for face in range(span[2], span[3]):
            if _draw_front(models.faces[face], seen, screen, is_ahead, corners, view, count, target) == 0:
                continue
            _faces_camera(corners, normal)
            part = models.parts[face]
            base = users.colours[k] if part == _BODY else _PALETTE[part]
            glow = _emission(part, users.lights[k], light[_WEATHER, 0])
            facing, level = _cosine(normal, sun), _cosine(normal, up)
            distance = sqrt(corners[0, 0] ** 2 + corners[0, 1] ** 2 + corners[0, 2] ** 2)
            _shade_face(part, base, glow, facing, level, distance, light, table, target.shades[count])
            target.owners[count] = k
            count += 1
    return count


@kernel
def _draw_front(face, seen, screen, is_ahead, corners, view, tag, target):
    """Draw a face if its front is seen, and leave its corners; returns how many pixels changed."""
    a, b, c = face[0], face[1], face[2]
    if is_ahead:
        ux, uy = screen[b, 0] - screen[a, 0], screen[b, 1] - screen[a, 1]
        vx, vy = screen[c, 0] - screen[a, 0], screen[c, 1] - screen[a, 1]
        if ux * vy - uy * vx >= 0.0:
            return 0
        changed = fill_triangle(
            screen[a, 0], screen[a, 1], screen[a, 2], screen[b, 0], screen[b, 1], screen[b, 2],
            screen[c, 0], screen[c, 1], screen[c, 2], tag, NEARER, target.depths, target.tags,
        )  # fmt: skip
        if changed == 0:
            return 0
    for axis in range(3):
        corners[0, axis], corners[1, axis], corners[2, axis] = seen[a, axis], seen[b, axis], seen[c, axis]
    if is_ahead:
        return changed
    ux, uy, uz = seen[b, 0] - seen[a, 0], seen[b, 1] - seen[a, 1], seen[b, 2] - seen[a, 2]
    vx, vy, vz = seen[c, 0] - seen[a, 0], seen[c, 1] - seen[a, 1], seen[c, 2] - seen[a, 2]
    away = (
        (uy * vz - uz * vy) * seen[a, 0] + (uz * vx - ux * vz) * seen[a, 1] + (ux * vy - uy * vx) * seen[a, 2]
    )
    return 0 if away >= 0.0 else draw_face(corners, view.lens, tag, NEARER, target.depths, target.tags)


@kernel
def draw_shadows(near, users, sun, view, target):
    """Cast each road user's box along the sun onto the plane it stands on: its top and its two lit sides."""
    cast, screen, quad = np.empty((8, 3)), np.empty((8, 3)), np.empty(4, dtype=np.int64)
    held, seen, corners = np.empty(3), np.empty(3), np.empty((3, 3))
    for k in near:
        frame = users.frames[k]
        ahead = frame[0, 0] * sun[0] + frame[1, 0] * sun[1] + frame[2, 0] * sun[2]
        left = frame[0, 1] * sun[0] + frame[1, 1] * sun[1] + frame[2, 1] * sun[2]
        square = frame[0, 2] ** 2 + frame[1, 2] ** 2 + frame[2, 2] ** 2
        steep = max(
            _LOW_SUN * sqrt(square), frame[0, 2] * sun[0] + frame[1, 2] * sun[1] + frame[2, 2] * sun[2]
        )
        for v in range(8):
            x, y, z = -0.98 + 0.96 * (v & 1), _SHADOW_WIDTH * ((v >> 1 & 1) - 0.5), _SHADOW_HEIGHT * (v >> 2)
            for axis in range(3):
                held[axis] = users.places[k, axis] - z * square / steep * sun[axis]
                held[axis] += frame[axis, 0] * x + frame[axis, 1] * y + frame[axis, 2] * z
            turn(held, view, seen)
            for axis in range(3):
                cast[v, axis] = seen[axis]
        is_ahead = project(cast, 8, view, screen)
        touch(screen, 8, is_ahead, target)
        for side in range(3):
            if side == 0:
                quad[0], quad[1], quad[2], quad[3] = 4, 5, 7, 6
            elif side == 1:
                low = 1 if ahead > 0.0 else 0
                quad[0], quad[1], quad[2], quad[3] = low, low + 2, low + 6, low + 4
            else:
                low = 2 if left > 0.0 else 0
                quad[0], quad[1], quad[2], quad[3] = low, low + 1, low + 5, low + 4
            for second in range(1, 3):
                for axis in range(3):
                    corners[0, axis], corners[1, axis] = cast[quad[0], axis], cast[quad[second], axis]
                    corners[2, axis] = cast[quad[second + 1], axis]
                draw_face(corners, view.lens, SHADED, SHADOW, target.depths, target.tags)


@kernel
def count_alone(whose, users, models, view, target):
    """Count the pixels that each of some road users would cover if it were alone: (k,)."""
    seen, corners, normal = np.empty((_MOST_VERTICES, 3)), np.empty((3, 3)), np.empty(3)
    pixels = np.zeros(len(whose), dtype=np.int32)
    for m in range(len(whose)):
        k = whose[m]
        span = models.spans[users.models[k], _detail(users.frames[k], users.places[k], view)]
        _see(models.vertices, span, users.frames[k], users.places[k], view, seen)
        for face in range(span[2], span[3]):
            for c in range(3):
                corners[c] = seen[models.faces[face, c]]
            if _faces_camera(corners, normal):
                pixels[m] += draw_face(corners, view.lens, m, COVER, target.depths, target.tags)
    return pixels


@kernel
def _see(vertices, span, frame, place, view, seen):
    """Bring a model's vertices into camera space."""
    matrix, shift = np.zeros((3, 3)), np.empty(3)
    turn(place, view, shift)
    for row in range(3):
        for inner in range(3):
            for column in range(3):
                matrix[row, column] += view.axes[row, inner] * frame[inner, column]
    for k in range(span[1] - span[0]):
        x, y, z = vertices[span[0] + k, 0], vertices[span[0] + k, 1], vertices[span[0] + k, 2]
        for row in range(3):
            seen[k, row] = matrix[row, 0] * x + matrix[row, 1] * y + matrix[row, 2] * z + shift[row]


@kernel
def _detail(frame, place, view):
    """Level of detail for the size that a road user has on the screen."""
    z = square = 0.0
    for axis in range(3):
        z += view.axes[2, axis] * (place[axis] - 0.5 * frame[axis, 0] - view.eye[axis])
        for column in range(3):
            square = max(square, frame[axis, column] ** 2)
    pixels = view.lens[0] * sqrt(square) / max(z, view.lens[3])
    return 0 if pixels > _FINE else (1 if pixels > _MIDDLE else 2)


@kernel
def _faces_camera(corners, normal):
    """Compute a face's normal, not of unit length; tells whether its front is seen."""
    a, b, c = corners[0], corners[1], corners[2]
    ux, uy, uz = b[0] - a[0], b[1] - a[1], b[2] - a[2]
    vx, vy, vz = c[0] - a[0], c[1] - a[1], c[2] - a[2]
    normal[0], normal[1], normal[2] = uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx
    return normal[0] * a[0] + normal[1] * a[1] + normal[2] * a[2] < 0.0


@kernel
def _cosine(normal, direction):
    """Cosine of the angle between a normal of any length and a unit vector."""
    length = sqrt(normal[0] ** 2 + normal[1] ** 2 + normal[2] ** 2) + 1e-30
    return (normal[0] * direction[0] + normal[1] * direction[1] + normal[2] * direction[2]) / length


@kernel
def _emission(part, lights, headlights):
    """How brightly a part shines by itself; -1 where it does not."""
    if part == _HEADLAMP:
        return 1.0 if headlights > 0.0 else -1.0
    if part == _BRAKE:
        return 1.0 if lights & _LIT_BRAKE else (0.25 if headlights > 0.0 else -1.0)
    if part == _LEFT:
        return 1.0 if lights & _LIT_LEFT else -1.0
    if part == _RIGHT:
        return 1.0 if lights & _LIT_RIGHT else -1.0
    if part == _BLUE:
        return 1.0 if lights & _LIT_BLUE else -1.0
    return -1.0


@kernel
def _shade_face(part, base, glow, facing, level, distance, light, table, shade):
    """Light a face: what it emits, or sun and sky on its colour; then fog."""
    share = 0.5 + 0.5 * level
    veil = 1.0 - exp(-light[_WEATHER, 2] * distance)
    gloss = 0.22 if part == _GLASS else (0.05 if part == _BODY else 0.0)
    for c in range(3):
        if glow >= 0.0:
            value = glow * _EMITTED[part, c]
        else:
            soft = share * light[_SKY_COLOUR, c] + (1.0 - share) * light[_GROUND_COLOUR, c]
            soft += light[_WEATHER, 0] * _STREET[c]
            value = base[c] * (soft + max(0.0, facing) * light[_SUN_COLOUR, c])
            value += gloss * max(0.0, level) * light[_SKY_COLOUR, c]
        value = value * (1.0 - veil) + veil * light[_HORIZON, c]
        shade[c] = table[int(min(1.0, value) * 4095.0 + 0.5)]
