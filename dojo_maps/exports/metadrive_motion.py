"""What moves in a MetaDrive scenario: the signals' lights over time, and the car that shows the way.

MetaDrive's environment loads a scenario only with an ego car in it. It is a guide, no traffic: it drives
along lanes at their speed limit, heeds no signal, and stops where its way ends.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from dojo_maps.description import Connection, Phase, Program, RoadMap
from dojo_maps.errors import ExportError
from dojo_maps.exports.metadrive_features import Feature
from dojo_maps.geometry.polylines import Floats, along
from dojo_maps.signals.programs import following

STEP = 0.1
"""MetaDrive's step, seconds."""
EGO = "ego"
_SHORTEST, _LONGEST = 60.0, 180.0
"""Bounds of a scenario's duration, seconds."""
_CAR = {"length": 5.0, "width": 1.8, "height": 1.5}
"""SUMO's default passenger car, metres."""
_STARTS = 100
"""How many lanes are tried as the start of the car's way."""

_RED, _YELLOW, _GREEN = "LANE_STATE_STOP", "LANE_STATE_CAUTION", "LANE_STATE_GO"
_UNKNOWN = "LANE_STATE_UNKNOWN"
LIGHTS = {
    "r": _RED, "R": _RED, "u": _RED, "U": _RED, "y": _YELLOW, "Y": _YELLOW, "g": _GREEN, "G": _GREEN,
    "s": "LANE_STATE_FLASHING_STOP", "o": "LANE_STATE_FLASHING_CAUTION", "O": _UNKNOWN,
}  # fmt: skip
"""SUMO's letters; with red and yellow together (u) nobody may drive yet."""


def choose_times(road_map: RoadMap) -> Floats:
    """List a scenario's instants: one cycle of the slowest signal, but from 60 to 180 s.

    Args:
        road_map: whose signals' programs count.

    Returns:
        (n,), seconds, from 0 on, `STEP` apart.
    """
    cycles = [_list_cycle(signal.program) for signal in road_map.signals if signal.program is not None]
    seconds = (sum(phase.duration for phase in cycle) for cycle in cycles)
    duration = float(np.clip(max(seconds, default=0.0), _SHORTEST, _LONGEST))
    return np.arange(round(duration / STEP), dtype=np.float64) * STEP


def build_signal_states(
    road_map: RoadMap, features: dict[str, Feature], times: Floats
) -> dict[str, dict[str, Any]]:
    """Give each signalled way through a junction its light at each instant, from the signal's program.

    Crossings have lights in SUMO but not in MetaDrive, which knows lights of lanes only.

    Args:
        road_map: with stop lines.
        features: of the map by id; connections without one get no light.
        times: (n,), seconds of the simulation.

    Returns:
        MetaDrive's `dynamic_map_states`, by connection; positions in metres around the map's origin.
    """
    programs = {s.id: s.program for s in road_map.signals if s.program is not None}
    places = {line.lane: line.shape.mean(axis=0) for line in road_map.stop_lines}
    ends = {lane.id: lane.shape[-1] for lane in road_map.lanes}
    origin = np.array([*road_map.origin, 0.0])
    states: dict[str, dict[str, Any]] = {}
    for connection in road_map.connections:
        if connection.signal is None or connection.id not in features or connection.id in states:
            continue
        source = connection.from_lane
        states[connection.id] = {
            "type": "TRAFFIC_LIGHT",
            "state": {"object_state": _lights(programs.get(connection.signal), connection, times)},
            "lane": connection.id,
            "stop_point": places.get(source, ends[source]) - origin,
            "metadata": {
                "type": "TRAFFIC_LIGHT",
                "object_id": connection.id,
                "track_length": len(times),
                "signal": connection.signal,
                "link_index": connection.link_index,
            },
        }
    return states


def _list_cycle(program: Program) -> list[Phase]:
    """List a program's phases as they follow each other; none where traffic alone decides, as under NEMA."""
    places: list[int] = []
    place = 0
    while program.phases and not program.rings and place not in places:
        places.append(place)
        place = following(program, place)[0]
    return [program.phases[place] for place in places]


