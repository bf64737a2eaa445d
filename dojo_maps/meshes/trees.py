"""Trees: trunks, and crowns of a few species' shapes, made of closed clusters with sprays of leaves on them.

A crown is shaped once in a box of its own, about 1 wide to each side and from 0 to 1 high, and then scaled
and turned for every tree. Trees that stand close together are of one species.
"""

import zlib
from collections.abc import Sequence
from functools import cache

import numpy as np
import trimesh

from dojo_maps.description import Prop
from dojo_maps.geometry.polylines import Floats, Ints

Part = tuple[Floats, Ints]
"""Vertices (n, 3) and faces (m, 3)."""
_FOOTING = 0.3
"""How far trunks reach below the ground, metres."""
_RADIUS = 0.32
"""Radius of a crown, as a share of the tree's height."""
_TRUNK_RADIUS, _SLIM, _THICK = 0.02, 0.08, 0.35
"""Radius of a trunk as a share of the tree's height, and its bounds, metres."""
_STAND = 70.0
"""Side of the squares within which trees are of one species, metres."""
_UNEVEN = 0.13
_SPRAYS, _SPRAY = 72, 0.2
"""Sprays of leaves of a crown, and their size as a share of its radius."""
_ROOTED = 0.12
"""How deep sprays begin in their cluster, as a share of its size."""
_EPSILON = 1e-9
_GOLDEN = np.pi * (3.0 - np.sqrt(5.0))

_Clusters = Sequence[tuple[float, float, float, float, float]]
"""Of each cluster the middle, half its width and half its height."""


def _ring(count: int, away: float, height: float, wide: float, high: float) -> _Clusters:
    """Put clusters in a ring, by turns a little higher and lower."""
    turns = 2 * np.pi * np.arange(count) / count
    return [
        (away * np.cos(turn), away * np.sin(turn), height + 0.07 * (-1) ** k, wide, high)
        for k, turn in enumerate(turns)
    ]


_SPECIES: tuple[tuple[float, _Clusters], ...] = (
    (0.26, [(0.0, 0.0, 0.5, 0.66, 0.42), *_ring(5, 0.48, 0.36, 0.45, 0.27), (0.12, -0.1, 0.78, 0.44, 0.22)]),
    (
        0.34,
        [(0.0, 0.0, 0.45, 0.6, 0.38), *_ring(6, 0.58, 0.42, 0.42, 0.3), (-0.2, 0.12, 0.72, 0.5, 0.28)],
    ),
    (
        0.16,
        [(0.0, 0.0, 0.2, 0.46, 0.2), (0.06, 0.03, 0.45, 0.56, 0.26), (-0.05, 0.0, 0.7, 0.44, 0.22),
         (0.02, -0.03, 0.88, 0.26, 0.12)],
    ),
)  # fmt: skip
"""Of each broad-leaved species where its crown begins, as a share of its height, and its clusters: round like
a lime, spreading like a plane, and upright like a hornbeam."""
_NEEDLES_FROM, _TIERS = 0.12, ((0.0, 0.42, 0.72), (0.2, 0.64, 0.58), (0.42, 0.84, 0.42), (0.64, 1.0, 0.26))
"""Where a conifer's crown begins; of its tiers the foot, the top and the radius."""


def build_trunk(tree: Prop, shift: Floats) -> Part:
    """Reach from the ground into the crown.

    Args:
        tree: with a position, metres, map frame; its tag `leaf_type` tells conifers.
        shift: (3,) the origin of the scene, metres.

    Returns:
        A closed post in the frame of the scene.
    """
    vertices, faces = _post()
    radius = min(max(tree.height * _TRUNK_RADIUS, _SLIM), _THICK)
    size = np.array([radius, radius, tree.height * (_begin(tree) + 0.18) + _FOOTING])
    return vertices * size + np.array(tree.position) - shift - [0.0, 0.0, _FOOTING], faces


def build_crown(tree: Prop, shift: Floats) -> Part:
    """Give a tree the closed clusters of its crown.

    Args:
        tree: with a position, metres, map frame; its tag `leaf_type` tells conifers.
        shift: (3,) the origin of the scene, metres.

    Returns:
        The clusters, of conifers the tiers, in the frame of the scene.
    """
    return _grown(tree, shift, _tiers() if _has_needles(tree) else _clusters(_species(tree)))


def build_leaves(tree: Prop, shift: Floats) -> Part:
    """Give a tree the sprays that stand out of its crown, single triangles; none to conifers.

    Args:
        tree: with a position, metres, map frame; its tag `leaf_type` tells conifers.
        shift: (3,) the origin of the scene, metres.

    Returns:
        The sprays in the frame of the scene; arrays without rows for conifers.
    """
    return _grown(tree, shift, _NOTHING if _has_needles(tree) else _sprays(_species(tree)))


_NOTHING: Part = (np.empty((0, 3)), np.empty((0, 3), dtype=np.int64))


def _has_needles(tree: Prop) -> bool:
    return dict(tree.tags).get("leaf_type") == "needleleaved"


def _species(tree: Prop) -> int:
    x, y = np.array(tree.position)[:2] // _STAND
    return zlib.crc32(f"{x:.0f}:{y:.0f}".encode()) % len(_SPECIES)


def _begin(tree: Prop) -> float:
    return _NEEDLES_FROM if _has_needles(tree) else _SPECIES[_species(tree)][0]


