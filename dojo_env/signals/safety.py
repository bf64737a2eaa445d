"""A watch over what a signal really shows, apart from the code that sets it: every breach is counted."""

from collections import Counter
from dataclasses import dataclass

import numpy as np

from dojo_env.config import SignalConfig
from dojo_env.signals.plan import SignalPlan
from dojo_maps.signals.programs import GREEN, YELLOW

_KEPT = 20
_LONG_AGO = -1e9


@dataclass(frozen=True, slots=True, kw_only=True)
class Violation:
    """A breach of a rule: which, when, at which signal and by which links."""

    rule: str
    time: float
    signal: str
    links: tuple[int, ...]


class SafetyLog:
    """Counts violations by rule and keeps the first ones."""

    def __init__(self) -> None:
        """Begin with a clean record."""
        self.counts: Counter[str] = Counter()
        self.first: list[Violation] = []

    def add(self, violation: Violation) -> None:
        """Count a violation.

        Args:
            violation: a breach; only the first 20 are kept whole.
        """
        self.counts[violation.rule] += 1
        if len(self.first) < _KEPT:
            self.first.append(violation)


class SignalWatch:
    """Looks at one signal's letters whenever they may have changed, and at every decision.

    Rules: `unknown_state`, `conflict` (two links green that must not be), `skipped_yellow`, `short_yellow`,
    `short_green`, `long_green`, `short_red` (green before all-red is over), `sudden_yield` (green in the
    second in which a foe loses its priority) and `walker_cut_off` (green before walkers are across). To get
    priority while green counts as a start of green. A program that no agent controls has its own greens;
    there only conflicts and skipped yellows count.
    """

    def __init__(self, plan: SignalPlan, config: SignalConfig, log: SafetyLog, *, time: float) -> None:
        """Begin to watch; what was before counts as long ago."""
        self._plan, self._config, self._log = plan, config, log
        self._state = ""
        self._since = [time] * len(plan.phases[0])
        self._stopped = [_LONG_AGO] * len(plan.phases[0])
        self._phase_since = time
        self._judged: dict[str, list[tuple[int, int]]] = {}
        # Plain lists: a change is judged letter by letter, and thousands of times an episode.
        self._foes = [np.flatnonzero(row).tolist() for row in plan.conflicts.foes]
        self._walks, self._yellow = plan.is_crossing.tolist(), plan.yellow.tolist()
        self._red = np.maximum(plan.red, config.all_red).tolist()
        self._may_be_sudden = [config.always_transition or walk for walk in self._walks]

    def look(self, time: float, state: str) -> None:
        """Judge the letters that are shown from `time` on.

        Args:
            time: simulated seconds.
            state: the letters, one for each link index; another number of them is a violation of its own.
        """
        if state == self._state:
            return
        if len(state) != len(self._since):
            self._report("unknown_state", time, ())
            return
        if state not in self._judged:
            self._judged[state] = self._plan.conflicts.find_unsafe(state)
        for pair in self._judged[state]:
            self._report("conflict", time, pair)
        if self._state:
            self._judge_changes(time, state)
        self._state = state

    def look_back(self, time: float) -> None:
        """Judge at the end of a decision interval how long the present green has lasted.

        Args:
            time: of the interval's end, simulated seconds.
        """
        limit = self._config.max_green
        if limit is None or self._config.fixed_ts or len(self._plan.phases) == 1:
            return
        greens = tuple(k for k, letter in enumerate(self._state) if letter in GREEN)
        if greens and time - self._phase_since > limit and self._state in self._plan.phases:
            self._report("long_green", time, greens)

    def _judge_changes(self, time: float, state: str) -> None:
        # Where the next phase only takes green away, all-red looks like it, and is no part of it.
        ended = (red for red, letter in zip(self._red, self._state, strict=True) if letter in YELLOW)
        self._phase_since = time + max(ended, default=0.0)
        for link, (old, new) in enumerate(zip(self._state, state, strict=True)):
            if old == new:
                continue
            if old in GREEN and new not in GREEN:
                self._judge_end_of_green(link, time, new)
            elif old in YELLOW and new not in YELLOW:
                self._judge_end_of_yellow(link, time, new)
            if new == "G" or (new in GREEN and old not in GREEN):
                self._judge_start_of_green(link, time, state)
            if (old in GREEN) != (new in GREEN) or (old in YELLOW) != (new in YELLOW):
                self._since[link] = time
                if new not in GREEN | YELLOW:
                    self._stopped[link] = time

    def _judge_end_of_green(self, link: int, time: float, new: str) -> None:
        if new not in YELLOW and not self._walks[link]:
            self._report("skipped_yellow", time, (link,))
        if not self._config.fixed_ts and time - self._since[link] < self._config.min_green:
            self._report("short_green", time, (link,))

    def _judge_end_of_yellow(self, link: int, time: float, new: str) -> None:
        short = time - self._since[link] < self._yellow[link]
        if not self._config.fixed_ts and (short or new in GREEN):
            self._report("short_yellow", time, (link,))

    def _judge_start_of_green(self, link: int, time: float, state: str) -> None:
        if self._config.fixed_ts:
            return
        for foe in self._foes[link]:
            if state[foe] in GREEN | YELLOW:
                if state[foe] in YELLOW:
                    self._report("short_red", time, (link, foe))
                elif (self._state[foe], state[foe]) == ("G", "g") and not self._may_be_sudden[foe]:
                    self._report("sudden_yield", time, (link, foe))
                continue
            stopped = time if self._state[foe] in GREEN | YELLOW else self._stopped[foe]
            if time - stopped < self._plan.clearance[foe]:
                self._report("walker_cut_off", time, (link, foe))
            elif not self._walks[foe] and time - stopped < self._red[foe]:
                self._report("short_red", time, (link, foe))

    def _report(self, rule: str, time: float, links: tuple[int, ...]) -> None:
        self._log.add(Violation(rule=rule, time=time, signal=self._plan.signal, links=links))
