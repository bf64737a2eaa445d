"""What road users do to the ground they stand on: sun shadows, contact shadows, and the light of head lamps.

Each pixel that shows the ground near a road user is brought into metres ahead of its nose and to its left,
where shadow and light are given in closed form: soft edges at every size, without teeth. How strong they are
is kept in the pixel's tag: `STATIC` less (shadow + 32 contact + 1024 light), each from 0 to `LEVELS`.
"""

from math import ceil, isnan, sqrt

import numpy as np

from dojo_env.rendering.compiling import inner, kernel
from dojo_env.rendering.raster import STATIC
from dojo_env.rendering.target import LEVELS, keep_span
from dojo_env.rendering.traffic import Users
from dojo_env.snapshot import Lights

BEAM_LENGTH = 22.0
"""How far head lamps reach, metres."""
_HEIGHT_REACH = 0.8
"""How far along the optical axis a surface may be from the ground's plane, metres."""
_LOW_SUN = 0.12
_SOFT = 0.16
"""Width of a sun shadow's edge, metres; at least `_SOFT_PIXELS`."""
_SOFT_PIXELS = 1.4
_CONTACT_REACH = 0.45
"""Width of a contact shadow's edge, as a share of a road user's half width."""
_BEAM_FOOT, _BEAM_SPREAD = 1.3, 0.2
"""Half width of the light at the nose, and what it gains each metre."""
_NARROW = 0.7
"""Road users narrower than this have no head lamps, metres."""
_OFF = int(Lights.OFF)
_EDGES = np.array(
    [(0, 1), (1, 3), (3, 2), (2, 0), (4, 5), (5, 7), (7, 6), (6, 4), (0, 4), (1, 5), (2, 6), (3, 7)]
)
"""Edges between the corners of a footprint (0 to 3) and of what it reaches (4 to 7)."""


