"""The best plan that sees nothing, by search: what any controller that sees has to beat.

The network's own program comes first, then sequences of phases, each with the greens that Webster gives it
for the scenario's usual flows; all with longer and shorter ones, too. Then single times are changed, in steps
that become smaller, as long as that helps (coordinate search, Hooke and Jeeves 1961). A plan is judged by the
mean `travel_time_all` of the same validation episodes; a poor one is given up after the first few (racing).
The same search tunes SUMO's own logics: their sequences, longest greens and parameters.
"""

import hashlib
import json
import math
from collections import Counter, defaultdict
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, field, replace
from itertools import combinations, islice, pairwise, permutations
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import numpy as np

from dojo_env.config import EnvConfig, build_config
from dojo_env.controllers import Controller
from dojo_env.errors import ConfigError, PlanError
from dojo_env.forks import call_in_fork
from dojo_env.local_world import LocalWorld
from dojo_env.signals.plan import SignalPlan
from dojo_env.timing_plans import LOGICS, SignalTiming, TimingPlan, describe_plan
from dojo_maps.safe_json import read_json
from dojo_maps.signals.programs import GREEN
from dojo_maps.whole_file import write_json

VALIDATION_SEEDS = (500, 501, 502, 503)
"""Episodes that plans are judged by; the benchmark's are others."""
JUDGED_BY = "travel_time_all"
_FACTORS = (1.0, 0.7, 1.4)
"""How long the stages of a sequence are at first, beside Webster's."""
_SATURATION, _LOST, _FULLEST = 0.5, 4.0, 0.9
"""A lane's vehicles per second of green; seconds lost at a change; the most that flow ratios sum up to."""
_CYCLES = (30.0, 150.0)
"""Seconds of the shortest and the longest of Webster's cycles."""
_STEPS = (8, 4, 2, 1)
"""Seconds by which single times are changed."""
_MOST_SEQUENCES = 8
"""Of a signal."""
_LARGEST_SET = 5
"""Phases of a sequence, beside the network's own."""
_GIVEN_UP = 1.02
"""How much worse than the best plan's the first episodes may be."""
_INTERVAL = 60
"""Seconds from one look at the traffic to the next: nobody decides anything meanwhile."""
_SHORTEST, _LONGEST = 5, 120
"""Seconds of a stage."""
_PARAMETERS: Mapping[str, Mapping[str, tuple[float, ...]]] = {
    "fixed": {},
    "actuated": {"max-gap": (1.0, 1.5, 2.0, 3.0, 4.0, 6.0), "detector-gap": (1.0, 2.0, 3.0, 4.0)},
    "delay_based": {"detectorRange": (50.0, 100.0, 150.0, 250.0), "minTimeLoss": (0.5, 1.0, 2.0, 4.0)},
}
"""Of SUMO's logics, the values that are tried; the first guess is the middle one."""
_LONGEST_GREENS = (20, 30, 45, 60, 90)

Stages = tuple[tuple[int, int], ...]
"""Phases and seconds, as `SignalTiming` has them."""
Score = Callable[[TimingPlan, int], float]
"""Judges a plan in the episode of a seed; less is better."""


