"""What there is to know of a map, as a page shows, finds and plays it. Lengths are whole centimetres."""

from collections.abc import Mapping
from math import isfinite
from typing import Any

import numpy as np

from dojo_maps.description import Lane, LinkKind, Points, Program, RoadMap, Signal, SignalHead

_BEHIND, _AHEAD, _EYE = 26.0, 14.0, 9.0
"""Metres: the first view is from behind the stop line, at a place beyond it, from this height."""
_FEW_CLASSES = 8
"""A lane for more classes of vehicles than so many is one for all traffic."""


def describe_map(road_map: RoadMap, report: Mapping[str, Any] | None) -> dict[str, Any]:
    """Give a map's lanes, junctions, crossings, connections, signals and findings as JSON values.

    Args:
        road_map: the map.
        report: its report.json, if there is one; what in it is not as it should be is left out.

    Returns:
        JSON values by the map's lists, with a row for each thing. In the rows of lanes, crossings and
        connections lanes, roads and signals stand by their places in their lists, -1 for none. Widths and
        shapes are whole centimetres, shapes around the map's origin; speeds are km/h, other lengths metres.
    """
    shift = np.array([*road_map.origin, 0.0])
    roads = {road.id: k for k, road in enumerate(road_map.roads)}
    lanes = {lane.id: k for k, lane in enumerate(road_map.lanes)}
    signals = {signal.id: k for k, signal in enumerate(road_map.signals)}
    low, high = (np.array(corner) - shift[:2] for corner in road_map.bounds)
    return {
        "name": road_map.name,
        "origin": list(road_map.origin),
        "bounds": [*low.tolist(), *high.tolist()],
        "roads": [[r.id, r.name, r.kind, r.from_junction, r.to_junction] for r in road_map.roads],
        "lanes": [
            [lane.id, roads[lane.road], lane.index, lane.kind.value, _centimetres(lane.width),
             round(lane.speed * 3.6, 1), round(lane.length, 1), _classes(lane), _line(lane.shape, shift)]
            for lane in road_map.lanes
        ],
        "junctions": [[j.id, j.kind, _line(j.polygon, shift)] for j in road_map.junctions],
        "crossings": [
            [c.id, c.junction, signals.get(c.signal or "", -1), -1 if c.link_index is None else c.link_index,
             _line(c.polygon, shift), _line(c.shape, shift), _centimetres(c.width)]
            for c in road_map.crossings
        ],
        "connections": [
            [lanes[c.from_lane], lanes[c.to_lane], c.direction, signals.get(c.signal or "", -1),
             -1 if c.link_index is None else c.link_index, _line(c.shape, shift)]
            for c in road_map.connections
        ],
        "signals": [_describe_signal(signal, road_map, shift) for signal in road_map.signals],
        "issues": _findings(report or {}, shift),
    }  # fmt: skip


def _describe_signal(signal: Signal, road_map: RoadMap, shift: Points) -> dict[str, Any]:
    walks = {link.index for link in signal.links if link.kind is LinkKind.PEDESTRIAN}
    return {
        "id": signal.id,
        "junctions": list(signal.junctions),
        "links": [[k.index, k.kind.value, k.from_id, k.to_id, k.direction] for k in signal.links],
        "programs": [_describe_program(program) for program in signal.programs],
        "heads": [_describe_head(head, head.link_indices[0] in walks, shift) for head in signal.heads],
        "view": _first_view(signal, road_map, shift),
    }  # fmt: skip


def _describe_program(program: Program) -> dict[str, Any]:
    phases = [
        [phase.duration, phase.state, phase.min_duration, phase.max_duration] for phase in program.phases
    ]
    return {"id": program.id, "kind": program.kind, "offset": program.offset, "phases": phases}


def _describe_head(head: SignalHead, is_walk: bool, shift: Points) -> list[Any]:
    lamps = head.lamps(2 if is_walk else 3) - shift
    return [list(head.link_indices), round(head.heading, 4), _line(lamps, np.zeros(3))]


def _first_view(signal: Signal, road_map: RoadMap, shift: Points) -> list[float] | None:
    """Look from behind a stop line along the widest approach: eye and target, metres, or None."""
    lanes = {lane.id: lane for lane in road_map.lanes}
    heads = {link.from_id for link in signal.links if link.kind is LinkKind.VEHICLE}
    approaches: dict[str, list[Lane]] = {}
    for name in sorted(heads & lanes.keys()):
        approaches.setdefault(lanes[name].road, []).append(lanes[name])
    if not approaches:
        return None
    widest = max(approaches.values(), key=lambda side: (len(side), sum(lane.length for lane in side)))
    ends = np.array([lane.shape[-1] for lane in widest]).mean(axis=0) - shift
    line = widest[0].shape[:, :2]
    before = line[-1] - line[:-1]
    apart = np.hypot(*before.T)
    # Along the last metres, whatever short piece the lane ends with.
    step = before[max(0, int(np.searchsorted(-apart, -8.0, side="right")) - 1)]
    ahead = np.array([*(step / max(1e-6, float(np.hypot(*step)))), 0.0])
    eye = ends - _BEHIND * ahead + [0.0, 0.0, _EYE]
    target = ends + _AHEAD * ahead + [0.0, 0.0, 1.5]
    return [round(float(value), 2) for value in [*eye, *target]]


def _findings(report: Mapping[str, Any], shift: Points) -> list[dict[str, Any]]:
    issues = report.get("issues")
    return (
        [found for issue in issues if (found := _finding(issue, shift))] if isinstance(issues, list) else []
    )


def _finding(issue: Any, shift: Points) -> dict[str, Any] | None:
    """Take over what a page shows of a finding; None if it lies nowhere."""
    if not isinstance(issue, dict):
        return None
    place, elements = issue.get("position"), issue.get("elements")
    if not (isinstance(place, list) and len(place) == 3 and all(map(_is_number, place))):
        return None
    named = [each for each in elements if isinstance(each, dict)] if isinstance(elements, list) else []
    return {
        **{name: str(issue.get(name) or "") for name in ("severity", "check", "message", "hint")},
        "position": [round(float(value), 2) for value in np.array(place, dtype=float) - shift],
        "elements": [[str(each.get("kind")), str(each.get("id"))] for each in named],
    }


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and isfinite(value) and abs(value) < 1e9


def _classes(lane: Lane) -> str:
    return "all" if len(lane.allow) > _FEW_CLASSES else " ".join(lane.allow)


def _centimetres(metres: float) -> int:
    return round(metres * 100)


def _line(line: Points, shift: Points) -> list[int]:
    found: list[int] = np.rint((line - shift) * 100).astype(np.int64).ravel().tolist()
    return found
