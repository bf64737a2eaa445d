"""Episodes under a policy that still tries things, and what happened at each decision that counted.

A decision counts where a change would be granted: in between, nothing that a policy wants happens. What comes
of it is all that it costs until the next one.
"""

from collections.abc import Mapping
from contextlib import closing
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

import dojo_env.queue_forecast  # noqa: F401 - here once, not anew in each fork
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

DISCOUNT = 0.97
"""From decision time to decision time, which are 5 s apart: what comes in three minutes counts a third."""
WAITING, WALKERS = 0.01, 2.0
"""What a second of a vehicle's waiting costs beside one that stands, and walkers at a crossing beside one."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Trajectory:
    """The decisions at one signal in one episode, n of them, and the state after the last one.

    Attributes:
        junction: scenario and signal.
        phases: (n + 1, phases, features).
        constraints: (n + 1, c).
        present: (n + 1,) the phase that was green.
        actions: (n,) the phase that was chosen.
        chances: (n,) the logarithm of its probability.
        costs: (n,) until the next decision, discounted.
        spans: (n,) how many decision times later that came.
    """

    junction: str
    phases: Array
    constraints: Array
    present: NDArray[np.int64]
    actions: NDArray[np.int64]
    chances: Array
    costs: Array
    spans: NDArray[np.int64]


@dataclass(slots=True)
class _Track:
    """A signal's decisions so far."""

    phases: list[Array] = field(default_factory=list)
    constraints: list[Array] = field(default_factory=list)
    present: list[int] = field(default_factory=list)
    actions: list[int] = field(default_factory=list)
    chances: list[float] = field(default_factory=list)
    costs: list[float] = field(default_factory=list)
    spans: list[int] = field(default_factory=list)

    def see(self, phases: Array, constraints: Array, present: int) -> None:
        self.phases.append(phases)
        self.constraints.append(constraints)
        self.present.append(present)

    def pay(self, cost: float) -> None:
        """Add what a decision time cost, to the last decision."""
        if self.actions:
            self.costs[-1] += cost * DISCOUNT ** self.spans[-1]
            self.spans[-1] += 1

    def close(self, junction: str) -> Trajectory:
        return Trajectory(
            junction=junction,
            phases=np.stack(self.phases).astype(np.float32),
            constraints=np.stack(self.constraints).astype(np.float32),
            present=np.array(self.present),
            actions=np.array(self.actions, np.int64),
            chances=np.array(self.chances, np.float32),
            costs=np.array(self.costs, np.float32),
            spans=np.array(self.spans, np.int64),
        )


def run_case(case: Case, weights: Mapping[str, Array]) -> list[Trajectory]:
    """Run an episode in a fork, so that it is the same whatever ran before in this process.

    Args:
        case: the episode.
        weights: of the policy's scores.

    Returns:
        What happened at each of its signals at which anything was decided.

    Raises:
        SimulationError: SUMO stopped.
    """
    found: list[Trajectory] = call_in_fork(_run, case, weights)
    return found


def _run(case: Case, weights: Mapping[str, Array]) -> list[Trajectory]:
    chance = np.random.default_rng(case.seed)
    with notes_unsaid(), closing(LocalWorld(build_config(**case.environment))) as world:
        world.reset(case.seed)
        readers = {signal: PhaseReader(view.plan) for signal, view in world.instant.signals.items()}
        tracks = {signal: _Track() for signal in readers}
        ended = False
        while not ended:
            actions, now = {}, world.instant
            for signal, reader in readers.items():
                view, track = now.signals[signal], tracks[signal]
                phases, constraints = reader.read(signal, now), reader.constraints(view)
                actions[signal] = view.phase
                if view.may_change and len(phases) > 1:
                    scores = score_phases(weights, phases, constraints, view.phase).astype(float)
                    shares = np.exp(scores - scores.max())
                    shares /= shares.sum()
                    actions[signal] = action = int(chance.choice(len(shares), p=shares))
                    track.see(phases, constraints, view.phase)
                    track.actions.append(action)
                    track.chances.append(float(np.log(shares[action])))
                    track.costs.append(0.0)
                    track.spans.append(0)
            _, _, ended, _ = world.step(actions)
            now = world.instant
            for signal, track in tracks.items():
                track.pay(measure_cost(signal, now, world.traffic.simulation))
        for signal, track in tracks.items():
            view = now.signals[signal]
            track.see(readers[signal].read(signal, now), readers[signal].constraints(view), view.phase)
    return [
        track.close(f"{case.scenario}/{signal}") for signal, track in tracks.items() if len(track.actions) > 1
    ]


def measure_cost(signal: str, instant: Instant, simulation: Simulation) -> float:
    """Measure what a decision time costs: who is slow, for how long vehicles wait, and who waits on foot.

    Who starts again is slow, too; so a stop costs more than the time for which one stands.

    Args:
        signal: its id.
        instant: the decision at which that time ends.
        simulation: stands at that decision.

    Returns:
        The cost, in vehicles that stand on the lanes to the signal and away from it.

    Raises:
        StaleInstantError: SUMO has moved on before it was measured.
    """
    view = instant.signals[signal]
    plan = view.plan
    return (
        simulation.measure_slowness(dict.fromkeys((*plan.lanes, *plan.upstream, *plan.out_lanes)))
        + WAITING * view.lanes.total_waiting
        + WALKERS * len(instant.list_wanted_walks(signal))
    )
