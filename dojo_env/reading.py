"""What is measured at a decision: figures of lanes and of all traffic, without a picture of each vehicle."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Figures = NDArray[np.float64]
HALTING = 0.1
"""m/s; SUMO's own limit below which a vehicle counts as stopped."""
MIN_GAP = 2.5
"""Metres between standing vehicles: SUMO's default, and what SUMO-RL divides by."""
RAW = 6
"""How many rows SUMO measures; the others follow from them."""
_VEHICLES, _HALTING, _MEAN_SPEED, _MEAN_LENGTH, _WAITING, _CO2 = range(RAW)
_RELATIVE, _PACE, _DENSITY, _QUEUE = range(RAW, RAW + 4)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class LaneReading:
    """Figures of the lanes that lead to a signal.

    One table and its sums, since this is made at every decision.

    Attributes:
        table: (10, lanes): vehicles, those slower than 0.1 m/s, mean speed in m/s (the limit where the
            lane is empty), mean length in metres (0 where it is empty), accumulated waiting in s, CO2 in
            mg/s, speed over limit, that times the vehicles, and the shares of the lane's room that vehicles
            and halting ones take, at most 1.
        totals: the rows' sums.
    """

    table: Figures
    totals: list[float]

    @property
    def vehicles(self) -> Figures:
        """How many are on each lane."""
        return self.table[_VEHICLES]

    @property
    def halting(self) -> Figures:
        """How many of them are slower than 0.1 m/s."""
        return self.table[_HALTING]

    @property
    def mean_speed(self) -> Figures:
        """In m/s; the speed limit where the lane is empty."""
        return self.table[_MEAN_SPEED]

    @property
    def accumulated_waiting(self) -> Figures:
        """The sum of SUMO's accumulated waiting times, seconds."""
        return self.table[_WAITING]

    @property
    def co2(self) -> Figures:
        """In mg/s."""
        return self.table[_CO2]

    @property
    def shares(self) -> Figures:
        """(2, lanes), 0 to 1: density and queue."""
        return self.table[_DENSITY:]

    @property
    def total_vehicles(self) -> float:
        """Vehicles on all of the lanes."""
        return self.totals[_VEHICLES]

    @property
    def total_halting(self) -> float:
        """Vehicles slower than 0.1 m/s on all of the lanes."""
        return self.totals[_HALTING]

    @property
    def total_waiting(self) -> float:
        """Accumulated waiting on all of the lanes, seconds."""
        return self.totals[_WAITING]

    @property
    def total_co2(self) -> float:
        """CO2 of all of the lanes, g/s."""
        return self.totals[_CO2] / 1000.0

    @property
    def average_speed(self) -> float:
        """The mean, over the vehicles, of speed over speed limit; 1 where there are none."""
        vehicles = self.totals[_VEHICLES]
        return self.totals[_PACE] / vehicles if vehicles else 1.0

    @property
    def delay(self) -> float:
        """The sum over the lanes of 1 - mean speed / speed limit; an empty lane counts 0."""
        return self.table.shape[1] - self.totals[_RELATIVE]


class LaneGroups:
    """The lanes of several signals, measured together and divided again."""

    def __init__(self, groups: Sequence[tuple[Sequence[str], Figures, Figures]]) -> None:
        """Take lanes, their speed limits in m/s and their lengths in metres, for each signal."""
        self.lanes: tuple[str, ...] = tuple(lane for lanes, _, _ in groups for lane in lanes)
        self._limits = np.concatenate([limits for _, limits, _ in groups])
        self._lengths = np.concatenate([lengths for _, _, lengths in groups])
        self._ends = np.cumsum([len(lanes) for lanes, _, _ in groups])
        self._starts = np.concatenate([[0], self._ends[:-1]])
        self._slices = [slice(a, b) for a, b in zip(self._starts.tolist(), self._ends.tolist(), strict=True)]

    def divide(self, raw: Figures) -> list[LaneReading]:
        """Give each signal its figures, from (6, all lanes) that SUMO has measured."""
        table = np.empty((RAW + 4, len(self.lanes)))
        table[:RAW] = raw
        np.divide(raw[_MEAN_SPEED], self._limits, out=table[_RELATIVE])
        np.multiply(table[_RELATIVE], raw[_VEHICLES], out=table[_PACE])
        room = (MIN_GAP + raw[_MEAN_LENGTH]) / self._lengths
        np.minimum(raw[: _HALTING + 1] * room, 1.0, out=table[_DENSITY:])
        totals = np.add.reduceat(table, self._starts, axis=1).T.tolist()
        return [
            LaneReading(table=table[:, part], totals=sums)
            for part, sums in zip(self._slices, totals, strict=True)
        ]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class TrafficReading:
    """Figures of the whole network.

    Attributes:
        running: vehicles on the road.
        backlogged: vehicles whose time has come and who find no place.
        stopped: vehicles slower than 0.1 m/s.
        waiting_time: the sum over vehicles of the seconds since they last moved.
        mean_speed: m/s, of all vehicles; 0 where there is none.
        arrived: since the episode's begin.
        departed: since the episode's begin.
        teleported: since the episode's begin.
        pedestrians: people on foot.
        pedestrian_waiting: the sum over people of the seconds that they have stood.
    """

    running: int
    backlogged: int
    stopped: int
    waiting_time: float
    mean_speed: float
    arrived: int
    departed: int
    teleported: int
    pedestrians: int
    pedestrian_waiting: float


@dataclass(slots=True, kw_only=True)
class Trip:
    """A vehicle's journey; times are simulated seconds; the simulation adds `arrival` when it comes."""

    mode: str
    route: tuple[str, ...]
    depart: float
    depart_delay: float
    arrival: float | None = None
