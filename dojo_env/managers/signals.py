"""The signals of the episode: actions become states, and a watch looks at what is really shown."""

from collections.abc import Mapping
from functools import partial

from dojo_env.config import SignalConfig
from dojo_env.errors import ConfigError
from dojo_env.instant import SignalView
from dojo_env.managers.base import Manager, Turn
from dojo_env.reading import HALTING, LaneReading
from dojo_env.signals.cycle import CycleStep, build_cycle, check_timing, find_step, plan_stages
from dojo_env.signals.longest_red import LongestRed
from dojo_env.signals.plan import SignalPlan
from dojo_env.signals.safety import SafetyLog, SignalWatch
from dojo_env.signals.switching import SignalSwitch
from dojo_env.simulation import Simulation
from dojo_env.timing_plans import SignalTiming


class SignalManager(Manager):
    """Owns a switch and a watch for every signal; with `fixed_ts` it only looks on.

    Attributes:
        safety: every breach of the rules that was seen in the episode.
        longest_red: the longest that somebody saw no green, seconds; 0 if nobody waited a third of the limit.
        timing: the timing plan that the next episode runs, where one does.
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
        """Take the signals to control; `interval` is the time between decisions, `step` that of SUMO's.

        Raises:
            ConfigError: a timing plan does not fit the signals.
        """
        self._simulation, self._plans, self._config = simulation, plans, config
        self._step, self._interval = step, interval
        self.timing = config.timing
        if self.timing is not None:
            check_timing(self.timing, plans)
        self._switches: dict[str, SignalSwitch] = {}
        self._watches: dict[str, SignalWatch] = {}
        self._phases: dict[str, int] = {}
        self._reds: dict[str, LongestRed] = {}
        self._cycles: dict[str, tuple[CycleStep, ...]] = {}
        self.longest_red = 0.0
        self.safety = SafetyLog()

    def count_actions(self, signal: str) -> int:
        """Tell how many actions a signal's agent has.

        Args:
            signal: id of one that agents control.

        Returns:
            How many: 2 with `next_or_keep`, one per duration with `set_duration`, else one per phase.
        """
        if self._config.action_mode == "next_or_keep":
            return 2
        if self._config.action_mode == "set_duration":
            longest = self._config.max_green or self._config.min_green
            return 1 + int((longest - self._config.min_green) // self._interval)
        return len(self._plans[signal].phases)

    def before_reset(self, turn: Turn) -> None:
        """Forget the last episode."""
        self.safety = SafetyLog()
        self.longest_red = 0.0

    def reset(self, turn: Turn) -> None:
        """Show each signal's first phase, or hand it to SUMO."""
        time = self._simulation.time
        self._switches = {
            name: SignalSwitch(plan, self._config, step=self._step) for name, plan in self._plans.items()
        }
        self._phases = dict.fromkeys(self._plans, 0)
        self._reds = {
            name: LongestRed(
                plan, self._config, interval=self._interval, time=time, order=self._list_order(name)
            )
            for name, plan in self._plans.items()
        }
        self._watches = {
            name: SignalWatch(plan, self._config, self.safety, time=time)
            for name, plan in self._plans.items()
        }
        self._cycles = {}
        for signal, switch in self._switches.items():
            if self._config.program != "network":
                self._hand_over(signal)
            elif not self._config.fixed_ts:
                self._simulation.show(signal, switch.state)
        self._look()

    def _own_timing(self, signal: str) -> SignalTiming | None:
        return self.timing.signals.get(signal) if self.timing is not None else None

    def _staged(self, signal: str) -> SignalPlan:
        """Give the signal's plan, with the greens of the timing plan where that has some for it."""
        plan, own = self._plans[signal], self._own_timing(signal)
        return plan if own is None else plan_stages(plan, own)

    def _list_order(self, signal: str) -> tuple[int, ...] | None:
        """List the phases in the order in which they come; None where any may be chosen."""
        if self._config.fixed_ts:
            return tuple(green.phase for green in self._staged(signal).greens)
        if self._config.action_mode == "choose_phase":
            return None
        return tuple(range(len(self._plans[signal].phases)))

    def _hand_over(self, signal: str) -> None:
        """Let SUMO's own logic run the signal, under the same constraints as agents."""
        plan, config, simulation = self._plans[signal], self._config, self._simulation
        own = self._own_timing(signal)
        cycle = build_cycle(self._staged(signal), config)
        start = None
        if own is not None:
            start = find_step(cycle, own.offset)
        elif config.program == "fixed" and plan.starts:
            number, spent = simulation.read_position(signal)
            start = find_step(cycle, plan.starts[number] + spent)
        longest = config.max_green if self.timing is None else self.timing.max_green
        limits = (config.min_green, max(longest or 0, config.min_green))
        parameters = self.timing.parameters if self.timing is not None else {}
        simulation.run_program(
            signal, config.program, cycle, limits=limits, start=start, parameters=parameters
        )
        if config.program != "fixed":
            self._cycles[signal] = cycle

    def _end_greens(self) -> None:
        """Let SUMO's logics go on from a green where somebody would else wait too long."""
        for signal, cycle in self._cycles.items():
            number, spent = self._simulation.read_position(signal)
            may_change = cycle[number].varies and spent >= self._config.min_green
            place = sum(step.varies for step in cycle[:number])
            due = self._reds[signal].find_due(self._simulation.time, place, may_change=may_change)
            if due is not None:
                self._simulation.show_step(signal, (number + 1) % len(cycle))
                self._see(signal)

    def before_step(self, turn: Turn) -> None:
        """Ask for what the agents want, or for what those need who have waited longest.

        Raises:
            ConfigError: an action is none of the signal's; nothing has been asked for then.
        """
        if self._config.fixed_ts:
            self._end_greens()
            return
        for signal, action in turn.actions.items():
            self._check(signal, action)
        for signal, switch in self._switches.items():
            before = switch.state
            action = int(turn.actions.get(signal, self._keeping(switch)))
            asked = action != self._keeping(switch)
            due = self._reds[signal].find_due(
                self._simulation.time, switch.phase, may_change=switch.may_change, is_asked=asked
            )
            if due is not None:
                switch.request_phase(due)
            elif signal in turn.actions:
                self._request(switch, action)
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
        time = self._simulation.time
        for watch in self._watches.values():
            watch.look_back(time)

    def view(self, signal: str, lanes: LaneReading) -> SignalView:
        """Describe a signal as it is at a decision, and note who waits there.

        Args:
            signal: id of one that agents control.
            lanes: the present figures of its plan's lanes.

        Returns:
            The signal; with `fixed_ts` the phase is the last one that was shown whole, `green_time` is 0 and
            `may_change` is True.
        """
        switch, plan = self._switches[signal], self._plans[signal]
        red = self._reds[signal].decide(
            self._simulation.time, lanes.halting_row, partial(self._list_waiting, signal)
        )
        self.longest_red = max(self.longest_red, red)
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

    def _list_waiting(self, signal: str, links: set[int]) -> set[int]:
        """List those of a signal's links at which somebody stands."""
        plan = self._plans[signal]
        sources = dict.fromkeys(source for link, source, _ in plan.links if link in links)
        lanes = dict.fromkeys(lane for source in sources for lane in (source, *plan.before.get(source, ())))
        coming = self._simulation.list_approaching(signal, lanes)
        crossings = [(link, crossing) for link, crossing in plan.walks if link in links]
        wanted = self._simulation.list_wanted_crossings() if crossings else set()
        return {
            *(link for link, _, speed, _ in coming if speed < HALTING and link in links),
            *(link for link, crossing in crossings if crossing in wanted),
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
        self.longest_red = max(self.longest_red, self._reds[signal].look(time, state))

    def _keeping(self, switch: SignalSwitch) -> int:
        """Name the action that leaves the signal as it is; a duration never does."""
        return {"choose_phase": switch.phase, "next_or_keep": 0}.get(self._config.action_mode, -1)

    def _request(self, switch: SignalSwitch, action: int) -> None:
        mode = self._config.action_mode
        if mode == "set_duration":
            switch.request_duration(self._config.min_green + action * self._interval)
        elif mode == "choose_phase":
            switch.request_phase(action)
        elif action:
            switch.request_phase(switch.next_phase)
