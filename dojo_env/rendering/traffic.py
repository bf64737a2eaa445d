"""What moves, drawn over a background: road users, their shadows and head lamps, signal lamps, link paths."""

from dataclasses import dataclass
from functools import cache
from math import sqrt
from zlib import crc32

import numpy as np
from numpy.typing import NDArray

from dojo_env.rendering.background import View
from dojo_env.rendering.lighting import Light, to_linear
from dojo_env.rendering.models import DETAILS, Part, build_models
from dojo_env.rendering.raster import COVER, NEARER, SHADED, SHADOW, draw_face, fill_triangle, kernel
from dojo_env.rendering.scene import LAMP_COLOURS, Lamps
from dojo_env.snapshot import Kind, Lights, Snapshot

Floats = NDArray[np.float64]
Ints = NDArray[np.int32]

LAMP, PATH = -1, -2
"""Owners of faces that belong to no road user."""
_FINE, _MIDDLE = 44.0, 14.0
"""Pixels from which a road user is drawn at the finest and the middle level of detail."""
_LEAST_LAMP = 1.2
"""Pixels; a lit lamp never shows smaller than with this radius, so that cameras can see signals."""
_LAMP_RADIUS = 0.11
_BODY, _GLASS, _HEADLAMP, _BRAKE, _LEFT, _RIGHT, _BLUE = (
    int(part) for part in (Part.BODY, Part.GLASS, Part.HEADLAMP, Part.BRAKE, Part.LEFT, Part.RIGHT, Part.BLUE)
)
_LIT_BRAKE, _LIT_LEFT, _LIT_RIGHT, _LIT_BLUE = (
    int(light) for light in (Lights.BRAKE, Lights.LEFT, Lights.RIGHT, Lights.BLUE)
)
_PARTS = to_linear(
    np.array(
        [
            (0, 0, 0), (38, 46, 54), (20, 20, 22), (44, 46, 50), (236, 238, 228), (120, 16, 14),
            (190, 110, 30), (190, 110, 30), (40, 80, 230), (205, 160, 130), (46, 52, 76), (232, 232, 230),
        ],
        dtype=np.uint8,
    )
)  # fmt: skip
"""Linear colour by `Part`; the body's own is each road user's."""
_EMITTED = np.minimum(1.0, _PARTS * 1.2)
_EMITTED[int(Part.HEADLAMP)] = (1.0, 0.97, 0.86)
_EMITTED[int(Part.BRAKE)] = (1.0, 0.06, 0.04)
_EMITTED[int(Part.LEFT)] = _EMITTED[int(Part.RIGHT)] = (1.0, 0.5, 0.04)
_EMITTED[int(Part.BLUE)] = (0.2, 0.4, 1.0)
"""Linear light of a lit part."""
_STREET = (0.5, 0.36, 0.21)
"""What street lamps add to road users at night."""
_NATURAL = np.array(
    [
        (222, 224, 226), (222, 224, 226), (196, 200, 204), (150, 154, 160), (92, 97, 104), (36, 38, 42),
        (28, 30, 34), (24, 52, 104), (40, 84, 150), (146, 24, 28), (176, 40, 36), (60, 82, 66),
        (178, 164, 132), (70, 50, 40),
    ],
    dtype=np.uint8,
)  # fmt: skip
"""Colours that cars have, roughly as often as here."""
_BY_KIND = {
    Kind.TAXI: (238, 206, 60), Kind.VAN: (228, 228, 224), Kind.BUS: (196, 44, 40), Kind.COACH: (226, 226, 230),
    Kind.TRUCK: (50, 92, 150), Kind.TRAILER: (170, 44, 40), Kind.TRAM: (214, 40, 36),
    Kind.TRAIN: (200, 30, 34), Kind.AMBULANCE: (240, 240, 236), Kind.POLICE: (60, 90, 170),
    Kind.FIRE_ENGINE: (190, 24, 24), Kind.SHIP: (60, 70, 84),
}  # fmt: skip
_UNSET = (255, 255, 0)
"""SUMO's colour for a vehicle that was given none."""
LIGHT_STEPS = 6
"""Steps from dark to the full light of head lamps."""
_BEAM_LENGTH, _BEAM_WIDTH = 16.0, 2.3


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Users:
    """The road users of a snapshot, as kernels take them.

    Attributes:
        frames: (n, 3, 3) columns are the model's axes, scaled; scene frame.
        places: (n, 3) metres, scene frame.
        models: (n,) index into the library.
        colours: (n, 3) linear.
        lights: (n,) `Lights`.
    """

    frames: Floats
    places: Floats
    models: Ints
    colours: Floats
    lights: NDArray[np.uint8]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Library:
    """Every model at every level of detail in one piece; `spans` (m, 3, 4): first and last vertex and face."""

    vertices: Floats
    faces: Ints
    parts: NDArray[np.uint8]
    spans: Ints


