"""The road users of a snapshot as kernels draw them: model, place, colours and lights of each."""

from collections.abc import Iterable
from functools import lru_cache
from math import cos, floor, isnan, sin
from typing import NamedTuple
from zlib import crc32

import numpy as np
from numpy.typing import NDArray

from dojo_env.rendering.compiling import inner, kept_arrays, kernel
from dojo_env.rendering.fleet import Fleet, usual_fleet
from dojo_env.rendering.lighting import to_linear
from dojo_env.rendering.models import UMBRELLAS, Variant, build_models
from dojo_env.rendering.people import PACE, TALL
from dojo_env.rendering.ways import NO_WAYS, Ways, turn_on
from dojo_env.snapshot import Kind, Snapshot

Floats = NDArray[np.float64]
Ints = NDArray[np.int32]
RGB = tuple[int, int, int]

_SHARES = 100
"""Colours that a road user may have, as often as there are percents."""
_PAINTS: dict[RGB, int] = {
    (92, 97, 104): 17, (64, 68, 74): 10, (228, 230, 231): 24, (30, 31, 34): 15, (18, 19, 22): 7,
    (186, 190, 194): 10, (36, 66, 124): 6, (24, 38, 72): 3, (150, 24, 28): 5, (70, 82, 66): 1,
    (150, 136, 112): 1, (196, 96, 30): 1,
}  # fmt: skip
"""Paints of cars and their percents. Source: Axalta, Global Automotive Color Popularity Report 2021, Europe:
grey 27, white a quarter, black 22, silver 10, blue 11; a few per cent are red, brown, green and others."""
Livery = tuple[RGB, RGB]
"""Colour of a body, and of the bands and letters on it."""
_WHITE, _YELLOW = (232, 233, 231), (246, 198, 28)
_VAN_LIVERIES: dict[Livery, int] = {
    (_WHITE, _WHITE): 34, (_WHITE, (34, 76, 150)): 12, (_WHITE, (176, 34, 34)): 8, (_WHITE, (50, 120, 62)): 6,
    ((190, 193, 196), (190, 193, 196)): 10, ((92, 97, 104), (92, 97, 104)): 7, ((40, 70, 130), _WHITE): 6,
    (_YELLOW, (40, 40, 42)): 8, ((84, 54, 34), (226, 176, 60)): 4, ((160, 30, 30), _WHITE): 5,
}  # fmt: skip
_LOADS: dict[Livery, int] = {
    ((50, 92, 150), _WHITE): 22, ((228, 230, 231), _WHITE): 20, ((170, 44, 40), _WHITE): 14,
    ((228, 230, 231), (36, 72, 128)): 10, ((40, 44, 52), (186, 190, 194)): 10,
    ((50, 92, 150), (186, 190, 194)): 8, ((46, 100, 66), (196, 198, 190)): 8,
    ((206, 110, 30), (206, 110, 30)): 8,
}  # fmt: skip
"""Cabs of lorries and what is behind them, box or tarpaulin."""
_LIVERIES: dict[Kind, dict[Livery, int]] = {
    Kind.VAN: _VAN_LIVERIES, Kind.TRUCK: _LOADS, Kind.TRAILER: _LOADS, Kind.ROAD_TRAIN: _LOADS,
    Kind.AMBULANCE: {((240, 240, 236), (206, 52, 30)): 100},
    Kind.POLICE: {((218, 221, 224), (24, 66, 160)): 100},
}  # fmt: skip
_CLOTHES: dict[RGB, int] = {
    (34, 36, 42): 16, (52, 60, 82): 10, (86, 90, 96): 8, (222, 220, 214): 11, (150, 150, 150): 5,
    (62, 92, 140): 8, (150, 176, 204): 5, (140, 32, 38): 6, (196, 66, 50): 4, (72, 92, 66): 5,
    (158, 138, 104): 6, (96, 68, 50): 5, (208, 164, 60): 3, (206, 128, 142): 3, (96, 56, 100): 2,
    (60, 134, 130): 3,
}  # fmt: skip
_BUS_PAINTS: dict[RGB, int] = {
    (196, 44, 40): 34, (228, 228, 226): 16, (232, 182, 34): 16, (40, 88, 156): 14, (44, 120, 70): 12,
    (120, 170, 196): 8,
}  # fmt: skip
_BY_KIND: dict[Kind, dict[RGB, int]] = {
    Kind.TAXI: {(238, 206, 60): 60, (232, 222, 190): 40},
    Kind.BUS: _BUS_PAINTS, Kind.ARTICULATED_BUS: _BUS_PAINTS,
    Kind.COACH: {(226, 226, 230): 60, (40, 60, 110): 15, (150, 30, 36): 15, (190, 170, 120): 10},
    Kind.TRAM: {(214, 40, 36): 100}, Kind.TRAIN: {(200, 30, 34): 100},
    Kind.FIRE_ENGINE: {(190, 24, 24): 100}, Kind.SHIP: {(60, 70, 84): 100},
    Kind.CAR: _PAINTS, Kind.HATCHBACK: _PAINTS, Kind.SALOON: _PAINTS, Kind.ESTATE: _PAINTS,
    Kind.PICKUP: _PAINTS, Kind.MOTORCYCLE: _PAINTS, Kind.MOPED: _PAINTS,
}  # fmt: skip
_SKIN: dict[RGB, int] = {
    (232, 190, 166): 30, (218, 172, 146): 26, (198, 146, 116): 16, (166, 114, 84): 12, (120, 78, 56): 9,
    (78, 50, 38): 7,
}  # fmt: skip
_TROUSERS: dict[RGB, int] = {
    (40, 50, 78): 30, (26, 27, 31): 28, (72, 84, 110): 10, (84, 84, 86): 10, (150, 136, 110): 10,
    (74, 62, 50): 6, (196, 192, 184): 3, (66, 72, 54): 3,
}  # fmt: skip
_HAIR: dict[RGB, int] = {
    (26, 21, 19): 30, (56, 38, 27): 34, (98, 70, 44): 14, (172, 140, 92): 10, (150, 148, 146): 9,
    (120, 56, 30): 3,
}  # fmt: skip
_GEAR: dict[RGB, int] = {
    (28, 30, 34): 32, (52, 60, 84): 14, (150, 30, 36): 12, (44, 84, 150): 12, (64, 96, 70): 8,
    (214, 214, 210): 8, (120, 122, 126): 6, (214, 176, 46): 4, (150, 70, 120): 4,
}  # fmt: skip
_UNSET = (255, 255, 0)
"""SUMO's colour for a vehicle that was given none."""
_LINEAR = to_linear(np.arange(256, dtype=np.uint8))
_CODES_KEPT, _FLEETS_KEPT = 1 << 14, 8

