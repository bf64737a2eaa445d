"""One simulated instant as arrays: all that sensors, metrics and controllers see of the traffic."""

from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from enum import IntEnum, IntFlag
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from dojo_env.charts import Plot, draw_traffic
from dojo_env.errors import SnapshotError
from dojo_maps.description import RoadMap
from dojo_maps.wording import counted

if TYPE_CHECKING:
    from dojo_maps.bundle import Bundle

Floats = NDArray[np.float64]
Ints = NDArray[np.int32]
Bytes = NDArray[np.uint8]

LARGEST_SIZE = 1000.0
"""Metres; longer than any train."""


class Kind(IntEnum):
    """What a road user is, as far as its looks go."""

    CAR = 0
    TAXI = 1
    VAN = 2
    BUS = 3
    COACH = 4
    TRUCK = 5
    TRAILER = 6
    TRAM = 7
    TRAIN = 8
    MOTORCYCLE = 9
    BICYCLE = 10
    SCOOTER = 11
    AMBULANCE = 12
    POLICE = 13
    FIRE_ENGINE = 14
    PEDESTRIAN = 15
    SHIP = 16
    WHEELCHAIR = 17
    PRAM = 18
    HATCHBACK = 19
    SALOON = 20
    ESTATE = 21
    PICKUP = 22
    ARTICULATED_BUS = 23
    ROAD_TRAIN = 24
    MOPED = 25


