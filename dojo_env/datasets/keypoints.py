"""Keypoints of vehicles: where their models have wheels and lamps, and what of these a camera sees."""

from collections.abc import Iterator
from functools import cache

import numpy as np
from numpy.typing import NDArray

from dojo_env.camera import Camera
from dojo_env.datasets.labels import HIDDEN, SHOWN
from dojo_env.rendering.models import Model, Variant, build_models
from dojo_env.rendering.shapes import Part
from dojo_env.snapshot import Kind

Floats = NDArray[np.float64]

_TOLERANCE = 0.3
"""Metres that something must be nearer to hide a point: middles of lamps and wheels lie in round shapes."""
_APART = 0.15
"""A lamp nearer to the middle than this share of the width is neither the left nor the right one."""
_Mark = tuple[Floats, NDArray[np.int32]]
"""A point, and the corners around it."""
_NO_MARK: _Mark = (np.full(3, np.nan), np.zeros(1, np.int32))
_WITHOUT = {
    Kind.MOTORCYCLE, Kind.BICYCLE, Kind.SCOOTER, Kind.PEDESTRIAN, Kind.SHIP, Kind.WHEELCHAIR, Kind.PRAM,
    Kind.MOPED,
}  # fmt: skip
"""Kinds without left and right wheels or lamps."""


@cache
def model_points() -> Floats:
    """Find wheels and lamps of every model.

    Returns:
        (models, 8, 3) in the models' unit boxes, as `traffic.Users` numbers models and in the order of
        `KEYPOINTS` after the corners; nan where a model has none.
    """
    return np.array(
        [
            points
            for kind, variants in build_models().items()
            for variant in variants
            for points in _points_of(variant, has_any=kind not in _WITHOUT)
        ]
    )


def _points_of(variant: Variant, *, has_any: bool) -> Iterator[Floats]:
    """Give the points of each pose, (8, 3): those of the first, moved as the corners around them have."""
    first = variant.poses[0][0]
    marks = [*_wheels(first), *_lamps(first)] if has_any else [_NO_MARK] * 8
    for model, *_ in variant.poses:
        moved = model.vertices - first.vertices if has_any else model.vertices
        yield np.array([point + moved[around].mean(axis=0) for point, around in marks])


def _wheels(model: Model) -> list[_Mark]:
    """Find the outer centres of the outermost wheels: front left and right, rear left and right."""
    found: list[_Mark] = []
    tyres = model.faces[model.parts == Part.TYRE]
    for side in (1.0, -1.0):
        own = tyres[(model.vertices[tyres, 1] * side > 0).all(axis=1)]
        spans = _axles(model.vertices[own])
        for low, high in spans[-1:] + spans[:1]:
            corners = np.unique(own)
            x = model.vertices[corners, 0]
            corners = corners[(x >= low) & (x <= high)]
            wheel = model.vertices[corners]
            outside = wheel[np.argmax(wheel[:, 1] * side), 1]
            height = 0.5 * (wheel[:, 2].min() + wheel[:, 2].max())
            found.append((np.array([0.5 * (low + high), outside, height]), corners))
        found += [_NO_MARK] * (2 - len(spans[-1:] + spans[:1]))
    front_left, rear_left, front_right, rear_right = found
    return [front_left, front_right, rear_left, rear_right]


def _axles(faces: Floats) -> list[tuple[float, float]]:
    """Find where wheels begin and end along a vehicle, from the rear: faces (k, 3, 3) that overlap."""
    spans: list[tuple[float, float]] = []
    for low, high in sorted((float(face[:, 0].min()), float(face[:, 0].max())) for face in faces):
        if spans and low <= spans[-1][1]:
            spans[-1] = (spans[-1][0], max(spans[-1][1], high))
        else:
            spans.append((low, high))
    return spans


def _lamps(model: Model) -> list[_Mark]:
    """Find the middles of the lamps: head lamps left and right, rear lamps left and right."""
    found: list[_Mark] = []
    for part, is_ahead in ((Part.HEADLAMP, True), (Part.BRAKE, False)):
        faces = model.faces[model.parts == part]
        middles = model.vertices[faces].mean(axis=1)
        for side in (1.0, -1.0):
            corners = np.unique(faces[((middles[:, 0] > -0.5) == is_ahead) & (middles[:, 1] * side > _APART)])
            own = model.vertices[corners]
            found.append((0.5 * (own.min(axis=0) + own.max(axis=0)), corners) if len(own) else _NO_MARK)
    return found


def see_points(points: Floats, camera: Camera, depths: NDArray[np.float32]) -> Floats:
    """Project points, and tell which of them something hides.

    Args:
        points: (k, 3) metres, map frame; nan where there is none.
        camera: that looks.
        depths: (h, w) of its picture, metres along its axis.

    Returns:
        (k, 3) x, y in pixels, and 0, `HIDDEN` or `SHOWN`; all 0 outside of the picture.
    """
    pixels, away = camera.project(points)
    with np.errstate(invalid="ignore"):
        inside = (pixels >= 0).all(axis=1) & (pixels < [camera.width, camera.height]).all(axis=1)
    seen = np.zeros((len(points), 3))
    columns, rows = pixels[inside].astype(np.intp).T
    is_shown = depths[rows, columns] > away[inside] - _TOLERANCE
    seen[inside] = np.column_stack([pixels[inside], np.where(is_shown, SHOWN, HIDDEN)])
    return seen
