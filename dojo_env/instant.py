"""What is known at a decision: all that observations, rewards, metrics and controllers see."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

from dojo_env.reading import Figures, LaneReading, TrafficReading
from dojo_env.signals.plan import SignalPlan
from dojo_env.simulation import Simulation
from dojo_env.snapshot import Snapshot


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


class Instant:
    """The traffic and the signals at one decision.

    What costs more than a glance, such as the snapshot, is fetched when it is asked for, and only until
    the next decision.
    """

    __slots__ = ("_simulation", "_snapshot", "signals", "time", "traffic")

    def __init__(
        self, simulation: Simulation, traffic: TrafficReading, signals: Mapping[str, SignalView]
    ) -> None:
        """Freeze what has been read."""
        self.time: float = simulation.time
        self.traffic = traffic
        self.signals = signals
        self._simulation = simulation
        self._snapshot: Snapshot | None = None

    @property
    def snapshot(self) -> Snapshot:
        """Everyone on the road."""
        if self._snapshot is None:
            self._snapshot = self._simulation.read_snapshot()
        return self._snapshot

    def count_vehicles(self, lanes: Iterable[str]) -> Figures:
        """Count the vehicles on each lane."""
        return self._simulation.count_vehicles(lanes)

    def list_vehicles(self, lane: str) -> tuple[str, ...]:
        """List the vehicles on a lane by their ids."""
        return self._simulation.list_vehicles(lane)
