"""The model of every kind of road user, at four levels of detail.

A model lives in a unit box: x from -1 (tail) to 0 (nose), y from -0.5 to 0.5 (left), z from 0 (ground) to 1,
and is scaled to each road user's own length, width and height. Faces turn counter-clockwise, from outside.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cache

import numpy as np
from numpy.typing import NDArray

from dojo_env.rendering.car_bodies import COARSE, CarShape
from dojo_env.rendering.car_details import build_car
from dojo_env.rendering.heavy_bodies import build_bus, build_lorry
from dojo_env.rendering.people import (
    STANDING,
    TALL,
    Look,
    build_people,
    pushing,
    under_umbrella,
    walking,
)
from dojo_env.rendering.rail_bodies import RailShape, build_rail
from dojo_env.rendering.shapes import Face, Part, box, lights, loft, section
from dojo_env.rendering.two_wheelers import (
    build_cyclists,
    build_motorcyclist,
    build_pram,
    build_scooter_rider,
    build_wheelchair,
)
from dojo_env.snapshot import Kind

Floats = NDArray[np.float64]
Faces = NDArray[np.int32]

DETAILS = 4
"""Levels of detail; 0 is the finest."""
_COARSEST = 3
_CELLS, _ROOM = 1e5, 1 << 20
"""Vertices lie on a grid of this many cells in a unit box; so many cells fit on each side of 0."""
_MIX = 0x9E3779B97F4A7
"""An odd number, large and without a pattern."""


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
    length=4.1,
    width=1.77,
    height=1.48,
    cowl=0.98,
    roof=(1.83, 3.4),
    foot=3.95,
    axles=(0.8, 3.36),
    rake=(0.2, 0.1),
    grille=(0.38, 0.12),
    tall_lamps=True,
)
_SALOON = CarShape(
    length=4.65, width=1.81, height=1.45, cowl=1.25, roof=(2.1, 3.2), foot=4.0, deck=0.7, axles=(0.86, 3.6),
    bonnet=0.52, belt=(0.645, 0.7),
)  # fmt: skip
_ESTATE = CarShape(
    length=4.7, width=1.82, height=1.48, cowl=1.25, roof=(2.08, 4.1), foot=4.58, axles=(0.87, 3.62),
    panes=((0.07, 0.36), (0.39, 0.66), (0.7, 0.92)), rails=True, grille=(0.44, 0.13),
)  # fmt: skip
_SUV = CarShape(
    length=4.5, width=1.86, height=1.68, cowl=1.12, roof=(1.86, 3.95), foot=4.36,
    axles=(0.86, 3.5), wheel=0.37, clearance=0.24, bonnet=0.54, belt=(0.64, 0.66),
    panes=((0.07, 0.4), (0.43, 0.72), (0.76, 0.92)), rails=True, grille=(0.46, 0.2), rake=(0.16, 0.06),
)  # fmt: skip
_MINI = CarShape(
    length=3.6,
    width=1.66,
    height=1.5,
    cowl=0.8,
    roof=(1.45, 2.95),
    foot=3.42,
    axles=(0.68, 3.0),
    wheel=0.3,
    tall_lamps=True,
    grille=(0.3, 0.1),
)
_VAN = CarShape(
    length=5.2, width=1.95, height=2.2, cowl=0.85, roof=(1.55, 5.12), foot=5.17,
    axles=(0.95, 4.2), wheel=0.34, clearance=0.24, bonnet=0.43, belt=(0.52, 0.52), deck=0.52, lean=0.86,
    panes=((0.04, 0.2),), rear_glass=(0.3, 0.8), tall_lamps=True, rake=(0.14, 0.02), grille=(0.42, 0.16),
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


def _ship(_detail: int) -> list[Face]:
    faces = loft(
        [section(0.0, 0.3, 0.6, 2.0), section(-4.0, 2.4, 0.0, 1.8), section(-17.0, 2.2, 0.0, 1.8)],
        Part.BODY,
    )
    return faces + box(-9.0, -14.0, 1.6, 1.8, 4.0, Part.WHITE)


@dataclass(frozen=True, slots=True, kw_only=True)
class Variant:
    """One of the looks of a kind of road user.

    Attributes:
        size: length, width and height of its box, metres, as it is built; mirrors and feet may stand out.
        front: how far the box reaches before what moves it, such as a walker's hips, metres.
        poses: models, by pose and by level of detail: at a stop, then those of a pace.
    """

    size: tuple[float, float, float]
    front: float
    poses: tuple[tuple[Model, ...], ...]


_Poses = Callable[[int], list[list[Face]]]
"""Builds a level of detail in every pose."""


@dataclass(frozen=True, slots=True, kw_only=True)
class _Figure:
    """Builds somebody who moves: a walker or a rider.

    Attributes:
        build: builds a level of detail in every pose.
        size: length, width and height of the box, metres.
        front: how far the box reaches before the origin, metres.
    """

    build: _Poses
    size: tuple[float, float, float]
    front: float


_STEPS = tuple(k / 6 for k in range(6))
"""Shares of a pace at which a walker is drawn."""
_TURNS = tuple(k / 4 for k in range(4))
"""The same for a cyclist's cranks."""
_MAN = Look(height=1.8)
_WOMAN = Look(height=1.67, broad=0.88, long_hair=True)
_ADULTS = (
    _MAN, replace(_WOMAN, bare_arms=True), replace(_MAN, height=1.74, bare_arms=True, broad=1.06),
    replace(_WOMAN, coat=True), replace(_MAN, bag=True), replace(_WOMAN, skirt=True, bare_arms=True),
)  # fmt: skip
_CHILDREN = (
    Look(height=1.3, head=1.22, broad=0.95, bag=True),
    Look(height=1.15, head=1.3, broad=0.95, bare_arms=True, long_hair=True),
)
UMBRELLAS = 4
"""How many of the people on foot, the last ones, have umbrellas."""
_RIDERS = (replace(_MAN, helmet=True), replace(_WOMAN, bare_arms=True), replace(_MAN, bag=True))
_MOTORCYCLIST = Look(helmet=True, face=Part.GLASS, top=Part.LEGS)


