"""How many vehicles per hour each way across a junction can take, given what goes on the others.

Under a signal that is the saturation flow times the share of the cycle that is green, as in the Highway
Capacity Manual (7th edition, chapter 19: c = s g / C). Who yields, with a signal or without, goes in the gaps
of those that it must let go (chapters 19 and 20): with none left it does not go at all. A green that yields
has no gaps until the queue that it waits for has gone.
"""

import math
from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from dojo_maps.description import Connection, Program, RoadMap
from dojo_maps.geometry.polylines import Flags
from dojo_maps.index import MapIndex
from dojo_maps.signals.conflicts import list_foes

SATURATION_FLOW = 1_800.0
"""Vehicles per hour of green and lane; the manual's base is 1,900 passenger cars."""
_LOST = 2.0
"""Seconds of each green that starting and clearing take."""
_PERMITTED = (5.5, 3.5)
"""Seconds that a gap must have for one vehicle to go in a green that yields, and for each that follows it."""
_MAJOR, _MINOR = (600.0, 6.0, 3.5), (400.0, 10.0, 5.0)
_UNSIGNALLED = {"M": (1_200.0, 0.0, 0.0), "o": (1_200.0, 0.0, 0.0), "m": _MAJOR, "=": (500.0, 8.0, 4.5)}
"""By the state of a link without a signal: vehicles per hour at most, and seconds of gaps as above; of `m`,
those who turn off the main road. Gaps are longer than the manual's: measured in SUMO."""
_WAITING_INSIDE = 1.0
"""Vehicles that wait on the junction and go when the green ends, of a link that lets them."""
_ON_FOOT, _WALK = 30.0, 6.0
"""People per hour each way over a crossing, and seconds for which they keep who turns from going."""
_LEAST = 20.0
_LONGEST_CYCLE = 3_600.0
_VEHICLE, _CRAMPED = 7.5, 0.25
"""Metres that one takes as it stands, and how many stand on average where there is less."""
_SORTED = 20.0
"""Metres of a road from which vehicles of different lanes wait beside each other and not behind."""


@dataclass(frozen=True, slots=True, kw_only=True)
class _Green:
    """A phase in which a link is green: seconds, and whom it lets go first then; None where nobody."""

    duration: float
    rivals: tuple[str, ...] | None
    crossings: int


@dataclass(frozen=True, slots=True, kw_only=True)
class _Signalled:
    """The greens of a link, its cycle and its red, seconds, and how often a cycle it turns green."""

    greens: tuple[_Green, ...]
    cycle: float
    starts: int
    waits_inside: bool

    @property
    def green(self) -> float:
        """Seconds of green in a cycle."""
        return sum(green.duration for green in self.greens)