def _grown(tree: Prop, shift: Floats, part: Part) -> Part:
    """Bring a crown's part to the tree's place and size; turned so that no two look alike."""
    shape, faces = part
    chance = zlib.crc32(tree.id.encode()) / 2**32
    angle = 2 * np.pi * chance
    cos, sin = np.cos(angle), np.sin(angle)
    radius = tree.height * _RADIUS * (0.85 + 0.3 * chance)
    begin = _begin(tree)
    size = np.array([radius, radius, tree.height * (1 - begin)])
    turned = shape @ np.array([[cos, sin, 0.0], [-sin, cos, 0.0], [0.0, 0.0, 1.0]])
    foot = np.array(tree.position) - shift + [0.0, 0.0, tree.height * begin]
    return turned * size + foot, faces


@cache
def _clusters(species: int) -> Part:
    """Make the clusters of a crown: uneven balls of 32 faces."""
    _, faces = _ball()
    parts = []
    for k, (*middle, wide, high) in enumerate(_SPECIES[species][1]):
        parts.append((_bulge(k) * [wide, wide, high] + middle, faces))
    return _joined(parts)


def _bulge(number: int) -> Floats:
    """Make the corners of a ball uneven, each cluster's in its own way."""
    ball, _ = _ball()
    return ball * (1.0 + _UNEVEN * np.sin(7.0 * ball @ [1.0, 1.7, 2.3] + 2.1 * number)[:, None])


def _reach(number: int, out: Floats) -> Floats:
    """Measure how far a cluster's faces are from its middle.

    Args:
        number: of the cluster.
        out: (n, 3) unit vectors.

    Returns:
        (n,) distances, about 1.
    """
    corners = _bulge(number)[_ball()[1]].transpose(0, 2, 1)
    weights = np.linalg.solve(corners[:, None], out[None, :, :, None])[..., 0]
    meets = weights.min(axis=2) > -_EPSILON
    distances: Floats = np.where(meets, 1.0 / np.where(meets, weights.sum(axis=2), 1.0), 0.0).max(axis=0)
    return distances


@cache
def _sprays(species: int) -> Part:
    """Set triangles that stand out where clusters end outside, spread evenly over them."""
    clusters = np.array(_SPECIES[species][1])
    number = np.arange(4 * _SPRAYS)
    up = 1.0 - 2.0 * (number * 0.618034 % 1.0)
    turn = _GOLDEN * number
    level = np.sqrt(1.0 - up**2)
    out = np.column_stack([level * np.cos(turn), level * np.sin(turn), up])
    own = clusters[number % len(clusters)]
    reaches = np.stack([_reach(k, out) for k in range(len(clusters))])
    reach = reaches[number % len(clusters), number] - _ROOTED
    places = own[:, :3] + out * own[:, [3, 3, 4]] * reach[:, None]
    sizes = clusters[:, [3, 3, 4]]
    depths = np.linalg.norm((places[:, None] - clusters[:, :3]) / sizes, axis=2)
    depths[number, number % len(clusters)] = np.inf
    outside = np.flatnonzero(depths.min(axis=1) > 0.95)[:_SPRAYS]
    out, places, number = out[outside], places[outside], number[outside]
    side = np.cross(out, [0.3, 0.2, 1.0])
    side /= np.linalg.norm(side, axis=1, keepdims=True)
    lean = np.cross(out, side)
    twist = 2.4 * number[:, None]
    one, other = side * np.cos(twist) + lean * np.sin(twist), lean * np.cos(twist) - side * np.sin(twist)
    scale = np.array([_SPRAY, _SPRAY, 0.6 * _SPRAY])
    corners = np.stack([0.5 * one - 0.3 * other, -0.5 * one - 0.3 * other, 0.7 * other + 0.45 * out], axis=1)
    vertices: Floats = (places[:, None] + corners * scale).reshape(-1, 3)
    return vertices, np.arange(len(vertices)).reshape(-1, 3)


@cache
def _tiers() -> Part:
    """Make the tiers of a conifer: cones with uneven rims, one above the other."""
    cone = trimesh.creation.cone(radius=1.0, height=1.0, sections=10)
    corners, faces = np.array(cone.vertices), np.array(cone.faces, dtype=np.int64)
    turns = np.arctan2(corners[:, 1], corners[:, 0])
    parts = []
    for k, (foot, top, radius) in enumerate(_TIERS):
        wide = radius * (1.0 + 0.14 * np.sin(5.0 * turns + 1.3 * k))[:, None]
        parts.append(
            (corners * np.hstack([wide, wide, np.full_like(wide, top - foot)]) + [0, 0, foot], faces)
        )
    return _joined(parts)


def _joined(parts: Sequence[Part]) -> Part:
    starts = np.cumsum([0, *(len(vertices) for vertices, _ in parts)])
    faces = [faces + start for (_, faces), start in zip(parts, starts, strict=False)]
    return np.concatenate([vertices for vertices, _ in parts]), np.concatenate(faces)


@cache
def _ball() -> Part:
    """Make a ball of radius 1 from an octahedron."""
    corners = np.array([[1, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0], [0, 0, 1], [0, 0, -1]], dtype=float)
    sides = [(0, 2, 4), (2, 1, 4), (1, 3, 4), (3, 0, 4), (2, 0, 5), (1, 2, 5), (3, 1, 5), (0, 3, 5)]
    ball = trimesh.Trimesh(corners, sides, process=False).subdivide()
    vertices: Floats = np.array(ball.vertices)
    return vertices / np.linalg.norm(vertices, axis=1, keepdims=True), np.array(ball.faces, dtype=np.int64)


@cache
def _post() -> Part:
    post = trimesh.creation.cylinder(radius=1.0, height=1.0, sections=6)
    return np.array(post.vertices) + np.array([0.0, 0.0, 0.5]), np.array(post.faces, dtype=np.int64)