def _walker(look: Look, *, umbrella: bool = False, pram: bool = False) -> _Figure:
    poses = [STANDING, *(walking(step) for step in _STEPS)]
    if umbrella:
        poses = [under_umbrella(pose) for pose in poses]
    if pram:
        poses = [pushing(pose) for pose in poses]

    def build(detail: int) -> list[list[Face]]:
        pushed = build_pram(detail) if pram else []
        return [each + pushed for each in build_people(look, poses, detail, umbrella=umbrella)]

    share = look.height / TALL
    front, back = (1.25, 0.3) if pram else (0.3 * share, 0.3 * share)
    return _Figure(build=build, size=(front + back, 0.55 * share, look.height), front=front)


def _rider(build: Callable[[Look, int], list[Face]], look: Look, size: tuple[float, float, float]) -> _Figure:
    return _Figure(build=lambda detail: [build(look, detail)], size=size, front=size[0] / 2)


def _cyclist(look: Look) -> _Figure:
    return _Figure(
        build=lambda detail: build_cyclists(look, _TURNS, detail), size=(1.74, 0.62, 1.7), front=0.87
    )


_Builder = _Car | _Body | _Figure | Callable[[int], list[Face]]
_TRAM = RailShape(length=30.0, width=2.4, height=3.4, sections=3, stripe=True)
_TRAIN = RailShape(length=80.0, width=2.8, height=3.9, sections=4, floor=0.7, nose=2.2)