_ON_FOOT = (Kind.PEDESTRIAN, Kind.PRAM)
"""Kinds that keep their proportions, whatever box SUMO has for them, and are scaled by its height alone."""
_CRANK_TURN = 4.6
"""Metres that a bicycle rolls while its cranks turn once."""
_BY_LENGTH = (Kind.BUS, Kind.TRUCK, Kind.TRAM, Kind.TRAIN)
"""Kinds whose variants differ in length, so that SUMO's decides."""
_LEAST_SPEED = 0.2
"""m/s; who is slower stands."""
_ACCENT = 4
"""Row of `Users.colours`."""
_CHILD = 1.45
"""Metres; types of people that are smaller are children."""
_CHILDREN, _DRY = 10, 8
"""One of so many people of usual size is a child; one of so many has no umbrella."""
_STATURES = np.array([0.95, 0.98, 1.0, 1.02, 1.05])
"""Shares of their look's height that people have."""


class Users(NamedTuple):
    """Road users in the scene's frame.

    Attributes:
        frames: (n, 3, 3) columns are the model's axes, scaled to the road user's size, metres.
        places: (n, 3) middle of the front end on the ground, metres.
        models: (n,) index into the library.
        colours: (n, 5, 3) linear: of the body, or of somebody's clothes; of skin, trousers, hair; of gear, or
            of the bands on a vehicle.
        lights: (n,) `Lights`.
        origin: (3,) of the scene, metres, map frame.
    """

    frames: Floats
    places: Floats
    models: Ints
    colours: Floats
    lights: NDArray[np.uint8]
    origin: Floats


