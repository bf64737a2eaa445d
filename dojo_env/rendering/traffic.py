"""The road users of a snapshot as kernels draw them: model, place, colour and lights of each."""

from functools import cache, lru_cache
from math import cos, sin
from typing import NamedTuple
from zlib import crc32

import numpy as np
from numpy.typing import NDArray

from dojo_env.rendering.compiling import kernel
from dojo_env.rendering.lighting import to_linear
from dojo_env.rendering.models import DETAILS, Model, build_models
from dojo_env.snapshot import Kind, Snapshot

Floats = NDArray[np.float64]
Ints = NDArray[np.int32]

_NATURAL = to_linear(
    np.array(
    [
        (222, 224, 226), (222, 224, 226), (196, 200, 204), (150, 154, 160), (92, 97, 104), (36, 38, 42),
        (28, 30, 34), (24, 52, 104), (40, 84, 150), (146, 24, 28), (176, 40, 36), (60, 82, 66),
        (178, 164, 132), (70, 50, 40),
    ],
    dtype=np.uint8,
))  # fmt: skip
"""Linear colours that cars have, and clothes, roughly as often as here."""
_BY_KIND = {
    Kind.TAXI: (238, 206, 60), Kind.VAN: (228, 228, 224), Kind.BUS: (196, 44, 40),
    Kind.COACH: (226, 226, 230), Kind.TRUCK: (50, 92, 150), Kind.TRAILER: (170, 44, 40),
    Kind.TRAM: (214, 40, 36), Kind.TRAIN: (200, 30, 34), Kind.AMBULANCE: (240, 240, 236),
    Kind.POLICE: (60, 90, 170), Kind.FIRE_ENGINE: (190, 24, 24), Kind.SHIP: (60, 70, 84),
}  # fmt: skip
_UNSET = (255, 255, 0)
"""SUMO's colour for a vehicle that was given none."""
_LINEAR = to_linear(np.arange(256, dtype=np.uint8))
_CODES_KEPT = 1 << 14


class Users(NamedTuple):
    """Road users in the scene's frame.

    Attributes:
        frames: (n, 3, 3) columns are the model's axes, scaled to the road user's size, metres.
        places: (n, 3) middle of the front end on the ground, metres.
        models: (n,) index into the library.
        colours: (n, 3) linear.
        lights: (n,) `Lights`.
    """

    frames: Floats
    places: Floats
    models: Ints
    colours: Floats
    lights: NDArray[np.uint8]


class Library(NamedTuple):
    """Every model at every level of detail in one piece.

    Attributes:
        vertices: (n, 3) in the models' unit boxes.
        faces: (m, 3) indices that begin at 0 for each model and level.
        planes: (m, 4) unit normal of each face and its distance from 0, in the unit box.
        parts: (m,) `Part`.
        spans: (models, levels, 4) first and last vertex, first and last face; last ones are exclusive.
        profiles: (models, 4) what throws shadows, in the unit box: height of the nose, and of what stands
            higher the rear and front end and half the width.
    """

    vertices: Floats
    faces: Ints
    planes: Floats
    parts: NDArray[np.uint8]
    spans: Ints
    profiles: Floats


_NOSE, _HIGH = 0.16, 0.8
"""Share of the length that is the nose; share of the height over which a road user is high."""
MOST_FACES, MOST_VERTICES = 2000, 4096
"""No model has more of them; kernels make room for as many."""


@cache
def library() -> Library:
    """Pack the models."""
    levels = [model for variants in build_models() for each in variants for model in each]
    vertices = np.cumsum([0] + [len(model.vertices) for model in levels])
    faces = np.cumsum([0] + [len(model.faces) for model in levels])
    spans = np.stack([vertices[:-1], vertices[1:], faces[:-1], faces[1:]], axis=1)
    return Library(
        vertices=np.concatenate([model.vertices for model in levels]),
        faces=np.concatenate([model.faces for model in levels]),
        planes=np.concatenate([_planes(model) for model in levels]),
        parts=np.concatenate([model.parts for model in levels]),
        spans=spans.astype(np.int32).reshape(-1, DETAILS, 4),
        profiles=np.array([_profile(each[0].vertices) for variants in build_models() for each in variants]),
    )


def _profile(vertices: Floats) -> tuple[float, float, float, float]:
    """Measure what of a model throws its shadow; see `Library.profiles`."""
    nose, high = vertices[vertices[:, 0] > -_NOSE], vertices[vertices[:, 2] > _HIGH]
    return nose[:, 2].max(), high[:, 0].min(), high[:, 0].max(), np.abs(high[:, 1]).max()


def _planes(model: Model) -> Floats:
    a, b, c = (model.vertices[model.faces[:, k]] for k in range(3))
    normals = np.cross(b - a, c - a)
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    return np.column_stack([normals, (normals * a).sum(axis=1)])


@cache
def _variants() -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """First model and number of variants of each kind."""
    counts = np.array([len(variants) for variants in build_models()])
    return np.cumsum(counts) - counts, counts


def place_users(snapshot: Snapshot, origin: Floats) -> Users:
    """Bring road users into the frame of a scene. Shape and colour follow from a road user's id alone."""
    count = len(snapshot.ids)
    codes = np.fromiter(map(_code, snapshot.ids), np.int64, count)
    users = Users(
        frames=np.empty((count, 3, 3)),
        places=snapshot.positions - origin,
        models=np.empty(count, dtype=np.int32),
        colours=np.empty((count, 3)),
        lights=snapshot.lights,
    )
    turns = (snapshot.headings, snapshot.slopes, snapshot.sizes)
    _place(*turns, snapshot.kinds, snapshot.colours, codes, *_variants(), *_usual_colours(), users)
    return users


@lru_cache(maxsize=_CODES_KEPT)
def _code(name: str) -> int:
    """Number an id, the same in every process."""
    return crc32(name.encode())


@cache
def _usual_colours() -> tuple[Floats, NDArray[np.bool_]]:
    """Linear colour of each kind, and whether it has one."""
    chosen = [_BY_KIND.get(kind) for kind in Kind]
    table = to_linear(np.array([colour or (0, 0, 0) for colour in chosen], dtype=np.uint8))
    return table, np.array([colour is not None for colour in chosen])


@kernel
def _place(headings, slopes, sizes, kinds, given, codes, first, variants, usual, fixed, users):
    """Turn and scale each road user's axes, choose its model, and its colour unless SUMO gives one."""
    for k in range(len(codes)):
        cos_h, sin_h, cos_s, sin_s = cos(headings[k]), sin(headings[k]), cos(slopes[k]), sin(slopes[k])
        ahead = (cos_h * cos_s, sin_h * cos_s, sin_s)
        left = (-sin_h, cos_h, 0.0)
        up = (-cos_h * sin_s, -sin_h * sin_s, cos_s)
        users.models[k] = first[kinds[k]] + codes[k] % variants[kinds[k]]
        unset = given[k, 0] == _UNSET[0] and given[k, 1] == _UNSET[1] and given[k, 2] == _UNSET[2]
        for axis in range(3):
            users.frames[k, axis, 0] = ahead[axis] * sizes[k, 0]
            users.frames[k, axis, 1] = left[axis] * sizes[k, 1]
            users.frames[k, axis, 2] = up[axis] * sizes[k, 2]
            if not unset:
                users.colours[k, axis] = _LINEAR[given[k, axis]]
            elif fixed[kinds[k]]:
                users.colours[k, axis] = usual[kinds[k], axis]
            else:
                users.colours[k, axis] = _NATURAL[(codes[k] >> 8) % len(_NATURAL), axis]
