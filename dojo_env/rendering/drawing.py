"""Kernels that draw road users."""

from math import exp, sqrt

import numpy as np

from dojo_env.rendering.compiling import inner, kernel
from dojo_env.rendering.fleet import MOST_VERTICES
from dojo_env.rendering.lighting import SRGB, to_linear
from dojo_env.rendering.raster import COVER, NEARER, draw_face, fill_triangle
from dojo_env.rendering.shading import expose
from dojo_env.rendering.shapes import Part
from dojo_env.rendering.target import project, touch, turn
from dojo_env.snapshot import Lights

_FINEST, _FINE, _MIDDLE = 100.0, 36.0, 12.0
"""Pixels from which a road user is drawn at each level of detail but the coarsest."""
_COARSER = 3.0
"""How many times larger a road user must be for each level where the look is plain."""
_BODY, _GLASS, _HEADLAMP, _BRAKE, _LEFT, _RIGHT, _BLUE = (
    int(part) for part in (Part.BODY, Part.GLASS, Part.HEADLAMP, Part.BRAKE, Part.LEFT, Part.RIGHT, Part.BLUE)
)
_LIT_BRAKE, _LIT_LEFT, _LIT_RIGHT, _LIT_BLUE, _OFF = (
    int(light) for light in (Lights.BRAKE, Lights.LEFT, Lights.RIGHT, Lights.BLUE, Lights.OFF)
)
PALETTE = to_linear(
    np.array(
        [
            (0, 0, 0), (16, 19, 22), (17, 17, 18), (30, 31, 34), (236, 238, 228), (120, 16, 14),
            (190, 110, 30), (190, 110, 30), (40, 80, 230), (205, 160, 130), (46, 52, 76), (232, 232, 230),
            (150, 154, 160), (56, 38, 27), (60, 60, 64), (226, 206, 40), (0, 0, 0), (62, 62, 64),
        ],
        dtype=np.uint8,
    )
)  # fmt: skip
"""Linear colour by `Part`, of those that are the same for all road users."""
_PARTS = len(Part)
OWN = np.full(len(Part), -1)
"""Row of a road user's own colours by `Part`; -1 where it has none."""
OWN[[Part.BODY, Part.SKIN, Part.LEGS, Part.HAIR, Part.GEAR]] = range(5)
OWN[Part.ACCENT] = OWN[Part.GEAR]
_EMITTED = np.minimum(1.0, PALETTE * 1.2)
"""Linear light of a lit part."""
_EMITTED[_HEADLAMP] = (1.0, 0.97, 0.86)
_EMITTED[_BRAKE] = (1.0, 0.06, 0.04)
_EMITTED[_LEFT] = _EMITTED[_RIGHT] = (1.0, 0.5, 0.04)
_EMITTED[_BLUE] = (0.2, 0.4, 1.0)
_STREET = (0.2, 0.165, 0.12)
"""What street lamps add to road users at night."""
_GLOSS = np.zeros(len(Part))
_GLOSS[: Part.CHROME + 1] = (0.05, 0.14, 0.0, 0.03, 0.06, 0.05, 0.05, 0.05, 0.05, 0.0, 0.0, 0.04, 0.45)
_GLOSS[[Part.STRIPE, Part.ACCENT, Part.CABIN]] = _GLOSS[Part.BODY]
"""Share of the light that each `Part` mirrors when one looks straight at it."""
_SPARKLE = 7.0
"""Strength of the sun's highlight, as a multiple of what is mirrored straight on."""
_AROUND = 0.3
"""What houses and trees around send, as a share of the sky's light."""
_DARK_FOOT, _LIT_FROM = 0.5, 0.45
"""Share of the sky's light that reaches a body's lower edge, and the share of its height that all reaches."""
_SUN, _SUN_COLOUR, _SKY_COLOUR, _GROUND_COLOUR, _ZENITH, _HORIZON, WEATHER = range(7)
"""Rows of a packed light."""


@kernel
def users_in_view(users, beyond, view):
    """Find the road users whose bounding spheres reach into the view.

    Args:
        users: the road users.
        beyond: metres by which the spheres are widened, for shadows and head lamps that reach farther.
        view: the camera.

    Returns:
        (k,) int32 their rows, ascending.
    """
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
        reach = sqrt(square) + beyond
        if seen[2] + reach < lens[3] or seen[2] - reach > lens[4]:
            continue
        beside = abs(seen[0]) - reach * side_length > side * seen[2]
        if not beside and abs(seen[1]) - reach * rise_length <= rise * seen[2]:
            kept[count] = k
            count += 1
    return kept[:count]


