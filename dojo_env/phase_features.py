"""Each phase of a signal as one vector, for policies that serve any junction: what a green would let go.

A movement's vehicles are counted once for each phase that lets them go; links that yield count as far as
they can discharge beside those that they yield to. All else that decides is relative, too: for how long a
phase has been red, what changing to it costs, which walkers wait for it. So nothing depends on how many
approaches, lanes or phases a junction has, nor on their order.

Source: Zheng et al., Learning phase competition for traffic signal control (FRAP), CIKM 2019.
"""

import numpy as np
from numpy.typing import NDArray

from dojo_env.instant import Instant, SignalView
from dojo_env.signals.plan import SignalPlan
from dojo_maps.signals.programs import green_links

Array = NDArray[np.float32]

PHASE_FEATURES = (
    "is_present", "green_time", "red_time", "halting", "halting_yielding", "moving", "blocked", "waiting",
    "lanes", "walkers", "walkers_waiting", "room", "change", "kept", "delay",
)  # fmt: skip
"""The columns, see `PhaseReader.read`."""
CONSTRAINTS = ("min_green", "max_red", "yellow", "all_red", "may_change")
"""What a signal may do, see `PhaseReader.constraints`."""
_VEHICLES, _LANES, _MINUTE, _CHANGE, DELAY = 10.0, 4.0, 60.0, 10.0, 100.0
"""What one unit of a feature is: vehicles, lanes, seconds of green and red, of a change, of all's delay."""
_LONGEST, _MOST_DELAY = 3.0, 10.0
"""Minutes of green or red, and units of delay, beyond which nothing more is told."""
_WALKERS = 0.9
"""Seconds of delay for each second of red that somebody on foot waits at: the longer, the more they are."""


class PhaseReader:
    """Reads the vectors of one signal's phases; it remembers when each was green."""

    def __init__(self, plan: SignalPlan) -> None:
        """Note what never changes of a signal."""
        # numba takes a third of a second to load, which who only reads these names need not wait for.
        from dojo_env.queue_forecast import QueueForecast  # noqa: PLC0415

        self._plan, self._forecast = plan, QueueForecast(plan)
        self._green, self._first, self._yields, changes, _ = self._forecast.signal
        count = self._green.shape[1]
        self._is_walk = np.zeros(count, bool)
        self._is_walk[[link for link, _ in plan.walks]] = True
        self._lanes = np.zeros((count, len(plan.lanes)))
        """The share of a lane's vehicles that take each of its links."""
        for link, lane, _ in plan.links:
            self._lanes[link, plan.lanes.index(lane)] = 1.0
        self._serves = (self._green @ self._lanes > 0).sum(axis=1) / _LANES
        self._lanes /= np.maximum(self._lanes.sum(axis=0), 1.0)
        self._change = changes / _CHANGE
        kept = self._green.astype(float) @ self._green.T
        self._kept = kept / np.maximum(np.diag(kept)[:, None], 1.0)
        self._rules = np.array([
            plan.rules.min_green / 20, (plan.rules.max_red or 0.0) / 240, plan.yellow.max() / 5,
            max(plan.rules.all_red, plan.red.max()) / 5, 0.0,
        ], np.float32)  # fmt: skip
        self._last = np.zeros(len(plan.phases))
        self._begin: float | None = None

    def reset(self) -> None:
        """Begin an episode."""
        self._begin = None

    def read(self, signal: str, instant: Instant) -> Array:
        """Read the vectors at a decision, once for each.

        Args:
            signal: its id.
            instant: the decision.

        Returns:
            (phases, features): whether it is the present one; minutes of its green, or of its red; vehicles
            that stand and may go first, that stand and must yield, that move within 150 m, in tens; standing
            ones that have no room to go to, in tens; the logarithm of its lanes' seconds of waiting; lanes
            that it serves, by four; crossings at which somebody waits, and for how many minutes; standing
            vehicles behind it, in tens; ten seconds that the change to it takes; the share of the present
            greens that it keeps; in 100 s, the delay of `queue_forecast`, unless places are guessed, and that
            of walkers who see another phase.
        """
        view, approach = instant.signals[signal], instant.approach(signal)
        red = self._note(view, instant.time)
        count = self._green.shape[1]
        links = np.asarray(approach.links, int)
        stands = np.asarray(approach.halting, bool)
        halting = np.bincount(links[stands], minlength=count)[:count].astype(float)
        moving = np.bincount(links[~stands], minlength=count)[:count].astype(float)
        opposing = self._green @ ((halting + moving)[:, None] * self._yields.T)
        share = np.where(self._first, 1.0, 1.0 / (1.0 + opposing)) * self._green
        blocked = np.zeros(count, bool)
        blocked[list(approach.blocked)] = True
        free = share * ~blocked
        beyond = np.zeros(count)
        beyond[list(approach.beyond)] = list(approach.beyond.values())
        waiting = self._lanes @ view.lanes.accumulated_waiting
        walks, wanted = np.zeros(count, bool), instant.list_wanted_walks(signal)
        walks[list(wanted)] = True
        served = self._green & walks
        waited = np.where(served.any(axis=1), np.minimum(red, _LONGEST * _MINUTE), 0.0)
        delays = _WALKERS * (waited.max() - waited)
        if instant.tells_places:
            delays += self._forecast.measure_delays(view, approach, wanted)
        present = np.arange(len(red)) == view.phase
        columns = (
            present,
            np.where(present, min(view.green_time / _MINUTE, _LONGEST), 0.0),
            np.minimum(red / _MINUTE, _LONGEST),
            (free * self._first) @ halting / _VEHICLES,
            (free * ~self._first) @ halting / _VEHICLES,
            free @ moving / _VEHICLES,
            (self._green * blocked) @ halting / _VEHICLES,
            np.log1p(share @ waiting) / _VEHICLES,
            self._serves,
            served.sum(axis=1),
            waited / _MINUTE,
            (self._green * ~self._is_walk) @ beyond / np.maximum(self._green.sum(axis=1), 1) / _VEHICLES,
            self._change[view.phase],
            self._kept[view.phase],
            np.minimum(delays / DELAY, _MOST_DELAY),
        )
        return np.stack(columns, axis=1).astype(np.float32)

    def constraints(self, view: SignalView) -> Array:
        """Tell what the signal may do.

        Args:
            view: the signal.

        Returns:
            (5,): its least green in 20 s, its longest red in 240 s (0 for none), yellow and all-red in 5 s,
            and whether a change would be granted.
        """
        rules = self._rules.copy()
        rules[4] = view.may_change
        return rules

    def _note(self, view: SignalView, time: float) -> NDArray[np.float64]:
        """Note which links are green; returns for how many seconds each phase has not been."""
        if self._begin is None or time < self._begin:
            self._begin = time
            self._last[:] = time
        shown = {link for link, letter in enumerate(view.state) if letter in "Gg"}
        for phase, state in enumerate(self._plan.phases):
            if phase == view.phase or green_links(state) <= shown:
                self._last[phase] = time
        return time - self._last