@kernel
def draw_on_ground(near, users, models, sun, headlights, plain, view, target):
    """Lay the shadows of road users, and at night the light of their head lamps, on the planes they stand on.

    Args:
        near: (k,) which road users.
        users: all of them.
        models: the library.
        sun: (3,) towards the sun; zero where none shines.
        headlights: whether head lamps are on.
        plain: throw the shadow of a box, and none where a road user touches the ground if the sun shines.
        view: the camera.
        target: what to draw into.
    """
    plane, corners, bounds = np.empty((7, 3)), np.empty((8, 2)), np.empty((view.height, 2))
    bounds[:, 0], bounds[:, 1] = view.width, 0.0
    prisms, seen = np.empty((2, 8)), np.empty((8, 3))
    one = Users(
        np.empty((1, 3, 3)),
        np.empty((1, 3)),
        np.empty(1, np.int32),
        users.colours,
        users.lights,
        users.origin,
    )
    for number in range(len(near) * models.prints.shape[1]):
        k, section = near[number // models.prints.shape[1]], number % models.prints.shape[1]
        if not _stand(users, k, models, section, one) or not _lay_plane(one, 0, view, plane):
            continue
        shadows, touches = _throw(one, 0, models.profiles, sun, plain, view, plane, prisms, corners)
        _fill(False, shadows, touches, prisms, corners, plane, view, seen, bounds, target)
        if headlights and section == 0 and plane[6, 1] > _NARROW and not users.lights[k] & _OFF:
            for corner in range(8):
                far = corner >> 2
                half = _BEAM_FOOT + far * _BEAM_SPREAD * BEAM_LENGTH
                corners[corner, 0], corners[corner, 1] = far * BEAM_LENGTH, half * (2 * (corner & 1) - 1)
            _fill(True, 0, False, prisms, corners, plane, view, seen, bounds, target)


@inner
def _stand(users, k, models, section, one):
    """Take a section of a road user for one of its own; tells whether there is such a section."""
    model = users.models[k]
    ends = models.prints[model, section]
    if isnan(ends[0, 0]):
        return False
    frame = users.frames[k]
    one.models[0] = model if isnan(models.prints[model, 1, 0, 0]) else len(models.profiles) - 1
    ahead = wide = 0.0
    for axis in range(3):
        one.places[0, axis] = users.places[k, axis]
        one.places[0, axis] += ends[0, 0] * frame[axis, 0] + ends[0, 1] * frame[axis, 1]
        along = ends[0, 0] - ends[1, 0], ends[0, 1] - ends[1, 1]
        one.frames[0, axis, 0] = along[0] * frame[axis, 0] + along[1] * frame[axis, 1]
        one.frames[0, axis, 2] = frame[axis, 2]
        ahead += one.frames[0, axis, 0] ** 2
        wide += frame[axis, 1] ** 2
    # To the left: at right angles to ahead and up, and as wide as the whole road user.
    size, tall = sqrt(wide / ahead), 0.0
    for axis in range(3):
        tall += frame[axis, 2] ** 2
    for axis in range(3):
        m, n = (axis + 1) % 3, (axis + 2) % 3
        cross = frame[m, 2] * one.frames[0, n, 0] - frame[n, 2] * one.frames[0, m, 0]
        one.frames[0, axis, 1] = size / sqrt(tall) * cross
    return True


@inner
def _lay_plane(users, k, view, plane):
    """Find the way from pixels to metres ahead and to the left; tells whether the camera is off the plane.

    Rows 0 to 2: ahead, left and 1, each divided by the depth, by column, row and 1. Rows 3 to 5: the axes and
    the nose in camera space. Row 6: length, width and height.
    """
    frame = users.frames[k]
    for column in range(3):
        square = 0.0
        for axis in range(3):
            square += frame[axis, column] ** 2
        plane[6, column] = sqrt(square)
    for row in range(3):
        a, b, c = view.axes[row, 0], view.axes[row, 1], view.axes[row, 2]
        plane[3, row] = (a * frame[0, 0] + b * frame[1, 0] + c * frame[2, 0]) / plane[6, 0]
        plane[4, row] = (a * frame[0, 1] + b * frame[1, 1] + c * frame[2, 1]) / plane[6, 1]
        plane[5, row] = a * (users.places[k, 0] - view.eye[0]) + b * (users.places[k, 1] - view.eye[1])
        plane[5, row] += c * (users.places[k, 2] - view.eye[2])
    volume = 0.0
    for row in range(3):
        one, two = plane[3 + (row + 1) % 3], plane[3 + (row + 2) % 3]
        for axis in range(3):
            m, n = (axis + 1) % 3, (axis + 2) % 3
            plane[row, axis] = one[m] * two[n] - one[n] * two[m]
    for axis in range(3):
        volume += plane[5, axis] * plane[2, axis]
    if abs(volume) < 1e-3:
        return False
    for row in range(3):
        x, y = plane[row, 0] / volume / view.lens[0], plane[row, 1] / volume / view.lens[0]
        plane[row, 2] = plane[row, 2] / volume - x * view.lens[1] - y * view.lens[2]
        plane[row, 0], plane[row, 1] = x, y
    return True


@inner
def _throw(users, k, profiles, sun, plain, view, plane, prisms, corners):
    """Find the outlines of a road user's shadow; returns how many there are, and whether it has a contact's.

    A shadow is that of two prisms: the body up to its belt, and what stands on it. Each is a rectangle swept
    along the ground, which three pairs of parallel lines bound. A prism's row: its middle, half length, half
    width, the unit normal of the sweep, half its width along that, and how sharp its edge is, 1/m.
    """
    frame, profile = users.frames[k], profiles[users.models[k]]
    length, width, height = plane[6, 0], plane[6, 1], plane[6, 2]
    along = across = up = 0.0
    for axis in range(3):
        along += frame[axis, 0] * sun[axis] / length
        across += frame[axis, 1] * sun[axis] / width
        up += frame[axis, 2] * sun[axis] / height
    shines = up > 0.0
    up = max(_LOW_SUN, up)
    x, y = -along / up * height, -across / up * height
    soft = max(_SOFT, _SOFT_PIXELS * max(plane[5, 2], view.lens[3]) / view.lens[0])
    touches = not (plain and shines)
    reach = 0.5 * (max(soft, _contact_edge(width)) if touches else soft)
    for corner in range(8):
        thrown = (corner >> 2) * shines
        corners[corner, 0] = -length - reach + (corner & 1) * (length + 2.0 * reach) + thrown * x
        corners[corner, 1] = (0.5 * width + reach) * ((corner & 2) - 1) + thrown * y
    if not shines:
        return 0, touches
    size = sqrt(x * x + y * y)
    for prism in range(2):
        row = prisms[prism]
        share = profile[0] if prism == 0 else 0.95
        low, high = (-0.98, -0.02) if prism == 0 else (profile[1], profile[2])
        row[0] = 0.5 * (low + high) * length + 0.5 * share * x
        row[1] = 0.5 * share * y
        half_length = 0.5 * (high - low) * length
        half_width = width * (0.48 if prism == 0 else profile[3])
        row[2], row[3] = half_length + 0.5 * share * abs(x), half_width + 0.5 * share * abs(y)
        row[4], row[5] = (-y / size, x / size) if size > 1e-6 else (0.0, 0.0)
        row[6] = abs(row[4]) * half_length + abs(row[5]) * half_width if size > 1e-6 else 1.0
        row[7] = 1.0 / soft
    return 1 if plain else 2, touches


@inner
def _contact_edge(width):
    """Width of the edge of a contact shadow, metres."""
    return _CONTACT_REACH * min(0.5 * width, 1.0) + 0.12


@inner
def _fill(lit, shadows, touches, prisms, corners, plane, view, seen, bounds, target):
    """Darken or light what lies on the plane within the hull of eight corners."""
    half_length, half_width = 0.5 * plane[6, 0], 0.5 * plane[6, 1]
    sharp = 1.0 / _contact_edge(plane[6, 1])
    top, bottom = _bound(corners, plane, view, seen, bounds)
    for row in range(top, bottom):
        first = int(max(0.0, min(float(view.width), bounds[row, 0])))
        last = int(max(0.0, min(float(view.width), ceil(bounds[row, 1]))))
        bounds[row, 0], bounds[row, 1] = view.width, 0.0
        keep_span(target, row, first, last)
        start_x = plane[0, 0] * 0.5 + plane[0, 1] * (row + 0.5) + plane[0, 2]
        start_y = plane[1, 0] * 0.5 + plane[1, 1] * (row + 0.5) + plane[1, 2]
        start_w = plane[2, 0] * 0.5 + plane[2, 1] * (row + 0.5) + plane[2, 2]
        for column in range(first, last):
            tag, held = target.tags[row, column], target.depths[row, column]
            w = start_w + plane[2, 0] * column
            if tag > STATIC or not abs(w - held) < _HEIGHT_REACH * w * held:
                continue
            depth = 1.0 / w
            ahead, left = (start_x + plane[0, 0] * column) * depth, (start_y + plane[1, 0] * column) * depth
            shade = contact = light = 0.0
            if lit:
                light = _beam(ahead, left)
            else:
                for prism in range(shadows):
                    shade = max(shade, _inside(prisms[prism], ahead, left))
                if touches:
                    contact = _both(
                        (half_length - abs(ahead + half_length)) * sharp, (half_width - abs(left)) * sharp
                    )
            if shade > 0.0 or contact > 0.0 or light > 0.0:
                target.tags[row, column] = _joined(tag, shade, contact, light)


@inner
def _bound(corners, plane, view, seen, bounds):
    """Find the columns that the hull of corners on the plane covers in each row; returns the rows.

    Rows of `bounds` begin as (width, 0), and whoever has read them leaves them so.
    What lies before the near plane is cut off from each edge; the ground is far outside the picture there.
    """
    height, near = view.height, view.lens[3]
    for corner in range(8):
        for axis in range(3):
            seen[corner, axis] = plane[5, axis] + corners[corner, 0] * plane[3, axis]
            seen[corner, axis] += corners[corner, 1] * plane[4, axis]
    first, last = height, 0
    for edge in range(len(_EDGES)):
        a, b = _EDGES[edge, 0], _EDGES[edge, 1]
        if seen[a, 2] < near and seen[b, 2] < near:
            continue
        if seen[a, 2] < seen[b, 2]:
            a, b = b, a
        share = 1.0 if seen[b, 2] >= near else (seen[a, 2] - near) / (seen[a, 2] - seen[b, 2])
        scale_a = view.lens[0] / seen[a, 2]
        scale_b = view.lens[0] / max(near, seen[b, 2])
        x, y = seen[a, 0] * scale_a + view.lens[1], seen[a, 1] * scale_a + view.lens[2]
        end_x = (seen[a, 0] + share * (seen[b, 0] - seen[a, 0])) * scale_b + view.lens[1]
        end_y = (seen[a, 1] + share * (seen[b, 1] - seen[a, 1])) * scale_b + view.lens[2]
        if y > end_y:
            x, y, end_x, end_y = end_x, end_y, x, y
        step = (end_x - x) / max(1e-9, end_y - y)
        top, bottom = int(max(0.0, min(y, float(height)))), int(max(0.0, min(float(height), end_y + 1.0)))
        first, last = min(first, top), max(last, bottom)
        for row in range(top, bottom):
            # Where the edge crosses the row's middle, or ends before it.
            place = x + step * (min(max(row + 0.5, y), end_y) - y)
            bounds[row, 0], bounds[row, 1] = min(bounds[row, 0], place), max(bounds[row, 1], place)
    return first, last


@inner
def _inside(prism, ahead, left):
    """How far inside a swept rectangle a place is, from 0 to 1."""
    x, y = ahead - prism[0], left - prism[1]
    depth = min(prism[2] - abs(x), prism[6] - abs(prism[4] * x + prism[5] * y))
    side = prism[3] - abs(y)
    return _both(depth * prism[7], side * prism[7])


@inner
def _both(depth, side):
    """Go from 0 to 1, smoothly, from half a unit outside to half a unit inside, in two directions."""
    if depth <= -0.5 or side <= -0.5:
        return 0.0
    one, other = min(1.0, 0.5 + depth), min(1.0, 0.5 + side)
    return one * one * (3.0 - 2.0 * one) * (other * other * (3.0 - 2.0 * other))


@inner
def _beam(ahead, left):
    """Light of a pair of dipped head lamps: two pools that join and fade."""
    if ahead <= 0.0 or ahead >= BEAM_LENGTH:
        return 0.0
    apart = 0.62 * max(0.0, 1.0 - ahead / 7.0)
    wide = _BEAM_FOOT + _BEAM_SPREAD * ahead - apart
    aside = abs(abs(left) - apart) / wide
    if aside >= 1.0:
        return 0.0
    fade = 1.0 - ahead / BEAM_LENGTH
    return (1.0 - aside * aside) ** 2 * ahead / (ahead + 1.2) * fade * fade


@inner
def _joined(tag, shade, contact, light):
    """Add shadow, contact and light to what a tag holds; where there is some already, the stronger counts."""
    held = STATIC - tag
    shadow = max(held & LEVELS, int(shade * LEVELS + 0.5))
    touching = max(held >> 5 & LEVELS, int(contact * LEVELS + 0.5))
    lit = max(held >> 10 & LEVELS, int(light * LEVELS + 0.5))
    return STATIC - (shadow + 32 * touching + 1024 * lit)