@kernel
def draw_users(near, users, models, light, plain, colours, view, target, count):
    """Draw road users.

    Args:
        near: (k,) which ones.
        users: all of them.
        models: the library.
        light: (7, 3) packed.
        plain: draw fewer faces, which mirror nothing.
        colours: shade the faces; shapes alone need none.
        view: the camera.
        target: what to draw into; changed.
        count: the number of faces in it so far.

    Returns:
        The number of faces in it now.
    """
    seen, screen = np.empty((MOST_VERTICES, 3)), np.empty((MOST_VERTICES, 3))
    corners, inside = np.empty((3, 3)), np.empty((5, 3))
    for k in near:
        detail = _detail(users, k, plain, view)
        model = users.models[k]
        first, last = models.spans[model, detail, 0], models.spans[model, detail, 1]
        away = _see(models.vertices, first, last, users, k, view, seen)
        is_ahead = project(seen[: last - first], view, screen)
        if not touch(screen[: last - first], is_ahead, target):
            continue
        _look_from_inside(users, k, view, light, inside)
        veil = 1.0 - exp(-light[WEATHER, 2] * away)
        for face in range(models.spans[model, detail, 2], models.spans[model, detail, 3]):
            if not _shows_front(models.planes, face, inside):
                continue
            if _draw(models.faces, face, seen, screen, is_ahead, corners, view, count, NEARER, target):
                if colours:
                    height = models.vertices[first + models.faces[face, 0], 2]
                    _shade_face(
                        users, k, models, face, height, inside, veil, light, plain, target.shades, count
                    )
                target.owners[count] = k
                count += 1
    return count


@inner
def _draw(faces, face, seen, screen, is_ahead, corners, view, tag, mode, target):
    """Draw one face of what `_see` has brought into view; returns how many pixels changed."""
    a, b, c = faces[face, 0], faces[face, 1], faces[face, 2]
    if is_ahead:
        return fill_triangle(
            screen[a, 0], screen[a, 1], screen[a, 2], screen[b, 0], screen[b, 1], screen[b, 2],
            screen[c, 0], screen[c, 1], screen[c, 2], tag, mode, target.depths, target.tags,
        )  # fmt: skip
    for axis in range(3):
        corners[0, axis], corners[1, axis], corners[2, axis] = seen[a, axis], seen[b, axis], seen[c, axis]
    return draw_face(corners, view.lens, tag, mode, target.depths, target.tags)


@inner
def _look_from_inside(users, k, view, light, inside):
    """Bring eye, sun and the way up into a model's unit box; the fourth row takes normals out of it.

    Which side of a face a place lies on does not change when both are scaled, so fronts can be told in the
    box; a normal is scaled by the inverse. The last row: distance to the eye, and how far up and towards the
    sun the way to it leads.
    """
    square = up = sun = 0.0
    for axis in range(3):
        part = view.eye[axis] - users.places[k, axis] + 0.5 * users.frames[k, axis, 0]
        square += part * part
        sun += part * light[_SUN, axis]
        up += part * (axis == 2)
    inside[4, 0] = sqrt(square)
    inside[4, 1], inside[4, 2] = up / inside[4, 0], sun / inside[4, 0]
    for column in range(3):
        square = eye = sun = 0.0
        for axis in range(3):
            part = users.frames[k, axis, column]
            square += part * part
            eye += part * (view.eye[axis] - users.places[k, axis])
            sun += part * light[_SUN, axis]
        inside[0, column] = eye / square
        inside[1, column] = sun / square
        inside[2, column] = users.frames[k, 2, column] / square
        inside[3, column] = 1.0 / square


@inner
def _shows_front(planes, face, inside):
    x, y, z = planes[face, 0], planes[face, 1], planes[face, 2]
    return x * inside[0, 0] + y * inside[0, 1] + z * inside[0, 2] > planes[face, 3]


@kernel
def count_alone(whose, users, models, light, plain, view, target):
    """Count the pixels that each of some road users would cover if it were alone.

    Args:
        whose: (k,) rows of those to count.
        users: all road users.
        models: the library.
        light: (7, 3) packed; pixels do not depend on it.
        plain: count them as they are drawn in fewer faces.
        view: the camera.
        target: its tags, all `STATIC` at first, are written to; nothing else of it is changed.

    Returns:
        (k,) int32 pixels inside the view, whatever stands in front.
    """
    seen, screen = np.empty((MOST_VERTICES, 3)), np.empty((MOST_VERTICES, 3))
    corners, inside = np.empty((3, 3)), np.empty((5, 3))
    pixels = np.zeros(len(whose), dtype=np.int32)
    for m in range(len(whose)):
        k = whose[m]
        detail, model = _detail(users, k, plain, view), users.models[k]
        first, last = models.spans[model, detail, 0], models.spans[model, detail, 1]
        _see(models.vertices, first, last, users, k, view, seen)
        is_ahead = project(seen[: last - first], view, screen)
        _look_from_inside(users, k, view, light, inside)
        for face in range(models.spans[model, detail, 2], models.spans[model, detail, 3]):
            if _shows_front(models.planes, face, inside):
                pixels[m] += _draw(
                    models.faces, face, seen, screen, is_ahead, corners, view, m, COVER, target
                )
    return pixels


