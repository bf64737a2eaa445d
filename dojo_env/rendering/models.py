"""The model of every kind of road user, at four levels of detail.

A model lives in a unit box: x from -1 (tail) to 0 (nose), y from -0.5 to 0.5 (left), z from 0 (ground) to 1,
and is scaled to each road user's own length, width and height. Faces turn counter-clockwise, from outside.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.typing import NDArray

from dojo_env.rendering.car_bodies import COARSE, CarShape, build_car
from dojo_env.rendering.heavy_bodies import build_bus, build_lorry
from dojo_env.rendering.shapes import Face, Part, box, lights, loft, moved, screen, section, wheels, windows
from dojo_env.snapshot import Kind

Floats = NDArray[np.float64]
Faces = NDArray[np.int32]

DETAILS = 4
"""Levels of detail; 0 is the finest."""
_FLAT_WHEELS, _COARSEST = 1, 3


@dataclass(frozen=True, slots=True, kw_only=True)
class Model:
    """Triangles of one road user at one level of detail."""

    vertices: Floats
    faces: Faces
    parts: NDArray[np.uint8]


@dataclass(frozen=True, slots=True, kw_only=True)
class _Car:
    """Builds a car: as `car_bodies` has it where it is near, and from a few boxes where it is far.

    Attributes:
        shape: its measures.
        on_roof: what stands there.
    """

    shape: CarShape
    on_roof: tuple[Face, ...] = ()

    @property
    def size(self) -> tuple[float, float, float]:
        """Length, width and height of the body, metres; mirrors stand out."""
        high = max([self.shape.height, *(float(corners[:, 2].max()) for corners, _ in self.on_roof)])
        return self.shape.length, self.shape.width, high

    def __call__(self, detail: int) -> list[Face]:
        """Build a level of detail."""
        near = build_car(self.shape, detail) if detail <= COARSE else _far_car(self.shape, detail)
        return near + list(self.on_roof)


@dataclass(frozen=True, slots=True, kw_only=True)
class _Body:
    """Builds a vehicle whose mirrors stand out of its box.

    Attributes:
        build: builds a level of detail.
        size: length, width and height of the box, metres.
    """

    build: Callable[[int], list[Face]]
    size: tuple[float, float, float]

    def __call__(self, detail: int) -> list[Face]:
        """Build a level of detail."""
        return self.build(detail)


def _far_car(shape: CarShape, detail: int) -> list[Face]:
    """Build a car of a dozen pixels."""
    length, half, height = shape.length, shape.width / 2, shape.height
    belt, foot, heel = 0.62 * height, shape.cowl, shape.foot
    tail = -length
    if detail < _COARSEST:
        body = loft(
            [
                section(0.0, 0.86 * half, 0.14 * height, 0.5 * height),
                section(-foot, half, 0.08 * height, belt),
                section(-heel, half, 0.08 * height, 0.66 * height),
                section(tail, 0.92 * half, 0.16 * height, 0.62 * height),
            ],
            Part.BODY,
        )
    else:
        body = box(0.0, tail, 0.95 * half, 0.08 * height, belt, Part.BODY)
    lower = np.array([(-foot, 0.9 * half), (-heel, 0.9 * half)])
    upper = np.array([(-place, shape.lean * half) for place in shape.roof])
    (a, wide), (b, _), (c, slim), (d, _) = *lower, *upper
    z = 0.99 * belt
    glass = Part.GLASS if detail < _COARSEST else Part.BODY
    body += [
        (np.array([(c, -slim, height), (c, slim, height), (d, slim, height), (d, -slim, height)]), Part.BODY),
        (np.array([(a, -wide, z), (a, wide, z), (c, slim, height), (c, -slim, height)]), Part.GLASS),
        (np.array([(b, wide, z), (b, -wide, z), (d, -slim, height), (d, slim, height)]), Part.GLASS),
        (np.array([(a, wide, z), (b, wide, z), (d, slim, height), (c, slim, height)]), glass),
        (np.array([(b, -wide, z), (a, -wide, z), (c, -slim, height), (d, -slim, height)]), glass),
    ]
    if detail < _COARSEST:
        body += lights(tail, half, (0.36 * height, 0.45 * height), (0.46 * height, 0.56 * height))
    return body


_HATCHBACK = CarShape(
    length=4.1, width=1.77, height=1.48, cowl=0.98, roof=(1.78, 3.35), foot=3.92, axles=(0.8, 3.36)
)
_SALOON = CarShape(
    length=4.65, width=1.81, height=1.45, cowl=1.25, roof=(2.1, 3.2), foot=4.0, deck=0.7, axles=(0.86, 3.6),
    bonnet=0.52, belt=(0.645, 0.7),
)  # fmt: skip
_ESTATE = CarShape(
    length=4.7, width=1.82, height=1.48, cowl=1.25, roof=(2.08, 4.1), foot=4.58, axles=(0.87, 3.62),
    panes=((0.07, 0.36), (0.39, 0.66), (0.7, 0.92)),
)  # fmt: skip
_SUV = CarShape(
    length=4.5, width=1.86, height=1.68, cowl=1.12, roof=(1.86, 3.95), foot=4.36,
    axles=(0.86, 3.5), wheel=0.37, clearance=0.24, bonnet=0.54, belt=(0.64, 0.66),
    panes=((0.07, 0.4), (0.43, 0.72), (0.76, 0.92)),
)  # fmt: skip
_MINI = CarShape(
    length=3.6, width=1.66, height=1.5, cowl=0.8, roof=(1.45, 2.95), foot=3.42, axles=(0.68, 3.0), wheel=0.3
)
_VAN = CarShape(
    length=5.2, width=1.95, height=2.2, cowl=0.85, roof=(1.55, 5.12), foot=5.17,
    axles=(0.95, 4.2), wheel=0.34, clearance=0.24, bonnet=0.43, belt=(0.52, 0.52), deck=0.52, lean=0.86,
    panes=((0.04, 0.2),),
)  # fmt: skip


_BUS = _Body(build=build_bus(12.0, 3.1, (2.7, 8.9), doors=(0.35, 5.2, 9.9)), size=(12.0, 2.5, 3.1))
_COACH = _Body(build=build_bus(13.0, 3.7, (2.9, 9.0, 10.3), doors=(0.4,), sill=0.5), size=(13.0, 2.5, 3.7))
_LORRY = _Body(
    build=build_lorry(8.0, 2.1, (2.35, 1.05, 3.6), (1.3, 5.9, 7.0), 3.0), size=(8.0, 2.5, 3.6)
)  # fmt: skip
_ARTICULATED = _Body(
    build=build_lorry(16.0, 2.3, (3.0, 1.15, 3.95), (1.4, 4.6, 12.4, 13.6, 14.8), 3.5), size=(16.0, 2.5, 3.95)
)


def _fire_engine(detail: int) -> list[Face]:
    body = build_bus(8.0, 3.1, (1.6, 6.2))
    return body(detail) + box(-0.6, -0.9, 1.0, 3.09, 3.3, Part.BLUE)


def _rail_car(height: float, length: float, sections: int) -> Callable[[int], list[Face]]:
    def build(detail: int) -> list[Face]:
        half, cut = 1.2, length / sections
        faces: list[Face] = []
        for k in range(sections):
            nose, tail = -k * cut - (0.15 if k else 0.0), -(k + 1) * cut + (0.15 if k < sections - 1 else 0.0)
            ends = [section(nose, half, 0.3, height), section(tail, half, 0.3, height)]
            if k == 0:
                ends = [
                    section(0.0, 0.75 * half, 0.4, 0.8 * height),
                    section(-0.9, half, 0.3, height),
                    ends[1],
                ]
            if k == sections - 1:
                ends = [*ends[:-1], section(tail + 0.9, half, 0.3, height)]
                ends.append(section(tail, 0.75 * half, 0.4, 0.8 * height))
            faces += loft(ends, Part.BODY)
            if detail < _COARSEST:
                faces += windows(nose - 1.1, tail + 1.1, half + 0.01, 0.45 * height, 0.8 * height)
            if k:
                faces += box(nose + 0.3, nose, 0.8 * half, 0.4, 0.92 * height, Part.TRIM)
        if detail < _COARSEST:
            faces += screen(0.0, -0.6, 0.65 * half, 0.45 * height, 0.72 * height)
            faces += lights(-length, 0.75 * half, (0.5, 0.75), (0.5, 0.75))
        return faces

    return build


def _two_wheeler(length: float, wheel: float, body: Part, *, motor: bool) -> Callable[[int], list[Face]]:
    """A motorcycle, scooter or bicycle with its rider."""

    def build(detail: int) -> list[Face]:
        thin = 0.12 if motor else 0.06
        faces = box(-0.45 * length, -0.78 * length, 0.2, 0.75, 1.35, body)
        faces += box(-0.5 * length, -0.64 * length, 0.11, 1.38, 1.66, Part.SKIN)
        faces += box(-0.3 * length, -0.72 * length, 0.22 if motor else 0.17, 0.45, 0.78, Part.LEGS)
        faces += box(-0.18 * length, -0.85 * length, thin, 0.4, 0.72, Part.BODY if motor else Part.TRIM)
        faces += box(-0.22 * length, -0.28 * length, 0.33, 0.95, 1.05, Part.TRIM)
        for x in (-wheel, wheel - length):
            if detail < _COARSEST:
                faces += wheels((x,), thin / 2, wheel, 0, tyre=thin / 2)
            else:
                faces += box(x + 0.92 * wheel, x - 0.92 * wheel, thin / 2, 0.08, 1.9 * wheel, Part.TYRE)
        if motor and detail < _COARSEST:
            faces += lights(-0.9 * length, 0.15, (0.8, 0.95), (0.6, 0.75))
        return faces

    return build


def _pedestrian(detail: int) -> list[Face]:
    """Somebody walking, 1.75 m tall."""
    faces = loft([section(-0.13, 0.2, 0.8, 1.42), section(-0.37, 0.2, 0.8, 1.42)], Part.BODY)
    faces += box(-0.15, -0.35, 0.1, 1.46, 1.75, Part.SKIN)
    if detail == _COARSEST:
        return faces + box(-0.12, -0.38, 0.16, 0.0, 0.82, Part.LEGS)
    for y, reach in ((0.09, 0.08), (-0.09, -0.08)):
        leg = [section(-0.17, 0.07, 0.8, 0.82), section(-0.33, 0.07, 0.8, 0.82)]
        foot = leg[0][[0, 1, 1, 0]] * [1.0, 1.0, 0.0]
        foot[:, 0] = [-0.1 + reach] * 2 + [-0.3 + reach] * 2
        top = np.array([leg[0][0], leg[0][1], leg[1][1], leg[1][0]])
        sides = [
            (np.array([foot[k], foot[(k + 1) % 4], top[(k + 1) % 4], top[k]]), Part.LEGS) for k in range(4)
        ]
        faces += moved([*sides, (foot[::-1], Part.LEGS)], y)
        faces += moved(box(-0.2 - reach, -0.31 - reach, 0.045, 0.78, 1.4, Part.BODY), y * 2.7)
    return faces


def _ship(_detail: int) -> list[Face]:
    faces = loft(
        [section(0.0, 0.3, 0.6, 2.0), section(-4.0, 2.4, 0.0, 1.8), section(-17.0, 2.2, 0.0, 1.8)],
        Part.BODY,
    )
    return faces + box(-9.0, -14.0, 1.6, 1.8, 4.0, Part.WHITE)


_BUILDERS: dict[Kind, tuple[Callable[[int], list[Face]], ...]] = {
    Kind.CAR: tuple(_Car(shape=shape) for shape in (_SALOON, _HATCHBACK, _ESTATE, _SUV, _MINI, _HATCHBACK)),
    Kind.TAXI: (_Car(shape=_ESTATE, on_roof=tuple(box(-2.4, -2.6, 0.3, 1.47, 1.6, Part.WHITE))),),
    Kind.VAN: (_Car(shape=_VAN),),
    Kind.BUS: (_BUS,),
    Kind.COACH: (_COACH,),
    Kind.TRUCK: (_LORRY,),
    Kind.TRAILER: (_ARTICULATED,),
    Kind.TRAM: (_rail_car(3.4, 30.0, 3),),
    Kind.TRAIN: (_rail_car(3.9, 80.0, 4),),
    Kind.MOTORCYCLE: (_two_wheeler(2.1, 0.32, Part.TRIM, motor=True),),
    Kind.BICYCLE: (_two_wheeler(1.75, 0.34, Part.BODY, motor=False),),
    Kind.SCOOTER: (_two_wheeler(1.8, 0.25, Part.WHITE, motor=True),),
    Kind.AMBULANCE: (_Car(shape=_VAN, on_roof=tuple(box(-1.7, -1.95, 0.6, 2.19, 2.35, Part.BLUE))),),
    Kind.POLICE: (_Car(shape=_ESTATE, on_roof=tuple(box(-2.4, -2.65, 0.55, 1.47, 1.6, Part.BLUE))),),
    Kind.FIRE_ENGINE: (_Body(build=_fire_engine, size=(8.0, 2.5, 3.3)),),
    Kind.PEDESTRIAN: (_pedestrian,),
    Kind.SHIP: (_ship,),
}


@cache
def build_models() -> tuple[tuple[tuple[Model, ...], ...], ...]:
    """Build every model: by kind, by variant (cars come in several shapes), by level of detail."""
    return tuple(tuple(_levels(build) for build in _BUILDERS[kind]) for kind in Kind)


def _levels(build: Callable[[int], list[Face]]) -> tuple[Model, ...]:
    """Build a model at every level of detail, all in the box of the finest; mirrors stand out of it."""
    if isinstance(build, _Car | _Body):
        foot, size = np.zeros(3), np.array(build.size)
    else:
        corners = np.concatenate([polygon for polygon, _ in build(0)])
        low, high = corners.min(axis=0), corners.max(axis=0)
        foot, size = np.array([high[0], (low[1] + high[1]) / 2, low[2]]), high - low
    return tuple(_triangulated(build(detail), foot, size) for detail in range(DETAILS))


def _triangulated(polygons: list[Face], foot: Floats, size: Floats) -> Model:
    """Cut polygons into fans, and bring them from a box of this foot and size into the unit box."""
    faces, parts, start = [], [], 0
    for polygon, part in polygons:
        faces += [(start, start + k, start + k + 1) for k in range(1, len(polygon) - 1)]
        parts += [part] * (len(polygon) - 2)
        start += len(polygon)
    corners = (np.concatenate([polygon for polygon, _ in polygons]) - foot) / size
    unit, inverse = np.unique(np.round(corners, 6), axis=0, return_inverse=True)
    numbered = inverse.reshape(-1)[np.array(faces)].astype(np.int32)
    whole = (np.diff(np.sort(numbered, axis=1)) > 0).all(axis=1)
    return Model(vertices=unit, faces=numbered[whole], parts=np.array(parts, dtype=np.uint8)[whole])