@cache
def library() -> Library:
    """Pack the models."""
    vertices, faces, parts, spans = [], [], [], []
    vertex = face = 0
    for variants in build_models():
        for levels in variants:
            for model in levels:
                vertices.append(model.vertices)
                faces.append(model.faces)
                parts.append(model.parts)
                spans.append((vertex, vertex + len(model.vertices), face, face + len(model.faces)))
                vertex, face = spans[-1][1], spans[-1][3]
    return Library(
        vertices=np.concatenate(vertices),
        faces=np.concatenate(faces),
        parts=np.concatenate(parts),
        spans=np.array(spans, dtype=np.int32).reshape(-1, DETAILS, 4),
    )


@cache
def _variants() -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """First model and number of variants of each kind."""
    counts = np.array([len(variants) for variants in build_models()])
    return np.cumsum(counts) - counts, counts


def place_users(snapshot: Snapshot, origin: Floats) -> Users:
    """Turn a snapshot into what kernels draw. Shape and colour follow from a road user's id alone."""
    first, counts = _variants()
    kinds = snapshot.kinds
    codes = np.fromiter((crc32(name.encode()) for name in snapshot.ids), np.int64, len(snapshot.ids))
    cos_h, sin_h = np.cos(snapshot.headings), np.sin(snapshot.headings)
    cos_s, sin_s = np.cos(snapshot.slopes), np.sin(snapshot.slopes)
    ahead = np.stack([cos_h * cos_s, sin_h * cos_s, sin_s], axis=1)
    left = np.stack([-sin_h, cos_h, np.zeros_like(cos_h)], axis=1)
    up = np.stack([-cos_h * sin_s, -sin_h * sin_s, cos_s], axis=1)
    frames = np.stack([ahead, left, up], axis=2) * snapshot.sizes[:, None, :]
    return Users(
        frames=np.ascontiguousarray(frames),
        places=snapshot.positions - origin,
        models=(first[kinds] + codes % counts[kinds]).astype(np.int32),
        colours=_colours(snapshot, codes),
        lights=snapshot.lights,
    )


@cache
def _kind_colours() -> tuple[Floats, NDArray[np.bool_], Floats]:
    chosen = [_BY_KIND.get(kind) for kind in Kind]
    table = to_linear(np.array([colour or (0, 0, 0) for colour in chosen], dtype=np.uint8))
    return table, np.array([colour is not None for colour in chosen]), to_linear(_NATURAL)


def _colours(snapshot: Snapshot, codes: NDArray[np.int64]) -> Floats:
    """SUMO's colour where one was given, else a usual one for the kind."""
    table, fixed, natural = _kind_colours()
    usual = np.where(
        fixed[snapshot.kinds][:, None], table[snapshot.kinds], natural[(codes >> 8) % len(natural)]
    )
    unset = (snapshot.colours == _UNSET).all(axis=1)
    return np.where(unset[:, None], usual, to_linear(snapshot.colours))