class Lights(IntFlag):
    """Which lights of a road user are lit."""

    NONE = 0
    BRAKE = 1
    LEFT = 2
    RIGHT = 4
    BLUE = 8
    OFF = 16
    """Nobody is in it: no lamp shines, whatever the hour."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Snapshot:
    """Every road user and every signal at one instant. All arrays have one row per road user.

    Attributes:
        time: simulated seconds.
        ids: SUMO's ids, unique.
        numbers: (n,) above 0 and unique; a road user keeps its number as long as it exists.
        kinds: (n,) `Kind`.
        positions: (n, 3) middle of the front end on the ground, metres, map frame.
        headings: (n,) radians, counter-clockwise from east.
        slopes: (n,) radians, positive uphill.
        sizes: (n, 3) length, width, height, metres.
        colours: (n, 3) sRGB.
        lights: (n,) `Lights`.
        speeds: (n,) m/s.
        lanes: lane id of each road user, "" where it is on none.
        types: SUMO's vehicle type of each, or none at all where they are not known.
        signals: the state of each signal, one of SUMO's letters per link index.
    """

    time: float
    ids: tuple[str, ...] = ()
    numbers: Ints = field(default_factory=lambda: np.empty(0, np.int32))
    kinds: Bytes = field(default_factory=lambda: np.empty(0, np.uint8))
    positions: Floats = field(default_factory=lambda: np.empty((0, 3)))
    headings: Floats = field(default_factory=lambda: np.empty(0))
    slopes: Floats = field(default_factory=lambda: np.empty(0))
    sizes: Floats = field(default_factory=lambda: np.empty((0, 3)))
    colours: Bytes = field(default_factory=lambda: np.empty((0, 3), np.uint8))
    lights: Bytes = field(default_factory=lambda: np.empty(0, np.uint8))
    speeds: Floats = field(default_factory=lambda: np.empty(0))
    lanes: tuple[str, ...] = ()
    types: tuple[str, ...] = ()
    signals: Mapping[str, str] = field(default_factory=dict)

    def __post_init__(self) -> None:
        """Fix types, make everything read-only, and refuse what cannot be.

        Raises:
            SnapshotError: rows are missing, or a road user has no finite pose, no size, or another's number.
        """
        count = len(self.ids)
        for name, shape, dtype in _COLUMNS:
            values = _read_only(getattr(self, name), dtype)
            if values.shape != (count, *shape):
                raise SnapshotError(f"snapshot: {name} of shape {values.shape}, expected {(count, *shape)}")
            object.__setattr__(self, name, values)
        object.__setattr__(self, "signals", MappingProxyType(dict(self.signals)))
        if len(self.lanes) != count:
            raise SnapshotError(f"snapshot: {len(self.lanes)} lanes, expected {count}")
        if len(self.types) not in (0, count):
            raise SnapshotError(f"snapshot: {len(self.types)} types, expected {count} or none")
        self._refuse("pose", ~np.isfinite(np.column_stack([self.positions, self.headings, self.slopes])))
        self._refuse("size", ~((self.sizes > 0) & (self.sizes < LARGEST_SIZE)))
        self._refuse("kind", self.kinds > max(Kind))
        self._refuse("number", self.numbers < 1)
        if len(set(self.ids)) != count or len(np.unique(self.numbers)) != count:
            raise SnapshotError("snapshot: two road users share an id or a number; each needs its own")

    @classmethod
    def trusted(cls, **values: Any) -> "Snapshot":
        """Make a snapshot of all its values, known to be right and of the right types, without checks.

        For who has read SUMO itself, at every decision.

        Args:
            values: every field.

        Returns:
            The snapshot.
        """
        made = object.__new__(cls)
        made.__setstate__(values)
        return made

    def __getstate__(self) -> dict[str, Any]:
        """Give all values, as pickle can take them."""
        values = {each.name: getattr(self, each.name) for each in fields(self)}
        return {**values, "signals": dict(self.signals)}

    def __setstate__(self, values: dict[str, Any]) -> None:
        """Take values that are known to be right, and make everything read-only."""
        for name, value in values.items():
            if isinstance(value, np.ndarray):
                value.setflags(write=False)
            object.__setattr__(self, name, value)
        object.__setattr__(self, "signals", MappingProxyType(self.signals))

    def joined(self, others: "Snapshot") -> "Snapshot":
        """Give the same instant with others among the road users.

        Args:
            others: road users, none of which is here already.

        Returns:
            The snapshot of all.
        """
        values = self.__getstate__()
        added: dict[str, Any] = {
            name: np.concatenate([values[name], getattr(others, name)]) for name, _, _ in _COLUMNS
        }
        types = (name for each in (self, others) for name in each.types or ("",) * len(each.ids))
        added |= {"ids": self.ids + others.ids, "lanes": self.lanes + others.lanes, "types": tuple(types)}
        return Snapshot.trusted(**{**values, **added})

    def plot(self, road_map: "RoadMap | Bundle | None" = None) -> Plot:
        """Draw the traffic from above, red where it stands, green where it is fast.

        Args:
            road_map: a map, or its bundle, whose lanes are drawn below.

        Returns:
            The chart, which shows itself in a notebook.

        Raises:
            ToolMissingError: matplotlib is not installed.
        """
        title = f"{counted(len(self.ids), 'road user')} at {self.time:g} s"
        described: Any = getattr(road_map, "road_map", road_map)
        return draw_traffic(title, self.positions, self.headings, self.sizes, self.speeds, described)

    def __repr__(self) -> str:
        """Tell when it is, and how many there are."""
        users, signals = counted(len(self.ids), "road user"), counted(len(self.signals), "signal")
        return f"Snapshot({self.time:g} s, {users}, {signals})"

    def _refuse(self, what: str, wrong: NDArray[np.bool_]) -> None:
        if wrong.any():
            k = int(np.flatnonzero(wrong.reshape(len(self.ids), -1).any(axis=1))[0])
            raise SnapshotError(
                f"snapshot at {self.time} s: road user {self.ids[k]!r} has no valid {what} "
                f"(position {self.positions[k]}, heading {self.headings[k]}, slope {self.slopes[k]}, "
                f"size {self.sizes[k]}, kind {self.kinds[k]}, number {self.numbers[k]})"
            )


_COLUMNS: tuple[tuple[str, tuple[int, ...], Any], ...] = (
    ("numbers", (), np.int32),
    ("kinds", (), np.uint8),
    ("positions", (3,), np.float64),
    ("headings", (), np.float64),
    ("slopes", (), np.float64),
    ("sizes", (3,), np.float64),
    ("colours", (3,), np.uint8),
    ("lights", (), np.uint8),
    ("speeds", (), np.float64),
)


def _read_only(values: Any, dtype: Any) -> NDArray[Any]:
    array = np.array(values, dtype=dtype)
    array.setflags(write=False)
    return array
