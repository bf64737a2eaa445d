"""What signals observe beyond their own lanes: each movement by itself, or all signals of the network.

Both look alike for every signal of an environment, padded to the largest, so that one policy can serve all.
"""

from collections.abc import Mapping

import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from dojo_env.instant import Instant
from dojo_env.lane_features import place_features, read_features
from dojo_env.sensors.eyes import Eyes
from dojo_env.signals.plan import SignalPlan
from dojo_maps.signals.programs import green_links

Array = NDArray[np.float32]

MOVEMENT_FEATURES = ("halting", "moving", "is_green", "walkers")
"""The columns of `movements`, see `Movements`."""
NEIGHBOURS = 5
"""Signals in a neighbourhood, the signal itself among them; as many as in CoLight."""
_VEHICLES = 10.0


class Movements:
    """The traffic of each link of a signal, and which phases let it go.

    `movements` (m, 4): vehicles that stand and that move within 150 m, in tens, whether it is green, whether
    somebody waits to walk; `serves` (p, m): 1 where a phase lets a link go; `mask` (p,): 1 for each phase
    that there is; `may_change` (1,): a change would be granted.

    Source: Zheng et al., Learning phase competition for traffic signal control (FRAP), CIKM 2019.
    """

    def __init__(self, _eyes: Eyes, plans: Mapping[str, SignalPlan]) -> None:
        """Note which phases serve which links."""
        self._rows = max((len(plan.phases) for plan in plans.values()), default=0)
        self._links = max((len(plan.phases[0]) for plan in plans.values()), default=0)
        self._serves = {signal: self._place(plan) for signal, plan in plans.items()}
        self._masks = {
            signal: (np.arange(self._rows) < len(plan.phases)).astype(np.float32)
            for signal, plan in plans.items()
        }

    def _place(self, plan: SignalPlan) -> Array:
        serves = np.zeros((self._rows, self._links), np.float32)
        for row, state in enumerate(plan.phases):
            serves[row, list(green_links(state))] = 1.0
        return serves

    def space(self, signal: str) -> spaces.Dict:  # noqa: ARG002 - all alike
        """The same for every signal."""
        return spaces.Dict(
            movements=spaces.Box(0.0, np.inf, (self._links, len(MOVEMENT_FEATURES)), np.float32),
            serves=spaces.Box(0.0, 1.0, (self._rows, self._links), np.float32),
            mask=spaces.Box(0.0, 1.0, (self._rows,), np.float32),
            may_change=spaces.Box(0.0, 1.0, (1,), np.float32),
        )

    def reset(self, seed: int) -> None:
        """Nothing is kept between decisions."""

    def observe(self, signal: str, instant: Instant) -> dict[str, Array]:
        """Count who is on each link's way."""
        view, approach = instant.signals[signal], instant.approach(signal)
        links, stands = np.asarray(approach.links, int), np.asarray(approach.halting, bool)
        seen = np.zeros((self._links, len(MOVEMENT_FEATURES)), np.float32)
        seen[:, 0] = np.bincount(links[stands], minlength=self._links) / _VEHICLES
        seen[:, 1] = np.bincount(links[~stands], minlength=self._links) / _VEHICLES
        seen[list(green_links(view.state)), 2] = 1.0
        seen[list(instant.list_wanted_walks(signal)), 3] = 1.0
        return {
            "movements": seen,
            "serves": self._serves[signal],
            "mask": self._masks[signal],
            "may_change": np.array([view.may_change], np.float32),
        }


class Neighbours:
    """What every signal of the network observes, and who is near.

    `own` (w,): the signal's `features`, padded block by block to those of the largest; `everyone` (n, w): the
    same of all signals; `near` (n,): 1 for the signal itself and for the four that are nearest to it.

    Source: Wei et al., CoLight: learning network-level cooperation for traffic signal control, CIKM 2019.
    """

    def __init__(self, eyes: Eyes, plans: Mapping[str, SignalPlan]) -> None:
        """Find who is near whom."""
        self._names = tuple(plans)
        phases = [len(plan.phases) for plan in plans.values()]
        lanes = [len(plan.lanes) for plan in plans.values()]
        self._places = dict(zip(plans, place_features(phases, lanes), strict=True))
        self._width = max(phases, default=0) + 1 + 2 * max(lanes, default=0)
        self._near = dict(zip(plans, self._find_near(eyes), strict=True))
        self._instant: Instant | None = None
        self._everyone = np.zeros((len(plans), self._width), np.float32)

    def _find_near(self, eyes: Eyes) -> Array:
        corners = {junction.id: junction.polygon.mean(axis=0)[:2] for junction in eyes.road_map.junctions}
        signals = {signal.id: signal.junctions for signal in eyes.road_map.signals}
        places = np.array([np.mean([corners[j] for j in signals[name]], axis=0) for name in self._names])
        apart = np.linalg.norm(places[:, None] - places[None], axis=2)
        near = np.zeros_like(apart, np.float32)
        closest = np.argsort(apart, axis=1, kind="stable")[:, :NEIGHBOURS]
        np.put_along_axis(near, closest, 1.0, axis=1)
        return near

    def space(self, signal: str) -> spaces.Dict:  # noqa: ARG002 - all alike
        """The same for every signal."""
        count = len(self._names)
        return spaces.Dict(
            own=spaces.Box(0.0, 1.0, (self._width,), np.float32),
            everyone=spaces.Box(0.0, 1.0, (count, self._width), np.float32),
            near=spaces.Box(0.0, 1.0, (count,), np.float32),
        )

    def reset(self, seed: int) -> None:  # noqa: ARG002 - nothing is drawn
        """Forget the last decision."""
        self._instant = None

    def observe(self, signal: str, instant: Instant) -> dict[str, Array]:
        """Read all signals, once for each decision."""
        if instant is not self._instant:
            self._instant, self._everyone = instant, self._read(instant)
        return {
            "own": self._everyone[self._names.index(signal)],
            "everyone": self._everyone,
            "near": self._near[signal],
        }

    def _read(self, instant: Instant) -> Array:
        seen = np.zeros((len(self._names), self._width), np.float32)
        for row, (name, places) in enumerate(self._places.items()):
            seen[row, places] = read_features(instant.signals[name])
        return seen
