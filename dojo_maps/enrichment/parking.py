"""Parked cars: on the parking lanes that a source tells of, else in bays generated from the map alone.

A bay takes the ground of generated pavement, which goes around it where the forecourts leave room for that:

    lane       =====================================
    bay             [ car ][ car ][     ][ car ]
    pavement   -----+                          +----
                    +--------------------------+
    forecourt
    houses     #####################################
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import groupby

import numpy as np
import shapely

from dojo_maps.description import CARRIAGEWAY, Lane, LaneKind, Origin, Points, Prop, Sidewalk
from dojo_maps.enrichment.houses import GENERATED, chance
from dojo_maps.enrichment.vicinity import Vicinity, areas
from dojo_maps.geometry.pieces import GRID, flat_polygons
from dojo_maps.geometry.polylines import Flags, Floats, Shapes, drop_repeats, lift, places_on

PARKING, PARKED_CAR = "parking", "parked_car"
"""Kinds of props: a bay, its outline along the kerb and back, and a car, its outline from the right front
corner over the left one."""

_DEPTH, _PLACE = 2.1, 5.8
"""Size of a parking place across and along the street, metres."""
_LEAST_PLACES = 2
_UNDERLAP = 0.1
"""How far bays reach under the carriageway, metres, as pavement does."""
PAVEMENT_BEHIND = 2.0
"""Width of the pavement behind a bay, and how far it goes on past the bay's ends, metres."""
_FROM_JUNCTIONS = 11.0
_FROM_CROSSINGS, _FROM_POSTS, _FROM_WALLS = 5.0, 0.9, 0.2
"""Metres that places keep away from these, at least."""
_FASTEST = 15.3
"""Nobody parks along roads above 55 km/h, m/s."""
_STRAIGHT = np.radians(4.0)
"""Most that a street may bend along a place."""
_KERB_GAP = 0.08
"""Metres that cars leave to the sides of their places, at least."""
_TAKEN, _VANS = 0.72, 0.09
"""Shares of the places that are taken, and of vans among the cars."""
_CAR, _VAN = (4.15, 1.78, 1.48), (5.0, 1.95, 2.1)
"""Length, width and height of cars, which differ a little, and of vans, metres."""
_FROM_ENDS = 5.0
"""Metres that cars keep from the ends of parking lanes, at least."""
_NARROWEST = 1.9
_STANDS = ((4.7, 0.5 * np.pi, 2.6, 5.0), (3.0, 0.2 * np.pi, 4.2, 2.5), (_NARROWEST, 0.0, _PLACE, _PLACE))
"""How cars stand on parking lanes from some width on, metres: by how much they turn to the kerb, radians, and
metres from place to place and of a place's length."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Places:
    """Room for n cars beside a lane, one after the other.

    Attributes:
        lane: the lane that it lies beside.
        ends: (n + 1, 2) places on the lane's middle, metres, map frame.
        outward: (n + 1, 2) unit vectors from there across the street.
        free: (n,) whether each may be used.
    """

    lane: Lane
    ends: Floats
    outward: Floats
    free: Flags

    def band(self, first: int, last: int, near: float, far: float) -> Floats:
        """Outline the ground beside places, between two distances from the lane's edge.

        Args:
            first: index of the first place.
            last: index after the last place.
            near: metres from the lane's edge to the inner side; negative on the lane.
            far: metres from the lane's edge to the outer side.

        Returns:
            (2 k, 2), metres, map frame, for k - 1 places: the inner side in driving direction, then the outer
            side back.
        """
        start, out = self.ends[first : last + 1], self.outward[first : last + 1]
        half = self.lane.width / 2
        return np.vstack([start + (half + near) * out, (start + (half + far) * out)[::-1]])

    def runs(self) -> Iterator[tuple[int, int]]:
        """List where bays begin and end."""
        for is_free, run in groupby(range(len(self.free)), key=lambda k: bool(self.free[k])):
            places = list(run)
            if is_free and len(places) >= _LEAST_PLACES:
                yield places[0], places[-1] + 1


def generate_parking(
    near: Vicinity, sidewalks: Sequence[Sidewalk], walls: Shapes, taken: Shapes
) -> tuple[tuple[Prop, ...], tuple[Sidewalk, ...]]:
    """Lay bays along the streets of a vicinity, and park cars in them.

    Args:
        near: the vicinity.
        sidewalks: the map's; generated ones give way to bays.
        walls: (n,) outlines of houses, map frame.
        taken: (m,) where something else stands, such as lamps and signs.

    Returns:
        Bays, then cars, and the sidewalks.
    """
    beside = {walk.road for walk in sidewalks if walk.origin is Origin.GENERATED}
    found = [places for lane in near.road_map.lanes if lane.road in beside for places in _beside(near, lane)]
    rooms = _find_room(found, near, walls, taken)
    runs = [(room, *run) for room in rooms for run in room.runs()]
    if not runs:
        return (), tuple(sidewalks)
    bays = areas([_ring(room.band(first, last, -_UNDERLAP, _DEPTH)) for room, first, last in runs])
    around = areas([_ring(_way_round(room, first, last)) for room, first, last in runs])
    props = [_bay(room, room.band(first, last, -_UNDERLAP, _DEPTH)) for room, first, last in runs]
    props += [
        car for room, first, last in runs for k in range(first, last) if (car := _car_in(room, k)) is not None
    ]
    return tuple(props), tuple(_led_around(sidewalks, runs, bays, around))


def park_on_lanes(near: Vicinity) -> tuple[Prop, ...]:
    """Park cars on the parking lanes of a vicinity: those that are open to nobody.

    Args:
        near: the vicinity; cars stand within its `focus`.

    Returns:
        Props of kind `parked_car`.
    """
    closed = [lane for lane in near.road_map.lanes if lane.kind is LaneKind.SHOULDER and not lane.allow]
    outermost = {lane.road: lane.index for lane in reversed(near.road_map.lanes) if lane.kind in CARRIAGEWAY}
    side = 1.0 if near.road_map.left_hand else -1.0
    cars: list[Prop] = []
    for lane in closed:
        is_outer = lane.index < outermost.get(lane.road, lane.index + 1)
        cars += _park_on(lane, side if is_outer else -side)
    outlines = areas([car.polygon for car in cars if car.polygon is not None])
    inside = shapely.contains(near.focus, outlines)
    return tuple(car for car, is_inside in zip(cars, inside, strict=True) if is_inside)


def _park_on(lane: Lane, side: float) -> Iterator[Prop]:
    """Park cars on a parking lane, whose kerb is on its left (1) or right (-1)."""
    shape = drop_repeats(lane.shape)
    if lane.width < _NARROWEST or len(shape) < 2:
        return
    turn, pitch, room = next(stand for least, *stand in _STANDS if lane.width >= least)
    length = float(np.hypot(*np.diff(shape[:, :2], axis=0).T).sum())
    count = int(max(0.0, length - 2 * _FROM_ENDS) / pitch)
    distances: Floats = length / 2 + pitch * (np.arange(float(count)) + 0.5 - count / 2)
    spots, headings = places_on(shape, distances)
    for spot, heading in zip(spots[:, :2], headings + turn * side, strict=True):
        place = (room, pitch * float(np.sin(turn)) if turn else lane.width)
        car = _car(f"{spot[0]:.1f}:{spot[1]:.1f}", spot, float(heading), place, shape)
        if car is not None:
            yield car


def _beside(near: Vicinity, lane: Lane) -> Iterator[Places]:
    """Divide the side of a street's outermost lane into places."""
    shape = drop_repeats(lane.shape)
    if lane.index > 0 or lane.kind is not LaneKind.DRIVING or lane.speed > _FASTEST or len(shape) < 2:
        return
    length = float(np.hypot(*np.diff(shape[:, :2], axis=0).T).sum())
    count = int((length - 2 * _FROM_JUNCTIONS) / _PLACE)
    if count < _LEAST_PLACES:
        return
    distances: Floats = length / 2 + _PLACE * (np.arange(count + 1.0) - count / 2)
    spots, ahead = places_on(shape, distances)
    side = np.pi / 2 if near.road_map.left_hand else -np.pi / 2
    bend = np.abs(np.remainder(np.diff(ahead) + np.pi, 2 * np.pi) - np.pi)
    yield Places(
        lane=lane,
        ends=spots[:, :2],
        outward=np.column_stack([np.cos(ahead + side), np.sin(ahead + side)]),
        free=bend < _STRAIGHT,
    )


