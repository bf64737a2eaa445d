"""What stands around the street: buildings, trees, hedges, street lamps, signs, bus shelters, parked cars."""

from collections import defaultdict
from collections.abc import Callable, Iterator, Sequence
from functools import cache

import numpy as np
import trimesh

from dojo_maps.description import STREET_LAMP_REACH, Prop, RoadMap, heading_of
from dojo_maps.geometry.polylines import Floats, Ints
from dojo_maps.meshes.buildings import raise_outlines
from dojo_maps.meshes.mesh import Mesh, join
from dojo_maps.meshes.parked_cars import parked_car_meshes
from dojo_maps.meshes.trees import build_crown, build_leaves, build_trunk

_FOOTING = 0.3
"""How far posts reach below the ground, metres."""
_PLATE = 0.3
"""Radius of a sign, metres."""


def surrounding_meshes(road_map: RoadMap) -> Iterator[Mesh]:
    """Build what stands around the street, in the frame of the map's origin.

    Args:
        road_map: whose buildings, hedges, trees, lamps, signs, shelters and parked cars are drawn.

    Yields:
        A mesh for each kind of thing and material that there is.
    """
    shift = np.array([*road_map.origin, 0.0])
    outlined: dict[str, list[Prop]] = defaultdict(list)
    placed: dict[str, list[Prop]] = defaultdict(list)
    for prop in road_map.props:
        (outlined if prop.polygon is not None else placed)[prop.kind].append(prop)
    for kind, name in _OUTLINED.items():
        if outlined[kind]:
            yield raise_outlines(name, outlined[kind], shift)
    for kind, shapes in _PLACED.items():
        for name, shape in shapes.items():
            mesh = join(name, ((prop.id, *shape(prop, shift)) for prop in placed[kind]))
            if len(mesh.faces):  # Conifers have no sprays of leaves.
                yield mesh
    yield from parked_car_meshes(outlined["parked_car"], shift)


@cache
def _post() -> tuple[Floats, Ints]:
    post = trimesh.creation.cylinder(radius=1.0, height=1.0, sections=6)
    return np.array(post.vertices) + np.array([0.0, 0.0, 0.5]), np.array(post.faces, dtype=np.int64)


def _lamp_post(lamp: Prop, shift: Floats) -> tuple[Floats, Ints]:
    """Raise a post with an arm and its lamp over the carriageway."""
    vertices, faces = _post()
    post = vertices * [0.08, 0.08, lamp.height + _FOOTING] - [0.0, 0.0, _FOOTING]
    arm, arm_faces = _box()
    parts = (
        (post, faces),
        (arm * [STREET_LAMP_REACH, 0.07, 0.07] + [STREET_LAMP_REACH / 2, 0.0, lamp.height - 0.08], arm_faces),
        (arm * [0.7, 0.24, 0.1] + [STREET_LAMP_REACH, 0.0, lamp.height - 0.02], arm_faces),
    )
    return _stood(parts, lamp, shift)


def _sign_post(sign: Prop, shift: Floats) -> tuple[Floats, Ints]:
    vertices, faces = _post()
    height = sign.height + _FOOTING
    return _stood(((vertices * [0.03, 0.03, height] - [0.0, 0.0, _FOOTING], faces),), sign, shift)


def _sign_rim(sign: Prop, shift: Floats) -> tuple[Floats, Ints]:
    return _stood((_plate(sign.height, _PLATE, 0.04),), sign, shift)


def _sign_face(sign: Prop, shift: Floats) -> tuple[Floats, Ints]:
    return _stood((_plate(sign.height, 0.75 * _PLATE, 0.055),), sign, shift)


def _shelter_frame(shelter: Prop, shift: Floats) -> tuple[Floats, Ints]:
    """Raise posts at the corners of a shelter, a roof, and a bench; its open side faces +x."""
    height = shelter.height
    posts = [_beam((x, y, height / 2), (0.07, 0.07, height)) for x in (-0.55, 0.5) for y in (-1.6, 1.6)]
    roof = _beam((0.0, 0.0, height), (1.4, 3.5, 0.1))
    seat = _beam((-0.3, 0.0, 0.47), (0.36, 2.3, 0.05))
    legs = [_beam((-0.3, y, 0.22), (0.3, 0.06, 0.45)) for y in (-0.9, 0.9)]
    return _stood((*posts, roof, seat, *legs), shelter, shift)


def _shelter_panes(shelter: Prop, shift: Floats) -> tuple[Floats, Ints]:
    """Close a shelter's back and one of its sides with glass."""
    high = shelter.height - 0.5
    back = [_beam((-0.55, y, 0.25 + high / 2), (0.02, 1.48, high)) for y in (-0.78, 0.78)]
    return _stood((*back, _beam((0.0, 1.6, 0.25 + high / 2), (0.95, 0.02, high))), shelter, shift)


def _beam(middle: tuple[float, float, float], size: tuple[float, float, float]) -> tuple[Floats, Ints]:
    vertices, faces = _box()
    return vertices * size + middle, faces


def _plate(top: float, radius: float, ahead: float) -> tuple[Floats, Ints]:
    """Make a round plate that faces +x."""
    disc, faces = _disc()
    return disc * [0.02, radius, radius] + [ahead, 0.0, top - _PLATE], faces


def _stood(parts: Sequence[tuple[Floats, Ints]], prop: Prop, shift: Floats) -> tuple[Floats, Ints]:
    """Put parts together, turn what looks to +x to a thing's heading, and stand them in its place."""
    heading = heading_of(prop)
    cos, sin = np.cos(heading), np.sin(heading)
    turn = np.array([[cos, sin, 0.0], [-sin, cos, 0.0], [0.0, 0.0, 1.0]])
    starts = np.cumsum([0, *(len(vertices) for vertices, _ in parts)])
    faces = [faces + start for (_, faces), start in zip(parts, starts, strict=False)]
    vertices: Floats = np.concatenate([vertices for vertices, _ in parts]) @ turn
    return vertices + np.array(prop.position) - shift, np.concatenate(faces)


@cache
def _box() -> tuple[Floats, Ints]:
    box = trimesh.creation.box((1.0, 1.0, 1.0))
    return np.array(box.vertices), np.array(box.faces, dtype=np.int64)


@cache
def _disc() -> tuple[Floats, Ints]:
    """Make a disc of radius 1 across x, 1 thick."""
    disc = trimesh.creation.cylinder(radius=1.0, height=1.0, sections=12)
    return np.array(disc.vertices)[:, [2, 0, 1]], np.array(disc.faces, dtype=np.int64)


_OUTLINED = {"building": "building", "hedge": "tree/hedge"}
"""Meshes of what has an outline, by kind."""
_PLACED: dict[str, dict[str, Callable[[Prop, Floats], tuple[Floats, Ints]]]] = {
    "tree": {"tree": build_crown, "tree/leaves": build_leaves, "tree/trunk": build_trunk},
    "lamp": {"building/lamp": _lamp_post},
    "shelter": {"building/shelter": _shelter_frame, "building/shelter/glass": _shelter_panes},
    "sign": {"building/sign": _sign_post, "building/sign/rim": _sign_rim, "building/sign/face": _sign_face},
}
"""Meshes of what has a place, by kind, and how each is shaped."""
