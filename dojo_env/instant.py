"""What was measured at one decision, as values: all that observations, rewards, metrics and controllers see.

What costs more than a glance is measured when it is first asked for, and kept. Once SUMO has moved on it can
no longer be measured, and asking for it is an error, never an answer about another time.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any, Self

import numpy as np

from dojo_env.errors import StaleInstantError
from dojo_env.reading import HALTING, Approach, Figures, LaneReading, TrafficReading
from dojo_env.signals.plan import REACH, SignalPlan
from dojo_env.simulation import Simulation
from dojo_env.snapshot import Snapshot
from dojo_maps.short_repr import short_repr
from dojo_maps.wording import counted


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class SignalView:
    """A signal at a decision.

    Attributes:
        plan: what there is to control.
        phase: the phase that is green or on its way.
        state: the letters shown.
        green_time: seconds that `phase` has been green.
        may_change: a change would be granted.
        lanes: figures of `plan.lanes`.
    """

    plan: SignalPlan
    phase: int
    state: str
    green_time: float
    may_change: bool
    lanes: LaneReading

    __repr__ = short_repr


class Instant:
    """The traffic and the signals at one decision. It can be kept, compared and pickled.

    Attributes:
        time: simulated seconds.
        traffic: figures of the whole network.
        signals: each signal that agents control, by id.
        tells_places: where on its lane each vehicle is has been measured just now, and is not guessed.
    """

    __slots__ = (
        "_approaches",
        "_crossings",
        "_lanes",
        "_moment",
        "_simulation",
        "_snapshot",
        "signals",
        "tells_places",
        "time",
        "traffic",
    )

    def __init__(
        self,
        simulation: Simulation,
        traffic: TrafficReading,
        signals: Mapping[str, SignalView],
        lanes: Mapping[str, tuple[str, ...]],
    ) -> None:
        """Take what has been measured, and what measures the rest.

        Args:
            simulation: stands at this decision.
            traffic: figures of the whole network.
            signals: each signal that agents control, by id.
            lanes: ids of the vehicles on the lanes that have been looked at.
        """
        self.time: float = simulation.time
        self.tells_places = True
        self.traffic = traffic
        self.signals: Mapping[str, SignalView] = MappingProxyType(dict(signals))
        self._simulation: Simulation | None = simulation
        self._moment = simulation.moment
        self._snapshot: Snapshot | None = None
        self._lanes = dict(lanes)
        self._approaches: dict[str, Approach] = {}
        self._crossings: frozenset[str] | None = None

    @classmethod
    def of_views(cls, time: float, signals: Mapping[str, SignalView]) -> Self:
        """Make an instant that no simulation has measured, and of which nothing more can be asked.

        Args:
            time: seconds.
            signals: each signal that is controlled, by id.

        Returns:
            The instant.
        """
        count, halting = (
            sum(int(getattr(view.lanes, name)) for view in signals.values())
            for name in ("total_vehicles", "total_halting")
        )
        instant = cls.__new__(cls)
        instant.time, instant.signals = time, MappingProxyType(dict(signals))
        instant.traffic = TrafficReading(
            running=count, backlogged=0, stopped=halting, waiting_time=0.0, mean_speed=0.0, arrived=0,
            departed=0, teleported=0, pedestrians=0, pedestrian_waiting=0.0,
        )  # fmt: skip
        instant.tells_places = True
        instant._simulation, instant._moment, instant._snapshot = None, 0, None
        instant._lanes, instant._approaches = {}, {}
        instant._crossings = frozenset()
        return instant

    @property
    def snapshot(self) -> Snapshot:
        """Everyone on the road.

        Raises:
            StaleInstantError: it was not asked for before SUMO moved on.
        """
        if self._snapshot is None:
            self._snapshot = self._present("snapshot").read_snapshot()
        return self._snapshot

    def list_vehicles(self, lane: str) -> tuple[str, ...]:
        """List the vehicles on a lane by their ids.

        Args:
            lane: any lane of the network.

        Returns:
            Their ids.

        Raises:
            StaleInstantError: the lane was not asked for before SUMO moved on.
        """
        if lane not in self._lanes:
            self._lanes[lane] = self._present(f"vehicles of lane {lane!r}").list_vehicles(lane)
        return self._lanes[lane]

    def count_vehicles(self, lanes: Iterable[str]) -> Figures:
        """Count the vehicles on each lane.

        Args:
            lanes: any lanes of the network, n of them.

        Returns:
            (n,) vehicles, in the lanes' order.

        Raises:
            StaleInstantError: a lane was not asked for before SUMO moved on.
        """
        return np.array([len(self.list_vehicles(lane)) for lane in lanes], dtype=np.float64)

    def approach(self, signal: str) -> Approach:
        """Tell who is on the way to a signal, by the links that they will take.

        Args:
            signal: one of those that agents control.

        Returns:
            Who is there.

        Raises:
            StaleInstantError: it was not asked for before SUMO moved on.
        """
        if signal not in self._approaches:
            simulation = self._present(f"approach to signal {signal!r}")
            self._approaches[signal] = _read_approach(simulation, self.signals[signal].plan)
        return self._approaches[signal]

    def list_wanted_walks(self, signal: str) -> tuple[int, ...]:
        """List the links at which somebody on foot stands and waits.

        Args:
            signal: one of those that agents control.

        Returns:
            The indices of the links.

        Raises:
            StaleInstantError: it was not asked for before SUMO moved on.
        """
        walks = self.signals[signal].plan.walks
        if not walks:
            return ()
        if self._crossings is None:
            self._crossings = frozenset(self._present("waiting walkers").list_wanted_crossings())
        return tuple(link for link, crossing in walks if crossing in self._crossings)

    def measure_all(self) -> "Instant":
        """Measure at once all that can be asked for.

        Returns:
            Itself.

        Raises:
            StaleInstantError: SUMO has moved on, and something is missing.
        """
        if self._simulation is not None:
            self.count_vehicles(self._simulation.lane_ids)
            self._snapshot = self.snapshot
            for signal in self.signals:
                self.approach(signal)
                self.list_wanted_walks(signal)
            self._simulation = None
        return self

    def _present(self, what: str) -> Simulation:
        simulation = self._simulation
        if simulation is None or simulation.moment != self._moment:
            raise StaleInstantError(
                f"the {what} at {self.time:g} s can no longer be measured, for SUMO has moved on; "
                "ask for it at its decision, or call measure_all() then"
            )
        return simulation

    def __repr__(self) -> str:
        """Tell when it is, and of how many vehicles and signals."""
        vehicles, signals = counted(self.traffic.running, "vehicle"), counted(len(self.signals), "signal")
        return f"Instant({self.time:g} s, {vehicles}, {signals})"

    def __getstate__(self) -> dict[str, Any]:
        """Measure the rest: another process has no simulation to ask."""
        self.measure_all()
        state = {name: getattr(self, name) for name in Instant.__slots__}
        return {**state, "signals": dict(self.signals)}

    def __setstate__(self, state: dict[str, Any]) -> None:
        """Take all that was measured."""
        for name, value in state.items():
            setattr(self, name, value)
        self.signals = MappingProxyType(self.signals)


def _read_approach(simulation: Simulation, plan: SignalPlan) -> Approach:
    coming = simulation.list_approaching(plan.signal, (*plan.lanes, *plan.upstream))
    return build_approach(
        plan,
        [vehicle[:3] for vehicle in coming],
        simulation.count_halting(plan.out_lanes),
        [link for link, metres, _, is_urgent in coming if metres <= REACH and is_urgent],
    )


def build_approach(
    plan: SignalPlan,
    coming: Sequence[tuple[int, float, float]],
    beyond: Iterable[float],
    urgent: Iterable[int] = (),
) -> Approach:
    """Put together who is on the way to a signal.

    Args:
        plan: of the signal.
        coming: the link, metres to the stop line and m/s of each vehicle.
        beyond: vehicles that stand on each of `plan.out_lanes`.
        urgent: the links to which somebody comes with blue lights on.

    Returns:
        Who is on the way.
    """
    standing = dict(zip(plan.out_lanes, beyond, strict=True))
    full = {lane for lane, room in zip(plan.out_lanes, plan.room, strict=True) if standing[lane] >= room}
    near = [(link, speed < HALTING) for link, metres, speed in coming if metres <= REACH]
    return Approach(
        links=tuple(link for link, _ in near),
        halting=tuple(halting for _, halting in near),
        coming=tuple(coming),
        blocked=frozenset(link for link, lanes in plan.exits.items() if full.issuperset(lanes)),
        beyond={
            link: sum(standing[lane] for lane in lanes) / len(lanes) for link, lanes in plan.exits.items()
        },
        urgent=frozenset(urgent),
    )
