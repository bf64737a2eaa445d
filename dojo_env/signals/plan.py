"""What there is to control at a signal: its green phases, its links, and the times its changes need."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import chain

import numpy as np
from numpy.typing import NDArray

from dojo_env.config import SignalConfig
from dojo_env.errors import ConfigError
from dojo_maps.description import LinkKind, Program, RoadMap, Signal
from dojo_maps.index import MapIndex
from dojo_maps.short_repr import short_repr
from dojo_maps.signals.conflicts import Conflicts, list_walks, read_conflicts
from dojo_maps.signals.nema import list_cycle, list_pairs, show
from dojo_maps.signals.programs import GREEN, is_green
from dojo_maps.signals.timing import walking_time, whole, yellow_time

REACH = 150.0
"""Metres before the stop line within which vehicles are on their way to a signal: 10 s at 50 km/h."""
_LONGEST_CLEARANCE = 6.0
"""Seconds of all-red that a program may have; no green is as short."""
ROOM_OF_A_VEHICLE = 7.5
"""Metres: SUMO's usual car and the gap before it."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Green:
    """A green of the network's own program.

    Attributes:
        phase: the place of its state among the plan's phases.
        seconds: how long it lasts there.
        change: seconds from its end to the next green.
    """

    phase: int
    seconds: float
    change: float


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class SignalPlan:
    """All that controlling a signal needs to know of the map.

    Attributes:
        signal: its id.
        phases: the state of each green phase.
        conflicts: which links must not be green together.
        is_crossing: (n,) per link: it is for walkers alone.
        yellow: (n,) seconds of yellow after a link's green; 0 for walkers alone.
        red: (n,) seconds between a link's yellow and the next green that the program itself asks for.
        clearance: (n,) seconds that a walker needs to get across; 0 for vehicles alone.
        lanes: the lanes that lead to the signal, each once, in the order of their links.
        out_lanes: the lanes that lead away from it, in the same order.
        links: (index, from lane, to lane) of each vehicle link, with multiplicity.
        upstream: lanes by which vehicles come to `lanes` within 150 m, no other signal between.
        before: of each of `lanes` that is shorter than a vehicle, the lanes on which those stand who wait at
            its end; they are in `upstream`, too.
        walks: (index, crossing) of each way across on foot.
        exits: the lanes behind each vehicle link, each once.
        room: how many standing vehicles each of `out_lanes` holds.
        limits: (lanes,) speed limits, m/s.
        lengths: (lanes,) metres.
        is_of_program: the phases are those of the network's own program, not computed.
        greens: those of that program, in its order.
        starts: for each phase of that program, the seconds from the begin of its first green.
        changes: what differs from the network's own program, for people to read.
        rules: the constraints that hold for all who control it.
    """

    signal: str
    phases: tuple[str, ...]
    conflicts: Conflicts
    is_crossing: NDArray[np.bool_]
    yellow: NDArray[np.float64]
    red: NDArray[np.float64]
    clearance: NDArray[np.float64]
    lanes: tuple[str, ...]
    out_lanes: tuple[str, ...]
    links: tuple[tuple[int, str, str], ...]
    upstream: tuple[str, ...]
    before: Mapping[str, tuple[str, ...]]
    walks: tuple[tuple[int, str], ...]
    exits: Mapping[int, tuple[str, ...]]
    room: tuple[float, ...]
    limits: NDArray[np.float64]
    lengths: NDArray[np.float64]
    is_of_program: bool = True
    greens: tuple[Green, ...] = ()
    starts: tuple[float, ...] = ()
    changes: tuple[str, ...] = ()
    rules: SignalConfig = field(default_factory=SignalConfig)

    __repr__ = short_repr

    def list_links(self, lane: str) -> list[int]:
        """List a lane's links.

        Args:
            lane: one of `lanes`.

        Returns:
            Their indices, each once, in their order.
        """
        return list(dict.fromkeys(index for index, source, _ in self.links if source == lane))


