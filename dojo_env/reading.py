"""What is measured at a decision: figures of lanes and of all traffic, without a picture of each vehicle."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Figures = NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class LaneReading:
    """Figures of the lanes that lead to a signal; each array has one value per lane.

    Attributes:
        vehicles: how many are on the lane.
        halting: how many of them are slower than 0.1 m/s.
        mean_speed: m/s; the speed limit where the lane is empty.
        mean_length: metres; 0 where the lane is empty.
        accumulated_waiting: the sum of SUMO's accumulated waiting times, seconds.
        co2: mg/s.
        relative_speed: the mean, over vehicles, of speed over allowed speed; 1 where there are none.
    """

    vehicles: Figures
    halting: Figures
    mean_speed: Figures
    mean_length: Figures
    accumulated_waiting: Figures
    co2: Figures
    relative_speed: float


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
