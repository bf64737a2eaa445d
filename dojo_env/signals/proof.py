"""A proof by exhaustion that no requests, whatever they are and whenever they come, make a signal unsafe.

**What is proved.** For a plan and a setting: however many requests come, in whatever order, each at any whole
second (hence for every `delta_time`), no second shows letters that break one of the rules below. The modes
`choose_phase` (any phase at any second), `next_or_keep` and `set_duration` (any whole seconds up to
`max_green`) are each explored whole.

**How.** Two finite automata run in step, and every state that both can reach together is visited, breadth
first, so that the first counterexample of a rule is a shortest one:

- the switch. It is `SignalSwitch` itself, not a model: put into a state, asked, and let a second pass;
- the judge. It knows the plan's foes, right of way and times, and sees of the switch only the letters of
  each second. It remembers each link's letter and for how long it has shown.

**Why that is exact.** Two things make the states finite. Both automata use a time only as its distance from
now, so the clock begins anew in every state. And a distance counts only up to a bound, beyond which all are
alike: how long a green has lasted is compared with `min_green`, and with durations of at most `max_green`;
how long walkers have had red is compared with their own clearance; what is due already comes next, however
long it has been due. The judge compares with the same bounds, yellow and red. Times are whole seconds
(settings refuse others), so floats hold them exactly.

**What is assumed.** SUMO shows the letters that are set, from the second in which they are set: the watch
of `safety` reads them back in every episode. At the begin the first phase has just turned green, and no
walker is left of before. Foes, right of way, speeds and lengths are those of the map. Letters that no lane
heeds are judged like the others. Programs that SUMO runs itself (`fixed_ts`) are not the switch's.

The rules, whose names are those of `safety`, with vehicles and walkers told apart by what the plan gives
them, yellow or a clearance:

- `conflict`: foes show green together, and neither is green without priority and yields to the other;
- `skipped_yellow`, `short_yellow`: vehicles lose green without yellow, or with too little, or yellow turns
  green again;
- `short_green`: a green ends before `min_green`; `long_green`: a phase stands longer than `max_green`, the
  all-red before it not counted;
- `short_red`: a link turns green, or gets priority, while vehicles that are its foes show yellow, or less
  than their red after it;
- `sudden_yield`: a link turns green, or gets priority, in the second in which vehicles that are its foes, and
  stay green, lose theirs (not asked for with `always_transition`);
- `walker_cut_off`: a link turns green, or gets priority, before walkers who lost green and are its foes can
  be across.
"""

from collections import deque
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import combinations, groupby

import numpy as np

from dojo_env.config import SignalConfig
from dojo_env.errors import ConfigError
from dojo_env.signals.plan import SignalPlan
from dojo_env.signals.switching import SignalSwitch, SwitchState
from dojo_maps.signals.programs import GREEN, YELLOW

_MOST = 100_000_000
"""States times links: what some gigabytes hold."""
_Memory = tuple[str, tuple[int, ...], int]
"""The letters, for how long each link has been green, yellow or stopped, and for how long all have stood."""
_Node = tuple[SwitchState, _Memory]
_Breach = tuple[str, tuple[int, ...]]
_Second = tuple[str, str]
"""What is asked for, and the letters shown."""
_Request = tuple[str, Callable[[SignalSwitch], object]]
_KEEP: _Request = ("", lambda _switch: None)


@dataclass(frozen=True, slots=True, kw_only=True)
class Counterexample:
    """Requests that break a rule.

    Attributes:
        rule: which.
        links: the links by which it is broken.
        seconds: from the begin on, what is asked for in each second, if anything, and the letters that it
            shows; the last one's break the rule.
    """

    rule: str
    links: tuple[int, ...]
    seconds: tuple[tuple[str, str], ...]

    def __str__(self) -> str:
        """Write a line for each time that letters stand without a request."""
        links = ", ".join(map(str, self.links))
        lines = [f"{self.rule} at second {len(self.seconds) - 1}, link {links}:"]
        numbered = list(enumerate(self.seconds))
        runs = groupby(numbered, key=lambda item: (item[1][1], item[0] if item[1][0] else -1))
        for _, run in runs:
            (first, (words, letters)), *rest = run
            span = f"{first}-{rest[-1][0]}" if rest else f"{first}"
            lines.append(f"  {span:>9}  {letters}  {words}".rstrip())
        return "\n".join(lines)


@dataclass(frozen=True, slots=True, kw_only=True)
class Proof:
    """What the exploration of one signal in one action mode came to.

    Attributes:
        signal: its id.
        mode: the action mode.
        phases: how many there are to choose from.
        states: how many the switch and the judge can reach together.
        transitions: how many ways lead from one to another within a second.
        longest_change: the most seconds from the end of one green phase to the next one's begin.
        counterexamples: a shortest one of each rule that is broken.
    """

    signal: str
    mode: str
    phases: int
    states: int
    transitions: int
    longest_change: float
    counterexamples: tuple[Counterexample, ...]


