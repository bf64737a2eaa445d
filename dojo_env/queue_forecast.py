"""How long vehicles would wait under each phase: a point queue per lane, run a minute ahead.

Whoever comes reaches the stop line at free flow, waits there for green and for those before him in his lane,
and leaves a headway behind them; who must yield waits for a gap, too. Each phase is tried now, for several
durations; after that whatever serves most. Who is not in sight yet counts for nothing.

Source: Vickrey, Congestion theory and transport investment, 1969, for the queues; Gartner, OPAC: a
demand-responsive strategy for traffic signal control, TRR 906, 1983, for the rolling horizon.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from dojo_env.instant import SignalView
from dojo_env.reading import HALTING, Approach
from dojo_env.rendering.compiling import inner, kernel
from dojo_env.signals.plan import SignalPlan
from dojo_maps.signals.programs import green_links

Floats = NDArray[np.float64]

_HORIZON = 60
"""Seconds ahead."""
_DURATIONS = np.array([5.0, 10.0, 15.0, 20.0, 30.0, 40.0])
"""Seconds for which a phase is tried."""
_DECIDES = 5
"""Seconds between the model's own decisions."""
_FREE_FLOW = 0.8
"""Share of the speed limit at which vehicles come."""
_HEADWAY, _START, _GAP = 1.9, 2.5, 3.0
"""Seconds: from one vehicle to the next, until the first one starts, and the gap in which somebody who yields
goes; nobody uses the yellow."""
_APART = 40.0
"""Metres to the vehicle ahead, or to the stop line, beyond which who stands does not stand in the queue."""
_BLOCKED = 10
"""Seconds for which nobody leaves a link that has no room behind it."""
_STAY, _YIELDING, _COMING, _SOON = 0.3, 0.4, 0.5, 12.0
"""What the model's own decisions count beside 1 for a vehicle that waits and has priority: for the present
phase, for one that yields, and for one that comes within so many seconds."""
_IMPATIENCE, _TIRED = 0.02, 40.0
"""How much more a second of waiting counts for each second that somebody has waited before, up to so many:
where all queues are full, phases must not change without end."""
_SINCE, _WENT = range(2)


class SignalModel(NamedTuple):
    """What never changes of a signal.

    Attributes:
        green: (phases, links) whether each link is green.
        first: (phases, links) whether it is green and yields to nobody.
        yields: (links, links) whether each yields to each.
        changes: (phases, phases) seconds of each change: yellow and red, or until walkers are across.
        min_green: seconds.
    """

    green: NDArray[np.bool_]
    first: NDArray[np.bool_]
    yields: NDArray[np.bool_]
    changes: Floats
    min_green: float


class _Queued(NamedTuple):
    """Who waits or comes, queue by queue.

    Attributes:
        bounds: (queues + 1,) the first of each queue among all.
        links: (n,) the link that each will take.
        arrivals: (n,) seconds until he reaches the stop line.
    """

    bounds: NDArray[np.int64]
    links: NDArray[np.int64]
    arrivals: Floats


class QueueForecast:
    """The queues of one signal.

    Attributes:
        signal: what never changes of it.
    """

    def __init__(self, plan: SignalPlan) -> None:
        """Note what never changes of a signal."""
        count = len(plan.phases[0])
        green = np.zeros((len(plan.phases), count), bool)
        for row, state in enumerate(plan.phases):
            green[row, list(green_links(state))] = True
        needed = np.maximum(plan.yellow + np.maximum(plan.red, plan.rules.all_red), plan.clearance)
        lost = green[:, None, :] & ~green[None, :, :]
        self.signal = SignalModel(
            green=green,
            first=np.array([[letter == "G" for letter in state] for state in plan.phases]),
            yields=np.array([plan.conflicts.yields[link][:count] for link in range(count)], bool),
            changes=np.where(lost, needed, 0.0).max(axis=2),
            min_green=float(plan.rules.min_green),
        )
        # A queue per lane, and one per way across on foot.
        self._queues = np.zeros(count, np.int64)
        self._speeds = np.full(count, np.inf)
        for link, lane, _ in plan.links:
            self._queues[link] = plan.lanes.index(lane)
            self._speeds[link] = plan.limits[self._queues[link]] * _FREE_FLOW
        room = dict(zip(plan.out_lanes, plan.room, strict=True))
        self._room = np.full(count, np.inf)
        for link, lanes in plan.exits.items():
            self._room[link] = max(1.0, sum(room[lane] for lane in lanes) / len(lanes))
        for place, (link, _) in enumerate(plan.walks):
            self._queues[link] = len(plan.lanes) + place
        self._count = len(plan.lanes) + len(plan.walks)

    def measure_delays(self, view: SignalView, approach: Approach, walks: tuple[int, ...]) -> Floats:
        """Run the queues ahead under each phase.

        Args:
            view: the signal as it is.
            approach: who is on the way to it.
            walks: the links at which somebody waits on foot.

        Returns:
            (phases,) seconds of waiting of all together, beyond those under the best phase; a second counts
            more for whom has waited for long.
        """
        came = [*approach.coming, *((link, 0.0, 0.0) for link in walks)]
        links = np.array([link for link, _, _ in came], np.int64)
        metres, speeds = np.array([(far, fast) for _, far, fast in came], float).reshape(-1, 2).T
        queues, stands = self._queues[links], speeds < HALTING
        waited = np.zeros(self._count)
        waited[: len(view.plan.lanes)] = view.lanes.accumulated_waiting
        waited /= np.maximum(np.bincount(queues[stands], minlength=self._count), 1)
        arrivals = np.where(stands, -waited[queues], metres / self._speeds[links])
        order = _leave_out_distant(np.lexsort((metres, queues)), queues, metres, stands)
        blocked = np.zeros(len(self._queues), bool)
        blocked[list(approach.blocked)] = True
        full = np.zeros(len(self._queues))
        full[list(approach.beyond)] = list(approach.beyond.values())
        full = np.minimum(full / self._room, 1.0)
        bounds = np.searchsorted(queues[order], np.arange(self._count + 1))
        queued = _Queued(bounds, links[order], arrivals[order])
        delays: Floats = _try_phases(queued, self.signal, blocked, full, view.phase, view.green_time)
        return delays - delays.min()


