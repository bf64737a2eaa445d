"""What is measured at a decision: figures of lanes and of all traffic, without a picture of each vehicle."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import fsum
from operator import mul, truediv

import numpy as np
from numpy.typing import NDArray

from dojo_maps.short_repr import short_repr

Figures = NDArray[np.float64]
HALTING = 0.1
"""m/s; SUMO's own limit below which a vehicle counts as stopped."""
MIN_GAP = 2.5
"""Metres between standing vehicles: SUMO's default, and what SUMO-RL divides by."""
_VEHICLES, _HALTING, _MEAN_SPEED, _MEAN_LENGTH, _WAITING, _CO2 = range(6)
"""Rows that SUMO measures; the others follow from them."""
_RELATIVE, _PACE, _DENSITY, _QUEUE = range(6, 10)


@dataclass(frozen=True, slots=True, kw_only=True)
class LaneReading:
    """Figures of the lanes that lead to a signal.

    Plain lists, since this is made at every decision: right after SUMO's steps each call of NumPy costs as
    much as a loop over a signal's few lanes.

    Attributes:
        rows: a value per lane each: vehicles, those slower than 0.1 m/s, mean speed in m/s (the limit where
            the lane is empty), mean length in metres (0 where it is empty), accumulated waiting in s, CO2 in
            mg/s, speed over limit, that times the vehicles, and the shares of the lane's room that vehicles
            and halting ones take, at most 1.
        totals: the rows' sums.
    """

    rows: list[list[float]]
    totals: list[float]

    __repr__ = short_repr

    @property
    def vehicles(self) -> Figures:
        """How many are on each lane."""
        return np.array(self.rows[_VEHICLES])

    @property
    def halting(self) -> Figures:
        """How many of them are slower than 0.1 m/s."""
        return np.array(self.rows[_HALTING])

    @property
    def halting_row(self) -> list[float]:
        """The same as a plain list."""
        return self.rows[_HALTING]

    @property
    def mean_speed(self) -> Figures:
        """In m/s; the speed limit where the lane is empty."""
        return np.array(self.rows[_MEAN_SPEED])

    @property
    def mean_length(self) -> Figures:
        """In metres, of the vehicles; 0 where the lane is empty."""
        return np.array(self.rows[_MEAN_LENGTH])

    @property
    def accumulated_waiting(self) -> Figures:
        """The sum of SUMO's accumulated waiting times, seconds."""
        return np.array(self.rows[_WAITING])

    @property
    def co2(self) -> Figures:
        """In mg/s."""
        return np.array(self.rows[_CO2])

    @property
    def shares(self) -> list[float]:
        """0 to 1: the density of each lane, then the queue of each."""
        return self.rows[_DENSITY] + self.rows[_QUEUE]

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
        return len(self.rows[_RELATIVE]) - self.totals[_RELATIVE]


class LaneGroups:
    """The lanes of several signals, measured together and divided again."""

    def __init__(self, groups: Sequence[tuple[Sequence[str], Figures, Figures]]) -> None:
        """Take lanes, their speed limits in m/s and their lengths in metres, for each signal."""
        self.lanes: tuple[str, ...] = tuple(lane for lanes, _, _ in groups for lane in lanes)
        self._groups: list[tuple[slice, list[float], list[float]]] = []
        end = 0
        for lanes, limits, lengths in groups:
            start, end = end, end + len(lanes)
            self._groups.append((slice(start, end), limits.tolist(), lengths.tolist()))

    def divide(self, raw: Sequence[Sequence[float]]) -> list[LaneReading]:
        """Give each signal its figures, from the six rows that SUMO has measured of all lanes.

        Args:
            raw: six rows with a value for each of `lanes`.

        Returns:
            A reading per signal, in the order of the groups.
        """
        return [
            _read_lanes([list(row[part]) for row in raw], limits, lengths)
            for part, limits, lengths in self._groups
        ]


def _read_lanes(rows: list[list[float]], limits: list[float], lengths: list[float]) -> LaneReading:
    vehicles = rows[_VEHICLES]
    relative = list(map(truediv, rows[_MEAN_SPEED], limits))
    room = [(MIN_GAP + mean) / length for mean, length in zip(rows[_MEAN_LENGTH], lengths, strict=True)]
    rows += [relative, list(map(mul, relative, vehicles))]
    rows += [[min(share, 1.0) for share in map(mul, row, room)] for row in (vehicles, rows[_HALTING])]
    return LaneReading(rows=rows, totals=list(map(fsum, rows)))


@dataclass(frozen=True, slots=True, kw_only=True)
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

    @property
    def figures(self) -> dict[str, float]:
        """The figures of vehicles by the names that SUMO-RL gives them."""
        return {
            "system_total_running": self.running,
            "system_total_backlogged": self.backlogged,
            "system_total_stopped": self.stopped,
            "system_total_arrived": self.arrived,
            "system_total_departed": self.departed,
            "system_total_teleported": self.teleported,
            "system_total_waiting_time": self.waiting_time,
            "system_mean_waiting_time": self.waiting_time / self.running if self.running else 0.0,
            "system_mean_speed": self.mean_speed,
        }


@dataclass(frozen=True, slots=True, kw_only=True)
class Approach:
    """Who is on the way to a signal, and where there is no room to go to.

    Attributes:
        links: the link that each vehicle within 150 m will take, by its place in the state.
        halting: whether it is slower than 0.1 m/s.
        coming: the link, metres to the stop line and m/s of each vehicle, of those farther away, too.
        blocked: the links behind which every lane is full of standing vehicles.
        beyond: standing vehicles on the lanes behind each link, as many as one of these has in the mean.
        urgent: the links to which somebody comes with blue lights on; of a lane that serves several, where it
            is not known which of them he takes, all.
    """

    links: tuple[int, ...]
    halting: tuple[bool, ...]
    coming: tuple[tuple[int, float, float], ...]
    blocked: frozenset[int]
    beyond: Mapping[int, float]
    urgent: frozenset[int] = frozenset()


@dataclass(slots=True, kw_only=True)
class Trip:
    """A vehicle's journey; times are simulated seconds.

    The simulation adds `arrival` when it comes, and at each decision how long the vehicle has stood so far.
    """

    mode: str
    route: tuple[str, ...]
    depart: float
    depart_delay: float
    arrival: float | None = None
    waiting: float = 0.0
