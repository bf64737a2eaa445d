"""What stands around the street as closed solids: buildings, trees, hedges, street lamps and signs."""

import zlib
from collections import defaultdict
from collections.abc import Callable, Iterator, Sequence
from functools import cache

import numpy as np
import trimesh

from dojo_maps.description import STREET_LAMP_REACH, Prop, RoadMap, heading_of
from dojo_maps.geometry.polylines import Floats, Ints
from dojo_maps.meshes.buildings import raise_outlines
from dojo_maps.meshes.mesh import Mesh, join

_FOOTING = 0.3
"""How far trunks and posts reach below the ground, metres."""
_CROWN_FROM = 0.28
"""Height of a crown's lower end, as a share of the tree's."""
_CROWN_WIDTH = 0.32
"""Radius of a crown, as a share of the tree's height."""
_TRUNK_RADIUS = 0.02
_SLIM, _THICK = 0.08, 0.35
_PLATE = 0.3
"""Radius of a sign, metres."""


def surrounding_meshes(road_map: RoadMap) -> Iterator[Mesh]:
    """Build what stands around the street, in the frame of the map's origin."""
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
            if placed[kind]:
                yield join(name, ((prop.id, *shape(prop, shift)) for prop in placed[kind]))


def _crown(tree: Prop, shift: Floats) -> tuple[Floats, Ints]:
    """Give a tree its crown: a cone where it has needles, else a lump; turned so that no two look alike."""
    needles = dict(tree.tags).get("leaf_type") == "needleleaved"
    shape, faces = _cone() if needles else _lump()
    chance = zlib.crc32(tree.id.encode()) / 2**32
    angle = 2 * np.pi * chance
    cos, sin = np.cos(angle), np.sin(angle)
    radius = tree.height * _CROWN_WIDTH * (0.85 + 0.3 * chance) * (0.7 if needles else 1.0)
    size = np.array([radius, radius, tree.height * (1 - _CROWN_FROM)])
    turned = shape @ np.array([[cos, sin, 0.0], [-sin, cos, 0.0], [0.0, 0.0, 1.0]])
    foot = np.array(tree.position) - shift + [0.0, 0.0, tree.height * _CROWN_FROM]
    return turned * size + foot, faces


def _trunk(tree: Prop, shift: Floats) -> tuple[Floats, Ints]:
    """Reach from the ground into the crown."""
    vertices, faces = _post()
    radius = min(max(tree.height * _TRUNK_RADIUS, _SLIM), _THICK)
    size = np.array([radius, radius, tree.height * (_CROWN_FROM + 0.15) + _FOOTING])
    return vertices * size + np.array(tree.position) - shift - [0.0, 0.0, _FOOTING], faces


@cache
def _lump() -> tuple[Floats, Ints]:
    """Make an uneven ball between 0 and 1 in height, of about radius 1."""
    ball = trimesh.creation.icosphere(subdivisions=1)
    corners = np.array(ball.vertices)
    uneven = 1.0 + 0.16 * np.sin(2.3 * corners[:, :1] + 1.0) * np.cos(2.9 * corners[:, 1:2] + 2.0)
    uneven += 0.1 * np.sin(5.1 * corners[:, 2:])
    lump = corners * uneven
    low, high = lump[:, 2].min(), lump[:, 2].max()
    lump[:, 2] = (lump[:, 2] - low) / (high - low)
    return lump, np.array(ball.faces, dtype=np.int64)


@cache
def _cone() -> tuple[Floats, Ints]:
    cone = trimesh.creation.cone(radius=1.0, height=1.0, sections=9)
    return np.array(cone.vertices), np.array(cone.faces, dtype=np.int64)


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
    "tree": {"tree": _crown, "tree/trunk": _trunk},
    "lamp": {"building/lamp": _lamp_post},
    "sign": {"building/sign": _sign_post, "building/sign/rim": _sign_rim, "building/sign/face": _sign_face},
}
"""Meshes of what has a place, by kind, and how each is shaped."""
