"""All models that road users are drawn with, packed as kernels take them: ours, and a user's by type."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from dojo_env.rendering.compiling import kept_arrays
from dojo_env.rendering.models import Model, Variant, build_models
from dojo_env.rendering.own_models import fit_model
from dojo_env.rendering.shapes import Part
from dojo_env.vehicle_models import VehicleModel

Floats = NDArray[np.float64]
Ints = NDArray[np.int32]

_NOSE, _HIGH = 0.16, 0.8
"""Share of the length that is the nose; share of the height over which a road user is high."""
_SECTION, _MOST_SECTIONS = (0.95, -0.97, -0.03, 0.48), 4
"""The profile of a section, which is a box; no vehicle has more of them."""
MOST_FACES, MOST_VERTICES = 4000, 4096
"""No model has more of them; kernels make room for as many."""


class Library(NamedTuple):
    """Every model at every level of detail in one piece.

    Attributes:
        vertices: (n, 3) in the models' unit boxes.
        faces: (m, 3) indices that begin at 0 for each model and level.
        planes: (m, 4) unit normal of each face and its distance from 0, in the unit box.
        parts: (m,) `Part`, or the number of parts and a row of `colours`.
        spans: (models, levels, 4) first and last vertex, first and last face; last ones are exclusive.
        profiles: (models + 1, 4) what throws shadows, in the unit box: height of the nose, and of what stands
            higher the rear and front end and half the width; the last is a section's of one with joints.
        prints: (models, sections, 2, 2) x and y of the front and rear end of each section on the ground, in
            the unit box; nan where a model has fewer.
        colours: (c, 3) linear, of models from elsewhere.
    """

    vertices: Floats
    faces: Ints
    planes: Floats
    parts: NDArray[np.uint16]
    spans: Ints
    profiles: Floats
    prints: Floats
    colours: Floats


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Fleet:
    """What there is to draw.

    Attributes:
        library: the models of all variants; a variant's poses follow each other.
        own: variants by SUMO's vehicle type, where a user has named a model for it.
        others: those variants, which come after ours.
    """

    library: Library
    own: Mapping[str, int]
    others: tuple[Variant, ...]

    @property
    def variants(self) -> tuple[Variant, ...]:
        """Every look: those of the first kind, of the next, and so on; then a user's."""
        return (*_usual_variants(), *self.others)


_LIBRARY = {
    "vertices": "<f8", "faces": "<i4", "planes": "<f8", "parts": "<u2", "spans": "<i4", "profiles": "<f8",
    "prints": "<f8", "colours": "<f8",
}  # fmt: skip


@cache
def usual_fleet() -> Fleet:
    """Give our own models; building them takes a good part of the time until a first picture."""
    return Fleet(library=kept_arrays("models", Library, _LIBRARY, pack_usual), own={}, others=())


def pack_usual() -> Library:
    """Pack our own models."""
    return _pack(_usual_variants(), np.empty((0, 3)))


def _usual_variants() -> list[Variant]:
    return [variant for each in build_models().values() for variant in each]


def build_fleet(models: Mapping[str, VehicleModel]) -> Fleet:
    """Pack our own models, and others for some vehicle types.

    Args:
        models: 3D models by SUMO's vehicle type.

    Returns:
        The fleet; who is of one of these types is drawn as its model.

    Raises:
        ModelError: a model's file cannot be read, or it holds no body; see `fit_model`.
    """
    variants, others = _usual_variants(), list[Variant]()
    own: dict[str, int] = {}
    colours = [np.empty((0, 3))]
    for name, model in models.items():
        variant, found = fit_model(model)
        own[name] = len(variants) + len(others)
        others.append(_shifted(variant, sum(map(len, colours))))
        colours.append(found)
    library = _pack(variants + others, np.concatenate(colours))
    return Fleet(library=library, own=own, others=tuple(others))


def _shifted(variant: Variant, rows: int) -> Variant:
    """Let a model's own colours begin some rows later."""
    (levels,) = variant.poses
    moved = [np.where(model.parts < len(Part), model.parts, model.parts + rows) for model in levels]
    models = [
        Model(vertices=model.vertices, faces=model.faces, parts=parts.astype(np.uint16))
        for model, parts in zip(levels, moved, strict=True)
    ]
    return Variant(size=variant.size, front=variant.front, poses=(tuple(models),))


def _pack(variants: list[Variant], colours: Floats) -> Library:
    poses = [pose for variant in variants for pose in variant.poses]
    # Poses that look the same from afar share their coarse levels, and kinds their variants.
    levels = list({id(model): model for pose in poses for model in pose}.values())
    vertices = np.cumsum([0] + [len(model.vertices) for model in levels])
    faces = np.cumsum([0] + [len(model.faces) for model in levels])
    spans = np.stack([vertices[:-1], vertices[1:], faces[:-1], faces[1:]], axis=1).astype(np.int32)
    rows = {id(model): row for row, model in enumerate(levels)}
    return Library(
        vertices=np.concatenate([model.vertices for model in levels]),
        faces=np.concatenate([model.faces for model in levels]),
        planes=np.concatenate([_planes(model) for model in levels]),
        parts=np.concatenate([model.parts for model in levels]).astype(np.uint16),
        spans=spans[[[rows[id(model)] for model in pose] for pose in poses]],
        profiles=np.array([*(_profile(pose[0].vertices) for pose in poses), _SECTION]),
        prints=np.concatenate([_prints(variant) for variant in variants]),
        colours=colours,
    )


def _prints(variant: Variant) -> Floats:
    """List where a variant stands in each pose; see `Library.prints`."""
    prints = np.full((len(variant.poses), _MOST_SECTIONS, 2, 2), np.nan)
    prints[:, 0] = (0.0, 0.0), (-1.0, 0.0)
    if variant.prints is not None:
        prints[:, : variant.prints.shape[1]] = variant.prints
    return prints


def _profile(vertices: Floats) -> tuple[float, float, float, float]:
    """Measure what of a model throws its shadow; see `Library.profiles`."""
    nose, high = vertices[vertices[:, 0] > -_NOSE], vertices[vertices[:, 2] > _HIGH]
    return nose[:, 2].max(), high[:, 0].min(), high[:, 0].max(), np.abs(high[:, 1]).max()


def _planes(model: Model) -> Floats:
    a, b, c = (model.vertices[model.faces[:, k]] for k in range(3))
    normals = np.cross(b - a, c - a)
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    return np.column_stack([normals, (normals * a).sum(axis=1)])