class _Looks(NamedTuple):
    """What there is to choose from.

    Attributes:
        first: (kinds + 1,) first variant of each kind; those of the next kind follow.
        adults: (kinds,) how many of a kind's variants are of usual height; children follow.
        umbrellas: (kinds,) how many of a kind's last variants have umbrellas; children are before them.
        by_length: (kinds,) whether a kind's variants are chosen by length.
        on_foot: (kinds,) whether a kind is scaled by its height alone.
        paces: (kinds,) metres in which a road user goes through its poses.
        models: (variants + 1,) first model of each variant, by pose.
        sizes: (variants, 3) metres, as built.
        fronts: (variants,) metres before what moves them.
        turns: (variants, most) radians, see `Variant.turns`; nan where a variant has fewer.
        paints: (kinds, 2, 100, 3) linear colours of bodies, and of the bands and letters on them; those of
            kinds that have none are nan.
        wear: (4, 100, 3) linear colours of skin, trousers, hair and gear.
    """

    first: Ints
    adults: Ints
    umbrellas: Ints
    by_length: NDArray[np.bool_]
    on_foot: NDArray[np.bool_]
    paces: Floats
    models: Ints
    sizes: Floats
    fronts: Floats
    turns: Floats
    paints: Floats
    wear: Floats


_LOOKS = {
    "first": "<i4", "adults": "<i4", "umbrellas": "<i4", "by_length": "|b1", "on_foot": "|b1", "paces": "<f8",
    "models": "<i4", "sizes": "<f8", "fronts": "<f8", "turns": "<f8", "paints": "<f8", "wear": "<f8",
}  # fmt: skip


@lru_cache(maxsize=_FLEETS_KEPT)
def _looks(fleet: Fleet) -> _Looks:
    if fleet.own:
        return _tabulate_looks(fleet)
    return kept_arrays("looks", _Looks, _LOOKS, lambda: _tabulate_looks(fleet))


def _tabulate_looks(fleet: Fleet) -> _Looks:
    """Tabulate what there is to choose from."""
    models, every = build_models(), fleet.variants
    walks = np.array([kind in _ON_FOOT for kind in models])
    return _Looks(
        first=np.cumsum([0] + [len(variants) for variants in models.values()]).astype(np.int32),
        adults=np.array([_count_adults(variants) for variants in models.values()], dtype=np.int32),
        umbrellas=np.array([UMBRELLAS if kind == Kind.PEDESTRIAN else 0 for kind in models], dtype=np.int32),
        by_length=np.array([kind in _BY_LENGTH for kind in models]),
        on_foot=walks,
        paces=np.where(walks, PACE, _CRANK_TURN),
        models=np.cumsum([0] + [len(variant.poses) for variant in every]).astype(np.int32),
        sizes=np.array([variant.size for variant in every]),
        fronts=np.array([variant.front for variant in every]),
        turns=_tabulate_turns([variant.turns for variant in every]),
        paints=np.array([_paints_of(kind) for kind in models]),
        wear=np.array([_shares(colours) for colours in (_SKIN, _TROUSERS, _HAIR, _GEAR)]),
    )


def _count_adults(variants: tuple[Variant, ...]) -> int:
    """Count the variants before the first child."""
    return next((k for k, variant in enumerate(variants) if _is_child(variant)), len(variants))


def _is_child(variant: Variant) -> bool:
    return len(variant.poses) > 1 and not variant.turns and variant.size[2] < _CHILD