def _find_room(found: Sequence[Places], near: Vicinity, walls: Shapes, taken: Shapes) -> list[Places]:
    """Keep the places on ground that nothing else needs; of two on the same ground, the first."""
    if not found:
        return []
    ground = _polygons(found, 0.05, _DEPTH + PAVEMENT_BEHIND)
    free = np.concatenate([places.free for places in found]) & shapely.contains(near.focus, ground)
    road_map = near.road_map
    crossings = areas([crossing.polygon for crossing in road_map.crossings])
    walked = areas([area.polygon for area in road_map.walking_areas])
    walked = np.concatenate(
        [walked, areas([w.polygon for w in road_map.sidewalks if w.origin is Origin.NETWORK])]
    )
    junctions = areas([junction.polygon for junction in road_map.junctions])
    for shapes, distance in (
        (near.driven, 0.0),
        (junctions, _FROM_JUNCTIONS),
        (crossings, _FROM_CROSSINGS),
        (walked, 0.0),
        (walls, _FROM_WALLS),
        (taken, _FROM_POSTS),
    ):
        free[shapely.STRtree(shapes).query(ground, "dwithin", distance=distance)[0]] = False
    one, other = shapely.STRtree(ground).query(shapely.buffer(ground, -0.1), "intersects")
    owner = np.repeat(np.arange(len(found)), [len(places.free) for places in found])
    for first, second in sorted(zip(one.tolist(), other.tolist(), strict=True)):
        if owner[first] < owner[second] and free[first]:
            free[second] = False
    kept = np.split(free, np.cumsum([len(places.free) for places in found])[:-1])
    return [replace(places, free=own) for places, own in zip(found, kept, strict=True)]


