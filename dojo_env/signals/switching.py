"""How a signal goes from one green phase to another: walkers first, then yellow, then all-red, then green.

No SUMO here: a clock, the plan and the rules.
"""

from dojo_env.config import SignalConfig
from dojo_env.signals.conflicts import GREEN
from dojo_env.signals.plan import SignalPlan

_Stage = tuple[float, str]


class SignalSwitch:
    """What a signal shows, second by second. Requests that come too early are held, not refused.

    Attributes:
        phase: the phase that is green, or that the signal is on its way to.
        state: the letters to be shown now.
        green_time: seconds that `phase` has been green; 0 on the way to it.
    """

    def __init__(self, plan: SignalPlan, config: SignalConfig) -> None:
        """Begin with the first phase green, walkers of before long gone."""
        self._plan, self._config = plan, config
        self.phase, self.state, self.green_time = 0, plan.phases[0], 0.0
        self._clock = 0.0
        self._stages: list[_Stage] = []
        self._left = 0.0
        self._duration: float | None = None
        self._walk_ended: dict[int, float] = {}

    @property
    def is_changing(self) -> bool:
        """Tell whether the signal is between two greens."""
        return bool(self._stages)

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
        if not self._stages and self._duration is None:
            self._duration = seconds

    def advance(self) -> str:
        """Let a second pass; returns the letters to be shown from now on."""
        self._clock += 1
        if self._stages:
            self._left -= 1
            if self._left <= 0:
                self._next_stage()
        else:
            self.green_time += 1
            if self._is_over() and self.may_change and len(self._plan.phases) > 1:
                self._begin_change(self.next_phase)
        return self.state

    def _is_over(self) -> bool:
        limits = (self._config.max_green, self._duration)
        return any(limit is not None and self.green_time >= limit for limit in limits)

    def _begin_change(self, phase: int) -> None:
        old, new = self.state, self._plan.phases[phase]
        self.phase, self.green_time, self._duration = phase, 0.0, None
        lost = [k for k, (a, b) in enumerate(zip(old, new, strict=True)) if a in GREEN and b not in GREEN]
        gained = [k for k, (a, b) in enumerate(zip(old, new, strict=True)) if a not in GREEN and b in GREEN]
        crossing, yellow = self._plan.is_crossing, self._plan.yellow
        for link in (link for link in lost if crossing[link]):
            self._walk_ended[link] = self._clock
        cars = [link for link in lost if not crossing[link]]
        amber = max((float(yellow[link]) for link in cars), default=0.0)
        all_red = self._config.all_red if cars else 0.0
        walking = self._walking_time(gained)
        stopped = _replace(old, [link for link in lost if crossing[link]], "r")
        self._stages = [
            (max(0.0, walking - amber - all_red), stopped),
            (amber, _replace(stopped, cars, "y")),
            (all_red, _replace(stopped, cars, "r")),
        ]
        self._next_stage(first=True)

    def _walking_time(self, gained: list[int]) -> float:
        """Compute how long walkers must still be kept from the links that are about to turn green."""
        needed = 0.0
        for link, ended in self._walk_ended.items():
            if self._plan.conflicts.foes[link, gained].any():
                needed = max(needed, float(self._plan.clearance[link]) - (self._clock - ended))
        return needed

    def _next_stage(self, *, first: bool = False) -> None:
        """Go on to the next stage that lasts; after the last one comes the green."""
        if not first:
            self._stages.pop(0)
        while self._stages and self._stages[0][0] <= 0:
            self._stages.pop(0)
        if self._stages:
            self._left, self.state = self._stages[0]
        else:
            self.state = self._plan.phases[self.phase]


def _replace(state: str, links: list[int], letter: str) -> str:
    letters = list(state)
    for link in links:
        letters[link] = letter
    return "".join(letters)