def build_plan(road_map: RoadMap, signal: Signal, config: SignalConfig) -> SignalPlan:
    """Find out all that controlling a signal needs.

    Args:
        road_map: where the signal stands.
        signal: with all its programs, of which the last one counts.
        config: how phases are found, and the times of changes; kept as the plan's rules.

    Returns:
        The plan.

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
    program = signal.program
    own = [] if config.phases == "computed" or program is None else _program_phases(program, walked)
    wanted = own or _computed_phases(conflicts, links, walked, count)
    crossings = walked.copy()
    crossings[[index for index, _, _ in links]] = False
    safe = [conflicts.make_safe(state) for state in wanted]
    # A program may show the same letters twice; for who chooses phases, that is one.
    phases = tuple(dict.fromkeys(safe))
    place = {old: phases.index(new) for old, new in zip(wanted, safe, strict=True)}
    greens, starts = _list_greens(program if own else None, place)
    index = MapIndex(road_map)
    lane_of = index.lanes
    lanes = tuple(dict.fromkeys(source for _, source, _ in links))
    out_lanes = tuple(dict.fromkeys(target for _, _, target in links))
    before = _find_before(index, lanes)
    speeds = np.zeros(count)
    for letter, source, _ in links:
        speeds[letter] = max(speeds[letter], lane_of[source].speed)
    # A letter that no lane heeds is shown like the others: with yellow.
    yellow, red = _changes_of(program, config, speeds, crossings)
    return SignalPlan(
        signal=signal.id,
        phases=phases,
        conflicts=conflicts,
        is_crossing=crossings,
        yellow=yellow,
        red=red,
        clearance=_clearances(road_map, signal, count, config.walking_speed),
        lanes=lanes,
        out_lanes=out_lanes,
        links=links,
        upstream=tuple(dict.fromkeys([*_find_upstream(index, lanes), *chain(*before.values())])),
        before=before,
        walks=tuple((link, way) for link, way in list_walks(signal) if way in index.crossings),
        exits={
            link: tuple(dict.fromkeys(b for other, _, b in links if other == link)) for link, _, _ in links
        },
        room=tuple(max(lane_of[lane].length / ROOM_OF_A_VEHICLE - 1.0, 1.0) for lane in out_lanes),
        limits=np.array([max(lane_of[lane].speed, 0.1) for lane in lanes]),
        lengths=np.array([max(lane_of[lane].length, 0.1) for lane in lanes]),
        is_of_program=bool(own),
        greens=greens,
        starts=starts,
        changes=tuple(
            f"phase {number}: {old} shows {new}, as links of it conflict"
            for number, (old, new) in enumerate(zip(wanted, safe, strict=True))
            if old != new
        ),
        rules=config,
    )


def _program_phases(program: Program, crossings: NDArray[np.bool_]) -> list[str]:
    """Take the phases of the network's program that are green and no passage to another; NEMA's pairs.

    A phase in which walkers already have red while vehicles go on is the end of the phase before it. One that
    is for walkers alone counts where some of them have no other. A short one in which nobody goes but those
    who may go in another as well is a clearance for the rest.
    """
    if program.rings:
        green = [show(program, pair) for pair in list_pairs(program)]
    else:
        shown = [phase for phase in program.phases if is_green(phase.state)]
        green = [
            phase.state
            for phase in shown
            if phase.duration > _LONGEST_CLEARANCE or not any(_has_more(o.state, phase.state) for o in shown)
        ]

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


def _has_more(state: str, other: str) -> bool:
    """Tell whether all that is green in another state is so in this one, with the same right, and more."""
    pairs = list(zip(state, other, strict=False))
    return all(a == "G" or b not in GREEN or a == b for a, b in pairs) and any(
        a in GREEN and b not in GREEN for a, b in pairs
    )


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


def _changes_of(
    program: Program | None, config: SignalConfig, speeds: NDArray[np.float64], walks: NDArray[np.bool_]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Find each link's yellow, the setting's or its NEMA movement's where that is longer, and own red."""
    by_speed = isinstance(config.yellow_time, str)
    yellow = np.array([yellow_time(v) if by_speed else float(config.yellow_time) for v in speeds.tolist()])
    red = np.zeros(len(speeds))
    for phase in program.phases if program is not None and program.rings else ():
        green = np.array([letter in GREEN for letter in phase.state.ljust(len(speeds), "r")[: len(speeds)]])
        yellow[green] = np.maximum(yellow[green], whole(phase.yellow or 0.0))
        red[green] = np.maximum(red[green], whole(phase.red or 0.0))
    return np.where(walks, 0.0, yellow), np.where(walks, 0.0, red)