def prove(
    plan: SignalPlan,
    config: SignalConfig,
    switch: Callable[[SignalPlan, SignalConfig], SignalSwitch] = SignalSwitch,
) -> Proof:
    """Visit every state that a signal can reach in the setting's action mode.

    Args:
        plan: of the signal.
        config: the setting.
        switch: the rules that are tried.

    Returns:
        The proof, or counterexamples.

    Raises:
        ConfigError: there are more states than fit into memory.
    """
    runner, judge, requests = switch(plan, config), _Judge(plan, config), _list_requests(plan, config)
    start = _measure_from_now(runner, plan, config), judge.begin(runner.state)
    came: dict[_Node, tuple[_Node, _Second] | None] = {start: None}
    broken: dict[str, tuple[tuple[int, ...], _Node, _Second]] = {}
    todo = deque(came)
    transitions = 0
    while todo:
        node = todo.popleft()
        for second in _ask_each(runner, node[0], requests):
            memory, breaches = judge.look(node[1], runner.state)
            for rule, links in breaches:
                broken.setdefault(rule, (links, node, second))
            runner.advance()
            transitions += 1
            after = _measure_from_now(runner, plan, config), memory
            if after not in came:
                came[after] = node, second
                todo.append(after)
        if len(came) * len(runner.state) > _MOST:
            raise ConfigError(
                f"signal {plan.signal}: more than {len(came)} states of {len(runner.state)} links in mode "
                f"{config.action_mode}, too many to visit; lower max_green, or raise min_green"
            )
    return Proof(
        signal=plan.signal,
        mode=config.action_mode,
        phases=len(plan.phases),
        states=len(came),
        transitions=transitions,
        longest_change=max(_time_to_green(state) for state, _ in came),
        counterexamples=tuple(
            Counterexample(rule=rule, links=links, seconds=(*_trace(came, node), second))
            for rule, (links, node, second) in broken.items()
        ),
    )


def _ask_each(runner: SignalSwitch, state: SwitchState, requests: Sequence[_Request]) -> Iterator[_Second]:
    """Put the switch into a state and ask, with each request that is not held; tell what it shows then."""
    for words, ask in requests:
        runner.clock, runner.now = 0.0, state
        ask(runner)
        if runner.now is not state or not words:
            yield words, runner.state


def _list_requests(plan: SignalPlan, config: SignalConfig) -> list[_Request]:
    """List what may be asked for within a second: nothing first, then all that the action mode knows."""
    if config.action_mode == "next_or_keep":
        return [_KEEP, ("next", lambda switch: switch.request_phase(switch.next_phase))]
    if config.action_mode == "set_duration":
        seconds = range(int(config.min_green), int(config.max_green or config.min_green) + 1)
        return [_KEEP, *((f"{s} s", partial(_request_duration, seconds=s)) for s in seconds)]
    return [_KEEP, *((f"phase {p}", partial(_request_phase, phase=p)) for p in range(len(plan.phases)))]


def _request_phase(switch: SignalSwitch, phase: int) -> None:
    switch.request_phase(phase)


def _request_duration(switch: SignalSwitch, seconds: int) -> None:
    switch.request_duration(seconds)


def _measure_from_now(switch: SignalSwitch, plan: SignalPlan, config: SignalConfig) -> SwitchState:
    """Measure a switch's times from now, and no farther back than any rule looks."""
    now, clock = switch.now, switch.clock
    oldest = max(config.min_green, config.max_green or 0.0)
    return replace(
        now,
        green_since=0.0 if now.stages else max(now.green_since - clock, -oldest),
        due=max(now.due - clock, 0.0),
        walk_ended=tuple((k, max(ended - clock, -float(plan.clearance[k]))) for k, ended in now.walk_ended),
    )


def _time_to_green(now: SwitchState) -> float:
    """Add up a change's stages that are left; the clock stands at 0."""
    return now.due + sum(seconds for seconds, _ in now.stages[1:]) if now.stages else 0.0


def _trace(came: dict[_Node, tuple[_Node, _Second] | None], node: _Node) -> list[_Second]:
    """Go back to the begin, and list the seconds from there on."""
    seconds = []
    step = came[node]
    while step is not None:
        node, second = step
        seconds.append(second)
        step = came[node]
    return seconds[::-1]


