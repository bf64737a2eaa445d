"""What a controller would do, from what is measured of lanes; no signal is touched.

The controller switches a signal of its own that nobody sees, under the constraints of every agent: minimum
green, yellow, walkers' clearance, longest red. Its minutes pass as the film's do.
"""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, fields
from functools import partial
from math import floor

import numpy as np

from dojo_env.config import SignalConfig
from dojo_env.controllers import CONTROLLERS, Controller, make_controller
from dojo_env.detectors.measuring import LaneMeasurements
from dojo_env.errors import ConfigError
from dojo_env.instant import Instant, SignalView
from dojo_env.managers.map import MapManager
from dojo_env.perceived import PerceivedInstant, read_lanes
from dojo_env.signals.longest_red import LongestRed
from dojo_env.signals.plan import SignalPlan
from dojo_env.signals.switching import SignalSwitch
from dojo_env.turn_guesses import TurnGuesses
from dojo_maps.bundle import Bundle
from dojo_maps.signals.programs import green_links
from dojo_maps.wording import counted

INTERVAL = 5.0
"""Seconds from decision to decision."""
_OF_SUMO = ("actuated", "delay-based")
_BY_PROGRAM = ("fixed-time", "pretimed")
POLICIES = tuple(name for name in CONTROLLERS if name not in _OF_SUMO)
"""The controllers that can be asked."""


@dataclass(frozen=True, slots=True, kw_only=True)
class PhaseDemand:
    """Who waits for a phase: vehicles on lanes that it serves, and how many of them stand."""

    phase: int
    vehicles: int
    halting: int


@dataclass(frozen=True, slots=True, kw_only=True)
class Advice:
    """What a controller would do at a signal.

    Attributes:
        signal: its id.
        phase: the phase that the controller's own signal shows, or is on its way to.
        state: the letters that it shows.
        green_time: seconds that `phase` has been green.
        choice: the phase that the controller asked for at its last decision.
        is_overruled: another one had to come, because somebody had waited for the longest red.
        demand: of each phase.
    """

    signal: str
    phase: int
    state: str
    green_time: float
    choice: int
    is_overruled: bool
    demand: tuple[PhaseDemand, ...]

    def describe(self) -> str:
        """Say it in a line."""
        wanted, shown = self.demand[self.choice], self.demand[self.phase]
        if self.is_overruled:
            return f"phase {self.phase}: somebody has waited for the longest red"
        words = f"{counted(wanted.vehicles, 'vehicle')}, {wanted.halting} standing"
        if self.choice == self.phase:
            return f"phase {self.phase} stays: {words}"
        return (
            f"phase {self.choice} next: {words}, phase {self.phase} has {shown.vehicles} and {shown.halting}"
        )


