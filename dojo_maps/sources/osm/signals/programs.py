"""Give each signal of a network the program that a city would run, timed by speeds, widths and crossings."""

import math
import re
from collections.abc import Sequence
from dataclasses import dataclass

from dojo_maps.description import RoadMap
from dojo_maps.signals.timing import clearing_time, walking_time, yellow_time
from dojo_maps.sources.osm.signals.stage_order import order_stages
from dojo_maps.sources.osm.signals.stages import SignalLink, Stage, build_stages, letters_of, read_links

_WALK = 7
"""Seconds that people see green. Source: MUTCD, 4I.06."""
_GREEN, _MAJOR_GREEN, _TURN_GREEN = 20, 32, 10
"""Seconds of green on streets, on wide roads and for protected turns, before walkers ask for more."""
_MAJOR_LANES = 4
_SLOWEST = 8.0
"""Metres a second of who clears a junction."""
_LONGEST = 120
"""Seconds of a cycle that are not exceeded unless walkers need them."""
_LONGEST_REPEATED = 130
"""Seconds of a cycle in which a stage may come twice, so that a short road is cleared in time."""
_LEAST = 7
_STORES_FEW = 20.0
"""Metres of a road between stop lines up to which those who come last in a green would stand back from it."""
_LONGEST_LAG = 6
"""Seconds of green that such a road has longer at most; what is longer counts as a green of its own."""

PhaseRow = tuple[int, str]
"""Seconds and the letters of a phase."""


@dataclass(frozen=True, slots=True, kw_only=True)
class _Change:
    """What lies between the greens of two stages, seconds.

    Attributes:
        yellow: of the links that end.
        red: after the last yellow.
        late: links of short roads that the others fill, and so end later.
        lag: between the yellow of the others and theirs.
        late_yellow: theirs.
    """

    yellow: int = 0
    red: int = 0
    late: frozenset[int] = frozenset()
    lag: int = 0
    late_yellow: int = 0

    @property
    def seconds(self) -> int:
        """All of it."""
        return self.yellow + self.lag + self.late_yellow + self.red


def program_signals(data: bytes, road_map: RoadMap) -> bytes:
    """Replace the programs of a network as netconvert writes it.

    Args:
        data: the network.
        road_map: what it holds.

    Returns:
        The network with other phases in its programs.
    """
    text = data.decode("utf-8")
    for signal in road_map.signals:
        phases = compute_program(read_links(road_map, signal))
        rows = "".join(f'        <phase duration="{time}" state="{state}"/>\n' for time, state in phases)
        name = re.escape(_escaped(signal.id))
        pattern = re.compile(rf'(    <tlLogic id="{name}"[^>]*>\n).*?(    </tlLogic>\n)', re.DOTALL)
        text = pattern.sub(lambda found, rows=rows: found[1] + rows + found[2], text, count=1)  # type: ignore[misc]
    return text.encode("utf-8")


