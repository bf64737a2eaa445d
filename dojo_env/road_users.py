"""Turn SUMO's vehicles and people into a snapshot's arrays. What never changes is asked once.

Plain getters, mapped over ids, cost less than subscriptions: libsumo answers one in about 0.2 µs, and a
subscription spends longer than that on building its dicts.
"""

from collections.abc import Iterable
from itertools import chain, compress, repeat
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dojo_env.snapshot import LARGEST_SIZE, Kind, Lights, Snapshot

_INVALID = -1e8
"""Metres; SUMO gives positions far beyond this to what is nowhere, as while teleporting."""
_KINDS = {
    "passenger": Kind.CAR, "private": Kind.CAR, "evehicle": Kind.CAR, "hov": Kind.CAR, "vip": Kind.CAR,
    "taxi": Kind.TAXI, "delivery": Kind.VAN, "bus": Kind.BUS, "coach": Kind.COACH, "truck": Kind.TRUCK,
    "trailer": Kind.TRAILER, "tram": Kind.TRAM, "rail_urban": Kind.TRAM, "subway": Kind.TRAIN,
    "rail": Kind.TRAIN, "rail_electric": Kind.TRAIN, "rail_fast": Kind.TRAIN, "cable_car": Kind.TRAM,
    "motorcycle": Kind.MOTORCYCLE, "moped": Kind.MOPED, "bicycle": Kind.BICYCLE,
    "scooter": Kind.SCOOTER, "wheelchair": Kind.WHEELCHAIR, "emergency": Kind.AMBULANCE,
    "authority": Kind.POLICE, "army": Kind.TRUCK, "pedestrian": Kind.PEDESTRIAN, "ship": Kind.SHIP,
}  # fmt: skip
_SHAPES = {
    "taxi": Kind.TAXI, "police": Kind.POLICE, "firebrigade": Kind.FIRE_ENGINE, "emergency": Kind.AMBULANCE,
    "delivery": Kind.VAN, "passenger/van": Kind.VAN, "passenger/hatchback": Kind.HATCHBACK,
    "passenger/sedan": Kind.SALOON, "passenger/wagon": Kind.ESTATE, "truck/trailer": Kind.ROAD_TRAIN,
    "truck/semitrailer": Kind.TRAILER, "truck": Kind.TRUCK, "bus/coach": Kind.COACH, "bus": Kind.BUS,
    "bus/flexible": Kind.ARTICULATED_BUS, "bus/trolley": Kind.BUS,
    "bicycle": Kind.BICYCLE, "motorcycle": Kind.MOTORCYCLE, "moped": Kind.MOPED,
    "scooter": Kind.SCOOTER, "pedestrian": Kind.PEDESTRIAN, "ship": Kind.SHIP,
}  # fmt: skip
"""SUMO's guiShape says more than the vehicle class where it is one of these."""
_PRAMS = ("pram", "stroller", "pushchair")
"""SUMO has no class for those who push one, so the names of their types must tell."""
_PICKUPS = ("pickup", "pick-up", "pick_up")
"""The same for these cars."""
_RIGHT, _LEFT, _BOTH, _BRAKE, _BLUE = 1, 2, 4, 8, 2048 | 4096 | 8192
"""Bits of SUMO's vehicle signals."""
_BITS = 1 << 14
_SPARE = 1000
_LOOK = np.dtype(
    [
        ("numbers", np.int32), ("types", np.int32), ("kinds", np.uint8), ("colours", np.uint8, 3),
        ("sizes", np.float64, 3),
    ],
    align=True,
)  # fmt: skip
"""What a road user keeps as long as it exists."""