@inner
def _see(vertices, first, last, users, k, view, seen):
    """Bring a model's vertices into camera space; returns how far away it is, metres."""
    ahead_x, left_x, up_x, x = _way_of(users, k, view, 0)
    ahead_y, left_y, up_y, y = _way_of(users, k, view, 1)
    ahead_z, left_z, up_z, z = _way_of(users, k, view, 2)
    for v in range(last - first):
        ahead, left, up = vertices[first + v, 0], vertices[first + v, 1], vertices[first + v, 2]
        seen[v, 0] = ahead_x * ahead + left_x * left + up_x * up + x
        seen[v, 1] = ahead_y * ahead + left_y * left + up_y * up + y
        seen[v, 2] = ahead_z * ahead + left_z * left + up_z * up + z
    return sqrt(x * x + y * y + z * z)


@inner
def _way_of(users, k, view, row):
    """Bring a road user's length, width, height and place onto an axis of the camera."""
    a, b, c = view.axes[row, 0], view.axes[row, 1], view.axes[row, 2]
    frame, place = users.frames[k], users.places[k]
    return (
        a * frame[0, 0] + b * frame[1, 0] + c * frame[2, 0],
        a * frame[0, 1] + b * frame[1, 1] + c * frame[2, 1],
        a * frame[0, 2] + b * frame[1, 2] + c * frame[2, 2],
        a * (place[0] - view.eye[0]) + b * (place[1] - view.eye[1]) + c * (place[2] - view.eye[2]),
    )


@inner
def _detail(users, k, plain, view):
    """Level of detail for the size that a road user has on the screen."""
    z = long = tall = 0.0
    for axis in range(3):
        part = users.frames[k, axis, 0]
        z += view.axes[2, axis] * (users.places[k, axis] - 0.5 * part - view.eye[axis])
        long += part * part
        tall += users.frames[k, axis, 2] ** 2
    pixels = view.lens[0] * sqrt(max(long, tall)) / max(z, view.lens[3]) / (_COARSER if plain else 1.0)
    return 0 if pixels > _FINEST else (1 if pixels > _FINE else (2 if pixels > _MIDDLE else 3))


@inner
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


@inner
def _shade_face(users, k, models, face, height, inside, veil, light, plain, shades, row):
    """Light a face: what it emits, or sun and sky on its colour and what it mirrors of them; then fog."""
    number = models.parts[face] - _PARTS
    part = models.parts[face] if number < 0 else _BODY  # A model from elsewhere has paint of its own colours.
    own = OWN[part] if number < 0 else -1
    lights = users.lights[k]
    glow = -1.0 if lights & _OFF else _emission(part, lights, light[WEATHER, 0])
    square = facing = level = 0.0
    seen = -models.planes[face, 3]
    for axis in range(3):
        normal = models.planes[face, axis]
        square += normal * normal * inside[3, axis]
        seen += normal * inside[0, axis]
        facing += normal * inside[1, axis]
        level += normal * inside[2, axis]
    length = sqrt(square)
    seen, facing, level = min(1.0, seen / (length * inside[4, 0])), facing / length, level / length
    gloss = sparkle = sky = high = 0.0
    if _GLOSS[part] > 0.0 and not plain:
        up, towards = 2.0 * seen * level - inside[4, 1], 2.0 * seen * facing - inside[4, 2]
        gloss = _GLOSS[part] * (1.0 + 8.0 * (1.0 - seen) ** 4)
        sparkle = _SPARKLE * _GLOSS[part] * max(0.0, towards) ** 32
        sky, high = min(1.0, max(0.0, 0.5 + 3.0 * up)), min(1.0, max(0.0, 1.5 * up))
    share = 0.5 + 0.5 * level
    foot = _DARK_FOOT + (1.0 - _DARK_FOOT) * min(1.0, height / _LIT_FROM)
    facing = max(0.0, facing)
    for c in range(3):
        if glow >= 0.0:
            value = glow * _EMITTED[part, c]
        else:
            base = users.colours[k, own, c] if own >= 0 else PALETTE[part, c]
            if number >= 0:
                base = models.colours[number, c]
            soft = share * light[_SKY_COLOUR, c] + (1.0 - share) * light[_GROUND_COLOUR, c]
            soft += light[WEATHER, 0] * _STREET[c] * (0.4 + 0.6 * share)
            around = _AROUND * light[_SKY_COLOUR, c]
            above = light[_HORIZON, c] + high * (light[_ZENITH, c] - light[_HORIZON, c])
            value = base * (foot * soft + facing * light[_SUN_COLOUR, c])
            value += gloss * (around + sky * (above - around)) + sparkle * light[_SUN_COLOUR, c]
        value = value * (1.0 - veil) + veil * light[_HORIZON, c]
        shades[row, c] = SRGB[int(expose(value) * 4095.0 + 0.5)]
