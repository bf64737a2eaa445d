"""Buildings and trees as closed solids: walls from the ground to flat roofs, trunks and crowns."""

import zlib
from collections.abc import Iterator
from functools import cache

import numpy as np
import shapely
import trimesh

from dojo_maps.description import Prop, RoadMap
from dojo_maps.geometry.pieces import GRID, flat_polygons
from dojo_maps.geometry.polylines import Floats, Ints
from dojo_maps.meshes.mesh import Mesh, compact, join
from dojo_maps.meshes.solids import extrude
from dojo_maps.meshes.surfaces import triangulate

_FOOTING = 0.3
"""How far walls and trunks reach below the ground, metres."""
_CROWN_FROM = 0.28
"""Height of a crown's lower end, as a share of the tree's."""
_CROWN_WIDTH = 0.32
"""Radius of a crown, as a share of the tree's height."""
_TRUNK_RADIUS = 0.02
_SLIM, _THICK = 0.08, 0.35


def surrounding_meshes(road_map: RoadMap) -> Iterator[Mesh]:
    """Build what stands around the street, in the frame of the map's origin."""
    buildings = [p for p in road_map.props if p.kind == "building" and p.polygon is not None]
    trees = [prop for prop in road_map.props if prop.kind == "tree" and prop.position is not None]
    shift = np.array([*road_map.origin, 0.0])
    if buildings:
        yield _building_mesh(buildings, shift)
    if trees:
        yield join("tree", ((tree.id, *_crown(tree, shift)) for tree in trees))
        yield join("tree/trunk", ((tree.id, *_trunk(tree, shift)) for tree in trees))


def _building_mesh(buildings: list[Prop], shift: Floats) -> Mesh:
    """Raise the outlines; each building stands by itself, as high and as low as its own ground says."""
    shapes = []
    ground = np.empty(len(buildings))
    for k, prop in enumerate(buildings):
        outline = np.asarray(prop.polygon) - shift
        ground[k] = outline[:, 2].min()
        shapes.append(shapely.Polygon(outline[:, :2], [hole[:, :2] - shift[:2] for hole in prop.holes]))
    valid = shapely.set_precision(shapely.make_valid(np.array(shapes, dtype=object)), GRID)
    polygons, source = flat_polygons(valid, larger_than=0.01)
    corners, polygon = triangulate(polygons)
    owner = source[polygon]
    rows = np.column_stack([np.repeat(owner, 3), corners.reshape(-1, 2)])
    places, faces = np.unique(rows, axis=0, return_inverse=True)
    faces = faces.reshape(-1, 3)
    solid = (faces != np.roll(faces, 1, axis=1)).all(axis=1)
    faces, owner = faces[solid], owner[solid]
    building = places[:, 0].astype(np.int64)
    vertices = np.column_stack([places[:, 1:], ground[building]])
    rise = np.array([prop.height for prop in buildings])[building]
    vertices, faces, origin = extrude(vertices, faces, rise, _FOOTING)
    return compact("building", vertices, faces, owner[origin], [prop.id for prop in buildings])


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