_BUILDERS: dict[Kind, tuple[_Builder, ...]] = {
    Kind.CAR: tuple(_Car(shape=shape) for shape in (_SALOON, _HATCHBACK, _ESTATE, _SUV, _MINI, _HATCHBACK)),
    Kind.TAXI: (_Car(shape=_ESTATE, on_roof=tuple(box(-2.4, -2.6, 0.3, 1.47, 1.6, Part.WHITE))),),
    Kind.VAN: (_Car(shape=_VAN),),
    Kind.BUS: (_BUS,),
    Kind.COACH: (_COACH,),
    Kind.TRUCK: (_LORRY,),
    Kind.TRAILER: (_ARTICULATED,),
    Kind.TRAM: (_Body(build=build_rail(_TRAM), size=(_TRAM.length, _TRAM.width, _TRAM.height)),),
    Kind.TRAIN: (_Body(build=build_rail(_TRAIN), size=(_TRAIN.length, _TRAIN.width, _TRAIN.height)),),
    Kind.MOTORCYCLE: (_rider(build_motorcyclist, _MOTORCYCLIST, (2.04, 0.86, 1.6)),),
    Kind.BICYCLE: tuple(_cyclist(look) for look in _RIDERS),
    Kind.SCOOTER: tuple(_rider(build_scooter_rider, look, (1.15, 0.55, 1.85)) for look in _RIDERS),
    Kind.AMBULANCE: (_Car(shape=_VAN, on_roof=tuple(box(-1.7, -1.95, 0.6, 2.19, 2.35, Part.BLUE))),),
    Kind.POLICE: (_Car(shape=_ESTATE, on_roof=tuple(box(-2.4, -2.65, 0.55, 1.47, 1.6, Part.BLUE))),),
    Kind.FIRE_ENGINE: (_Body(build=_fire_engine, size=(8.0, 2.5, 3.3)),),
    Kind.PEDESTRIAN: (
        *(_walker(look) for look in (*_ADULTS, *_CHILDREN)),
        *(_walker(look, umbrella=True) for look in _ADULTS[:UMBRELLAS]),
    ),
    Kind.SHIP: (_ship,),
    Kind.WHEELCHAIR: tuple(_rider(build_wheelchair, look, (1.12, 0.72, 1.42)) for look in _ADULTS[:2]),
    Kind.PRAM: tuple(_walker(look, pram=True) for look in _ADULTS[1:2]),
}


@cache
def build_models() -> dict[Kind, tuple[Variant, ...]]:
    """Build every model, by kind: cars come in several shapes, people in several looks and poses."""
    return {kind: tuple(_variant(build) for build in _BUILDERS[kind]) for kind in Kind}


def _variant(build: _Builder) -> Variant:
    """Build a look at every level of detail, all in the box of the finest; mirrors and feet stand out."""
    if isinstance(build, _Figure):
        foot, size = np.array([build.front, 0.0, 0.0]), np.array(build.size)
        levels = [build.build(detail) for detail in range(DETAILS)]
    else:
        levels = [[build(detail)] for detail in range(DETAILS)]
        if isinstance(build, _Car | _Body):
            foot, size = np.zeros(3), np.array(build.size)
        else:
            corners = np.concatenate([polygon for polygon, _ in levels[0][0]])
            low, high = corners.min(axis=0), corners.max(axis=0)
            foot, size = np.array([high[0], (low[1] + high[1]) / 2, low[2]]), high - low
    length, width, height = size.tolist()
    return Variant(
        size=(length, width, height),
        front=float(foot[0]),
        poses=tuple(zip(*(_triangulate(level, foot, size) for level in levels), strict=True)),
    )


def _triangulate(poses: Sequence[list[Face]], foot: Floats, size: Floats) -> list[Model]:
    """Cut polygons into fans, and bring them from a box of this foot and size into the unit box.

    Args:
        poses: the same polygons in several poses.
        foot: (3,) of the box.
        size: (3,) of it.

    Returns:
        A model of each pose.
    """
    cut = [_cut(np.array([corners for corners, _ in same])) for same in zip(*poses, strict=True)]
    cells = np.round((np.concatenate(cut, axis=1) - foot) / size * _CELLS).astype(np.int64)
    parts = np.repeat([part for _, part in poses[0]], [each.shape[1] // 3 for each in cut])
    keys = ((cells[..., 0] + _ROOM) * 2 * _ROOM + cells[..., 1] + _ROOM) * 2 * _ROOM + cells[..., 2] + _ROOM
    # Corners are one where they lie together in every pose; sums of odd multiples tell others apart.
    mixed = (keys * (1 + 2 * np.arange(len(poses)) * _MIX)[:, None]).sum(axis=0)
    _, first, inverse = np.unique(mixed, return_index=True, return_inverse=True)
    numbered = inverse.reshape(-1, 3).astype(np.int32)
    a, b, c = numbered.T
    whole = (a != b) & (b != c) & (c != a)
    faces, shown = numbered[whole], parts[whole].astype(np.uint8)
    return [Model(vertices=each[first] / _CELLS, faces=faces, parts=shown) for each in cells]


def _cut(polygons: Floats) -> Floats:
    """Cut polygons, (p, n, 3) or (p, m, n, 3), into triangles: (p, 3 times as many, 3)."""
    return polygons[..., _fan(polygons.shape[-2]), :].reshape(len(polygons), -1, 3)


@cache
def _fan(corners: int) -> NDArray[np.int64]:
    return np.array([(0, k, k + 1) for k in range(1, corners - 1)])
