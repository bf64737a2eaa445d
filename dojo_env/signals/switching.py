"""How a signal goes from one green phase to another: walkers first, then yellow, then all-red, then green.

No SUMO here: a clock, the plan and the rules.
"""

import math

from dojo_env.config import SignalConfig
from dojo_env.signals.conflicts import GREEN
from dojo_env.signals.plan import SignalPlan

_Stage = tuple[float, str]


class SignalSwitch:
    """What a signal shows, second by second. Requests that come too early are held, not refused.

    Attributes:
        phase: the phase that is green, or that the signal is on its way to.
        state: the letters to be shown now.
    """

    def __init__(self, plan: SignalPlan, config: SignalConfig) -> None:
        """Begin with the first phase green, walkers of before long gone."""
        self._plan, self._config = plan, config
        self.phase, self.state = 0, plan.phases[0]
        self._clock = 0.0
        self._due = math.inf
        self._green_since = 0.0
        self._duration_is_set = False
        self._stages: list[_Stage] = []
        self._walk_ended: dict[int, float] = {}
        self._begin_green()

    @property
    def green_time(self) -> float:
        """Seconds that `phase` has been green; 0 on the way to it."""
        return 0.0 if self._stages else self._clock - self._green_since

    @property
    def may_change(self) -> bool:
        """Tell whether a change would be granted now."""
        return not self._stages and self.green_time >= self._config.min_green

    @property
    def next_phase(self) -> int:
        """The phase that follows in the plan's order."""
        return (self.phase + 1) % len(self._plan.phases)

    def request_phase(self, phase: int) -> bool:
        """Ask for a phase; tell whether a change begins."""
        if phase == self.phase or not self.may_change:
            return False
        self._begin_change(phase)
        return True

    def request_duration(self, seconds: float) -> None:
        """Say how long the present green lasts; only the first word in each green counts."""
        if self._stages or self._duration_is_set:
            return
        self._duration_is_set = True
        self._due = min(self._due, self._green_since + max(seconds, self._config.min_green))

    def advance(self) -> bool:
        """Let a second pass; tell whether other letters are to be shown."""
        self._clock += 1
        if self._clock < self._due:
            return False
        before = self.state
        if self._stages:
            self._stages.pop(0)
            self._begin_stage()
        elif len(self._plan.phases) > 1:
            self._begin_change(self.next_phase)
        return self.state != before

    def _begin_green(self) -> None:
        self.state, self._green_since, self._duration_is_set = (
            self._plan.phases[self.phase],
            self._clock,
            False,
        )
        limit = self._config.max_green
        self._due = math.inf if limit is None else self._clock + limit

    def _begin_change(self, phase: int) -> None:
        old, new = self.state, self._plan.phases[phase]
        self.phase = phase
        lost = [k for k, (a, b) in enumerate(zip(old, new, strict=True)) if a in GREEN and b not in GREEN]
        gained = [k for k, (a, b) in enumerate(zip(old, new, strict=True)) if a not in GREEN and b in GREEN]
        walks = [link for link in lost if self._plan.is_crossing[link]]
        cars = [link for link in lost if not self._plan.is_crossing[link]]
        self._walk_ended.update(dict.fromkeys(walks, self._clock))
        yellow = max((float(self._plan.yellow[link]) for link in cars), default=0.0)
        all_red = self._config.all_red if cars else 0.0
        walking = self._walking_time(gained)
        stopped = _replace(old, walks, "r")
        self._stages = [
            (max(0.0, walking - yellow - all_red), stopped),
            (yellow, _replace(stopped, cars, "y")),
            (all_red, _replace(stopped, cars, "r")),
        ]
        self._begin_stage()

    def _walking_time(self, gained: list[int]) -> float:
        """Compute how long walkers must still be kept from the links that are about to turn green."""
        needed = 0.0
        for link, ended in self._walk_ended.items():
            if self._plan.conflicts.foes[link, gained].any():
                needed = max(needed, float(self._plan.clearance[link]) - (self._clock - ended))
        return needed

    def _begin_stage(self) -> None:
        """Go on to the next stage that lasts; after the last one comes the green."""
        while self._stages and self._stages[0][0] <= 0:
            self._stages.pop(0)
        if not self._stages:
            self._begin_green()
            return
        seconds, self.state = self._stages[0]
        self._due = self._clock + seconds


def _replace(state: str, links: list[int], letter: str) -> str:
    letters = list(state)
    for link in links:
        letters[link] = letter
    return "".join(letters)
