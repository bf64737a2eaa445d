"""Signals as meshes: poles, the arms that reach over the lanes, and heads with their lamps."""

from collections import defaultdict
from collections.abc import Iterator
from functools import cache

import numpy as np
import trimesh

from dojo_maps.description import LAMP_RADIUS, LAMP_SPACING, LinkKind, Prop, RoadMap, Signal, SignalHead
from dojo_maps.geometry.polylines import Floats, Ints
from dojo_maps.meshes.mesh import Mesh, join

_POLE_RADIUS = 0.07
_ARM_RADIUS = 0.05
_ARM_ABOVE_HEAD = 0.6
_HOUSING = (0.22, 0.34)
"""A housing's depth and width, metres."""
_LAMPS = ("red", "yellow", "green")

_Part = tuple[str, Floats, Ints]
_Place = tuple[str | None, bool]
"""The road that heads or a pole are for, and whether on the far side; walkers' poles are for none."""


def signal_meshes(road_map: RoadMap) -> Iterator[Mesh]:
    """Build the poles and housings, and the lamps by colour, of every signal.

    Args:
        road_map: with signal heads, and the poles among its props.

    Yields:
        `signal`, then `signal/red`, `signal/yellow` and `signal/green`, those that have something to show.
    """
    metal: list[_Part] = []
    lamps: dict[str, list[_Part]] = defaultdict(list)
    shift = np.array([*road_map.origin, 0.0])
    poles = _poles_by_signal(road_map)
    lane_road = {lane.id: lane.road for lane in road_map.lanes}
    for signal in road_map.signals:
        road_of_link = {link.index: lane_road.get(link.from_id) for link in signal.links}
        walks = {link.index for link in signal.links if link.kind is LinkKind.PEDESTRIAN}
        arms: dict[_Place, list[SignalHead]] = defaultdict(list)
        for head in signal.heads:
            walking = head.link_indices[0] in walks
            metal.append((signal.id, *_housing(head, shift, walking=walking)))
            for colour, part in _lamps(head, shift, walking=walking):
                lamps[colour].append((signal.id, *part))
            road = road_of_link.get(head.link_indices[0])
            if road is not None and not walking:
                arms[road, head.far_side].append(head)
        metal += _poles_and_arms(signal, poles, arms, shift)
    if metal:
        yield join("signal", metal)
    for colour in _LAMPS:
        if lamps[colour]:
            yield join(f"signal/{colour}", lamps[colour])


def _poles_by_signal(road_map: RoadMap) -> dict[str, list[tuple[_Place, Prop]]]:
    """List each signal's poles with what they serve."""
    poles: dict[str, list[tuple[_Place, Prop]]] = defaultdict(list)
    for prop in road_map.props:
        tags = dict(prop.tags)
        if prop.kind == "pole" and "signal" in tags:
            place = tags.get("road"), tags.get("side") == "far"
            poles[tags["signal"]].append((place, prop))
    return poles


def _poles_and_arms(
    signal: Signal,
    poles: dict[str, list[tuple[_Place, Prop]]],
    arms: dict[_Place, list[SignalHead]],
    shift: Floats,
) -> Iterator[_Part]:
    for place, pole in poles[signal.id]:
        foot = np.array(pole.position) - shift
        top = foot + np.array([0.0, 0.0, pole.height])
        yield signal.id, *_tube(foot - [0.0, 0.0, 0.2], top, _POLE_RADIUS)
        hooks = [
            np.array(head.position) - shift + [0.0, 0.0, _ARM_ABOVE_HEAD] for head in arms.get(place, ())
        ]
        for hook in hooks:
            yield signal.id, *_tube(hook - [0.0, 0.0, _ARM_ABOVE_HEAD / 2], hook, _ARM_RADIUS / 2)
        if hooks:
            # A pole that does not stand in line with the heads reaches for the nearest, then along them.
            hooks.sort(key=lambda hook: float(np.hypot(*(hook - foot)[:2])))
            yield signal.id, *_tube(np.array([*foot[:2], hooks[0][2]]), hooks[0], _ARM_RADIUS)
            yield signal.id, *_tube(hooks[0], hooks[-1], _ARM_RADIUS)


def _housing(head: SignalHead, shift: Floats, *, walking: bool) -> tuple[Floats, Ints]:
    lamps = 2 if walking else 3
    vertices, faces = _box(_HOUSING[0], _HOUSING[1], lamps * LAMP_SPACING + 0.06)
    return _turned(vertices, head, np.array(head.position) - shift), faces


def _lamps(head: SignalHead, shift: Floats, *, walking: bool) -> Iterator[tuple[str, tuple[Floats, Ints]]]:
    """Lay a disc in front of the housing for each lamp, red on top."""
    colours = ("red", "green") if walking else _LAMPS
    disc, faces = _disc()
    for colour, centre in zip(colours, head.lamps(len(colours)), strict=True):
        yield colour, (_turned(disc, head, centre - shift), faces)


def _turned(vertices: Floats, head: SignalHead, place: Floats) -> Floats:
    """Turn a shape that faces +x to the head's heading and put it in its place."""
    cos, sin = np.cos(head.heading), np.sin(head.heading)
    turn = np.array([[cos, sin, 0.0], [-sin, cos, 0.0], [0.0, 0.0, 1.0]])
    turned: Floats = vertices @ turn + place
    return turned


@cache
def _box(depth: float, width: float, height: float) -> tuple[Floats, Ints]:
    box = trimesh.creation.box((depth, width, height))
    return np.array(box.vertices), np.array(box.faces, dtype=np.int64)


@cache
def _disc() -> tuple[Floats, Ints]:
    """Make a twelve-sided disc in the plane x = 0 that faces +x."""
    angles = np.arange(12) * np.pi / 6
    rim = np.column_stack([np.zeros(12), np.cos(angles) * LAMP_RADIUS, np.sin(angles) * LAMP_RADIUS])
    faces = [(0, k, k + 1) for k in range(1, 11)]
    return rim, np.array(faces, dtype=np.int64)


def _tube(start: Floats, end: Floats, radius: float) -> tuple[Floats, Ints]:
    """Make an eight-sided tube with closed ends; empty where both ends are one place."""
    axis = end - start
    length = float(np.linalg.norm(axis))
    if length < 1e-3:
        return np.empty((0, 3)), np.empty((0, 3), dtype=np.int64)
    ring, faces = _unit_tube()
    across = np.cross(axis / length, [1.0, 0.0, 0.0] if abs(axis[0]) < 0.9 * length else [0.0, 1.0, 0.0])
    across /= np.linalg.norm(across)
    frame = np.array([across, np.cross(axis / length, across), axis / length])
    return start + (ring * [radius, radius, length]) @ frame, faces


@cache
def _unit_tube() -> tuple[Floats, Ints]:
    tube = trimesh.creation.cylinder(radius=1.0, height=1.0, sections=8)
    vertices: Floats = np.array(tube.vertices) + np.array([0.0, 0.0, 0.5])
    return vertices, np.array(tube.faces, dtype=np.int64)
