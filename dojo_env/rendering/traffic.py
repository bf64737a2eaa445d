"""The road users of a snapshot as kernels draw them: model, place, colour and lights of each."""

from functools import cache
from typing import NamedTuple
from zlib import crc32

import numpy as np
from numpy.typing import NDArray

from dojo_env.rendering.lighting import to_linear
from dojo_env.rendering.models import DETAILS, Model, build_models
from dojo_env.snapshot import Kind, Snapshot

Floats = NDArray[np.float64]
Ints = NDArray[np.int32]

_NATURAL = np.array(
    [
        (222, 224, 226), (222, 224, 226), (196, 200, 204), (150, 154, 160), (92, 97, 104), (36, 38, 42),
        (28, 30, 34), (24, 52, 104), (40, 84, 150), (146, 24, 28), (176, 40, 36), (60, 82, 66),
        (178, 164, 132), (70, 50, 40),
    ],
    dtype=np.uint8,
)  # fmt: skip
"""Colours that cars have, and clothes, roughly as often as here."""
_BY_KIND = {
    Kind.TAXI: (238, 206, 60), Kind.VAN: (228, 228, 224), Kind.BUS: (196, 44, 40),
    Kind.COACH: (226, 226, 230), Kind.TRUCK: (50, 92, 150), Kind.TRAILER: (170, 44, 40),
    Kind.TRAM: (214, 40, 36), Kind.TRAIN: (200, 30, 34), Kind.AMBULANCE: (240, 240, 236),
    Kind.POLICE: (60, 90, 170), Kind.FIRE_ENGINE: (190, 24, 24), Kind.SHIP: (60, 70, 84),
}  # fmt: skip
_UNSET = (255, 255, 0)
"""SUMO's colour for a vehicle that was given none."""


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
    """

    vertices: Floats
    faces: Ints
    planes: Floats
    parts: NDArray[np.uint8]
    spans: Ints


MOST_FACES = 400
"""No model has more faces."""


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
    )


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
    first, counts = _variants()
    kinds = snapshot.kinds
    codes = np.fromiter((crc32(name.encode()) for name in snapshot.ids), np.int64, len(snapshot.ids))
    cos_h, sin_h = np.cos(snapshot.headings), np.sin(snapshot.headings)
    cos_s, sin_s = np.cos(snapshot.slopes), np.sin(snapshot.slopes)
    frames = np.empty((len(codes), 3, 3))
    frames[:, 0, 0], frames[:, 1, 0], frames[:, 2, 0] = cos_h * cos_s, sin_h * cos_s, sin_s
    frames[:, 0, 1], frames[:, 1, 1], frames[:, 2, 1] = -sin_h, cos_h, 0.0
    frames[:, 0, 2], frames[:, 1, 2], frames[:, 2, 2] = -cos_h * sin_s, -sin_h * sin_s, cos_s
    return Users(
        frames=frames * snapshot.sizes[:, None, :],
        places=snapshot.positions - origin,
        models=(first[kinds] + codes % counts[kinds]).astype(np.int32),
        colours=_colours(snapshot, codes),
        lights=snapshot.lights,
    )


@cache
def _usual_colours() -> tuple[Floats, NDArray[np.bool_], Floats]:
    """Colour of each kind, whether it has one, and the colours of all others."""
    chosen = [_BY_KIND.get(kind) for kind in Kind]
    table = to_linear(np.array([colour or (0, 0, 0) for colour in chosen], dtype=np.uint8))
    return table, np.array([colour is not None for colour in chosen]), to_linear(_NATURAL)


def _colours(snapshot: Snapshot, codes: NDArray[np.int64]) -> Floats:
    """SUMO's colour where one was given, else a usual one for the kind."""
    table, fixed, natural = _usual_colours()
    others = natural[(codes >> 8) % len(natural)]
    usual = np.where(fixed[snapshot.kinds, None], table[snapshot.kinds], others)
    unset = (snapshot.colours == _UNSET).all(axis=1, keepdims=True)
    colours: Floats = np.where(unset, usual, to_linear(snapshot.colours))
    return colours