class Canvas:
    """The visibility buffer of one picture size, and the faces drawn into it."""

    def __init__(self, height: int, width: int) -> None:
        self.depths = np.zeros((height, width), dtype=np.float32)
        self.tags = np.full((height, width), -1, dtype=np.int32)
        self.shades = np.empty((0, 3), dtype=np.uint8)
        self.owners = np.empty(0, dtype=np.int32)
        self.count = 0

    def restore(self, depths: NDArray[np.float32], faces: int) -> None:
        """Begin a picture: put the background's depths back and make room for faces."""
        np.copyto(self.depths, depths)
        self.tags.fill(-1)
        self.count = 0
        if len(self.owners) < faces:
            self.shades = np.empty((2 * faces, 3), dtype=np.uint8)
            self.owners = np.empty(2 * faces, dtype=np.int32)


def most_faces(users: Users, lamps: Lamps, paths: int) -> int:
    """How many faces a picture can need at most."""
    spans = library().spans
    return int((spans[users.models, 0, 3] - spans[users.models, 0, 2]).sum()) + len(lamps.colours) + paths


def draw_users(canvas: Canvas, view: View, users: Users, light: Light, table: NDArray[np.uint8]) -> None:
    """Draw shadows and head lamps on the ground, then the road users themselves."""
    if not len(users.models):
        return
    models = library()
    near = _in_view(users.frames, users.places, view.axes, view.eye, view.lens, *canvas.tags.shape)
    if not len(near):
        return
    _draw_shadows(
        near, users.frames, users.places, users.models, models.vertices, models.faces, models.spans,
        light.sun if light.sun_colour.max() > 0.05 else np.array([0.0, 0.0, 1.0]),
        view.axes, view.eye, view.lens, canvas.depths, canvas.tags,
    )  # fmt: skip
    if light.headlights > 0:
        _draw_beams(
            near, users.frames, users.places, view.axes, view.eye, view.lens, canvas.depths, canvas.tags
        )
    lights = np.array(
        [view.axes @ light.sun, light.sun_colour, light.sky_colour, light.ground_colour, light.horizon,
         [light.headlights, light.fog, 0.0]]
    )  # fmt: skip
    canvas.count = _draw_models(
        near, users.frames, users.places, users.models, users.colours, users.lights,
        models.vertices, models.faces, models.parts, models.spans, _PARTS, lights, table,
        view.axes, view.eye, view.lens, canvas.depths, canvas.tags, canvas.shades, canvas.owners, canvas.count,
    )  # fmt: skip


def draw_lamps(canvas: Canvas, view: View, lamps: Lamps, table: NDArray[np.uint8]) -> None:
    """Draw the signal lamps that are lit and shine this way."""
    if len(lamps.colours):
        canvas.count = _draw_discs(
            lamps.centres, lamps.directions, lamps.colours, LAMP_COLOURS, table, view.axes, view.eye, view.lens,
            canvas.depths, canvas.tags, canvas.shades, canvas.owners, canvas.count,
        )  # fmt: skip


def draw_paths(
    canvas: Canvas, view: View, triangles: Floats, colours: Ints, table: NDArray[np.uint8]
) -> None:
    """Draw link paths in the colour that each link shows."""
    if len(colours):
        canvas.count = _draw_flat(
            triangles, colours, LAMP_COLOURS, table, view.axes, view.eye, view.lens,
            canvas.depths, canvas.tags, canvas.shades, canvas.owners, canvas.count,
        )  # fmt: skip


def count_pixels(canvas: Canvas, view: View, users: Users, whose: Ints) -> Ints:
    """Count the pixels that each of some road users would cover if it were alone: (k,)."""
    models = library()
    return _count(
        whose, users.frames, users.places, users.models, models.vertices, models.faces, models.spans,
        view.axes, view.eye, view.lens, canvas.depths, np.full_like(canvas.tags, -1),
    )  # fmt: skip


