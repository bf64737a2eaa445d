"""Turn SUMO's vehicles and people into a snapshot's arrays. What never changes is asked once per road user.

Plain getters, mapped over ids, cost less than subscriptions: libsumo answers one in about 0.2 µs, and a
subscription spends longer than that on building its dicts.
"""

from itertools import compress
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
    "motorcycle": Kind.MOTORCYCLE, "moped": Kind.MOTORCYCLE, "bicycle": Kind.BICYCLE,
    "scooter": Kind.SCOOTER, "wheelchair": Kind.SCOOTER, "emergency": Kind.AMBULANCE,
    "authority": Kind.POLICE, "army": Kind.TRUCK, "pedestrian": Kind.PEDESTRIAN, "ship": Kind.SHIP,
}  # fmt: skip
_SHAPES = {
    "taxi": Kind.TAXI, "police": Kind.POLICE, "firebrigade": Kind.FIRE_ENGINE, "emergency": Kind.AMBULANCE,
    "delivery": Kind.VAN, "passenger/van": Kind.VAN, "truck/trailer": Kind.TRAILER,
    "truck/semitrailer": Kind.TRAILER, "truck": Kind.TRUCK, "bus/coach": Kind.COACH, "bus": Kind.BUS,
    "bicycle": Kind.BICYCLE, "motorcycle": Kind.MOTORCYCLE, "moped": Kind.MOTORCYCLE,
    "scooter": Kind.SCOOTER, "pedestrian": Kind.PEDESTRIAN, "ship": Kind.SHIP,
}  # fmt: skip
"""SUMO's guiShape says more than the vehicle class where it is one of these."""
_RIGHT, _LEFT, _BOTH, _BRAKE, _BLUE = 1, 2, 4, 8, 2048 | 4096 | 8192
"""Bits of SUMO's vehicle signals."""
_SPARE = 1000


class RoadUsers:
    """Reads snapshots from a running SUMO and keeps what does not change."""

    def __init__(self, get: Any) -> None:
        """Start with nobody known; `get` holds SUMO's getters, such as `vehicle_getSpeed`."""
        self._get = get
        self._signals: tuple[str, ...] = tuple(get.trafficlight_getIDList())
        self._rows: dict[str, int] = {}
        self._looks = np.empty((_SPARE, 8))
        self._next = 1

    def read_snapshot(self, time: float) -> Snapshot:
        """Picture everyone who is somewhere: not those who ride in a vehicle or are being teleported."""
        get = self._get
        ids: tuple[str, ...] = get.vehicle_getIDList()
        people = tuple(name for name in get.person_getIDList() if not get.person_getVehicle(name))

        def column(name: str) -> list[Any]:
            values = list(map(getattr(get, f"vehicle_{name}"), ids))
            return values + list(map(getattr(get, f"person_{name}"), people)) if people else values

        names = ids
        if people:
            taken = set(ids)
            names = (*ids, *(f"person {name}" if name in taken else name for name in people))
        count = len(names)
        positions = np.array(column("getPosition3D"), dtype=np.float64).reshape(count, 3)
        looks = self._looks[self._find(ids, people)]
        bits = np.zeros(count, dtype=np.int64)
        bits[: len(ids)] = list(map(get.vehicle_getSignals, ids))
        is_flat = not positions[:, 2].any()
        slopes = np.zeros(count) if is_flat else np.radians(np.array(column("getSlope"), dtype=np.float64))
        snapshot: dict[str, Any] = {
            "numbers": looks[:, 0].astype(np.int32),
            "kinds": looks[:, 1].astype(np.uint8),
            "positions": positions,
            "headings": np.radians(90.0 - np.array(column("getAngle"), dtype=np.float64)),
            "slopes": slopes,
            "sizes": looks[:, 2:5],
            "colours": looks[:, 5:8].astype(np.uint8),
            "lights": _read_lights(bits),
            "speeds": np.array(column("getSpeed"), dtype=np.float64),
        }
        lanes = tuple(column("getLaneID"))
        there = np.all(positions > _INVALID, axis=1)
        if not there.all():
            snapshot = {name: values[there] for name, values in snapshot.items()}
            names, lanes = (tuple(compress(values, there.tolist())) for values in (names, lanes))
        signals = {name: get.trafficlight_getRedYellowGreenState(name) for name in self._signals}
        return Snapshot(time=time, ids=names, lanes=lanes, signals=signals, **snapshot)

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
        domain, name = ("person", key[1:]) if key.startswith("\0") else ("vehicle", key)
        row = self._rows[key] = len(self._rows)
        self._looks[row] = (self._next, *_read_look(self._get, domain, name))
        self._next += 1

    def _forget(self, present: list[str]) -> None:
        """Keep only who is present, so that memory does not grow with the episode, and make room."""
        kept = [key for key in present if key in self._rows]
        looks = np.empty((2 * len(present) + _SPARE, 8))
        looks[: len(kept)] = self._looks[[self._rows[key] for key in kept]]
        self._rows, self._looks = {key: row for row, key in enumerate(kept)}, looks


def _read_look(get: Any, domain: str, name: str) -> tuple[float, ...]:
    def ask(what: str) -> Any:
        return getattr(get, f"{domain}_get{what}")(name)

    on_foot = domain == "person"
    colour = tuple(ask("Color")[:3])
    kind = Kind.PEDESTRIAN
    if not on_foot:
        kind = _SHAPES.get(ask("ShapeClass"), _KINDS.get(ask("VehicleClass"), Kind.CAR))
    sizes = (min(max(ask(side), 0.1), LARGEST_SIZE - 1) for side in ("Length", "Width", "Height"))
    return (kind, *sizes, *colour)


def _read_lights(bits: NDArray[np.int64]) -> NDArray[np.uint8]:
    lights = np.where(bits & _BRAKE, Lights.BRAKE, 0)
    lights |= np.where(bits & (_LEFT | _BOTH), Lights.LEFT, 0)
    lights |= np.where(bits & (_RIGHT | _BOTH), Lights.RIGHT, 0)
    lights |= np.where(bits & _BLUE, Lights.BLUE, 0)
    return lights.astype(np.uint8)