class RoadUsers:
    """Reads snapshots from a running SUMO and keeps what does not change."""

    def __init__(self, get: Any) -> None:
        """Start with nobody known; `get` holds SUMO's getters, such as `vehicle_getSpeed`."""
        self._get = get
        self._signals: tuple[str, ...] = tuple(get.trafficlight_getIDList())
        self._rows: dict[str, int] = {}
        self._looks = np.empty(_SPARE, _LOOK)
        self._types: dict[str, tuple[int, Kind, tuple[float, ...]]] = {}
        self._next = 1

    def read_snapshot(self, time: float, ids: tuple[str, ...], speeds: list[float]) -> Snapshot:
        """Picture everyone who is somewhere: not those who ride in a vehicle or are being teleported.

        Args:
            time: of this instant, seconds.
            ids: of the vehicles.
            speeds: of them, m/s.

        Returns:
            The instant.
        """
        get = self._get
        people = tuple(name for name in get.person_getIDList() if not get.person_getVehicle(name))

        def column(name: str) -> Iterable[Any]:
            values = map(getattr(get, f"vehicle_{name}"), ids)
            return chain(values, map(getattr(get, f"person_{name}"), people)) if people else values

        names = ids
        if people:
            taken = set(ids)
            names = (*ids, *(f"person {name}" if name in taken else name for name in people))
            speeds = [*speeds, *map(get.person_getSpeed, people)]
        count = len(names)
        places = chain.from_iterable(column("getPosition3D"))
        positions = np.fromiter(places, np.float64, 3 * count).reshape(count, 3)
        rows = self._find(ids, people)  # It may put another array in the place of this one.
        looks = self._looks.take(rows)
        bits = chain(map(get.vehicle_getSignals, ids), repeat(0, len(people)))
        slopes = column("getSlope") if np.count_nonzero(positions[:, 2]) else repeat(0.0, count)
        snapshot: dict[str, Any] = {
            **{name: looks[name] for name in ("numbers", "kinds", "colours", "sizes")},
            "positions": positions,
            "headings": np.radians(90.0 - np.fromiter(column("getAngle"), np.float64, count)),
            "slopes": np.radians(np.fromiter(slopes, np.float64, count)),
            "lights": _LIGHTS[np.fromiter(bits, np.int64, count) % _BITS],
            "speeds": np.array(speeds, dtype=np.float64),
        }
        lanes, known = tuple(column("getLaneID")), tuple(self._types)
        types = tuple(map(known.__getitem__, looks["types"].tolist()))
        if positions.min(initial=0.0) < _INVALID:
            there = np.all(positions > _INVALID, axis=1)
            snapshot = {name: values[there] for name, values in snapshot.items()}
            kept = there.tolist()
            names, lanes, types = (tuple(compress(values, kept)) for values in (names, lanes, types))
        signals = {name: get.trafficlight_getRedYellowGreenState(name) for name in self._signals}
        return Snapshot.trusted(time=time, ids=names, lanes=lanes, types=types, signals=signals, **snapshot)

    def _find(self, ids: tuple[str, ...], people: tuple[str, ...]) -> list[int]:
        """Find the row of each road user's number, kind, size and colour; SUMO is asked for new ones."""
        # A person and a vehicle may share an id, so people are kept under one that no id can have.
        keys = [*ids, *(f"\0{name}" for name in people)]
        rows = list(map(self._rows.get, keys))
        if None in rows:
            if len(self._rows) + len(keys) > len(self._looks):
                self._forget(keys)
            for key in keys:
                if key not in self._rows:
                    self._learn(key)
            rows = list(map(self._rows.get, keys))
        return rows  # type: ignore[return-value]

    def _learn(self, key: str) -> None:
        get, on_foot, name = self._get, key.startswith("\0"), key.removeprefix("\0")
        type_id = get.person_getTypeID(name) if on_foot else get.vehicle_getTypeID(name)
        if type_id not in self._types:
            self._types[type_id] = (len(self._types), *_read_type(get, type_id))
        number, kind, sizes = self._types[type_id]
        colour = get.person_getColor(name) if on_foot else get.vehicle_getColor(name)
        row = self._rows[key] = len(self._rows)
        if on_foot and kind not in (Kind.WHEELCHAIR, Kind.PRAM):
            kind = Kind.PEDESTRIAN
        self._looks[row] = (self._next, number, kind, colour[:3], sizes)
        self._next += 1

    def _forget(self, present: list[str]) -> None:
        """Keep only who is present, so that memory does not grow with the episode, and make room."""
        kept = [key for key in present if key in self._rows]
        looks = np.empty(2 * len(present) + _SPARE, _LOOK)
        looks[: len(kept)] = self._looks[[self._rows[key] for key in kept]]
        self._rows, self._looks = {key: row for row, key in enumerate(kept)}, looks


def _read_type(get: Any, name: str) -> tuple[Kind, tuple[float, ...]]:
    """Read what all vehicles of a type share: whoever differs has a type of its own in SUMO."""
    usual = _KINDS.get(get.vehicletype_getVehicleClass(name), Kind.CAR)
    sizes = (get.vehicletype_getLength, get.vehicletype_getWidth, get.vehicletype_getHeight)
    kind = _SHAPES.get(get.vehicletype_getShapeClass(name), usual)
    # The usual shapes of these two are a pedestrian's and a van's.
    if usual == Kind.WHEELCHAIR or (usual, kind) == (Kind.AMBULANCE, Kind.VAN):
        kind = usual
    elif kind == Kind.PEDESTRIAN and any(word in name.lower() for word in _PRAMS):
        kind = Kind.PRAM
    elif usual == Kind.CAR and any(word in name.lower() for word in _PICKUPS):
        kind = Kind.PICKUP
    return kind, tuple(min(max(size(name), 0.1), LARGEST_SIZE - 1) for size in sizes)


def _tabulate_lights() -> NDArray[np.uint8]:
    bits = np.arange(_BITS)
    lights = np.where(bits & _BRAKE, Lights.BRAKE, 0)
    lights |= np.where(bits & (_LEFT | _BOTH), Lights.LEFT, 0)
    lights |= np.where(bits & (_RIGHT | _BOTH), Lights.RIGHT, 0)
    lights |= np.where(bits & _BLUE, Lights.BLUE, 0)
    return lights.astype(np.uint8)


_LIGHTS = _tabulate_lights()
"""`Lights` by SUMO's vehicle signals."""