@kernel
def _in_view(frames, places, axes, eye, lens, height, width):
    """Which road users' bounding spheres reach into the view."""
    kept = np.empty(len(places), dtype=np.int32)
    count = 0
    side = max(lens[1], width - lens[1]) / lens[0]
    rise = max(lens[2], height - lens[2]) / lens[0]
    side_length, rise_length = sqrt(1.0 + side * side), sqrt(1.0 + rise * rise)
    middle = np.empty(3)
    for k in range(len(places)):
        square = 0.0
        for axis in range(3):
            middle[axis] = places[k, axis] - 0.5 * frames[k, axis, 0] + 0.5 * frames[k, axis, 2] - eye[axis]
            for column in range(3):
                square += frames[k, axis, column] ** 2
        radius = 0.51 * sqrt(square)
        x = axes[0, 0] * middle[0] + axes[0, 1] * middle[1] + axes[0, 2] * middle[2]
        y = axes[1, 0] * middle[0] + axes[1, 1] * middle[1] + axes[1, 2] * middle[2]
        z = axes[2, 0] * middle[0] + axes[2, 1] * middle[1] + axes[2, 2] * middle[2]
        # Shadows and beams reach farther than the road user itself.
        reach = radius * 2.0 + 3.0
        if z + reach < lens[3] or z - reach > lens[4]:
            continue
        if abs(x) - reach * side_length > side * z or abs(y) - reach * rise_length > rise * z:
            continue
        kept[count] = k
        count += 1
    return kept[:count]


@kernel
def _detail(frame, place, axes, eye, lens):
    """Level of detail for the size that a road user has on the screen."""
    z = square = 0.0
    for axis in range(3):
        z += axes[2, axis] * (place[axis] - 0.5 * frame[axis, 0] - eye[axis])
        for column in range(3):
            square = max(square, frame[axis, column] ** 2)
    pixels = lens[0] * sqrt(square) / max(z, lens[3])
    return 0 if pixels > _FINE else (1 if pixels > _MIDDLE else 2)


@kernel
def _see(vertices, span, frame, place, axes, eye, seen):
    """Bring a model's vertices into camera space."""
    turn, shift = np.zeros((3, 3)), np.zeros(3)
    for row in range(3):
        for inner in range(3):
            shift[row] += axes[row, inner] * (place[inner] - eye[inner])
            for column in range(3):
                turn[row, column] += axes[row, inner] * frame[inner, column]
    for k in range(span[1] - span[0]):
        x, y, z = vertices[span[0] + k, 0], vertices[span[0] + k, 1], vertices[span[0] + k, 2]
        for row in range(3):
            seen[k, row] = turn[row, 0] * x + turn[row, 1] * y + turn[row, 2] * z + shift[row]


@kernel
def _faces_camera(a, b, c, normal):
    """Compute a face's normal in camera space; tells whether its front is seen."""
    ux, uy, uz = b[0] - a[0], b[1] - a[1], b[2] - a[2]
    vx, vy, vz = c[0] - a[0], c[1] - a[1], c[2] - a[2]
    normal[0], normal[1], normal[2] = uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx
    return normal[0] * a[0] + normal[1] * a[1] + normal[2] * a[2] < 0.0


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
def _shade_face(part, base, glow, normal, up, lights, distance, table, out):
    """Light a face: emission, or sun and sky on its colour; then fog."""
    length = sqrt(normal[0] ** 2 + normal[1] ** 2 + normal[2] ** 2) + 1e-30
    facing = rise = 0.0
    for axis in range(3):
        facing += normal[axis] * lights[0, axis] / length
        rise += normal[axis] * up[axis] / length
    share = 0.5 + 0.5 * rise
    veil = 1.0 - np.exp(-lights[5, 1] * distance)
    for c in range(3):
        if glow >= 0.0:
            value = glow * _EMITTED[part][c]
        else:
            soft = share * lights[2, c] + (1.0 - share) * lights[3, c] + 0.22 * lights[5, 0] * _STREET[c]
            value = base[c] * (soft + max(0.0, facing) * lights[1, c])
            if part == _GLASS:
                value += 0.22 * max(0.0, rise) * lights[2, c]
            elif part == _BODY:
                value += 0.05 * max(0.0, rise) * lights[2, c]
        value = value * (1.0 - veil) + veil * lights[4, c]
        out[c] = table[int(min(1.0, value) * 4095.0 + 0.5)]