def _list_greens(
    program: Program | None, place: Mapping[str, int]
) -> tuple[tuple[Green, ...], tuple[float, ...]]:
    """List a program's greens in order, and when each of its phases begins, from the first green on."""
    if program is None:
        return tuple(Green(phase=k, seconds=0.0, change=0.0) for k in dict.fromkeys(place.values())), ()
    if program.rings:
        shown = [(show(program, pair), [program.phases[k] for k in pair]) for pair in list_cycle(program)]
        steps = [(min(p.max_duration or p.duration for p in movements), state) for state, movements in shown]
    else:
        steps = [(phase.duration, phase.state) for phase in program.phases]
    first = next(k for k, (_, state) in enumerate(steps) if state in place)
    greens: list[Green] = []
    starts = [0.0] * len(steps)
    time = 0.0
    for number in [*range(first, len(steps)), *range(first)]:
        seconds, state = steps[number]
        starts[number] = time
        time += seconds
        if state in place and greens and greens[-1].phase == place[state] and not greens[-1].change:
            greens[-1] = replace(greens[-1], seconds=greens[-1].seconds + seconds)
        elif state in place:
            greens.append(Green(phase=place[state], seconds=seconds, change=0.0))
        else:
            greens[-1] = replace(greens[-1], change=greens[-1].change + seconds)
    return tuple(greens), () if program.rings else tuple(starts)


def _find_upstream(index: MapIndex, lanes: Sequence[str]) -> tuple[str, ...]:
    """Find the lanes that lead to these ones within reach, up to where another signal stands."""
    left = {lane: REACH - index.lanes[lane].length for lane in lanes}
    found: dict[str, None] = {}
    while left:
        lane, metres = left.popitem()
        for connection in index.entering.get(lane, ()) if metres > 0 else ():
            source = connection.from_lane
            if connection.signal is None and source not in found and source not in lanes:
                found[source] = None
                left[source] = metres - index.lanes[source].length
    return tuple(found)


def _find_before(index: MapIndex, lanes: Sequence[str]) -> dict[str, tuple[str, ...]]:
    """Find where those stand who wait at the end of a lane that is too short for them."""
    found: dict[str, tuple[str, ...]] = {}
    for lane in lanes:
        if index.lanes[lane].length < ROOM_OF_A_VEHICLE:
            entering = index.entering.get(lane, ())
            ways = [*chain(*(each.via for each in entering))]
            ways += [each.from_lane for each in entering if each.signal is None]
            found[lane] = tuple(dict.fromkeys(way for way in ways if way not in lanes))
    return found


def _clearances(road_map: RoadMap, signal: Signal, count: int, speed: float) -> NDArray[np.float64]:
    """Compute the whole seconds that a walker needs from kerb to kerb."""
    seconds = np.zeros(count)
    shapes = {crossing.id: crossing.shape for crossing in road_map.crossings}
    for index, crossing in list_walks(signal):
        if crossing in shapes:
            length = float(np.linalg.norm(np.diff(shapes[crossing][:, :2], axis=0), axis=1).sum())
            seconds[index] = max(seconds[index], walking_time(length, speed))
    return seconds