class _Judge:
    """Judges the letters of each second by those before, and by the plan."""

    def __init__(self, plan: SignalPlan, config: SignalConfig) -> None:
        self._foes = [np.flatnonzero(row).tolist() for row in plan.conflicts.foes]
        self._yields = plan.conflicts.yields.tolist()
        self._yellow = [int(seconds) for seconds in plan.yellow]
        self._clearance = [int(seconds) for seconds in plan.clearance]
        self._red, self._min_green = (
            np.maximum(plan.red, config.all_red).astype(int).tolist(),
            int(config.min_green),
        )
        self._max_green = int(config.max_green or 0) if len(plan.phases) > 1 else 0
        self._phases = frozenset(plan.phases)
        self._sudden = config.always_transition
        self._bounds = {
            "green": [self._min_green] * len(self._foes),
            "yellow": self._yellow,
            "stopped": [max(pair) for pair in zip(self._red, self._clearance, strict=True)],
        }
        self._looks: dict[tuple[_Memory, str], tuple[_Memory, list[_Breach]]] = {}

    def begin(self, letters: str) -> _Memory:
        """Remember letters that are about to be shown: green is new, and all else stopped long ago."""
        stopped = self._bounds["stopped"]
        ages = (0 if a in GREEN else bound for a, bound in zip(letters, stopped, strict=True))
        return letters, tuple(ages), 0

    def look(self, memory: _Memory, letters: str) -> tuple[_Memory, list[_Breach]]:
        """Judge a second's letters, and remember them."""
        key = memory, letters
        if key not in self._looks:
            self._looks[key] = self._remember(memory, letters), list(self._find_breaches(memory, letters))
        return self._looks[key]

    def _remember(self, memory: _Memory, letters: str) -> _Memory:
        before, ages, shown = memory
        kinds = [(_kind(old), _kind(new)) for old, new in zip(before, letters, strict=True)]
        grown = tuple(
            min(age + 1 if old == new else 1, self._bounds[new][link])
            for link, (age, (old, new)) in enumerate(zip(ages, kinds, strict=True))
        )
        if letters != before:
            # Where the next phase only takes green away, all-red looks like it, and is no part of it.
            ended = (red for red, letter in zip(self._red, before, strict=True) if letter in YELLOW)
            shown = -max(ended, default=0)
        return letters, grown, min(shown + 1, self._max_green + 1)

    def _find_breaches(self, memory: _Memory, letters: str) -> Iterator[_Breach]:
        before, ages, shown = memory
        yield from (("conflict", pair) for pair in self._find_conflicts(letters))
        if letters == before and letters in self._phases and 0 < self._max_green <= shown:
            yield "long_green", tuple(k for k, letter in enumerate(letters) if letter in GREEN)
        changes = (
            (k, old, new) for k, (old, new) in enumerate(zip(before, letters, strict=True)) if old != new
        )
        for link, old, new in changes:
            was, is_now = _kind(old), _kind(new)
            if was == "green" != is_now:
                yield from self._judge_end_of_green(link, ages[link], is_now)
            if was == "yellow" != is_now and (ages[link] < self._yellow[link] or is_now == "green"):
                yield "short_yellow", (link,)
            if new == "G" or (is_now == "green" != was):
                yield from self._judge_start_of_green(link, memory, letters)

    def _find_conflicts(self, letters: str) -> Iterator[tuple[int, int]]:
        green = [link for link, letter in enumerate(letters) if letter in GREEN]
        for a, b in combinations(green, 2):
            waits = (letters[a] == "g" and self._yields[a][b]) or (letters[b] == "g" and self._yields[b][a])
            if b in self._foes[a] and not waits:
                yield a, b

    def _judge_end_of_green(self, link: int, age: int, is_now: str) -> Iterator[_Breach]:
        if self._yellow[link] and is_now != "yellow":
            yield "skipped_yellow", (link,)
        if age < self._min_green:
            yield "short_green", (link,)

    def _judge_start_of_green(self, link: int, memory: _Memory, letters: str) -> Iterator[_Breach]:
        before, ages, _ = memory
        for foe in self._foes[link]:
            kind = _kind(letters[foe])
            stopped = ages[foe] if _kind(before[foe]) == kind == "stopped" else 0
            if kind == "green":  # Together they are a conflict, or one waits for the other.
                if (before[foe], letters[foe]) == ("G", "g") and self._yellow[foe] and not self._sudden:
                    yield "sudden_yield", (link, foe)
                continue
            if self._yellow[foe] and (kind == "yellow" or stopped < self._red[foe]):
                yield "short_red", (link, foe)
            if stopped < self._clearance[foe]:
                yield "walker_cut_off", (link, foe)


def _kind(letter: str) -> str:
    return "green" if letter in GREEN else "yellow" if letter in YELLOW else "stopped"
