"""The model of every kind of road user, at four levels of detail.

A model lives in a unit box: x from -1 (tail) to 0 (nose), y from -0.5 to 0.5 (left), z from 0 (ground) to 1,
and is scaled to each road user's own length, width and height. Faces turn counter-clockwise, from outside.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cache
from math import radians

import numpy as np
from numpy.typing import NDArray

from dojo_env.rendering.car_bodies import COARSE, CarShape
from dojo_env.rendering.car_details import build_car
from dojo_env.rendering.heavy_bodies import build_bus, build_fire_engine, build_lorry, build_road_train
from dojo_env.rendering.liveries import dress_ambulance, dress_police, dress_taxi, dress_van, load_bed
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
from dojo_env.rendering.turning import Joint, bend, cut_apart, footprints, steer
from dojo_env.rendering.two_wheelers import (
    build_cyclists,
    build_moped_rider,
    build_motorcyclist,
    build_pram,
    build_scooter_rider,
    build_wheelchair,
)
from dojo_env.snapshot import Kind

Floats = NDArray[np.float64]
Faces = NDArray[np.int32]
Parts = NDArray[np.uint8]

DETAILS = 4
"""Levels of detail; 0 is the finest."""
_COARSEST = 3
_CELLS, _ROOM = 1e5, 1 << 20
"""Vertices lie on a grid of this many cells in a unit box; so many cells fit on each side of 0."""
_TURNS_OF_CARS = tuple(radians(turn) for turn in (0, -15, -7, 7, 15))
_TURNS_OF_HEAVIES = tuple(radians(turn) for turn in (0, -36, -24, -14, -6, 6, 14, 24, 36))
"""What `Variant.turns` can be: straight on, then from the right to the left."""
_HEAVY_WHEEL = 0.5
"""Radius, metres."""
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
        dress: builds what is painted on its sides and stands on its roof.
    """

    shape: CarShape
    dress: Callable[[CarShape], list[Face]] | None = None

    @property
    def size(self) -> tuple[float, float, float]:
        """Length, width and height of the body, metres; mirrors stand out."""
        high = max([self.shape.height, *(float(corners[..., 2].max()) for corners, _ in self._dressed())])
        return self.shape.length, self.shape.width, high

    def __call__(self, detail: int) -> list[Face]:
        """Build a level of detail."""
        near = build_car(self.shape, detail) if detail <= COARSE else _far_car(self.shape, detail)
        return near + self._dressed()

    def _dressed(self) -> list[Face]:
        return self.dress(self.shape) if self.dress else []

    def turn(self, triangles: Floats, parts: Parts, turns: Floats) -> tuple[Floats, Parts]:
        """Steer to follow a road in every turn; see `Variant.turns`."""
        (front, rear), half = self.shape.axles, self.shape.half_width(self.shape.axles[0])
        angles = 2.0 * turns * (rear - front) / self.shape.length
        return steer(triangles, parts, front, half, self.shape.wheel, angles), parts


@dataclass(frozen=True, slots=True, kw_only=True)
class _Body:
    """Builds a vehicle whose mirrors stand out of its box.

    Attributes:
        build: builds a level of detail.
        size: length, width and height of the box, metres.
        axles: the first, and the last of those before a joint, metres behind the nose; on rails they are one.
        joints: where it bends.
    """

    build: Callable[[int], list[Face]]
    size: tuple[float, float, float]
    axles: tuple[float, float] = (0.0, 0.0)
    joints: tuple[Joint, ...] = ()

    def __call__(self, detail: int) -> list[Face]:
        """Build a level of detail."""
        return self.build(detail)

    def turn(self, triangles: Floats, parts: Parts, turns: Floats) -> tuple[Floats, Parts]:
        """Steer and bend to follow a road in every turn; see `Variant.turns`."""
        length, width, _ = self.size
        triangles, parts, sections = cut_apart(triangles, parts, self.joints)
        front, rear = self.axles
        angles = 2.0 * turns * (rear - front) / length
        steered = steer(triangles, parts, front, 0.5 * width, _HEAVY_WHEEL, angles)
        bent, folds = bend(steered, sections, length, self.joints, turns)
        return bent, np.append(parts, np.full(folds, Part.TRIM, parts.dtype))


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


_PICKUP = CarShape(
    length=5.3, width=1.88, height=1.8, cowl=1.35, roof=(2.05, 3.3), foot=3.5, bonnet=0.56, belt=(0.63, 0.64),
    deck=0.62, axles=(0.95, 4.2), wheel=0.38, clearance=0.26, panes=((0.08, 0.48), (0.52, 0.9)),
)  # fmt: skip