class Capacities:
    """The ways across all junctions of a map, and who waits for whom."""

    def __init__(self, road_map: RoadMap) -> None:
        """Read rights of way and each signal's first program."""
        self._lanes = MapIndex(road_map).lanes
        self._links = {link.id: link for link in road_map.connections}
        self._ways_on: dict[str, set[str]] = defaultdict(set)
        for link in self._links.values():
            self._ways_on[self._lanes[link.from_lane].road].add(self._lanes[link.to_lane].road)
        self._main_roads = {
            self._lanes[link.from_lane].road for link in self._links.values() if link.state == "M"
        }
        self._rivals: dict[str, list[str]] = defaultdict(list)
        self._inside: set[str] = set()
        for junction in road_map.junctions:
            self._inside.update(way.link for way in junction.right_of_way if way.cont)
            for pair in list_foes(junction):
                if pair.one_waits:
                    self._rivals[pair.one].append(pair.other)
                if pair.other_waits:
                    self._rivals[pair.other].append(pair.one)
        walks = {
            crossing.id: (crossing.signal, crossing.link_index)
            for crossing in road_map.crossings
            if crossing.signal is not None
        }
        self._places = walks | {link.id: (link.signal, link.link_index) for link in self._links.values()}
        programs = self._programs = {
            signal.id: signal.program
            for signal in road_map.signals
            if signal.program is not None and signal.program.phases
        }
        self._signalled = {
            link.id: self._read(link, programs[link.signal], link.link_index)
            for link in self._links.values()
            if link.signal in programs and link.link_index is not None
        }

    def of(self, flows: Mapping[str, float]) -> dict[str, float]:
        """Give each connection's capacity, vehicles per hour.

        Args:
            flows: vehicles per hour on connections, by their ids.

        Returns:
            Vehicles per hour by the connections' ids, for every connection of the map; 20 at least.
        """
        return {
            id_: max(
                self._with_signal(self._signalled[id_], flows)
                if id_ in self._signalled
                else self._without(link, flows),
                _LEAST,
            )
            for id_, link in self._links.items()
        }

    def rooms(self, ways: Sequence[Sequence[Connection]]) -> Iterator[tuple[str, float]]:
        """Give each last road before a signal with the vehicles per hour that get there and block nobody.

        Who does not find the signal green must find room between it and the one before, or blocks the
        junction there; or between it and the last road from which others go elsewhere.

        Args:
            ways: a route: the connections from each road to the next, one a lane.

        Yields:
            A road's id and its vehicles per hour, in driving order; nothing before the route has come from a
            signal or from a road from which others go elsewhere.
        """
        before: Sequence[Connection] | None = None
        length = 0.0
        for links in ways:
            lane = self._lanes[links[0].from_lane]
            program = self._programs.get(links[0].signal or "")
            length += lane.length
            if program is not None and before is not None:
                room = self._room(before, links, length)
                if lane.length < _SORTED:
                    green = float(_timeline(program, links[0].link_index or 0).mean())
                    room = min(room, len(before) * max(green * SATURATION_FLOW, _LEAST))
                yield lane.road, room
            if program is not None or len(self._ways_on[lane.road]) > 1:
                before, length = links, 0.0

    def _room(self, entering: Sequence[Connection], leaving: Sequence[Connection], length: float) -> float:
        one, other = (self._programs.get(links[0].signal or "") for links in (entering, leaving))
        first, second = entering[0].link_index or 0, leaving[0].link_index or 0
        standing = len(leaving) * max(length // _VEHICLE, _CRAMPED)
        after = _timeline(other, second) if other is not None else np.ones(1, dtype=bool)
        if one is None:
            return standing * 3600 / max(int((~after).sum()), 1)
        before = _timeline(one, first)
        if one is other:
            speed = self._lanes[leaving[0].from_lane].speed
            share = float((before & np.roll(after, -round(length / max(speed, 1.0)))).mean())
        else:
            share = float(before.mean() * after.mean())
        lanes = min(len(entering), len(leaving))
        return lanes * share * SATURATION_FLOW + standing * 3600 / len(after)

    def _read(self, link: Connection, program: Program, index: int) -> _Signalled:
        letters = [phase.state[index : index + 1] for phase in program.phases]
        greens = [
            self._green(link, phase.duration, phase.state, letter)
            for phase, letter in zip(program.phases, letters, strict=True)
            if letter in ("G", "g", "O", "o")
        ]
        before = [letters[-1], *letters]
        return _Signalled(
            greens=tuple(greens),
            cycle=sum(phase.duration for phase in program.phases),
            starts=sum(
                now in ("G", "g") and then not in ("G", "g")
                for then, now in zip(before, letters, strict=False)
            ),
            waits_inside=link.id in self._inside,
        )

    def _green(self, link: Connection, duration: float, state: str, letter: str) -> _Green:
        if letter not in ("g", "o"):
            return _Green(duration=duration, rivals=None, crossings=0)
        going = [rival for rival in self._rivals[link.id] if self._is_green(rival, link.signal, state)]
        rivals = tuple(rival for rival in going if rival in self._links)
        return _Green(duration=duration, rivals=rivals, crossings=len(going) - len(rivals))

    def _is_green(self, way: str, signal: str | None, state: str) -> bool:
        of, index = self._places.get(way, (None, None))
        return of != signal or index is None or state[index : index + 1] in ("G", "g")

    def _with_signal(self, link: _Signalled, flows: Mapping[str, float]) -> float:
        if link.cycle <= 0:
            return 0.0
        going = sum(self._in_green(green, flows) for green in link.greens)
        if link.waits_inside and any(green.rivals for green in link.greens):
            going += _WAITING_INSIDE
        lost = _LOST * link.starts * SATURATION_FLOW / 3600
        most = max(link.green * SATURATION_FLOW / 3600 - lost, 0.0)
        return min(going, most) * 3600 / link.cycle

    def _in_green(self, green: _Green, flows: Mapping[str, float]) -> float:
        """Tell how many vehicles go in a phase."""
        if green.rivals is None:
            return green.duration * SATURATION_FLOW / 3600
        queue = max((self._queue(rival, flows) for rival in green.rivals), default=0.0)
        left = max(green.duration - queue - _WALK * green.crossings * _ON_FOOT / 60, 0.0)
        against = sum(flows.get(rival, 0.0) for rival in green.rivals)
        return left / 3600 * min(_flow_in_gaps(against, *_PERMITTED), SATURATION_FLOW)

    def _queue(self, rival: str, flows: Mapping[str, float]) -> float:
        """Tell how many seconds of its green a link needs for those who came while it was red."""
        link, flow = self._signalled.get(rival), flows.get(rival, 0.0)
        if link is None or flow >= SATURATION_FLOW:
            return 0.0
        return (link.cycle - link.green) * flow / (SATURATION_FLOW - flow)

    def _without(self, link: Connection, flows: Mapping[str, float]) -> float:
        minor = link.state == "m" and self._lanes[link.from_lane].road not in self._main_roads
        most, gap, following = _MINOR if minor else _UNSIGNALLED.get(link.state, _MINOR)
        against = sum(flows.get(rival, 0.0) for rival in self._rivals[link.id])
        return min(most, _flow_in_gaps(against, gap, following)) if gap else most


def _timeline(program: Program, index: int) -> Flags:
    """Tell for each second of a cycle whether a link is green: (seconds,); of very long cycles, a sample."""
    cycle = sum(phase.duration for phase in program.phases)
    step = max(1.0, cycle / _LONGEST_CYCLE)
    parts = [
        np.full(round(phase.duration / step), phase.state[index : index + 1] in ("G", "g"))
        for phase in program.phases
    ]
    whole: Flags = np.concatenate(parts)
    return whole if len(whole) else np.ones(1, dtype=bool)


def _flow_in_gaps(against: float, gap: float, following: float) -> float:
    """Tell how many vehicles per hour go in the gaps of others. Source: Harders, 1968.

    Args:
        against: vehicles per hour that are let go.
        gap: seconds that one needs.
        following: seconds that each further one needs.
    """
    if against < 1.0:
        return 3600 / following
    return against * math.exp(-against * gap / 3600) / -math.expm1(-against * following / 3600)
