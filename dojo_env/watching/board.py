"""The figures beside the views: of a decision, or counted second by second from snapshots."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from dojo_env.instant import Instant
from dojo_env.reading import HALTING
from dojo_env.signals.plan import SignalPlan
from dojo_env.snapshot import Kind, Snapshot

Bools = NDArray[np.bool_]


@dataclass(frozen=True, slots=True, kw_only=True)
class Lamp:
    """What a signal shows.

    Attributes:
        signal: its id.
        phase: the green phase, from 0; None in between.
        phases: how many there are.
        state: the letters shown.
        green_time: seconds that the phase has been green.
        queue: vehicles slower than 0.1 m/s on the lanes that lead to it.
    """

    signal: str
    phase: int | None
    phases: int
    state: str
    green_time: float
    queue: int


@dataclass(frozen=True, slots=True, kw_only=True)
class Board:
    """The figures of an instant.

    Attributes:
        time: simulated seconds.
        queue: vehicles slower than 0.1 m/s on the lanes that lead to the signals.
        waiting: the seconds that the vehicles on these lanes have stood so far, together.
        vehicles: on the road.
        arrived: since the episode's begin.
        speed: m/s, the mean of all vehicles.
        lamps: of each signal.
    """

    time: float
    queue: int
    waiting: float
    vehicles: int
    arrived: int
    speed: float
    lamps: tuple[Lamp, ...]


def read_board(instant: Instant) -> Board:
    """Take the figures of a decision.

    Args:
        instant: the decision.

    Returns:
        Its figures, with a lamp for each signal that agents control.
    """
    views, traffic = instant.signals, instant.traffic
    return Board(
        time=instant.time,
        queue=int(sum(view.lanes.total_halting for view in views.values())),
        waiting=sum(view.lanes.total_waiting for view in views.values()),
        vehicles=traffic.running,
        arrived=traffic.arrived,
        speed=traffic.mean_speed,
        lamps=tuple(
            Lamp(
                signal=signal,
                phase=_find_phase(view.plan, view.state),
                phases=len(view.plan.phases),
                state=view.state,
                green_time=view.green_time,
                queue=int(view.lanes.total_halting),
            )
            for signal, view in views.items()
        ),
    )


class Scoreboard:
    """Counts the figures of an episode from its snapshots; each has to be a second after the one before."""

    def __init__(self, plans: Mapping[str, SignalPlan]) -> None:
        """Take the signals to count for; the first snapshot begins the episode."""
        self._plans = plans
        self._time = -np.inf
        self._stood: dict[str, float] = {}
        self._green: dict[str, tuple[str, float]] = {}

    def note(self, snapshot: Snapshot) -> Board:
        """Take in the next second; one that does not lie after the last begins another episode.

        Args:
            snapshot: everyone on the road, and what the signals show, a second after the last one.

        Returns:
            The figures of this second.
        """
        if snapshot.time <= self._time:
            self._stood, self._green = {}, {}
        self._time = snapshot.time
        vehicle = snapshot.kinds != Kind.PEDESTRIAN
        halting = vehicle & (snapshot.speeds < HALTING)
        self._add_second(snapshot, vehicle, halting)
        lanes = np.array(snapshot.lanes or (), dtype=np.str_)
        near = {name: vehicle & np.isin(lanes, plan.lanes) for name, plan in self._plans.items()}
        watched = np.flatnonzero(sum(near.values(), np.zeros(len(lanes), bool)))
        count = int(vehicle.sum())
        return Board(
            time=snapshot.time,
            queue=int(halting[watched].sum()),
            waiting=sum(self._stood[snapshot.ids[row]] for row in watched.tolist()),
            vehicles=count,
            arrived=len(self._stood) - count,
            speed=float(snapshot.speeds[vehicle].mean()) if count else 0.0,
            lamps=tuple(
                self._lamp(plan, snapshot, int((near[name] & halting).sum()))
                for name, plan in self._plans.items()
            ),
        )

    def _add_second(self, snapshot: Snapshot, vehicle: Bools, halting: Bools) -> None:
        for name, is_vehicle, stands in zip(snapshot.ids, vehicle.tolist(), halting.tolist(), strict=True):
            if is_vehicle:
                self._stood[name] = self._stood.get(name, 0.0) + stands

    def _lamp(self, plan: SignalPlan, snapshot: Snapshot, queue: int) -> Lamp:
        state = snapshot.signals.get(plan.signal, "")
        shown, since = self._green.get(plan.signal, ("", 0.0))
        if shown != state:
            since = snapshot.time
            self._green[plan.signal] = (state, since)
        phase = _find_phase(plan, state)
        return Lamp(
            signal=plan.signal,
            phase=phase,
            phases=len(plan.phases),
            state=state,
            green_time=snapshot.time - since if phase is not None else 0.0,
            queue=queue,
        )


def _find_phase(plan: SignalPlan, state: str) -> int | None:
    return plan.phases.index(state) if state in plan.phases else None