def _polygons(found: Sequence[Places], near: float, far: float) -> Shapes:
    rings = []
    for places in found:
        inner, outer = np.split(places.band(0, len(places.free), near, far), 2)
        outer = outer[::-1]
        rings.append(np.stack([inner[:-1], inner[1:], outer[1:], outer[:-1]], axis=1))
    polygons: Shapes = shapely.polygons(np.concatenate(rings))
    return polygons


def _way_round(room: Places, first: int, last: int) -> Floats:
    """Outline the ground of a bay and of the pavement that goes around it."""
    ring = room.band(first, last, -_UNDERLAP, _DEPTH + PAVEMENT_BEHIND)
    half = len(ring) // 2
    before, after = (_unit(ring[a] - ring[b]) * PAVEMENT_BEHIND for a, b in ((0, 1), (half - 1, half - 2)))
    ring[[0, -1]] += before
    ring[[half - 1, half]] += after
    return ring


def _led_around(
    sidewalks: Sequence[Sidewalk], runs: Sequence[tuple[Places, int, int]], bays: Shapes, around: Shapes
) -> Iterator[Sidewalk]:
    """Cut bays out of generated pavement, and lead that of their own street around them."""
    generated = [w for w in sidewalks if w.origin is Origin.GENERATED and len(w.polygon) > 2]
    own = areas([walk.polygon for walk in generated])
    number, bay = shapely.STRtree(bays).query(own, "intersects")
    crossed = {generated[k].id: (own[k], bay[number == k]) for k in np.unique(number).tolist()}
    roads = np.array([room.lane.road for room, _, _ in runs])
    for walk in sidewalks:
        if walk.id not in crossed:
            yield walk
            continue
        shape, cut = crossed[walk.id]
        led = shapely.union_all([shape, *around[cut[roads[cut] == walk.road]]], grid_size=GRID)
        left = shapely.difference(led, shapely.union_all(bays[cut]), grid_size=GRID)
        line = runs[cut[0]][0].lane.shape
        for k, part in enumerate(flat_polygons(np.array([left]), larger_than=1.0)[0]):
            yield replace(
                walk,
                id=f"{walk.id}+{k}" if k else walk.id,
                polygon=lift(shapely.get_coordinates(part.exterior)[:-1], line),
                holes=tuple(lift(shapely.get_coordinates(hole)[:-1], line) for hole in part.interiors),
            )


def _bay(room: Places, ring: Floats) -> Prop:
    x, y = np.round(ring[0], 1)
    return Prop(
        id=f"generated:parking:{x:.1f}:{y:.1f}",
        kind=PARKING,
        height=0.0,
        polygon=lift(np.round(ring, 3), room.lane.shape),
        tags=(GENERATED, ("road", room.lane.road)),
    )


def _car_in(room: Places, k: int) -> Prop | None:
    """Park a car in a place of a bay."""
    aside = (room.lane.width + _DEPTH) / 2
    spot = (room.ends[k] + room.ends[k + 1]) / 2 + aside * room.outward[k]
    ahead = room.ends[k + 1] - room.ends[k]
    name = f"{room.ends[k, 0]:.1f}:{room.ends[k, 1]:.1f}"
    return _car(name, spot, float(np.arctan2(ahead[1], ahead[0])), (_PLACE, _DEPTH), room.lane.shape)


def _car(name: str, spot: Floats, heading: float, place: tuple[float, float], ground: Points) -> Prop | None:
    """Park a car in a place, not quite in its middle; or leave the place empty.

    Args:
        name: decides about all that differs.
        spot: (2,) the place's middle, metres, map frame.
        heading: of its nose, radians.
        place: length and width of the place, metres.
        ground: (n, 3) a line nearby that has the ground's heights.
    """
    if chance("parked", name) > _TAKEN:
        return None
    is_van = chance("van", name) < _VANS
    length, width, height = _VAN if is_van else _CAR
    length += 0.0 if is_van else 0.5 * chance("length", name)
    ahead = np.array([np.cos(heading), np.sin(heading)])
    left = np.array([-ahead[1], ahead[0]])
    spare = np.maximum(0.0, [place[0] - length - 0.4, place[1] - width - 2 * _KERB_GAP])
    middle = spot + ahead * spare[0] * (chance("along", name) - 0.5)
    middle = middle + left * spare[1] * (chance("aside", name) - 0.5)
    corners = [
        middle + ahead * length / 2 * forward + left * width / 2 * side
        for forward, side in ((1, -1), (1, 1), (-1, 1), (-1, -1))
    ]
    return Prop(
        id=f"generated:parked:{name}",
        kind=PARKED_CAR,
        height=height,
        polygon=lift(np.round(corners, 3), ground),
        tags=(GENERATED, ("vehicle", "van" if is_van else "car")),
    )


def _unit(way: Floats) -> Floats:
    unit: Floats = way / np.hypot(*way)
    return unit


def _ring(outline: Floats) -> Points:
    return np.column_stack([outline, np.zeros(len(outline))])
