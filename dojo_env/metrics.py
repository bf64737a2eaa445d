"""The figures of an episode, defined once. Means are over the decisions of the episode.

Figures of lanes are summed over the lanes that lead to the signals that agents control.
"""

from collections import defaultdict
from collections.abc import Mapping
from typing import Any

import numpy as np

from dojo_env.instant import Instant
from dojo_env.reading import Figures, Trip
from dojo_env.signals.plan import SignalPlan

SIX = ("travel_time", "throughput", "delay", "accumulated_waiting", "queue", "co2")
"""The six figures of the paper's table."""
_LATE = 600.0
"""Seconds after which who has not arrived is late."""


class Metrics:
    """Adds up an episode's figures."""

    def __init__(self, plans: Mapping[str, SignalPlan], *, begin: float) -> None:
        """Begin an episode."""
        self._plans, self._begin = plans, begin
        self._time = begin
        self._decisions = 0
        self._sums = dict.fromkeys(("delay", "accumulated_waiting", "queue", "co2"), 0.0)
        self._mean_trips: list[float] = []
        self._pedestrians = [0.0, 0.0]

    def note(self, instant: Instant, *, arrived: int, travelled: float) -> None:
        """Take in a decision: `arrived` vehicles so far have been on their way for `travelled` seconds.

        Args:
            instant: the decision.
            arrived: vehicles since the episode's begin.
            travelled: seconds, of all those together.
        """
        self._time = instant.time
        self._decisions += 1
        sums = self._sums
        for view in instant.signals.values():
            sums["delay"] += view.lanes.delay
            sums["accumulated_waiting"] += view.lanes.total_waiting
            sums["queue"] += view.lanes.total_halting
            sums["co2"] += view.lanes.total_co2
        if arrived:
            self._mean_trips.append(travelled / arrived)
        self._pedestrians[0] += instant.traffic.pedestrians
        self._pedestrians[1] += instant.traffic.pedestrian_waiting

    def compute(
        self, trips: Mapping[str, Trip], pending_delays: Figures, losses: tuple[float, int]
    ) -> dict[str, Any]:
        """Compute all figures up to now; times in seconds.

        `travel_time` is the mean over decisions of the mean trip duration of all vehicles arrived so far, as
        the paper has it. It leaves out who has not arrived, so a jam makes it better: `missing` is their
        share, and `travel_time_all` the mean over all vehicles whose time to depart has come, with the wait
        for a place to depart and up to now. `depart_delay` is that wait alone, `time_loss` what driving
        slower than one may has cost those on the road, as SUMO and RESCO have both. `late` is the share of
        vehicles that have not arrived ten minutes after their time to depart. `mean_trip_duration` is
        the plain mean over arrived vehicles; `mean_trip_duration_all` another name of `travel_time_all`.

        Args:
            trips: every vehicle that has departed.
            pending_delays: (n,) how long those wait that have not.
            losses: the sum of SUMO's time losses, and of how many vehicles.

        Returns:
            Figures by name; those of modes and movements are grouped by them.
        """
        decisions = max(self._decisions, 1)
        durations = [t.arrival - t.depart for t in trips.values() if t.arrival is not None]
        every = [(t.arrival or self._time) - t.depart + t.depart_delay for t in trips.values()]
        travel_time_all = _mean([*every, *pending_delays.tolist()])
        wanted = len(trips) + len(pending_delays)
        hours = (self._time - self._begin) / 3600.0
        return {
            "travel_time": _mean(self._mean_trips),
            "throughput": len(durations) / hours if hours else 0.0,
            **{name: value / decisions for name, value in self._sums.items()},
            "mean_trip_duration": _mean(durations),
            "mean_trip_duration_all": travel_time_all,
            "travel_time_all": travel_time_all,
            "time_loss": losses[0] / losses[1] if losses[1] else 0.0,
            "depart_delay": _mean([*(t.depart_delay for t in trips.values()), *pending_delays.tolist()]),
            "missing": 1.0 - len(durations) / wanted if wanted else 0.0,
            "late": self._count_late(trips, pending_delays) / wanted if wanted else 0.0,
            "arrived": len(durations),
            "departed": len(trips),
            "backlogged": len(pending_delays),
            "pedestrians": self._pedestrians[0] / decisions,
            "pedestrian_waiting": self._pedestrians[1] / decisions,
            "modes": _group(trips, lambda trip: [trip.mode]),
            "movements": self._movements(trips),
        }

    def _count_late(self, trips: Mapping[str, Trip], pending_delays: Figures) -> int:
        under_way = (t for t in trips.values() if t.arrival is None)
        late = sum(self._time - t.depart + t.depart_delay > _LATE for t in under_way)
        return late + int((pending_delays > _LATE).sum())

    def _movements(self, trips: Mapping[str, Trip]) -> dict[str, dict[str, dict[str, float]]]:
        """Group trips by the movements of each signal that they take."""
        found = {}
        for signal, plan in self._plans.items():
            ways = {(_road(source), _road(target)) for _, source, target in plan.links}

            def taken(trip: Trip, ways: set[tuple[str, str]] = ways) -> list[str]:
                steps = zip(trip.route, trip.route[1:], strict=False)
                return [f"{a}->{b}" for a, b in steps if (a, b) in ways]

            found[signal] = _group(trips, taken)
        return found


def _group(trips: Mapping[str, Trip], key: Any) -> dict[str, dict[str, float]]:
    groups: dict[str, list[Trip]] = defaultdict(list)
    for trip in trips.values():
        for name in key(trip):
            groups[name].append(trip)
    return {
        name: {
            "departed": len(members),
            "arrived": sum(t.arrival is not None for t in members),
            "mean_trip_duration": _mean([t.arrival - t.depart for t in members if t.arrival is not None]),
            "mean_waiting": _mean([t.waiting for t in members]),
        }
        for name, members in sorted(groups.items())
    }


def _road(lane: str) -> str:
    return lane.rpartition("_")[0]


def _mean(values: list[float]) -> float:
    return float(np.mean(values)) if values else 0.0