@kernel
def _draw_models(
    near, frames, places, models, colours, lamps, vertices, faces, parts, spans, palette, lights, table,
    axes, eye, lens, depths, tags, shades, owners, count,
):  # fmt: skip
    seen, corners, normal = np.empty((512, 3)), np.empty((3, 3)), np.empty(3)
    up = axes[:, 2].copy()
    for k in near:
        level = _detail(frames[k], places[k], axes, eye, lens)
        span = spans[models[k], level]
        _see(vertices, span, frames[k], places[k], axes, eye, seen)
        for face in range(span[2], span[3]):
            a, b, c = seen[faces[face, 0]], seen[faces[face, 1]], seen[faces[face, 2]]
            if not _faces_camera(a, b, c, normal):
                continue
            corners[0], corners[1], corners[2] = a, b, c
            if draw_face(corners, lens, count, NEARER, depths, tags) == 0:
                continue
            part = parts[face]
            base = colours[k] if part == _BODY else palette[part]
            glow = _emission(part, lamps[k], lights[5, 0])
            distance = sqrt(a[0] ** 2 + a[1] ** 2 + a[2] ** 2)
            _shade_face(part, base, glow, normal, up, lights, distance, table, shades[count])
            owners[count] = k
            count += 1
    return count


@kernel
def _draw_shadows(near, frames, places, models, vertices, faces, spans, sun, axes, eye, lens, depths, tags):
    """Cast each road user's simplest shape along the sun onto the plane it stands on."""
    cast, corners, up = np.empty((512, 3)), np.empty((3, 3)), np.empty(3)
    for k in near:
        span = spans[models[k], 2]
        length = sqrt(frames[k, 0, 2] ** 2 + frames[k, 1, 2] ** 2 + frames[k, 2, 2] ** 2)
        towards = 0.0
        for axis in range(3):
            up[axis] = frames[k, axis, 2] / length
            towards += up[axis] * sun[axis]
        towards = max(0.12, towards)
        place = places[k]
        for v in range(span[1] - span[0]):
            x, y, z = vertices[span[0] + v, 0], vertices[span[0] + v, 1], vertices[span[0] + v, 2]
            drop = z * length / towards
            for axis in range(3):
                held = place[axis] + frames[k, axis, 0] * x + frames[k, axis, 1] * y + frames[k, axis, 2] * z
                cast[v, axis] = held - drop * sun[axis] - eye[axis]
        for v in range(span[1] - span[0]):
            x, y, z = cast[v, 0], cast[v, 1], cast[v, 2]
            for row in range(3):
                cast[v, row] = axes[row, 0] * x + axes[row, 1] * y + axes[row, 2] * z
        for face in range(span[2], span[3]):
            for c in range(3):
                corners[c] = cast[faces[face, c]]
            draw_face(corners, lens, SHADED, SHADOW, depths, tags)


@kernel
def _draw_beams(near, frames, places, axes, eye, lens, depths, tags):
    """Lay the light of head lamps on the ground, from wide and weak to narrow and strong."""
    corners, ground = np.empty((3, 3)), np.empty((4, 3))
    for k in near:
        length = sqrt(frames[k, 0, 0] ** 2 + frames[k, 1, 0] ** 2 + frames[k, 2, 0] ** 2)
        width = sqrt(frames[k, 0, 1] ** 2 + frames[k, 1, 1] ** 2)
        if width < 0.7:
            continue
        for step in range(LIGHT_STEPS):
            share = 1.0 - step / LIGHT_STEPS
            for corner in range(4):
                far = 0.6 + _BEAM_LENGTH * share if corner in (1, 2) else 0.4
                half = (0.5 * width + _BEAM_WIDTH * share * (1.0 if corner in (1, 2) else 0.1)) * share
                half = half if corner < 2 else -half
                for axis in range(3):
                    ground[corner, axis] = (
                        places[k, axis] + frames[k, axis, 0] / length * far
                        + frames[k, axis, 1] / width * half - eye[axis]
                    )  # fmt: skip
            for corner in range(4):
                x, y, z = ground[corner, 0], ground[corner, 1], ground[corner, 2]
                for row in range(3):
                    ground[corner, row] = axes[row, 0] * x + axes[row, 1] * y + axes[row, 2] * z
            for second in range(1, 3):
                corners[0], corners[1], corners[2] = ground[0], ground[second], ground[second + 1]
                draw_face(corners, lens, SHADED - 1 - step, SHADOW, depths, tags)