class Advisor:
    """A controller, and for each signal a switch that nobody sees.

    Attributes:
        plans: of the signals, by id.
    """

    def __init__(
        self, bundle: Bundle, policy: str, lanes: Collection[str], signals: Sequence[str] | None = None
    ) -> None:
        """Take a map and who advises.

        Args:
            bundle: the map.
            policy: one of `POLICIES`.
            lanes: those that are measured; signals to which none of them leads get no advice.
            signals: ids of those to advise on; None takes all of the map.

        Raises:
            ConfigError: the controller is unknown, or one of SUMO's own; the map has no such signal; or none
                of the lanes leads to one.
        """
        if policy in _OF_SUMO:
            raise ConfigError(
                f"policy {policy!r} is SUMO's own, which a film does not run; take {', '.join(POLICIES)}"
            )
        self._controller: Controller = make_controller(policy)
        known = {each.name for each in fields(SignalConfig)} - {"fixed_ts", "program", "timing"}
        settings = {name: value for name, value in self._controller.settings.items() if name in known}
        self._config = SignalConfig(ts_ids=tuple(signals) if signals is not None else None, **settings)
        self.plans: Mapping[str, SignalPlan] = {
            signal: plan
            for signal, plan in MapManager(bundle, self._config).plans.items()
            if not set(plan.lanes).isdisjoint(lanes)
        }
        if not self.plans:
            raise ConfigError(
                f"policy {policy!r}: none of the lanes measured, such as {next(iter(lanes))!r}, "
                f"leads to a signal of {bundle.road_map.name}; name regions by the map's lanes"
            )
        self._follows_program = policy in _BY_PROGRAM
        self._lanes = tuple(
            dict.fromkeys(lane for plan in self.plans.values() for lane in (*plan.lanes, *plan.out_lanes))
        )
        self.reset()

    def reset(self) -> None:
        """Begin anew: the first phase is green everywhere."""
        self._controller.reset(0)
        self._turns = TurnGuesses()
        self._switches = {s: SignalSwitch(plan, self._config) for s, plan in self.plans.items()}
        self._reds = {
            s: LongestRed(plan, self._config, interval=INTERVAL, time=0.0) for s, plan in self.plans.items()
        }
        self._decided: dict[str, tuple[int, bool]] = dict.fromkeys(self.plans, (0, False))
        self._due: float | None = None

    def advise(self, measured: LaneMeasurements) -> tuple[Advice, ...]:
        """Let the film's time pass at the controller's signals, and let it decide where a decision is due.

        Args:
            measured: of lanes, later than the last ones; others are taken to be empty.

        Returns:
            One for each signal of `plans`, in their order, whether a decision was due or not.
        """
        time, measured = measured.time, _complete(measured, self._lanes)
        for switch in self._switches.values():
            while switch.clock + 1.0 <= floor(time + 1e-6):
                switch.advance()
        for signal, switch in self._switches.items():
            self._reds[signal].look(time, switch.state)
        if self._due is None or time >= self._due - 1e-6:
            self._due = max((self._due or time) + INTERVAL, time)
            self._decide(time, measured)
        return tuple(
            Advice(
                signal=signal,
                phase=self._switches[signal].phase,
                state=self._switches[signal].state,
                green_time=self._switches[signal].green_time,
                choice=self._decided[signal][0],
                is_overruled=self._decided[signal][1],
                demand=_count_demand(plan, measured),
            )
            for signal, plan in self.plans.items()
        )

    def _decide(self, time: float, measured: LaneMeasurements) -> None:
        instant = self._perceive(time, measured)
        for signal, plan in self.plans.items():
            switch, view = self._switches[signal], instant.signals[signal]
            self._reds[signal].decide(time, view.lanes.halting_row, partial(_list_waiting, plan, measured))
            if self._follows_program and plan.greens:
                choice = _find_green(plan, time)
            else:
                choice = int(self._controller.choose(signal, instant))
            due = self._reds[signal].find_due(
                time, switch.phase, may_change=switch.may_change, is_asked=choice != switch.phase
            )
            switch.request_phase(choice if due is None else due)
            self._decided[signal] = (choice, due is not None)

    def _perceive(self, time: float, measured: LaneMeasurements) -> Instant:
        """Give the controller what it gets of an environment whose cameras count."""
        views = {
            signal: SignalView(
                plan=plan,
                phase=self._switches[signal].phase,
                state=self._switches[signal].state,
                green_time=self._switches[signal].green_time,
                may_change=self._switches[signal].may_change,
                lanes=read_lanes(measured, plan),
            )
            for signal, plan in self.plans.items()
        }
        instant, seen = Instant.of_views(time, views), dict.fromkeys(self.plans, measured)
        return PerceivedInstant(instant, seen, self._turns.note(instant, seen))


def _complete(measured: LaneMeasurements, lanes: Sequence[str]) -> LaneMeasurements:
    """Add lanes that were not measured, as empty ones."""
    missing = tuple(lane for lane in lanes if lane not in measured.lanes)
    none = np.zeros(len(missing))
    return LaneMeasurements(
        time=measured.time,
        lanes=(*measured.lanes, *missing),
        vehicles=np.append(measured.vehicles, none),
        halting=np.append(measured.halting, none),
        mean_speed=np.append(measured.mean_speed, none + np.nan),
        mean_length=np.append(measured.mean_length, none),
        waiting=np.append(measured.waiting, none),
        tracks=(*measured.tracks, *((),) * len(missing)),
    )


def _count_demand(plan: SignalPlan, measured: LaneMeasurements) -> tuple[PhaseDemand, ...]:
    demand = []
    for phase, letters in enumerate(plan.phases):
        served = dict.fromkeys(lane for link, lane, _ in plan.links if link in green_links(letters))
        rows = [measured.lanes.index(lane) for lane in served]
        vehicles, halting = int(measured.vehicles[rows].sum()), int(measured.halting[rows].sum())
        demand.append(PhaseDemand(phase=phase, vehicles=vehicles, halting=halting))
    return tuple(demand)


def _list_waiting(plan: SignalPlan, measured: LaneMeasurements, links: set[int]) -> set[int]:
    standing = dict(zip(measured.lanes, measured.halting.tolist(), strict=True))
    return {link for link, lane, _ in plan.links if link in links and standing[lane]}


def _find_green(plan: SignalPlan, time: float) -> int:
    """Find the phase that the network's own program shows at a time, or turns to next."""
    left = time % sum(green.seconds + green.change for green in plan.greens)
    for place, green in enumerate(plan.greens):
        if left < green.seconds:
            return green.phase
        left -= green.seconds
        if left < green.change:
            return plan.greens[(place + 1) % len(plan.greens)].phase
        left -= green.change
    return plan.greens[0].phase
