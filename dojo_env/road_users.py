"""Turn SUMO's vehicles and people into a snapshot's arrays. What never changes is asked once per road user.

Plain getters, mapped over ids, cost less than subscriptions: libsumo answers one in about 0.2 µs, and a
subscription spends longer than that on building its dicts.
"""

import zlib
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dojo_env.snapshot import LARGEST_SIZE, Kind, Lights, Snapshot

_INVALID = -1e8
"""Metres; SUMO gives positions far beyond this to what is nowhere, as while teleporting."""
_DEFAULT_COLOUR = (255, 255, 0)
"""What SUMO draws everything with that has no colour of its own."""
_PAINTS = (
    (236, 236, 234), (28, 29, 31), (120, 124, 128), (178, 182, 186), (38, 58, 102), (140, 28, 30),
    (72, 76, 80), (205, 200, 186), (52, 84, 62), (96, 128, 168),
)  # fmt: skip
"""sRGB, about as cars are painted."""
_CLOTHES = ((52, 58, 74), (148, 62, 54), (66, 92, 66), (190, 184, 170), (44, 44, 48), (92, 112, 150))
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
        self._looks: dict[str, tuple[float, ...]] = {}
        self._next = 1

    def read_snapshot(self, time: float) -> Snapshot:
        """Picture everyone who is somewhere: not those who ride in a vehicle or are being teleported."""
        get = self._get
        ids = get.vehicle_getIDList()
        people = [name for name in get.person_getIDList() if not get.person_getVehicle(name)]
        count, total = len(ids), len(ids) + len(people)

        def column(name: str, width: int = 1) -> NDArray[np.float64]:
            of_vehicles, of_people = getattr(get, f"vehicle_{name}"), getattr(get, f"person_{name}")
            values = [*map(of_vehicles, ids), *map(of_people, people)]
            return np.array(values, dtype=np.float64).reshape(total, width)

        positions = column("getPosition3D", 3)
        taken = set(ids)
        names = (*ids, *(f"person {name}" if name in taken else name for name in people))
        looks = np.array(
            [*map(self._look("vehicle"), ids), *map(self._look("person"), people)], dtype=np.float64
        ).reshape(total, 8)
        bits = np.zeros(total, dtype=np.int64)
        bits[:count] = list(map(get.vehicle_getSignals, ids))
        lanes = (*map(get.vehicle_getLaneID, ids), *map(get.person_getLaneID, people))
        there = np.flatnonzero((positions > _INVALID).all(axis=1))
        rows = there.tolist()
        self._forget(names)
        return Snapshot(
            time=time,
            ids=tuple(names[row] for row in rows),
            numbers=looks[there, 0].astype(np.int32),
            kinds=looks[there, 1].astype(np.uint8),
            positions=positions[there],
            headings=np.radians(90.0 - column("getAngle")[there, 0]),
            slopes=np.radians(column("getSlope")[there, 0]),
            sizes=looks[there, 2:5],
            colours=looks[there, 5:8].astype(np.uint8),
            lights=_read_lights(bits[there]),
            speeds=column("getSpeed")[there, 0],
            lanes=tuple(lanes[row] for row in rows),
            signals={name: get.trafficlight_getRedYellowGreenState(name) for name in self._signals},
        )

    def _look(self, domain: str) -> Callable[[str], tuple[float, ...]]:
        """Find number, kind, length, width, height and colour of one road user."""
        known = self._looks

        def look(name: str) -> tuple[float, ...]:
            # A person and a vehicle may share an id, so people are kept under one that no id can have.
            key = name if domain == "vehicle" else f"\0{name}"
            found = known.get(key)
            if found is None:
                found = known[key] = (self._next, *_read_look(self._get, domain, name))
                self._next += 1
            return found

        return look

    def _forget(self, names: tuple[str, ...]) -> None:
        """Drop who is gone, now and then, so that memory does not grow with the episode."""
        if len(self._looks) > 2 * len(names) + _SPARE:
            present = {*names, *(f"\0{name}" for name in names)}
            self._looks = {name: look for name, look in self._looks.items() if name in present}


def _read_look(get: Any, domain: str, name: str) -> tuple[float, ...]:
    def ask(what: str) -> Any:
        return getattr(get, f"{domain}_get{what}")(name)

    on_foot = domain == "person"
    colour = tuple(ask("Color")[:3])
    if colour == _DEFAULT_COLOUR:
        choices = _CLOTHES if on_foot else _PAINTS
        colour = choices[zlib.crc32(name.encode()) % len(choices)]
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
