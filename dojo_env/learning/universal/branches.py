"""Episodes under a policy, and what each phase would have come to at some of their decisions.

There the simulation is forked: from the same moment, with the same drivers, each fork shows another phase and
then goes on under the policy. What the forks cost differs by that phase alone, and hardly by chance.

Source: Lagoudakis and Parr, Reinforcement learning as classification, ICML 2003; the `vine` procedure of
Schulman et al., Trust region policy optimization, ICML 2015.
"""

from collections.abc import Mapping
from contextlib import closing
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from dojo_env.config import build_config
from dojo_env.controllers.phase_competition import score_phases
from dojo_env.forks import call_in_fork
from dojo_env.instant import Instant
from dojo_env.learning.universal.cases import Case
from dojo_env.local_world import LocalWorld
from dojo_env.notes import notes_unsaid
from dojo_env.phase_features import PhaseReader
from dojo_env.simulation import Simulation

Array = NDArray[np.float32]
Weights = Mapping[str, Array]

DISCOUNT = 0.975
"""From decision time to decision time, which are 5 s apart: what comes in two minutes counts half."""
WALKERS = 2.0
"""What walkers who wait at a crossing cost beside a vehicle that stands."""
MOST_BRANCHES = 4
"""Phases that are compared at one decision; of more, the others are drawn."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Looking:
    """At which decisions to look ahead, and how far.

    Attributes:
        share: of the decision times at which a change would be granted.
        horizon: decision times ahead.
        waiting: what a second of a vehicle's waiting costs beside one that stands.
        tries: how often the episode itself goes on with any phase, so that it comes to other states.
    """

    share: float
    horizon: int
    waiting: float
    tries: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Decision:
    """A decision at a signal of n phases, and what each phase would cost.

    Attributes:
        junction: scenario and signal.
        phases: (n, features).
        constraints: (c,).
        present: the phase that was green.
        chosen: the phase that the policy wants.
        costs: (n,) of the time ahead, discounted; NaN where a phase was not looked at.
    """

    junction: str
    phases: Array
    constraints: Array
    present: int
    chosen: int
    costs: Array


@dataclass(frozen=True, slots=True)
class _Choice:
    """A decision to which a change would be granted."""

    phases: Array
    constraints: Array
    present: int
    chosen: int


def run_case(case: Case, weights: Weights, looking: Looking) -> list[Decision]:
    """Run an episode in a fork, so that it is the same whatever ran before in this process.

    Args:
        case: the episode.
        weights: of the policy's scores.
        looking: at which decisions to look ahead.

    Returns:
        These decisions.

    Raises:
        SimulationError: SUMO stopped.
    """
    found: list[Decision] = call_in_fork(_run, case, weights, looking)
    return found


def _run(case: Case, weights: Weights, looking: Looking) -> list[Decision]:
    chance, found = np.random.default_rng(case.seed), list[Decision]()
    with notes_unsaid(), closing(LocalWorld(build_config(**case.environment))) as world:
        world.reset(case.seed)
        readers = {signal: PhaseReader(view.plan) for signal, view in world.instant.signals.items()}
        last = world.config.sumo.end - looking.horizon * world.config.sumo.interval
        ended = False
        while not ended:
            choices = _choose(world, readers, weights)
            if choices and world.instant.time <= last and chance.random() < looking.share:
                signal = str(chance.choice(list(choices)))
                each = choices[signal]
                costs = np.full(len(each.phases), np.nan, np.float32)
                for phase in _draw_branches(each, chance):
                    actions = {**_list_actions(world, choices), signal: phase}
                    ahead = (world, readers, weights, actions, signal, looking)
                    costs[phase] = call_in_fork(_look_ahead, *ahead)
                found.append(
                    Decision(
                        junction=f"{case.scenario}/{signal}",
                        phases=each.phases,
                        constraints=each.constraints,
                        present=each.present,
                        chosen=each.chosen,
                        costs=costs,
                    )
                )
            actions = _list_actions(world, choices)
            for signal, each in choices.items():
                if chance.random() < looking.tries:
                    actions[signal] = int(chance.integers(len(each.phases)))
            _, _, ended, _ = world.step(actions)
    return found


def _choose(world: LocalWorld, readers: Mapping[str, PhaseReader], weights: Weights) -> dict[str, _Choice]:
    """Let the policy choose, at each signal where a change would be granted."""
    now, choices = world.instant, {}
    for signal, reader in readers.items():
        view = now.signals[signal]
        phases, constraints = reader.read(signal, now), reader.constraints(view)
        if view.may_change and len(phases) > 1:
            scores = score_phases(weights, phases, constraints, view.phase)
            choices[signal] = _Choice(phases, constraints, view.phase, int(scores.argmax()))
    return choices


def _list_actions(world: LocalWorld, choices: Mapping[str, _Choice]) -> dict[str, int]:
    """List what is chosen; elsewhere the present phase stays."""
    present = {signal: view.phase for signal, view in world.instant.signals.items()}
    return {**present, **{signal: each.chosen for signal, each in choices.items()}}


def _draw_branches(choice: _Choice, chance: np.random.Generator) -> list[int]:
    """Draw the phases to look at: the present one, the policy's, and others."""
    phases = np.arange(len(choice.phases))
    surely = {choice.present, choice.chosen}
    others = chance.permutation([phase for phase in phases if phase not in surely])
    return sorted(surely | {int(phase) for phase in others[: MOST_BRANCHES - len(surely)]})


def _look_ahead(
    world: LocalWorld,
    readers: Mapping[str, PhaseReader],
    weights: Weights,
    actions: dict[str, int],
    signal: str,
    looking: Looking,
) -> float:
    """Go on with these actions, and then under the policy; give what it costs at the signal."""
    cost = 0.0
    for turn in range(looking.horizon):
        _, _, ended, _ = world.step(actions)
        now = measure_cost(signal, world.instant, world.traffic.simulation, waiting=looking.waiting)
        cost += DISCOUNT**turn * now
        if ended:
            break
        actions = _list_actions(world, _choose(world, readers, weights))
    return cost


def measure_cost(signal: str, instant: Instant, simulation: Simulation, *, waiting: float) -> float:
    """Measure what a decision time costs: who is slow, for how long vehicles wait, and who waits on foot.

    Who starts again is slow, too; so a stop costs more than the time for which one stands.

    Args:
        signal: its id.
        instant: the decision at which that time ends.
        simulation: stands at that decision.
        waiting: what a second of a vehicle's waiting costs beside one that stands.

    Returns:
        The cost, in vehicles that stand on the lanes to the signal and away from it.

    Raises:
        StaleInstantError: SUMO has moved on before it was measured.
    """
    view = instant.signals[signal]
    plan = view.plan
    return (
        simulation.measure_slowness(dict.fromkeys((*plan.lanes, *plan.upstream, *plan.out_lanes)))
        + waiting * view.lanes.total_waiting
        + WALKERS * len(instant.list_wanted_walks(signal))
    )
