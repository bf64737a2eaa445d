"""Snapshots for tests: road users of every kind on the lanes of a map, as SUMO would place them."""

import math
import random
from dataclasses import replace

import numpy as np

from dojo_env.snapshot import Kind, Lights, Snapshot
from dojo_maps.description import RoadMap
from dojo_maps.geometry.polylines import place_on

SIZES = {
    Kind.CAR: (4.5, 1.8, 1.5), Kind.TAXI: (4.6, 1.8, 1.5), Kind.VAN: (5.6, 2.0, 2.4),
    Kind.BUS: (12.0, 2.5, 3.2), Kind.COACH: (13.5, 2.55, 3.7), Kind.TRUCK: (8.0, 2.5, 3.5),
    Kind.TRAILER: (16.5, 2.55, 4.0), Kind.TRAM: (32.0, 2.4, 3.4), Kind.TRAIN: (80.0, 2.8, 4.0),
    Kind.MOTORCYCLE: (2.2, 0.9, 1.5), Kind.BICYCLE: (1.7, 0.6, 1.75), Kind.SCOOTER: (1.9, 0.8, 1.6),
    Kind.AMBULANCE: (6.2, 2.1, 2.7), Kind.POLICE: (4.7, 1.8, 1.6), Kind.FIRE_ENGINE: (8.2, 2.5, 3.2),
    Kind.PEDESTRIAN: (0.4, 0.6, 1.75), Kind.SHIP: (17.0, 4.0, 4.0),
    Kind.WHEELCHAIR: (1.2, 0.7, 1.2), Kind.PRAM: (0.4, 0.6, 1.75), Kind.HATCHBACK: (4.1, 1.8, 1.5),
    Kind.SALOON: (4.7, 1.8, 1.45), Kind.ESTATE: (4.7, 1.8, 1.5), Kind.PICKUP: (5.3, 1.9, 1.8),
    Kind.ARTICULATED_BUS: (18.0, 2.5, 3.1), Kind.ROAD_TRAIN: (18.75, 2.55, 3.9), Kind.MOPED: (1.9, 0.8, 1.7),
}  # fmt: skip


def empty(road_map: RoadMap, letter: str = "r") -> Snapshot:
    """Nobody on the road; every link shows the same letter."""
    longest = {
        signal.id: 1 + max((link.index for link in signal.links), default=-1) for signal in road_map.signals
    }
    return Snapshot(time=0.0, signals={signal: letter * count for signal, count in longest.items()})


def users(
    poses: list[tuple[float, float, float, float]], kinds: list[Kind], base: Snapshot, **changes: object
) -> Snapshot:
    """Road users of usual sizes at (x, y, z, heading)."""
    count = len(poses)
    values = np.array(poses, dtype=float).reshape(-1, 4)
    columns: dict[str, object] = {
        "ids": tuple(f"user{k}" for k in range(count)),
        "numbers": np.arange(1, count + 1),
        "kinds": np.array(kinds, dtype=np.uint8),
        "positions": values[:, :3],
        "headings": values[:, 3],
        "slopes": np.zeros(count),
        "sizes": np.array([SIZES[kind] for kind in kinds], dtype=float).reshape(-1, 3),
        "colours": np.full((count, 3), (255, 255, 0)),
        "lights": np.zeros(count, dtype=np.uint8),
        "speeds": np.zeros(count),
        "lanes": ("",) * count,
    }
    return replace(base, **{**columns, **changes})


def rush_hour(
    road_map: RoadMap, signal: str, *, seed: int = 1, kinds: tuple[Kind, ...] = (Kind.CAR,)
) -> Snapshot:
    """Queues on every lane that a signal stops."""
    chosen = random.Random(seed)  # noqa: S311 - no secret
    lanes = {lane.id: lane for lane in road_map.lanes}
    links = next(s.links for s in road_map.signals if s.id == signal)
    poses, who = [], []
    for lane_id in sorted({link.from_id for link in links if link.from_id in lanes}):
        lane, back = lanes[lane_id], 1.0
        length = float(np.hypot(*np.diff(lane.shape[:, :2], axis=0).T).sum())
        while back < min(60.0, length - 1.0):
            kind = chosen.choice(kinds)
            (x, y, z), heading = place_on(lane.shape, -back)
            poses.append((float(x), float(y), float(z), float(heading)))
            who.append(kind)
            back += SIZES[kind][0] + chosen.uniform(1.5, 4.0)
    lit = np.array([chosen.choice([0, int(Lights.BRAKE), int(Lights.LEFT)]) for _ in who], dtype=np.uint8)
    return users(poses, who, empty(road_map), lights=lit)


def flat_distance(a: tuple[float, ...], b: tuple[float, ...]) -> float:
    """Metres between two places seen from above."""
    return math.hypot(a[0] - b[0], a[1] - b[1])