@dataclass(slots=True)
class Search:
    """A search in progress; everything about it follows from its inputs.

    Attributes:
        score: judges a plan in an episode.
        sequences: those that may be tried at each signal, with the stages that they begin with.
        logic: of the plan.
        budget: episodes that it may take.
        seed: of the order in which changes are tried.
        best: the best plan so far.
        scores: of its episodes.
        spent: episodes so far.
    """

    score: Score
    sequences: Mapping[str, Sequence[Stages]]
    logic: str = "fixed"
    budget: int = 70
    seed: int = 0
    seeds: Sequence[int] = VALIDATION_SEEDS
    best: TimingPlan | None = None
    scores: list[float] = field(default_factory=list)
    spent: int = 0
    _tried: set[str] = field(default_factory=set)

    def run(self) -> None:
        """Search until the budget is spent or nothing helps any more.

        Raises:
            ConfigError: the budget does not suffice for one plan.
        """
        chance = np.random.default_rng(self.seed)
        for plan in self._list_starts():
            self._try(plan)
        before, now = None, self.found
        for step in _STEPS:
            while now is not before and not self._is_over:
                before = now
                moves = list(self._list_moves(step))
                for place in chance.permutation(len(moves)).tolist():
                    self._try(moves[place](self.found))
                now = self.found
            before = None

    @property
    def found(self) -> TimingPlan:
        """The best plan.

        Raises:
            ConfigError: the budget did not suffice for one.
        """
        if self.best is None:
            raise ConfigError(f"budget={self.budget}: expected at least {len(self.seeds)} episodes")
        return self.best

    @property
    def mean(self) -> float:
        """The best plan's mean over the validation episodes; nan where there is none."""
        return float(np.mean(self.scores)) if self.scores else math.nan

    @property
    def _is_over(self) -> bool:
        return self.spent + len(self.seeds) > self.budget

    def _try(self, plan: TimingPlan) -> bool:
        """Judge a plan, where that was not done; returns whether it is the best so far."""
        key = json.dumps(describe_plan(plan))
        if self._is_over or key in self._tried:
            return False
        self._tried.add(key)
        scores: list[float] = []
        for seed in self.seeds:
            scores.append(self.score(plan, seed))
            self.spent += 1
            if self.scores and np.mean(scores) > _GIVEN_UP * np.mean(self.scores[: len(scores)]):
                return False
        if self.scores and np.mean(scores) >= np.mean(self.scores):
            return False
        self.best, self.scores = plan, scores
        return True

    def _list_starts(self) -> Iterator[TimingPlan]:
        """Give all signals their n-th sequence, with stages as they begin, shorter and longer."""
        usual = {name: values[len(values) // 2] for name, values in _PARAMETERS[self.logic].items()}
        factors = _FACTORS if self.logic == "fixed" else _FACTORS[:1]
        for number in range(max(map(len, self.sequences.values()))):
            signals = {
                signal: SignalTiming(stages=known[min(number, len(known) - 1)])
                for signal, known in self.sequences.items()
            }
            plan = TimingPlan(signals=signals, logic=self.logic, parameters=usual)
            yield from (_Stretch(factor)(plan) for factor in factors)

    def _list_moves(self, step: int) -> Iterator[Callable[[TimingPlan], TimingPlan]]:
        if self.logic == "fixed":
            yield from (_Stretch(factor) for factor in (0.8, 0.9, 1.1, 1.25))
            for signal in self.sequences:
                stages = max(map(len, self.sequences[signal]))
                yield from (_Lengthen(signal, k, by) for k in range(stages) for by in (-step, step))
                if len(self.sequences) > 1:
                    yield from (_Shift(signal, by) for by in (-2 * step, 2 * step))
        else:
            yield from (_Limit(seconds) for seconds in _LONGEST_GREENS)
            for name, values in _PARAMETERS[self.logic].items():
                yield from (_Set(name, value) for value in values)
        if len(self.sequences) > 1:
            for signal, known in self.sequences.items():
                yield from (_Resequence(signal, sequence) for sequence in known[:_LARGEST_SET])


@dataclass(frozen=True, slots=True)
class _Stretch:
    """Make all stages of all signals longer or shorter."""

    factor: float

    def __call__(self, plan: TimingPlan) -> TimingPlan:
        signals = {
            signal: replace(
                timing, stages=tuple((phase, _fit(seconds * self.factor)) for phase, seconds in timing.stages)
            )
            for signal, timing in plan.signals.items()
        }
        return replace(plan, signals=signals)


@dataclass(frozen=True, slots=True)
class _Lengthen:
    """Make a stage longer, or shorter."""

    signal: str
    place: int
    by: int

    def __call__(self, plan: TimingPlan) -> TimingPlan:
        stages = plan.signals[self.signal].stages
        changed = tuple(
            (phase, _fit(seconds + self.by) if place == self.place else seconds)
            for place, (phase, seconds) in enumerate(stages)
        )
        return _with(plan, self.signal, replace(plan.signals[self.signal], stages=changed))


@dataclass(frozen=True, slots=True)
class _Shift:
    """Let a signal's cycle begin earlier or later."""

    signal: str
    by: int

    def __call__(self, plan: TimingPlan) -> TimingPlan:
        timing = plan.signals[self.signal]
        cycle = sum(seconds for _, seconds in timing.stages)
        return _with(plan, self.signal, replace(timing, offset=(timing.offset + self.by) % cycle))


@dataclass(frozen=True, slots=True)
class _Resequence:
    """Give a signal another sequence, with the stages that it begins with."""

    signal: str
    stages: Stages

    def __call__(self, plan: TimingPlan) -> TimingPlan:
        return _with(plan, self.signal, replace(plan.signals[self.signal], stages=self.stages))


@dataclass(frozen=True, slots=True)
class _Limit:
    """Set the longest green of SUMO's logic."""

    seconds: int

    def __call__(self, plan: TimingPlan) -> TimingPlan:
        return replace(plan, max_green=self.seconds)


@dataclass(frozen=True, slots=True)
class _Set:
    """Set a parameter of SUMO's logic."""

    name: str
    value: float

    def __call__(self, plan: TimingPlan) -> TimingPlan:
        return replace(plan, parameters={**plan.parameters, self.name: self.value})


def _with(plan: TimingPlan, signal: str, timing: SignalTiming) -> TimingPlan:
    return replace(plan, signals={**plan.signals, signal: timing})


def _fit(seconds: float) -> int:
    return int(min(max(round(seconds), _SHORTEST), _LONGEST))


def list_sequences(plan: SignalPlan) -> tuple[tuple[int, ...], ...]:
    """List sequences of phases that let every link go: the network's own first, then those of few phases.

    Args:
        plan: of the signal.

    Returns:
        Phases by their numbers; the first sequence is the network's own, where it has one.
    """
    served = [{link for link, letter in enumerate(state) if letter in GREEN} for state in plan.phases]
    every = set[int]().union(*served)
    own = tuple(green.phase for green in plan.greens)
    found = dict.fromkeys([own] if own else [])

    def orders() -> Iterator[tuple[int, ...]]:
        for size in range(1, min(len(served), _LARGEST_SET) + 1):
            for phases in combinations(range(len(served)), size):
                if set[int]().union(*(served[phase] for phase in phases)) == every:
                    yield from ((phases[0], *rest) for rest in permutations(phases[1:]))

    found.update(dict.fromkeys(islice(orders(), _MOST_SEQUENCES)))
    return tuple(found) or (tuple(range(len(served))),)


def compute_stages(
    plan: SignalPlan, sequence: Sequence[int], ways: Mapping[tuple[str, str], int], *, seconds: float
) -> Stages:
    """Give a sequence Webster's cycle and splits.

    Source: Webster, Traffic signal settings, Road Research Technical Paper 39, 1958.

    Args:
        plan: of the signal.
        sequence: phases.
        ways: how many vehicles drive from each road to the next.
        seconds: in which they do.

    Returns:
        Each phase with its seconds of green.
    """
    pairs = {
        link: (source.rpartition("_")[0], target.rpartition("_")[0]) for link, source, target in plan.links
    }
    lanes = Counter(pairs.values())
    ratios = []
    for phase in sequence:
        flows: dict[str, float] = defaultdict(float)
        for link, source, _ in plan.links:
            shown = sum(plan.phases[other][link] in GREEN for other in sequence)
            if plan.phases[phase][link] in GREEN:
                flows[source] += ways.get(pairs[link], 0) / lanes[pairs[link]] / shown / seconds
        ratios.append(max(flows.values(), default=0.0) / _SATURATION)
    lost, total = _LOST * len(sequence), max(sum(ratios), 1e-6)
    cycle = min(max((1.5 * lost + 5) / (1 - min(total, _FULLEST)), _CYCLES[0]), _CYCLES[1])
    return tuple(
        (phase, _fit(_LOST + (cycle - lost) * ratio / total))
        for phase, ratio in zip(sequence, ratios, strict=True)
    )


def search_plan(
    keywords: Mapping[str, Any],
    *,
    logic: str = "fixed",
    budget: int = 70,
    seed: int = 0,
    memory: "Memory | None" = None,
    on_score: Callable[[Search], None] = lambda _search: None,
) -> Search:
    """Search the best timing plan of a scenario.

    Episodes run in a process of their own, one after another.

    Args:
        keywords: settings of the environment: the scenario, and the constraints that hold for all.
        logic: `fixed`, or SUMO's `actuated` or `delay_based`, whose parameters are searched.
        budget: episodes.
        seed: of the order in which changes are tried.
        memory: of episodes that were judged already; new ones are added, so that a search that was
            interrupted goes on.
        on_score: is told of the search after each new episode.

    Returns:
        The search, with its best plan.

    Raises:
        ConfigError: a setting is unknown or cannot work, or the budget is too small.
        SimulationError: SUMO refuses the scenario.
    """
    if logic not in LOGICS:
        raise ConfigError(f"logic={logic!r}: expected one of {', '.join(LOGICS)}")
    known = Memory() if memory is None else memory
    config = build_config(**keywords)
    if (config.sumo.end - config.sumo.begin) % _INTERVAL == 0:
        config = build_config(**{**keywords, "delta_time": _INTERVAL})
    about = {name: str(value) for name, value in keywords.items()}
    signals = replace(config.signals, fixed_ts=True, program=logic)
    with ProcessPoolExecutor(1, mp_context=get_context("spawn")) as pool:
        sequences = pool.submit(_prepare, replace(config, signals=signals)).result()

        def score(plan: TimingPlan, episode: int) -> float:
            key = describe_episode(plan, episode, about)
            if key not in known.scores:
                known.add(key, pool.submit(_judge, plan, episode).result())
                on_score(search)
            return known.scores[key]

        search = Search(score=score, sequences=sequences, logic=logic, budget=budget, seed=seed)
        search.run()
    return search


class Memory:
    """What episodes came to, by what they were; kept in a file where one is named.

    Attributes:
        scores: by `describe_episode`.
    """

    def __init__(self, path: Path | None = None) -> None:
        """Read what is there.

        Raises:
            PlanError: the file is damaged.
        """
        self._path = path
        self.scores: dict[str, float] = {}
        if path is None or not path.is_file():
            return
        known = read_json(path, error=PlanError)
        if not isinstance(known, dict) or not all(isinstance(value, float) for value in known.values()):
            raise PlanError(path, "not the episodes of a search; delete it")
        self.scores = known

    def add(self, key: str, score: float) -> None:
        """Keep an episode's score.

        Args:
            key: what the episode depends on, as `describe_episode` tells it.
            score: of the episode; less is better.
        """
        self.scores[key] = score
        if self._path is not None:
            write_json(self._path, self.scores)

    def forget(self) -> None:
        """Delete the file: the search is done."""
        if self._path is not None:
            self._path.unlink(missing_ok=True)


def describe_episode(plan: TimingPlan, seed: int, about: Mapping[str, str]) -> str:
    """Tell what an episode depends on as a hash.

    Args:
        plan: that was run.
        seed: of the episode.
        about: all else, by name.

    Returns:
        24 hexadecimal digits.
    """
    text = json.dumps([describe_plan(plan), seed, about], sort_keys=True)
    return hashlib.sha256(text.encode()).hexdigest()[:24]


_worlds: list[LocalWorld] = []
"""The world of this process, from which episodes fork."""


def _prepare(config: EnvConfig) -> dict[str, tuple[Stages, ...]]:
    """Open the world; returns each signal's sequences, with stages by the flows of an episode."""
    _worlds[:] = [LocalWorld(config)]
    _worlds[0].prepare()
    ways: Counter[tuple[str, str]] = call_in_fork(_count_ways)
    seconds = config.sumo.end - config.sumo.begin
    return {
        signal: (
            *_list_own_stages(plan),
            *(compute_stages(plan, sequence, ways, seconds=seconds) for sequence in list_sequences(plan)),
        )
        for signal, plan in _worlds[0].map.plans.items()
    }


def _list_own_stages(plan: SignalPlan) -> tuple[Stages, ...]:
    """Give the stages of the network's own program, where it has times."""
    stages = tuple((green.phase, _fit(green.seconds + green.change)) for green in plan.greens)
    return (stages,) if plan.is_of_program else ()


def _count_ways() -> Counter[tuple[str, str]]:
    """Count who drives from each road to the next, under the network's own cycles."""
    world = _worlds[0]
    world.run(Controller(), VALIDATION_SEEDS[0])
    return Counter(pair for trip in world.traffic.simulation.trips.values() for pair in pairwise(trip.route))


def _judge(plan: TimingPlan, seed: int) -> float:
    figure: float = call_in_fork(_run, plan, seed)
    return figure


def _run(plan: TimingPlan, seed: int) -> float:
    world = _worlds[0]
    world.control.timing = plan
    _, figures = world.run(Controller(), seed)
    return float(figures[JUDGED_BY])
