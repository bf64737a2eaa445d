"""The signals of the episode: actions become states, and a watch looks at what is really shown."""

from collections.abc import Mapping
from functools import partial

from dojo_env.config import SignalConfig
from dojo_env.errors import ConfigError
from dojo_env.instant import SignalView
from dojo_env.managers.base import Manager, Turn
from dojo_env.reading import HALTING, LaneReading
from dojo_env.signals.longest_red import LongestRed
from dojo_env.signals.plan import SignalPlan
from dojo_env.signals.safety import SafetyLog, SignalWatch
from dojo_env.signals.switching import SignalSwitch
from dojo_env.simulation import Simulation

_AT_THE_LINE = 10.0
"""Metres before the stop line within which a vehicle has waited there, if it moves already."""


class SignalManager(Manager):
    """Owns a switch and a watch for every signal; with `fixed_ts` it only looks on.

    Attributes:
        safety: every breach of the rules that was seen in the episode.
    """

    def __init__(
        self,
        simulation: Simulation,
        plans: Mapping[str, SignalPlan],
        config: SignalConfig,
        *,
        step: float,
        interval: float,
    ) -> None:
        """Take the signals to control; `interval` is the time between decisions, `step` that of SUMO's."""
        self._simulation, self._plans, self._config = simulation, plans, config
        self._step, self._interval = step, interval
        self._switches: dict[str, SignalSwitch] = {}
        self._watches: dict[str, SignalWatch] = {}
        self._phases: dict[str, int] = {}
        self._reds: dict[str, LongestRed] = {}
        self._longest_red = 0.0
        self.safety = SafetyLog()

    def measure_longest_red(self) -> float:
        """Tell for how many seconds of the episode somebody saw no green at the most."""
        for signal, red in self._reds.items():
            self._note_reds(signal, red.list_ages(self._simulation.time))
        return self._longest_red

    def count_actions(self, signal: str) -> int:
        """Tell how many actions a signal's agent has."""
        if self._config.action_mode == "next_or_keep":
            return 2
        if self._config.action_mode == "set_duration":
            longest = self._config.max_green or self._config.min_green
            return 1 + int((longest - self._config.min_green) // self._interval)
        return len(self._plans[signal].phases)

    def before_reset(self, turn: Turn) -> None:
        """Forget the last episode."""
        self.safety = SafetyLog()
        self._longest_red = 0.0

    def reset(self, turn: Turn) -> None:
        """Show each signal's first phase, or hand it to SUMO."""
        time = self._simulation.time
        self._switches = {
            name: SignalSwitch(plan, self._config, step=self._step) for name, plan in self._plans.items()
        }
        self._phases = dict.fromkeys(self._plans, 0)
        self._reds = {
            name: LongestRed(plan, self._config, interval=self._interval, time=time)
            for name, plan in self._plans.items()
        }
        self._watches = {
            name: SignalWatch(plan, self._config, self.safety, time=time)
            for name, plan in self._plans.items()
        }
        for signal, switch in self._switches.items():
            if self._config.program != "network":
                limits = {"min_green": self._config.min_green, "max_green": self._config.max_green or 0.0}
                self._simulation.run_program(
                    signal, self._config.program, self._plans[signal].cycle, **limits
                )
            elif not self._config.fixed_ts:
                self._simulation.show(signal, switch.state)
        self._look()

    def before_step(self, turn: Turn) -> None:
        """Ask for what the agents want, or for what those need who have waited longest.

        Raises:
            ConfigError: an action is none of the signal's; nothing has been asked for then.
        """
        if self._config.fixed_ts:
            return
        for signal, action in turn.actions.items():
            self._check(signal, action)
        for signal, switch in self._switches.items():
            before = switch.state
            due = self._reds[signal].find_due(
                self._simulation.time, switch, partial(self._list_waiting, signal)
            )
            if due is not None:
                switch.request_phase(due)
            elif signal in turn.actions:
                self._request(switch, int(turn.actions[signal]))
            if switch.state != before:
                self._show(signal, switch.state)

    def _check(self, signal: str, action: int) -> None:
        if signal not in self._switches:
            raise ConfigError(f"no agent {signal!r}; the agents are {', '.join(self._switches)}")
        count = self.count_actions(signal)
        if int(action) != action or not 0 <= action < count:
            raise ConfigError(
                f"signal {signal}: action {action!r}, expected a whole number from 0 to {count - 1}"
            )

    def step(self, turn: Turn) -> None:
        """Let a step pass at every signal."""
        if self._config.fixed_ts:
            self._look()
            return
        for signal, switch in self._switches.items():
            if switch.advance():
                self._show(signal, switch.state)

    def after_step(self, turn: Turn) -> None:
        """Look at every signal, and judge how long greens have lasted."""
        self._look()
        for watch in self._watches.values():
            watch.look_back(self._simulation.time)

    def view(self, signal: str, lanes: LaneReading) -> SignalView:
        """Describe a signal as it is now."""
        switch, plan = self._switches[signal], self._plans[signal]
        if not self._config.fixed_ts:
            return SignalView(
                plan=plan,
                phase=switch.phase,
                state=switch.state,
                green_time=switch.green_time,
                may_change=switch.may_change,
                lanes=lanes,
            )
        state = self._simulation.read_state(signal)
        if state in plan.phases:
            self._phases[signal] = plan.phases.index(state)
        phase = self._phases[signal]
        return SignalView(plan=plan, phase=phase, state=state, green_time=0.0, may_change=True, lanes=lanes)

    def _list_waiting(self, signal: str) -> set[int]:
        """List the links at which somebody stands, or sets off only now."""
        plan = self._plans[signal]
        coming = self._simulation.list_approaching(signal, plan.lanes)
        wanted = self._simulation.list_wanted_crossings() if plan.walks else set()
        return {
            *(link for link, metres, speed in coming if speed < HALTING or metres < _AT_THE_LINE),
            *(link for link, crossing in plan.walks if crossing in wanted),
        }

    def _show(self, signal: str, state: str) -> None:
        self._simulation.show(signal, state)
        self._see(signal)

    def _look(self) -> None:
        for signal in self._plans:
            self._see(signal)

    def _see(self, signal: str) -> None:
        """Look at what is really shown."""
        time, state = self._simulation.time, self._simulation.read_state(signal)
        self._watches[signal].look(time, state)
        self._note_reds(signal, self._reds[signal].look(time, state))

    def _note_reds(self, signal: str, seconds: Mapping[int, float]) -> None:
        """Note the longest time for which a link was red where somebody waited at it."""
        if max(seconds.values(), default=0.0) > self._longest_red:
            waiting = self._list_waiting(signal)
            reds = (red for link, red in seconds.items() if link in waiting)
            self._longest_red = max([self._longest_red, *reds])

    def _request(self, switch: SignalSwitch, action: int) -> None:
        mode = self._config.action_mode
        if mode == "set_duration":
            switch.request_duration(self._config.min_green + action * self._interval)
        elif mode == "choose_phase":
            switch.request_phase(action)
        elif action:
            switch.request_phase(switch.next_phase)