def _tabulate_turns(turns: list[tuple[float, ...]]) -> Floats:
    table = np.full((len(turns), max(map(len, turns))), np.nan)
    for row, values in zip(table, turns, strict=True):
        row[: len(values)] = values
    return table


def _paints_of(kind: Kind) -> Floats:
    if kind not in _LIVERIES:
        bodies = _shares(_BY_KIND.get(kind, _CLOTHES))
        return np.stack([bodies, np.full_like(bodies, np.nan)])
    liveries = _LIVERIES[kind]
    return np.stack([_shares_of([pair[k] for pair in liveries], liveries.values()) for k in range(2)])


def _shares(colours: dict[RGB, int]) -> Floats:
    """List each colour as often as it has percents, linear."""
    return _shares_of(colours, colours.values())


def _shares_of(colours: Iterable[RGB], percents: Iterable[int]) -> Floats:
    return to_linear(np.repeat(np.array(list(colours), dtype=np.uint8), list(percents), axis=0))


def place_users(
    snapshot: Snapshot,
    origin: Floats,
    *,
    rain: float = 0.0,
    ways: Ways = NO_WAYS,
    fleet: Fleet | None = None,
) -> Users:
    """Bring road users into the frame of a scene.

    Shape and colour follow from a road user's id alone, its pose from where it is.

    Args:
        snapshot: the road users.
        origin: (3,) of the scene, metres, map frame.
        rain: 0 dry to 1 heavy rain, in which people have umbrellas.
        ways: the map's lanes, whose curves vehicles follow.
        fleet: what there is to draw; None takes our own models.

    Returns:
        One row for each, in the snapshot's order.
    """
    count, fleet = len(snapshot.ids), fleet or usual_fleet()
    own = np.full(count, -1, dtype=np.int32)
    if fleet.own:
        own[:] = [fleet.own.get(name, -1) for name in snapshot.types or ("",) * count]
    codes = np.fromiter(map(_code, snapshot.ids), np.int64, count)
    users = Users(
        frames=np.empty((count, 3, 3)),
        places=snapshot.positions - origin,
        models=np.empty(count, dtype=np.int32),
        colours=np.empty((count, 5, 3)),
        lights=snapshot.lights,
        origin=origin,
    )
    turns = np.empty(count)
    _turn(snapshot.positions, snapshot.headings, ways.find(snapshot.lanes), ways.points, ways.spans, turns)
    moves = (snapshot.headings, snapshot.slopes, snapshot.sizes, snapshot.speeds, turns)
    _place(*moves, snapshot.kinds, snapshot.colours, codes, own, float(rain), _looks(fleet), users)
    return users


@lru_cache(maxsize=_CODES_KEPT)
def _code(name: str) -> int:
    """Number an id, the same in every process."""
    return crc32(name.encode())


@kernel
def _turn(positions, headings, lanes, points, spans, turns):
    """Tell how far the road at each road user's nose has turned from where it heads."""
    for k in range(len(lanes)):
        turns[k] = 0.0
        if lanes[k] >= 0:
            first, last = spans[lanes[k], 0], spans[lanes[k], 1]
            turns[k] = turn_on(points, first, last, positions[k, 0], positions[k, 1], headings[k])


