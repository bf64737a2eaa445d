"""Phase diagrams: what may go in each phase of a signal program, drawn on its junction, as SVG.

Green arrows have the right of way, pale ones let others go first; bars over the road are walkers with green.
"""

from collections.abc import Iterator
from html import escape

import numpy as np

from dojo_maps.description import Phase, Points, RoadMap, Signal

_CELL, _TITLE = 150.0, 20.0
"""Pixels: a phase's side, and the height of its title."""
_AROUND = 9.0
"""Metres of street shown around the ways across the junction."""
_MOST_PHASES = 16
_GO, _YIELD, _WALK = "#0f9d58", "#86d3a8", "#0b6bcb"


def draw_phases(road_map: RoadMap, signal: Signal) -> str | None:
    """Draw the phases with green of the program that SUMO runs at a signal.

    Args:
        road_map: the map.
        signal: one of its signals.

    Returns:
        An SVG element, or None where the signal has no program or no way that it controls.
    """
    ways = list(_ways(road_map, signal))
    if signal.program is None or not ways:
        return None
    phases = [(k, phase) for k, phase in enumerate(signal.program.phases) if _is_stage(phase)]
    phases = phases[:_MOST_PHASES]
    if not phases:
        return None
    kind = signal.program.kind
    frame = _Frame(np.concatenate([line for _, _, line in ways]))
    street = "".join(_street(road_map, signal, frame))
    cells = "".join(
        f'<svg x="{i * (_CELL + 6):.0f}" y="{_TITLE:.0f}" width="{_CELL:.0f}" height="{_CELL:.0f}">{street}'
        f"{''.join(_arrows(ways, phase.state, frame))}</svg>"
        f'<text x="{i * (_CELL + 6) + 2:.0f}" y="14">{_title(k, phase, kind)}</text>'
        for i, (k, phase) in enumerate(phases)
    )
    width, height = len(phases) * (_CELL + 6), _CELL + _TITLE
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" width="{width:.0f}" height="{height:.0f}" '
        f'viewBox="0 0 {width:.0f} {height:.0f}" role="img" font-family="sans-serif" font-size="12" '
        f'aria-label="{escape(f"phases of signal {signal.id}")}">{cells}</svg>'
    )


class _Frame:
    """Takes metres of the map to pixels of a cell, north up."""

    def __init__(self, places: Points) -> None:
        low, high = places[:, :2].min(axis=0) - _AROUND, places[:, :2].max(axis=0) + _AROUND
        self.scale = _CELL / float((high - low).max())
        self.middle = (low + high) / 2

    def path(self, line: Points) -> str:
        """Give the points of a line for SVG."""
        places = (line[:, :2] - self.middle) * [self.scale, -self.scale] + _CELL / 2
        return " ".join(f"{x:.1f},{y:.1f}" for x, y in places)


def _is_stage(phase: Phase) -> bool:
    return "g" in phase.state.lower() and not set("yu") & set(phase.state)


def _title(number: int, phase: Phase, kind: str) -> str:
    span = f"{phase.duration:g} s"
    if kind != "static" and phase.min_duration is not None and phase.max_duration is not None:
        span = f"{phase.min_duration:g} to {phase.max_duration:g} s"
    return f"phase {number}: {span}"


def _ways(road_map: RoadMap, signal: Signal) -> Iterator[tuple[int, bool, Points]]:
    """List the ways that a signal controls: link, whether it is for walkers, line."""
    for connection in road_map.connections:
        if connection.signal == signal.id and connection.link_index is not None and len(connection.shape) > 1:
            yield connection.link_index, False, connection.shape
    for crossing in road_map.crossings:
        if crossing.signal == signal.id and crossing.link_index is not None and len(crossing.shape) > 1:
            yield crossing.link_index, True, crossing.shape


def _street(road_map: RoadMap, signal: Signal, frame: _Frame) -> Iterator[str]:
    junctions = [junction for junction in road_map.junctions if junction.id in signal.junctions]
    roads = {road for junction in junctions for road in (*junction.incoming, *junction.outgoing)}
    yield f'<rect width="{_CELL:.0f}" height="{_CELL:.0f}" fill="#eef0ea"/>'
    for lane in road_map.lanes:
        if lane.road in roads and len(lane.shape) > 1:
            yield (
                f'<polyline points="{frame.path(lane.shape)}" fill="none" stroke="#b4bac1" '
                f'stroke-width="{lane.width * frame.scale:.1f}"/>'
            )
    for junction in junctions:
        if len(junction.polygon) > 2:
            yield f'<polygon points="{frame.path(junction.polygon)}" fill="#a6adb5"/>'


def _arrows(ways: list[tuple[int, bool, Points]], state: str, frame: _Frame) -> Iterator[str]:
    for link, is_walk, line in ways:
        letter = state[link] if link < len(state) else "r"
        if letter not in "gG":
            continue
        colour = _WALK if is_walk else _GO if letter == "G" else _YIELD
        wide, dashes = (3.2, ' stroke-dasharray="2.5 2"') if is_walk else (2.2, "")
        yield (
            f'<polyline points="{frame.path(line)}" fill="none" stroke="{colour}" '
            f'stroke-width="{wide}"{dashes}/>'
        )
        if not is_walk:
            yield _head(line, colour, frame)


def _head(line: Points, colour: str, frame: _Frame) -> str:
    """Draw the arrow's head at the end of a way."""
    before = line[-1, :2] - line[:-1, :2]
    step = before[max(0, int(np.flatnonzero(np.hypot(*before.T) > 0.3).max(initial=0)))]
    ahead = step / max(1e-6, float(np.hypot(*step))) * 3.4 / frame.scale
    aside = np.array([-ahead[1], ahead[0]]) * 0.8
    corners = np.array([line[-1, :2] + 1.6 * ahead, line[-1, :2] + aside, line[-1, :2] - aside])
    return f'<polygon points="{frame.path(corners)}" fill="{colour}"/>'
