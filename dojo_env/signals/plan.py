"""What there is to control at a signal: its green phases, its links, and the times its changes need."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from dojo_env.config import SignalConfig
from dojo_env.errors import ConfigError
from dojo_env.signals.conflicts import GREEN, Conflicts, list_walks, read_conflicts
from dojo_maps.description import LinkKind, RoadMap, Signal

_REACTION, _BRAKING = 1.0, 3.05
"""Seconds and m/s². Source: ITE, Guidelines for Determining Traffic Signal Change and Clearance Intervals."""
_YELLOW_BOUNDS = (3.0, 6.0)
"""Seconds. Source: MUTCD 11th edition, section 4F.17."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class SignalPlan:
    """All that controlling a signal needs to know of the map.

    Attributes:
        signal: its id.
        phases: the state of each green phase.
        conflicts: which links must not be green together.
        is_crossing: (n,) per link: it is for walkers alone.
        yellow: (n,) seconds of yellow after a link's green; 0 for walkers alone.
        clearance: (n,) seconds that a walker needs to get across; 0 for vehicles alone.
        lanes: the lanes that lead to the signal, each once, in the order of their links.
        out_lanes: the lanes that lead away from it, in the same order.
        links: (index, from lane, to lane) of each vehicle link, with multiplicity.
        limits: (lanes,) speed limits, m/s.
        lengths: (lanes,) metres.
        changes: what differs from the network's own program, for people to read.
    """

    signal: str
    phases: tuple[str, ...]
    conflicts: Conflicts
    is_crossing: NDArray[np.bool_]
    yellow: NDArray[np.float64]
    clearance: NDArray[np.float64]
    lanes: tuple[str, ...]
    out_lanes: tuple[str, ...]
    links: tuple[tuple[int, str, str], ...]
    limits: NDArray[np.float64]
    lengths: NDArray[np.float64]
    changes: tuple[str, ...] = ()


def build_plan(road_map: RoadMap, signal: Signal, config: SignalConfig) -> SignalPlan:
    """Find out all that controlling a signal needs.

    Raises:
        ConfigError: the signal controls no vehicles.
    """
    links = tuple((k.index, k.from_id, k.to_id) for k in signal.links if k.kind is LinkKind.VEHICLE)
    if not links:
        raise ConfigError(f"signal {signal.id} controls no lane; leave it out with ts_ids")
    states = [phase.state for program in signal.programs for phase in program.phases]
    count = max([*map(len, states), *(link.index + 1 for link in signal.links)])
    conflicts = read_conflicts(road_map, signal, count)
    walked = np.zeros(count, dtype=bool)
    walked[[link.index for link in signal.links if link.kind is LinkKind.PEDESTRIAN]] = True
    own = [] if config.phases == "computed" else _program_phases(signal, walked)
    wanted = own or _computed_phases(conflicts, links, walked, count)
    crossings = walked.copy()
    crossings[[index for index, _, _ in links]] = False
    safe = [conflicts.make_safe(state) for state in wanted]
    # A program may show the same letters twice; for who chooses phases, that is one.
    phases = tuple(dict.fromkeys(safe))
    lane_of = {lane.id: lane for lane in road_map.lanes}
    lanes = tuple(dict.fromkeys(source for _, source, _ in links))
    speeds = np.zeros(count)
    for index, source, _ in links:
        speeds[index] = max(speeds[index], lane_of[source].speed)
    return SignalPlan(
        signal=signal.id,
        phases=phases,
        conflicts=conflicts,
        is_crossing=crossings,
        # A letter that no lane heeds is shown like the others: with yellow.
        yellow=np.where(crossings, 0.0, [_yellow(speed, config) for speed in speeds.tolist()]),
        clearance=_clearances(road_map, signal, count, config.walking_speed),
        lanes=lanes,
        out_lanes=tuple(dict.fromkeys(target for _, _, target in links)),
        links=links,
        limits=np.array([max(lane_of[lane].speed, 0.1) for lane in lanes]),
        lengths=np.array([max(lane_of[lane].length, 0.1) for lane in lanes]),
        changes=tuple(
            f"phase {number}: {old} shows {new}, as links of it conflict"
            for number, (old, new) in enumerate(zip(wanted, safe, strict=True))
            if old != new
        ),
    )


def _program_phases(signal: Signal, crossings: NDArray[np.bool_]) -> list[str]:
    """Take the phases of the network's program that are green and no passage to another.

    A phase in which walkers already have red while vehicles go on is the end of the phase before it. One that
    is for walkers alone counts where some of them have no other.
    """
    if not signal.programs:
        return []
    states = [phase.state for phase in signal.programs[-1].phases]
    green = [state for state in states if GREEN & set(state) and not set(state) & set("yYuoO")]

    def vehicles(state: str) -> str:
        return "".join(letter for letter, walk in zip(state, crossings, strict=False) if not walk)

    def walkers(state: str) -> set[int]:
        return {index for index in np.flatnonzero(crossings).tolist() if state[index] in GREEN}

    driven = [state for state in green if GREEN & set(vehicles(state))]
    beside = set[int]().union(*map(walkers, driven))
    return [
        state
        for state in green
        if (state in driven or walkers(state) - beside)
        and not any(vehicles(o) == vehicles(state) and walkers(o) > walkers(state) for o in green)
    ]


def _computed_phases(
    conflicts: Conflicts, links: tuple[tuple[int, str, str], ...], crossings: NDArray[np.bool_], count: int
) -> list[str]:
    """Build sets of links without any conflict: each begins with a link that no set before it has."""
    every = [*dict.fromkeys(index for index, _, _ in links), *np.flatnonzero(crossings).tolist()]
    covered: set[int] = set()
    phases = []
    for first in every:
        if first in covered:
            continue
        chosen = [first]
        for other in sorted(every, key=lambda index: index in covered):
            if other not in chosen and not conflicts.foes[other, chosen].any():
                chosen.append(other)
        covered.update(chosen)
        phases.append("".join("G" if index in chosen else "r" for index in range(count)))
    return phases


def _yellow(speed: float, config: SignalConfig) -> float:
    if not isinstance(config.yellow_time, str):
        return float(config.yellow_time)
    low, high = _YELLOW_BOUNDS
    return float(math.ceil(min(max(_REACTION + speed / (2 * _BRAKING), low), high)))


def _clearances(road_map: RoadMap, signal: Signal, count: int, speed: float) -> NDArray[np.float64]:
    """Compute the whole seconds that a walker needs from kerb to kerb."""
    seconds = np.zeros(count)
    shapes = {crossing.id: crossing.shape for crossing in road_map.crossings}
    for index, crossing in list_walks(signal):
        if crossing in shapes:
            length = float(np.linalg.norm(np.diff(shapes[crossing][:, :2], axis=0), axis=1).sum())
            seconds[index] = max(seconds[index], math.ceil(round(length / speed, 6)))
    return seconds