_BUS = _Body(
    build=build_bus(12.0, 3.1, (2.7, 8.9), doors=(0.35, 5.2, 9.9)), size=(12.0, 2.5, 3.1), axles=(2.7, 8.9)
)
_COACH = _Body(
    build=build_bus(13.0, 3.7, (2.9, 9.0, 10.3), doors=(0.4,), sill=0.5),
    size=(13.0, 2.5, 3.7), axles=(2.9, 9.0),
)  # fmt: skip
_ARTICULATED_BUS = _Body(
    build=build_bus(18.0, 3.1, (2.7, 8.4, 14.9), doors=(0.35, 5.2, 11.6, 16.1)), size=(18.0, 2.5, 3.1),
    axles=(2.7, 8.4), joints=(Joint(pivot=10.2, cut=(9.6, 10.8), bellows=(1.2, 0.4, 3.04)),),
)  # fmt: skip
_LORRY = _Body(
    build=build_lorry(8.0, 2.1, (2.35, 1.05, 3.6), (1.3, 5.9, 7.0), 3.0), size=(8.0, 2.5, 3.6),
    axles=(1.3, 5.9),
)  # fmt: skip
_ARTICULATED = _Body(
    build=build_lorry(16.0, 2.3, (3.0, 1.15, 3.95), (1.4, 4.6, 12.4, 13.6, 14.8), 3.5),
    size=(16.0, 2.5, 3.95), axles=(1.4, 4.6), joints=(Joint(pivot=4.4, cut=(2.6, 2.6)),),
)  # fmt: skip
_ROAD_TRAIN = _Body(
    build=build_road_train, size=(18.75, 2.5, 3.9), axles=(1.4, 6.6),
    joints=(Joint(pivot=10.6, cut=(10.6, 10.6)),),
)  # fmt: skip
_FIRE_ENGINE = _Body(build=build_fire_engine, size=(8.0, 2.5, 3.3), axles=(1.35, 5.7))


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
        poses: models, by pose and by level of detail: at a stop, then those of a pace; or by `turns`.
        turns: how far the road at the nose has turned from the line between nose and tail, radians, positive
            to the left; begins with 0. Empty where poses are those of a pace.
        prints: where the sections of one with joints stand in each turn, (turns, sections, 2, 2): x and y of
            the front and rear end of each, in the unit box; None without joints.
    """

    size: tuple[float, float, float]
    front: float
    poses: tuple[tuple[Model, ...], ...]
    turns: tuple[float, ...] = ()
    prints: Floats | None = None


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
_MOPED_RIDERS = (replace(_MAN, helmet=True), replace(_WOMAN, helmet=True))


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


def _on_rails(shape: RailShape) -> _Body:
    cuts = [shape.length * k / shape.sections for k in range(1, shape.sections)]
    bellows = (0.44 * shape.width, 0.5, 0.94 * shape.height)
    return _Body(
        build=build_rail(shape), size=(shape.length, shape.width, shape.height),
        joints=tuple(Joint(pivot=cut, cut=(cut - 0.25, cut + 0.25), bellows=bellows) for cut in cuts),
    )  # fmt: skip


_CARS = (_SALOON, _HATCHBACK, _ESTATE, _SUV, _MINI, _HATCHBACK)

_BUILDERS: dict[Kind, tuple[_Builder, ...]] = {
    Kind.CAR: tuple(_Car(shape=shape) for shape in _CARS),
    Kind.TAXI: tuple(_Car(shape=shape, dress=dress_taxi) for shape in (_ESTATE, _SALOON)),
    Kind.VAN: (_Car(shape=_VAN, dress=dress_van),),
    Kind.BUS: (_BUS, _ARTICULATED_BUS),
    Kind.COACH: (_COACH,),
    Kind.TRUCK: (_LORRY,),
    Kind.TRAILER: (_ARTICULATED,),
    Kind.TRAM: (_on_rails(_TRAM),),
    Kind.TRAIN: (_on_rails(_TRAIN),),
    Kind.MOTORCYCLE: (_rider(build_motorcyclist, _MOTORCYCLIST, (2.04, 0.86, 1.6)),),
    Kind.BICYCLE: tuple(_cyclist(look) for look in _RIDERS),
    Kind.SCOOTER: tuple(_rider(build_scooter_rider, look, (1.15, 0.55, 1.85)) for look in _RIDERS),
    Kind.AMBULANCE: (_Car(shape=_VAN, dress=dress_ambulance),),
    Kind.POLICE: tuple(_Car(shape=shape, dress=dress_police) for shape in (_ESTATE, _SALOON)),
    Kind.FIRE_ENGINE: (_FIRE_ENGINE,),
    Kind.PEDESTRIAN: (
        *(_walker(look) for look in (*_ADULTS, *_CHILDREN)),
        *(_walker(look, umbrella=True) for look in _ADULTS[:UMBRELLAS]),
    ),
    Kind.SHIP: (_ship,),
    Kind.WHEELCHAIR: tuple(_rider(build_wheelchair, look, (1.12, 0.72, 1.42)) for look in _ADULTS[:2]),
    Kind.PRAM: tuple(_walker(look, pram=True) for look in _ADULTS[1:2]),
    Kind.HATCHBACK: tuple(_Car(shape=shape) for shape in (_HATCHBACK, _MINI)),
    Kind.SALOON: (_Car(shape=_SALOON),),
    Kind.ESTATE: (_Car(shape=_ESTATE),),
    Kind.PICKUP: (_Car(shape=_PICKUP, dress=load_bed),),
    Kind.ARTICULATED_BUS: (_ARTICULATED_BUS,),
    Kind.ROAD_TRAIN: (_ROAD_TRAIN,),
    Kind.MOPED: tuple(_rider(build_moped_rider, look, (1.85, 0.7, 1.62)) for look in _MOPED_RIDERS),
}


@cache
def build_models() -> dict[Kind, tuple[Variant, ...]]:
    """Build every model, by kind: cars come in several shapes, people in several looks and poses."""
    return {kind: tuple(_variant(build) for build in _BUILDERS[kind]) for kind in Kind}


@cache
def _variant(build: _Builder) -> Variant:
    """Build a look at every level of detail, all in the box of the finest; mirrors and feet stand out."""
    if isinstance(build, _Figure):
        foot, size = np.array([build.front, 0.0, 0.0]), np.array(build.size)
        levels = [_join_up(*_triangulate(build.build(detail)), foot, size) for detail in range(DETAILS)]
    elif isinstance(build, _Car | _Body):
        foot, size = np.zeros(3), np.array(build.size)
        levels = [_in_turns(build, detail, size) for detail in range(DETAILS)]
    else:
        faces = [_triangulate([build(detail)]) for detail in range(DETAILS)]
        low, high = faces[0][0].min(axis=(0, 1)), faces[0][0].max(axis=(0, 1))
        foot, size = np.array([high[0], (low[1] + high[1]) / 2, low[2]]), high - low
        levels = [_join_up(corners, parts, foot, size) for corners, parts in faces]
    length, width, height = size.tolist()
    return Variant(
        size=(length, width, height),
        front=float(foot[0]),
        poses=tuple(zip(*levels, strict=True)),
        turns=_turns_of(build),
        prints=_prints_of(build),
    )


def _turns_of(build: _Builder) -> tuple[float, ...]:
    if isinstance(build, _Body):
        return _TURNS_OF_HEAVIES
    return _TURNS_OF_CARS if isinstance(build, _Car) else ()


def _prints_of(build: _Builder) -> Floats | None:
    if not (isinstance(build, _Body) and build.joints):
        return None
    return footprints(build.size[0], build.joints, np.array(_TURNS_OF_HEAVIES)) / build.size[:2]


def _in_turns(build: _Car | _Body, detail: int, size: Floats) -> list[Model]:
    """Build a level of detail of a vehicle in every turn; from afar nobody sees wheels steer."""
    (corners,), parts = _triangulate([build(detail)])
    turns = np.array(_turns_of(build))
    if detail > COARSE and not (isinstance(build, _Body) and build.joints):
        return _join_up(corners[None], parts, np.zeros(3), size) * len(turns)
    turned, parts = build.turn(corners.reshape(-1, 3, 3), parts, turns)
    return _join_up(turned.reshape(len(turns), -1, 3), parts, np.zeros(3), size)


def _triangulate(poses: Sequence[list[Face]]) -> tuple[Floats, Parts]:
    """Cut polygons into fans.

    Args:
        poses: the same polygons in several poses.

    Returns:
        (p, 3 n, 3) corners of the triangles of each pose, and (n,) what they show.
    """
    cut = [_cut(np.array([corners for corners, _ in same])) for same in zip(*poses, strict=True)]
    parts = np.repeat([part for _, part in poses[0]], [each.shape[1] // 3 for each in cut])
    return np.concatenate(cut, axis=1), parts.astype(np.uint8)


def _join_up(corners: Floats, parts: Parts, foot: Floats, size: Floats) -> list[Model]:
    """Bring triangles from a box of this foot and size into the unit box, and make corners one that are.

    Args:
        corners: (p, 3 n, 3) of each pose.
        parts: (n,) what the triangles show.
        foot: (3,) of the box.
        size: (3,) of it.

    Returns:
        A model of each pose.
    """
    cells = np.round((corners - foot) / size * _CELLS).astype(np.int64)
    keys = ((cells[..., 0] + _ROOM) * 2 * _ROOM + cells[..., 1] + _ROOM) * 2 * _ROOM + cells[..., 2] + _ROOM
    # Corners are one where they lie together in every pose; sums of odd multiples tell others apart.
    mixed = (keys * (1 + 2 * np.arange(len(cells)) * _MIX)[:, None]).sum(axis=0)
    _, first, inverse = np.unique(mixed, return_index=True, return_inverse=True)
    numbered = inverse.reshape(-1, 3).astype(np.int32)
    a, b, c = numbered.T
    whole = (a != b) & (b != c) & (c != a)
    faces, shown = numbered[whole], parts[whole]
    return [Model(vertices=each[first] / _CELLS, faces=faces, parts=shown) for each in cells]


def _cut(polygons: Floats) -> Floats:
    """Cut polygons, (p, n, 3) or (p, m, n, 3), into triangles: (p, 3 times as many, 3)."""
    return polygons[..., _fan(polygons.shape[-2]), :].reshape(len(polygons), -1, 3)


@cache
def _fan(corners: int) -> NDArray[np.int64]:
    return np.array([(0, k, k + 1) for k in range(1, corners - 1)])