def compute_program(links: dict[int, SignalLink]) -> list[PhaseRow]:
    """Compute the phases of a signal: green, green without walkers, yellow and all-red of each stage.

    Args:
        links: of the signal, by index, one at least, as `read_links` collects them.

    Returns:
        The seconds of each phase, and a letter for each index up to the highest, `r` where it has no link;
        one phase of green where a single stage serves all.
    """
    stages = build_stages(links)
    if len(stages) < 2:
        size = max(links) + 1
        states = [letters_of(links, stage) for stage in stages]
        return [(_LONGEST // 2, _state(size, letters)) for letters in states]
    repeated, once = order_stages(links, stages)
    rows = _time_stages(links, repeated)
    return rows if sum(seconds for seconds, _ in rows) <= _LONGEST_REPEATED else _time_stages(links, once)


def _time_stages(links: dict[int, SignalLink], stages: Sequence[Stage]) -> list[PhaseRow]:
    """Compute the phases of stages that follow each other."""
    changes = [
        _change(links, stage, following)
        for stage, following in zip(stages, [*stages[1:], stages[0]], strict=True)
    ]
    greens = _green_times(links, stages, changes)
    phases: list[PhaseRow] = []
    for number, stage in enumerate(stages):
        phases += _stage_phases(
            links, stage, stages[(number + 1) % len(stages)], greens[number], changes[number]
        )
    return _joined(phases)


def _change(links: dict[int, SignalLink], stage: Stage, following: Stage) -> _Change:
    """Find what lies between two stages."""
    ending = stage.vehicles - following.vehicles
    if not ending:
        return _Change()
    fed = {links[k].onto for k in ending} - {""}
    short = (k for k in ending if links[k].room < _STORES_FEW and not links[k].cycles)
    late = frozenset(k for k in short if links[k].road in fed)
    feeding = [links[k] for k in ending - late if links[k].onto in {links[k].road for k in late}]
    if not feeding:
        return _Change(yellow=_yellow(links, ending), red=_red(links, ending))
    way = max((link.length + _STORES_FEW) / max(link.speed, _SLOWEST) for link in feeding)
    return _Change(
        yellow=_yellow(links, ending - late),
        red=_red(links, late),
        late=late,
        lag=min(math.ceil(way), _LONGEST_LAG),
        late_yellow=_yellow(links, late),
    )


def _yellow(links: dict[int, SignalLink], ending: frozenset[int]) -> int:
    return int(max(yellow_time(links[k].speed) for k in ending))


def _red(links: dict[int, SignalLink], ending: frozenset[int]) -> int:
    clear = max(clearing_time(links[k].length, max(links[k].speed, _SLOWEST)) for k in ending)
    return min(max(math.ceil(clear - 1.0), 1), 5)


def _tail(links: dict[int, SignalLink], stage: Stage, following: Stage, change: _Change) -> int:
    """Give the seconds of green at a stage's end in which nobody starts to walk."""
    ending = stage.walks - following.walks
    clearance = int(max((walking_time(links[k].length) for k in ending), default=0))
    return max(0, clearance - change.seconds)


def _green_times(
    links: dict[int, SignalLink], stages: Sequence[Stage], changes: Sequence[_Change]
) -> list[int]:
    wanted, least = [], []
    for number, stage in enumerate(stages):
        following = stages[(number + 1) % len(stages)]
        tail = _tail(links, stage, following, changes[number])
        walkers = _WALK + tail if stage.walks else 0
        major = len({(links[k].road, k) for k in stage.vehicles if links[k].direction == "s"}) >= _MAJOR_LANES
        green = _TURN_GREEN if stage.protected else _MAJOR_GREEN if major else _GREEN
        green = green if stage.vehicles else _LEAST
        wanted.append(max(green, walkers))
        least.append(max(_LEAST, walkers))
    lost = sum(change.seconds for change in changes)
    while sum(wanted) + lost > _LONGEST and wanted != least:
        number = max(range(len(wanted)), key=lambda k: (wanted[k] - least[k], -k))
        wanted[number] -= 1
    return wanted


def _stage_phases(
    links: dict[int, SignalLink], stage: Stage, following: Stage, green: int, change: _Change
) -> list[PhaseRow]:
    size = max(links) + 1
    letters, after = letters_of(links, stage), letters_of(links, following)
    tail = _tail(links, stage, following, change)
    staying = {k: letters[k] for k in letters if links[k].walks is False or k in after}
    phases = [(green - tail, _state(size, letters)), (tail, _state(size, staying))]
    kept = {k: min(letters[k], after[k], key="gG".index) for k in staying if k in after}
    fading = {k: "y" for k in staying if k not in after}
    late = {k: letters[k] for k in change.late}
    phases += [
        (change.yellow, _state(size, kept | fading | late)),
        (change.lag, _state(size, kept | late)),
        (change.late_yellow, _state(size, kept | dict.fromkeys(late, "y"))),
        (change.red, _state(size, kept)),
    ]
    return phases


def _state(size: int, letters: dict[int, str]) -> str:
    return "".join(letters.get(k, "r") for k in range(size))


def _joined(phases: Sequence[PhaseRow]) -> list[PhaseRow]:
    """Leave out phases without time and join equal neighbours."""
    joined: list[PhaseRow] = []
    for time, state in phases:
        if time and joined and joined[-1][1] == state:
            joined[-1] = (joined[-1][0] + time, state)
        elif time:
            joined.append((time, state))
    return joined


def _escaped(text: str) -> str:
    return text.replace("&", "&amp;").replace('"', "&quot;").replace("<", "&lt;")
