"""What is measured at a decision: figures of lanes and of all traffic, without a picture of each vehicle."""

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

Figures = NDArray[np.float64]
COLUMNS = ("vehicles", "halting", "mean_speed", "mean_length", "accumulated_waiting", "co2")
_VEHICLES, _HALTING, _MEAN_SPEED, _MEAN_LENGTH, _WAITING, _CO2 = range(len(COLUMNS))


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class LaneReading:
    """Figures of the lanes that lead to a signal; each array has one value per lane.

    One table and its sums, since this is made at every decision.

    Attributes:
        table: (6, lanes), the rows in the order of `COLUMNS`.
        totals: the rows' sums.
    """

    table: Figures
    totals: list[float] = field(init=False)

    def __post_init__(self) -> None:
        """Sum the rows once."""
        object.__setattr__(self, "totals", self.table.sum(axis=1).tolist())

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
    def mean_length(self) -> Figures:
        """In metres; 0 where the lane is empty."""
        return self.table[_MEAN_LENGTH]

    @property
    def accumulated_waiting(self) -> Figures:
        """The sum of SUMO's accumulated waiting times, seconds."""
        return self.table[_WAITING]

    @property
    def co2(self) -> Figures:
        """In mg/s."""
        return self.table[_CO2]

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