def _leave_out_distant(
    order: NDArray[np.int64], queues: NDArray[np.int64], metres: Floats, stands: NDArray[np.bool_]
) -> NDArray[np.int64]:
    """Leave out who stands far behind the queue, for whatever reason: green here does not help him."""
    kept: list[int] = []
    queue, ahead, is_apart = -1, 0.0, False
    for one in order:
        if queues[one] != queue:
            queue, ahead, is_apart = queues[one], 0.0, False
        is_apart = is_apart or bool(stands[one] and metres[one] - ahead > _APART)
        ahead = metres[one]
        if not (is_apart and stands[one]):
            kept.append(one)
    return np.array(kept, np.int64)


@kernel
def _try_phases(queued, signal, blocked, full, present, green_time):
    """Find the least delay of the plans that begin with each phase."""
    bounds, arrivals = queued.bounds, queued.arrivals
    for queue in range(len(bounds) - 1):
        for k in range(bounds[queue] + 1, bounds[queue + 1]):
            arrivals[k] = max(arrivals[k], arrivals[k - 1])  # Nobody overtakes in a lane.
    phases, links = signal.green.shape
    delays, heads, free = np.empty(phases), np.empty(len(bounds) - 1, np.int64), np.empty(len(bounds) - 1)
    # By link: since when it is green, and when the last one went.
    times = np.empty((2, links))
    for phase in range(phases):
        delays[phase] = np.inf
        for duration in _DURATIONS:
            for queue in range(len(heads)):
                heads[queue], free[queue] = bounds[queue], 0.0
            for link in range(links):
                times[_SINCE, link] = -np.inf if signal.green[present, link] else np.inf
                times[_WENT, link] = -np.inf
            shown, begun, delay = present, -green_time, 0.0
            for second in range(_HORIZON):
                if second % _DECIDES == 0 and second >= begun:
                    wanted = shown
                    if second < duration:
                        wanted = phase
                    elif second - begun >= signal.min_green:
                        wanted = _choose(shown, second, queued, signal, heads)
                    if wanted != shown:
                        begun = second + signal.changes[shown, wanted]
                        _change(shown, wanted, begun, signal, times)
                        shown = wanted
                delay += _discharge(shown, second, queued, signal, blocked, full, heads, free, times)
            delays[phase] = min(delays[phase], delay)
    return delays


@inner
def _choose(shown, second, queued, signal, heads):
    """Choose the phase that serves most of those who wait or come soon."""
    best, most = shown, -1.0
    for phase in range(len(signal.green)):
        served = _STAY if phase == shown else 0.0
        for queue in range(len(heads)):
            for k in range(heads[queue], queued.bounds[queue + 1]):
                link, arrival = queued.links[k], queued.arrivals[k]
                if signal.green[phase, link] and arrival <= second + _SOON:
                    one = 1.0 if signal.first[phase, link] else _YIELDING
                    served += one if arrival <= second else one * _COMING
        if served > most:
            best, most = phase, served
    return best


@inner
def _change(shown, wanted, begun, signal, times):
    """Note since when links are green."""
    for link in range(times.shape[1]):
        if signal.green[shown, link] and not signal.green[wanted, link]:
            times[_SINCE, link] = np.inf
        elif signal.green[wanted, link] and not signal.green[shown, link]:
            times[_SINCE, link] = begun + _START


@inner
def _discharge(shown, second, queued, signal, blocked, full, heads, free, times):
    """Let the first of each queue go who can; returns what this second of waiting counts."""
    waiting = 0.0
    for queue in range(len(heads)):
        k, last = heads[queue], queued.bounds[queue + 1]
        if k == last or queued.arrivals[k] > second:
            continue
        link = queued.links[k]
        goes = free[queue] <= second and times[_SINCE, link] <= second
        goes = goes and not (blocked[link] and second < _BLOCKED)
        if goes and not signal.first[shown, link]:
            for other in range(times.shape[1]):
                opposes = signal.yields[link, other] and signal.green[shown, other]
                goes = goes and not (opposes and times[_WENT, other] > second - _GAP)
        if goes:
            k += 1
            waiting += full[link] * (_HORIZON - second)  # He waits on, behind those who stand there.
            heads[queue], free[queue], times[_WENT, link] = k, second + _HEADWAY, second
        while k < last and queued.arrivals[k] <= second:
            waiting += 1.0 + _IMPATIENCE * min(second - queued.arrivals[k], _TIRED)
            k += 1
    return waiting