@kernel
def _draw_discs(
    centres, directions, colours, palette, table, axes, eye, lens, depths, tags, shades, owners, count
):
    """Draw lit lamps as discs that face the camera, a little brighter in the middle by their glow."""
    height, width = tags.shape
    place = np.empty(3)
    for k in range(len(centres)):
        facing = 0.0
        for axis in range(3):
            place[axis] = centres[k, axis] - eye[axis]
            facing -= place[axis] * directions[k, axis]
        if facing <= 0.0:
            continue
        x = axes[0, 0] * place[0] + axes[0, 1] * place[1] + axes[0, 2] * place[2]
        y = axes[1, 0] * place[0] + axes[1, 1] * place[1] + axes[1, 2] * place[2]
        z = axes[2, 0] * place[0] + axes[2, 1] * place[1] + axes[2, 2] * place[2]
        if z < lens[3] or z > lens[4]:
            continue
        column, row = lens[1] + lens[0] * x / z, lens[2] + lens[0] * y / z
        radius = max(_LEAST_LAMP, 1.15 * _LAMP_RADIUS * lens[0] / z)
        w = 1.0 / (z - 0.06)
        changed = 0
        for v in range(max(0, int(row - radius)), min(height, int(row + radius) + 1)):
            for u in range(max(0, int(column - radius)), min(width, int(column + radius) + 1)):
                square = (u + 0.5 - column) ** 2 + (v + 0.5 - row) ** 2
                if square <= radius * radius and w > depths[v, u]:
                    depths[v, u] = w
                    tags[v, u] = count
                    changed += 1
        if changed:
            for c in range(3):
                shades[count, c] = table[int(palette[colours[k], c] * 4095.0 + 0.5)]
            owners[count] = LAMP
            count += 1
    return count


@kernel
def _draw_flat(triangles, colours, palette, table, axes, eye, lens, depths, tags, shades, owners, count):
    """Draw triangles in plain colours, from both sides."""
    corners = np.empty((3, 3))
    for k in range(len(triangles)):
        for corner in range(3):
            x, y, z = (
                triangles[k, corner, 0] - eye[0], triangles[k, corner, 1] - eye[1],
                triangles[k, corner, 2] - eye[2],
            )  # fmt: skip
            for row in range(3):
                corners[corner, row] = axes[row, 0] * x + axes[row, 1] * y + axes[row, 2] * z
        if draw_face(corners, lens, count, NEARER, depths, tags):
            for c in range(3):
                shades[count, c] = table[int(palette[colours[k], c] * 4095.0 + 0.5)]
            owners[count] = PATH
            count += 1
    return count


@kernel
def _count(whose, frames, places, models, vertices, faces, spans, axes, eye, lens, depths, tags):
    seen, corners, normal = np.empty((512, 3)), np.empty((3, 3)), np.empty(3)
    pixels = np.zeros(len(whose), dtype=np.int32)
    for m in range(len(whose)):
        k = whose[m]
        span = spans[models[k], _detail(frames[k], places[k], axes, eye, lens)]
        _see(vertices, span, frames[k], places[k], axes, eye, seen)
        for face in range(span[2], span[3]):
            for c in range(3):
                corners[c] = seen[faces[face, c]]
            if _faces_camera(corners[0], corners[1], corners[2], normal):
                pixels[m] += draw_face(corners, lens, m, COVER, depths, tags)
    return pixels
