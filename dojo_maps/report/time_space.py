"""Time-space diagrams: the green of coordinated signals along a street, and how traffic gets through it.

A row is a chain of signals that one meets driving straight on, all with fixed programs of one cycle time.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from html import escape
from itertools import pairwise

import numpy as np

from dojo_maps.description import Connection, Program, RoadMap

_FARTHEST = 1200.0
"""Metres from one signal to the next; platoons do not hold together longer."""
_STEP = 0.5
_WIDTH, _LEFT, _ROW_END = 420.0, 120.0, 18.0
_METRE, _LEAST_GAP = 0.28, 26.0
"""Pixels: of a metre, and between two signals at least."""
_CYCLES = 2
_MOST = 12


@dataclass(frozen=True, slots=True, kw_only=True)
class Stop:
    """A signal on the way.

    Attributes:
        signal: its id.
        link: index of the link that goes straight on.
        metres: from the first signal's stop line.
        seconds: after the first signal's stop line, at the limit.
    """

    signal: str
    link: int
    metres: float
    seconds: float


def find_rows(road_map: RoadMap) -> list[tuple[str, list[Stop]]]:
    """Find the longest rows of coordinated signals.

    Args:
        road_map: whose signals' programs count, of several the one that SUMO runs.

    Returns:
        At most 12 rows, those of most signals first: the first road's name, or its id where it has none, and
        the stops in driving order, two or more.
    """
    programs = {s.id: s.program for s in road_map.signals if s.program is not None}
    walker = _Walker(road_map, programs)
    rows = [row for start in road_map.connections if len(row := list(walker.follow(start))) > 1]
    rows.sort(key=lambda row: (-len(row), -row[-1][1].metres))
    kept: list[tuple[str, list[Stop]]] = []
    seen: set[tuple[str, int]] = set()
    for row in rows:
        places = {(stop.signal, stop.link) for _, stop in row}
        if not places <= seen:
            kept.append((row[0][0], [stop for _, stop in row]))
        # Lanes side by side make the same row.
        seen |= places | {key for _, stop in row for key in walker.beside(stop)}
    return kept[:_MOST]


class _Walker:
    """Drives straight on from signal to signal."""

    def __init__(self, road_map: RoadMap, programs: dict[str, Program]) -> None:
        self.programs = programs
        self.lanes = {lane.id: lane for lane in road_map.lanes}
        self.names = {road.id: road.name or road.id for road in road_map.roads}
        self.straight: dict[str, Connection] = {}
        for connection in road_map.connections:
            if connection.direction == "s":
                self.straight.setdefault(connection.from_lane, connection)
        self.links: dict[tuple[str, str], set[int]] = {}
        for connection in road_map.connections:
            if connection.direction == "s" and connection.signal and connection.link_index is not None:
                road = self.lanes[connection.from_lane].road
                self.links.setdefault((connection.signal, road), set()).add(connection.link_index)
        self.road_of = {(s, link): road for (s, road), links in self.links.items() for link in links}

    def beside(self, stop: Stop) -> set[tuple[str, int]]:
        """List the links that go straight on from the same road."""
        road = self.road_of[stop.signal, stop.link]
        return {(stop.signal, link) for link in self.links[stop.signal, road]}

    def follow(self, start: Connection) -> Iterator[tuple[str, Stop]]:
        """Give the stops from a link on, while programs have one cycle time and the next is near."""
        metres = seconds = gap = 0.0
        cycle, connection, seen = None, start, set[str]()
        while connection.direction == "s":
            signal, link = connection.signal, connection.link_index
            if signal in self.programs and link is not None and signal not in seen:
                program = self.programs[signal]
                if program.kind != "static" or (cycle is not None and _cycle(program) != cycle):
                    return
                cycle, gap = _cycle(program), 0.0
                seen.add(signal)
                road = self.names[self.lanes[connection.from_lane].road]
                yield road, Stop(signal=signal, link=link, metres=metres, seconds=seconds)
            elif cycle is None:
                return
            lane = self.lanes[connection.to_lane]
            length = lane.length + float(np.hypot(*np.diff(connection.shape[:, :2], axis=0).T).sum())
            gap += length
            metres += length
            seconds += length / max(1.0, lane.speed)
            following = self.straight.get(lane.id)
            if gap > _FARTHEST or following is None:
                return
            connection = following


def draw_row(road_map: RoadMap, name: str, stops: list[Stop]) -> str:
    """Draw a row's time-space diagram: seconds to the right, two cycles of them, metres up.

    Args:
        road_map: whose signals' programs are drawn, of several the one that SUMO runs.
        name: of the first road, for those who cannot see the picture.
        stops: a row of `find_rows`.

    Returns:
        An SVG element.
    """
    programs = {s.id: s.program for s in road_map.signals if s.program is not None}
    cycle = _cycle(programs[stops[0].signal])
    gaps = [max(_LEAST_GAP, _METRE * (b.metres - a.metres)) for a, b in pairwise(stops)]
    height = sum(gaps) + 60
    rows = [height - 40 - sum(gaps[:k]) for k in range(len(stops))]
    second = _WIDTH / (_CYCLES * cycle)
    parts = list(_drives(programs[stops[0].signal], stops, rows, second, cycle))
    for stop, y in zip(stops, rows, strict=True):
        parts += [
            f'<rect x="{_LEFT:.1f}" y="{y - 3:.1f}" width="{_WIDTH:.1f}" height="6" fill="#d9483b"/>',
            *(
                f'<rect x="{_LEFT + a * second:.1f}" y="{y - 3:.1f}" width="{(b - a) * second:.1f}" '
                'height="6" fill="#0f9d58"/>'
                for a, b in _greens(programs[stop.signal], stop.link, cycle)
            ),
            f'<text x="0" y="{y + 4:.1f}">{escape(stop.signal[:14])}</text>',
            f'<text x="{_LEFT - 4:.0f}" y="{y - 7:.1f}" text-anchor="end" fill="#5b6472">'
            f"{stop.metres:.0f} m</text>",
        ]
    for tick in range(_CYCLES + 1):
        x = _LEFT + tick * cycle * second
        parts.append(f'<text x="{x:.0f}" y="{height - 8:.0f}" text-anchor="middle">{tick * cycle:g} s</text>')
    width = _LEFT + _WIDTH + _ROW_END
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" width="{width:.0f}" height="{height:.0f}" '
        f'viewBox="0 0 {width:.0f} {height:.0f}" role="img" font-family="sans-serif" font-size="11" '
        f'aria-label="{escape(f"time-space diagram along {name}")}">{"".join(parts)}</svg>'
    )


def _drives(
    program: Program, stops: list[Stop], rows: list[float], second: float, cycle: float
) -> Iterator[str]:
    """Draw who leaves the first stop line as its green begins and ends, at the limit."""
    yield f'<svg x="{_LEFT:.0f}" width="{_WIDTH:.0f}">'  # What goes on beyond its side is cut off.
    for begin, end in _greens(program, stops[0].link, cycle):
        there = [((begin + stop.seconds) * second, y) for stop, y in zip(stops, rows, strict=True)]
        back = [((end + stop.seconds) * second, y) for stop, y in zip(stops, rows, strict=True)]
        points = " ".join(f"{x:.1f},{y:.1f}" for x, y in there + back[::-1])
        yield f'<polygon points="{points}" fill="#0b6bcb" fill-opacity=".16" stroke="#0b6bcb"/>'
    yield "</svg>"


def _greens(program: Program, link: int, cycle: float) -> Iterator[tuple[float, float]]:
    """Give the spans of green of a link within the shown cycles, seconds."""
    spans: list[tuple[float, float]] = []
    for turn in range(-1, _CYCLES):
        at = turn * cycle + program.offset % cycle
        for phase in program.phases:
            begin, end = max(0.0, at), min(_CYCLES * cycle, at + phase.duration)
            at += phase.duration
            if begin >= end or phase.state[link : link + 1] not in ("g", "G"):
                continue
            if spans and abs(spans[-1][1] - begin) < _STEP:
                spans[-1] = (spans[-1][0], end)
            else:
                spans.append((begin, end))
    yield from spans


def _cycle(program: Program) -> float:
    return sum(phase.duration for phase in program.phases)
