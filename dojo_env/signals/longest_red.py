"""Nobody waits longer than the longest red: which phase must come now, whatever is asked for.

It only ever asks for a phase, as agents do. So the rules of `switching` hold, and with them their proof.
"""

import math
from collections.abc import Callable, Iterator, Sequence

from dojo_env.config import SignalConfig
from dojo_env.signals.plan import SignalPlan
from dojo_maps.signals.programs import GREEN, green_links

_USUAL_LIMIT = 120.0
_LOOKS = 3
"""How often one looks who waits in the time after which a red is old."""
_CYCLES = 1.5
"""A limit shorter than this many of the shortest cycles would leave nothing to choose."""


class LongestRed:
    """Watches for how long somebody at each link of a signal has seen no green.

    A red counts from its begin, or, where nobody is there after a third of the limit, from when somebody is.

    Attributes:
        limit: seconds; the configured ones, or longer where the signal's shortest cycle needs more.
    """

    def __init__(
        self,
        plan: SignalPlan,
        config: SignalConfig,
        *,
        interval: float,
        time: float,
        order: Sequence[int] | None = None,
    ) -> None:
        """Begin with all links red.

        Args:
            plan: of the signal.
            config: its times.
            interval: seconds from decision to decision.
            time: simulated seconds now.
            order: the phases in the order in which they come; None where any may be chosen.
        """
        self._plan, self._interval, self._order = plan, interval, order
        self._state = "r" * len(plan.phases[0])
        self._since = [time] * len(self._state)
        self._wanted: dict[int, float] = {}
        places = {lane: number for number, lane in enumerate(plan.lanes)}
        untold = {link for link, _ in plan.walks}
        untold |= {link for link, lane, _ in plan.links if lane in plan.before}
        self._lanes = {
            link: tuple({places[lane] for other, lane, _ in plan.links if other == link})
            for link, _, _ in plan.links
            if link not in untold
        }
        self._greens = [green_links(state) for state in plan.phases]
        changes = [self._longest_change(greens, config) for greens in self._greens]
        self._slots = [_whole(config.min_green + change, interval) for change in changes]
        self._change = max(changes)
        self._cycle = self._change + sum(self._slots[k] for k in order or range(len(self._slots)))
        shortest = _CYCLES * sum(self._slots)
        self.limit = math.inf if config.max_red is None else max(config.max_red, shortest)
        self._next_look = time
        self._early = (_USUAL_LIMIT if self.limit == math.inf else self.limit) / 3

    def look(self, time: float, state: str) -> float:
        """Note the letters shown from `time` on.

        Args:
            time: simulated seconds.
            state: the letters, one for each link index.

        Returns:
            The longest red that ends with them, seconds; 0 where none ends, or nobody is known to wait.
        """
        if state == self._state:
            return 0.0
        longest = 0.0
        for link, (before, now) in enumerate(zip(self._state, state, strict=False)):
            if before in GREEN:
                self._since[link] = time
            elif now in GREEN:
                longest = max(longest, time - self._wanted.pop(link, time))
        self._state = state
        return longest

    def decide(
        self, time: float, halting: Sequence[float], list_waiting: Callable[[set[int]], set[int]]
    ) -> float:
        """Note at a decision who waits.

        Args:
            time: simulated seconds.
            halting: (lanes,) standing vehicles on the plan's lanes.
            list_waiting: lists, of some links, those at which somebody stands; asked only where it is not
                known: who waits at a red stays there.

        Returns:
            For how many seconds somebody has seen no green at the most.
        """
        if time >= self._next_look:
            self._next_look = time + self._early / _LOOKS
            self._find_who_waits(time, halting, list_waiting)
        return time - min(self._wanted.values()) if self._wanted else 0.0

    def _find_who_waits(
        self, time: float, halting: Sequence[float], list_waiting: Callable[[set[int]], set[int]]
    ) -> None:
        limit = time - self._early
        old = [
            link
            for link, letter in enumerate(self._state)
            if letter not in GREEN and self._since[link] <= limit and self._is_busy(link, halting)
        ]
        wanted = self._wanted = {link: self._wanted[link] for link in old if link in self._wanted}
        unknown = {link for link in old if link not in wanted}
        for link in list_waiting(unknown) if unknown else ():
            is_new = time - self._since[link] <= self._early + self._early / _LOOKS + self._interval
            wanted[link] = self._since[link] if is_new else time

    def _is_busy(self, link: int, halting: Sequence[float]) -> bool:
        """Tell whether somebody may wait at a link; of walkers, and of short lanes, that is not known."""
        lanes = self._lanes.get(link)
        return lanes is None or any(halting[lane] for lane in lanes)

    def find_due(self, time: float, place: int, *, may_change: bool, is_asked: bool = False) -> int | None:
        """Find the phase that must come now, so that those who wait longest get green in time.

        They get it one after the other, longest first: is one of them too late then?

        Args:
            time: simulated seconds.
            place: of the present phase in the order in which they come.
            may_change: whether a change would be granted now; without it nothing is due.
            is_asked: whether a change is asked for, after which the next one has to wait for its green.

        Returns:
            The phase, or None where there is time left.
        """
        if not self._wanted or not may_change:
            return None
        if time - min(self._wanted.values()) + self._cycle < self.limit:
            return None  # Even a whole cycle would not be too long.
        red = {link: time - since for link, since in self._wanted.items()}
        until = self._change + (max(self._slots) if is_asked else self._interval)
        first, served = None, set[int]()
        for link in sorted(red, key=lambda link: -red[link]):
            if link in served:
                continue
            for phase in self._phases_up_to(link, red, place):
                first = phase if first is None else first
                served |= self._greens[phase]
                if link in served and red[link] + until >= self.limit:
                    return first
                until += self._slots[phase]
        return None

    def _phases_up_to(self, link: int, red: dict[int, float], place: int) -> Iterator[int]:
        """List the phases that come until a link is green: that one alone, where phases may be chosen."""
        order = self._order or range(len(self._greens))
        having = [k for k, phase in enumerate(order) if link in self._greens[phase]]
        if not having:
            return
        if self._order is None:
            yield max(having, key=lambda k: (sum(red.get(other, 0.0) for other in self._greens[k]), -k))
            return
        nearest = min((k - place) % len(order) for k in having)
        yield from (order[(place + k) % len(order)] for k in range(1, nearest + 1))

    def _longest_change(self, greens: frozenset[int], config: SignalConfig) -> float:
        """Compute how long it takes to leave a phase: yellow and red, or until its walkers are across."""
        plan = self._plan
        vehicles = [float(plan.yellow[k]) + max(float(plan.red[k]), config.all_red) for k in greens]
        walkers = [float(plan.clearance[k]) for k in greens]
        return max([*vehicles, *walkers], default=0.0)


def _whole(seconds: float, interval: float) -> float:
    return math.ceil(round(seconds / interval, 6)) * interval