@kernel
def _place(headings, slopes, sizes, speeds, turns, kinds, given, codes, own, rain, looks, users):
    """Choose each road user's model and colours; turn and scale its axes."""
    for k in range(len(codes)):
        kind, code = kinds[k], codes[k]
        is_own = own[k] >= 0
        variant = own[k] if is_own else _choose_variant(kind, code, sizes[k, 0], sizes[k, 2], rain, looks)
        cos_h, sin_h, cos_s, sin_s = cos(headings[k]), sin(headings[k]), cos(slopes[k]), sin(slopes[k])
        ahead = (cos_h * cos_s, sin_h * cos_s, sin_s)
        left = (-sin_h, cos_h, 0.0)
        up = (-cos_h * sin_s, -sin_h * sin_s, cos_s)
        length, width, height, share = sizes[k, 0], sizes[k, 1], sizes[k, 2], 1.0
        shift = 0.0
        if looks.on_foot[kind] and not is_own:
            share = _scale_person(variant, code, height, looks)
            shift = share * looks.fronts[variant] - 0.5 * length
            length, width = share * looks.sizes[variant, 0], share * looks.sizes[variant, 1]
            height = share * looks.sizes[variant, 2]
        way = users.places[k, 0] * cos_h + users.places[k, 1] * sin_h
        if looks.turns[variant, 0] == 0.0:
            pose = _choose_turn(variant, turns[k], looks)
        else:
            pose = _choose_pose(variant, code, way / (share * looks.paces[kind]), speeds[k], looks)
        users.models[k] = looks.models[variant] + pose
        for axis in range(3):
            users.places[k, axis] += shift * ahead[axis]
            users.frames[k, axis, 0] = ahead[axis] * length
            users.frames[k, axis, 1] = left[axis] * width
            users.frames[k, axis, 2] = up[axis] * height
        _colour(users.colours, k, kind, code, given, looks)


@inner
def _choose_variant(kind, code, length, height, rain, looks):
    """Choose by a road user's id; by length where that tells; children by height, or a few of all."""
    first, count, adults = looks.first[kind], looks.first[kind + 1] - looks.first[kind], looks.adults[kind]
    if looks.by_length[kind]:
        best = first
        for variant in range(first, first + count):
            if abs(looks.sizes[variant, 0] - length) < abs(looks.sizes[best, 0] - length):
                best = variant
        return best
    wet = looks.umbrellas[kind]
    if adults < count - wet and (height < _CHILD or (code >> 3) % _CHILDREN == 0):
        return first + adults + code % (count - wet - adults)
    if wet > 0 and code % _DRY != 0 and (code >> 5) % _SHARES < 2.5 * rain * _SHARES:
        return first + count - wet + code % wet
    return first + code % adults


@inner
def _scale_person(variant, code, height, looks):
    """Tell by how much somebody is larger than his look; only people of usual height differ."""
    if height < _CHILD:
        return height / looks.sizes[variant, 2]
    return height / TALL * _STATURES[(code >> 7) % len(_STATURES)]


@inner
def _choose_pose(variant, code, way, speed, looks):
    """Choose the pose after a way, in paces: the first is for a stop."""
    steps = looks.models[variant + 1] - looks.models[variant] - 1
    if steps == 0 or speed < _LEAST_SPEED:
        return 0
    share = way + (code % 64) / 64
    return 1 + int((share - floor(share)) * steps) % steps


@inner
def _choose_turn(variant, turn, looks):
    """Choose the pose that turns most nearly as the road does."""
    best = 0
    for pose in range(1, looks.models[variant + 1] - looks.models[variant]):
        if abs(looks.turns[variant, pose] - turn) < abs(looks.turns[variant, best] - turn):
            best = pose
    return best


@inner
def _colour(colours, k, kind, code, given, looks):
    """Take SUMO's colour, or one of the kind's; and those of bands, or of somebody's skin and clothes.

    Bands that a kind's own colour hides are not seen on SUMO's either.
    """
    unset = given[k, 0] == _UNSET[0] and given[k, 1] == _UNSET[1] and given[k, 2] == _UNSET[2]
    paint = (code >> 8) % _SHARES
    for c in range(3):
        colours[k, 0, c] = looks.paints[kind, 0, paint, c] if unset else _LINEAR[given[k, c]]
    for row in range(len(looks.wear)):
        share = (code * (2 * row + 3) >> 6) % _SHARES
        for c in range(3):
            colours[k, 1 + row, c] = looks.wear[row, share, c]
    if not isnan(looks.paints[kind, 1, paint, 0]):
        plain = True
        for c in range(3):
            plain = plain and looks.paints[kind, 1, paint, c] == looks.paints[kind, 0, paint, c]
        for c in range(3):
            colours[k, _ACCENT, c] = colours[k, 0, c] if plain else looks.paints[kind, 1, paint, c]
