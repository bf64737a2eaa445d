"""How a signal goes from one green phase to another: walkers first, then yellow, then all-red, then green.

Who keeps green but loses priority, as a left turn whose arrow ends, yields for the time of a yellow before
the traffic starts that it must yield to.

No SUMO here: a clock, the plan and the rules. What a switch remembers is one value, so that `proof` can put
the very code that runs episodes into every state that it can reach.
"""

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace

from dojo_env.config import SignalConfig
from dojo_env.signals.plan import SignalPlan
from dojo_maps.signals.programs import GREEN

Stage = tuple[float, str]
"""Seconds, and the letters shown meanwhile."""


@dataclass(frozen=True, slots=True, kw_only=True)
class SwitchState:
    """All that a switch remembers; times are seconds on its clock.

    Attributes:
        phase: the phase that is green, or that the signal is on its way to.
        letters: what is shown.
        green_since: when `phase` turned green; 0 on the way to it.
        due: when the green, or the stage, ends by itself.
        duration_is_set: how long this green lasts has been asked for.
        stages: those of the change that are left, the present one first; none in a green.
        walk_ended: for each link on which walkers had green, when they last lost it.
    """

    phase: int
    letters: str
    green_since: float = 0.0
    due: float = math.inf
    duration_is_set: bool = False
    stages: tuple[Stage, ...] = ()
    walk_ended: tuple[tuple[int, float], ...] = ()


class SignalSwitch:
    """What a signal shows, second by second. Requests that come too early are no error, but change nothing.

    Attributes:
        clock: seconds since the switch began.
        now: what it remembers.
    """

    def __init__(self, plan: SignalPlan, config: SignalConfig, *, step: float = 1.0) -> None:
        """Begin with the first phase green, walkers of before long gone; `step` seconds pass at a time."""
        self._plan, self._config, self._step = plan, config, step
        self.clock = 0.0
        self.now = self._green(0, ())

    @property
    def phase(self) -> int:
        """The phase that is green, or that the signal is on its way to."""
        return self.now.phase

    @property
    def state(self) -> str:
        """The letters to be shown now."""
        return self.now.letters

    @property
    def green_time(self) -> float:
        """Seconds that `phase` has been green; 0 on the way to it."""
        return 0.0 if self.now.stages else self.clock - self.now.green_since

    @property
    def may_change(self) -> bool:
        """Tell whether a change would be granted now."""
        return not self.now.stages and self.green_time >= self._config.min_green

    @property
    def next_phase(self) -> int:
        """The phase that follows in the plan's order."""
        return (self.now.phase + 1) % len(self._plan.phases)

    def request_phase(self, phase: int) -> bool:
        """Ask for a phase.

        Args:
            phase: its place among the plan's phases.

        Returns:
            Whether a change begins. It does not where that phase is green already, during a change, and
            before the minimum green is over; the request is not remembered then.
        """
        if phase == self.now.phase or not self.may_change:
            return False
        self._begin_change(phase)
        return True

    def request_duration(self, seconds: float) -> None:
        """Say how long the present green lasts; only the first word in each green counts.

        Args:
            seconds: from the green's begin; the minimum and the maximum green hold nevertheless.
        """
        now = self.now
        if now.stages or now.duration_is_set:
            return
        due = min(now.due, now.green_since + max(seconds, self._config.min_green))
        self.now = replace(now, due=due, duration_is_set=True)

    def advance(self) -> bool:
        """Let a step pass; tell whether other letters are to be shown."""
        self.clock = round(self.clock + self._step, 3)
        before = self.now
        if self.clock < before.due:
            return False
        if before.stages:
            self.now = self._enter(before.phase, before.stages[1:], before.walk_ended)
        elif len(self._plan.phases) > 1:
            self._begin_change(self.next_phase)
        return self.now.letters != before.letters

    def _begin_change(self, phase: int) -> None:
        old, new = self.now.letters, self._plan.phases[phase]
        lost = [k for k, (a, b) in enumerate(zip(old, new, strict=True)) if a in GREEN and b not in GREEN]
        gained = [k for k, (a, b) in enumerate(zip(old, new, strict=True)) if _gains(a, b)]
        walks = [link for link in lost if self._plan.is_crossing[link]]
        cars = [link for link in lost if not self._plan.is_crossing[link]]
        shared = [link for link in cars if self._plan.clearance[link]]
        walk_ended = dict(self.now.walk_ended) | dict.fromkeys(walks, self.clock)
        yielding = self._list_yielding(new, gained)
        slowing = range(len(old)) if self._config.always_transition else (*cars, *yielding)
        yellow = max((float(self._plan.yellow[link]) for link in slowing), default=0.0)
        own = (float(self._plan.red[link]) for link in cars)
        all_red = max(self._config.all_red, *own) if cars else 0.0
        red = max(all_red, self._walking_time(gained, dict.fromkeys(shared, self.clock)))
        hold = max(0.0, self._walking_time(gained, walk_ended) - yellow - red)
        walk_ended |= dict.fromkeys(shared, self.clock + hold + yellow)
        stopped = _replace(_replace(old, walks, "r"), yielding, "g")
        stages = (
            (hold, stopped),
            (yellow, _replace(stopped, cars, "y")),
            (red, _replace(stopped, cars, "r")),
        )
        lasting = tuple(stage for stage in stages if stage[0] > 0)
        self.now = self._enter(phase, lasting, tuple(sorted(walk_ended.items())))

    def _list_yielding(self, new: str, gained: list[int]) -> list[int]:
        """List the vehicle links that lose priority to links that gain green."""
        if self._config.always_transition:
            return []
        foes, is_crossing = self._plan.conflicts.foes, self._plan.is_crossing
        changed = enumerate(zip(self.now.letters, new, strict=True))
        demoted = (link for link, (a, b) in changed if (a, b) == ("G", "g") and not is_crossing[link])
        return [link for link in demoted if foes[link, gained].any()]

    def _walking_time(self, gained: list[int], walk_ended: Mapping[int, float]) -> float:
        """Compute how long walkers must still be kept from the links that are about to turn green."""
        needed = 0.0
        for link, ended in walk_ended.items():
            if self._plan.conflicts.foes[link, gained].any():
                needed = max(needed, float(self._plan.clearance[link]) - (self.clock - ended))
        return needed

    def _enter(
        self, phase: int, stages: tuple[Stage, ...], walk_ended: tuple[tuple[int, float], ...]
    ) -> SwitchState:
        """Go on to the first of these stages; after the last one comes the green."""
        if not stages:
            return self._green(phase, walk_ended)
        seconds, letters = stages[0]
        due = round(self.clock + seconds, 3)
        return SwitchState(phase=phase, letters=letters, due=due, stages=stages, walk_ended=walk_ended)

    def _green(self, phase: int, walk_ended: tuple[tuple[int, float], ...]) -> SwitchState:
        limit = self._config.max_green
        return SwitchState(
            phase=phase,
            letters=self._plan.phases[phase],
            green_since=self.clock,
            due=math.inf if limit is None else self.clock + limit,
            walk_ended=walk_ended,
        )


def _gains(old: str, new: str) -> bool:
    """Tell whether a link turns green, or gets priority, and so no longer waits for its foes."""
    return (new in GREEN and old not in GREEN) or new == "G" != old


def _replace(state: str, links: Iterable[int], letter: str) -> str:
    letters = list(state)
    for link in links:
        letters[link] = letter
    return "".join(letters)