def _lights(program: Program | None, connection: Connection, times: Floats) -> list[str]:
    if program is None or connection.link_index is None:
        return [_UNKNOWN] * len(times)
    cycle = _list_cycle(program)
    ends = np.cumsum([phase.duration for phase in cycle])
    if len(ends) == 0 or ends[-1] <= 0:
        return [_UNKNOWN] * len(times)
    # A hair ahead, so that an instant which is a phase's end in all but rounding belongs to the next phase.
    within = (times - program.offset + 1e-6) % ends[-1]
    phases = np.minimum(np.searchsorted(ends, within, side="right"), len(ends) - 1)
    letters = [phase.state[connection.link_index : connection.link_index + 1] for phase in cycle]
    return [LIGHTS.get(letters[phase], _UNKNOWN) for phase in phases]


def build_ego_track(features: dict[str, Feature], times: Floats) -> dict[str, Any]:
    """Drive a car along the first way found that is long enough for all instants, or the longest.

    Args:
        features: of the map by id, as `build_features` makes them.
        times: (n,), seconds, from 0 on.

    Returns:
        MetaDrive's track of the car, with its place at every instant; where its way ends it stands.

    Raises:
        ExportError: the map has no lane for cars.
    """
    starts = [name for name, feature in features.items() if feature["type"] == "LANE_SURFACE_STREET"]
    if not starts:
        raise ExportError("MetaDrive needs a lane for cars, and this map has none; choose another --export")
    best: list[str] = []
    longest = -1.0
    for start in starts[:_STARTS]:
        way, duration = _follow(features, start, float(times[-1]))
        if duration > longest:
            best, longest = way, duration
        if longest >= times[-1]:
            break
    return _drive(features, best, times)


def _seconds(feature: Feature) -> float:
    speed: float = max(feature["speed_limit_kmh"] / 3.6, 1.0)
    return float(along(feature["polyline"])[-1]) / speed


def _follow(features: dict[str, Feature], start: str, wanted: float) -> tuple[list[str], float]:
    """Follow lanes onward, each once, until the wanted seconds are filled; returns lanes and seconds."""
    way, duration = [start], _seconds(features[start])
    visited = {start}
    while duration < wanted:
        onward = [name for name in features[way[-1]]["exit_lanes"] if name not in visited]
        if not onward:
            break
        # A lane that leads on is better than one that ends the way.
        way.append(next((name for name in onward if _leads_on(features, name, visited)), onward[0]))
        visited.add(way[-1])
        duration += _seconds(features[way[-1]])
    return way, duration


def _leads_on(features: dict[str, Feature], name: str, visited: set[str]) -> bool:
    """Tell whether a lane, or for a way through a junction the lane behind it, has somewhere to go."""
    feature = features[name]
    if feature["type"] == "LANE_SURFACE_UNSTRUCTURE":
        return all(next_ not in visited and features[next_]["exit_lanes"] for next_ in feature["exit_lanes"])
    return bool(feature["exit_lanes"])


def _drive(features: dict[str, Feature], way: list[str], times: Floats) -> dict[str, Any]:
    """Place the car at each instant."""
    line = np.concatenate([features[name]["polyline"] for name in way])
    clock = _clock(features, way)
    keep = np.concatenate([[True], np.diff(clock) > 1e-9])
    line, clock = line[keep], clock[keep]
    position = np.column_stack([np.interp(times, clock, line[:, axis]) for axis in range(3)])
    piece = np.clip(np.searchsorted(clock, times, side="right") - 1, 0, len(line) - 2)
    rates = (np.diff(line, axis=0) / np.diff(clock)[:, None])[piece]
    velocity = np.where((times < clock[-1])[:, None], rates[:, :2], 0.0)
    count = len(times)
    state: dict[str, NDArray[Any]] = {
        "position": position,
        "heading": np.arctan2(rates[:, 1], rates[:, 0]),
        "velocity": velocity,
        "valid": np.ones(count, dtype=bool),
        **{name: np.full(count, size) for name, size in _CAR.items()},
    }
    metadata = {"type": "VEHICLE", "object_id": EGO, "track_length": count, "route": way}
    return {"type": "VEHICLE", "state": state, "metadata": metadata}


def _clock(features: dict[str, Feature], way: list[str]) -> Floats:
    """Tell when the car passes each corner of its way, seconds."""
    clock, start = [], 0.0
    for name in way:
        length = along(features[name]["polyline"])
        clock.append(start + length / length[-1] * _seconds(features[name]))
        start = float(clock[-1][-1])
    return np.concatenate(clock)
