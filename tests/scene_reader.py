"""Reads scene.glb as any other program would, and turns it back into map coordinates around the origin."""

import json
import struct
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from functools import cached_property, lru_cache
from pathlib import Path
from typing import Any

import numpy as np
import shapely
import trimesh
from numpy.typing import NDArray
from shapely import STRtree
from shapely.affinity import translate
from shapely.geometry.base import BaseGeometry

_LAYER_NAMES = """
    terrain road rail junction sidewalk walking_area crossing marking stop_line arrow island signal
    building tree
"""
LAYERS = frozenset(_LAYER_NAMES.split())
GROUND = ("road", "junction", "sidewalk", "walking_area")
PAINT = ("crossing", "marking", "stop_line", "arrow")
SAME_LEVEL = 2.0

Triangles = NDArray[np.float64]
"""(n, 3, 3) corners: x east and y north of the scene's origin, z up; metres."""


@dataclass(frozen=True, eq=False)
class Part:
    """One node's mesh."""

    name: str
    mesh: trimesh.Trimesh
    triangles: Triangles

    @property
    def layer(self) -> str:
        return self.name.split("/")[0]


@dataclass(frozen=True, eq=False)
class Scene:
    """All meshes of a scene, and the glTF's own JSON."""

    parts: tuple[Part, ...]
    gltf: dict[str, Any]
    origin: tuple[float, float]

    def triangles(self, *layers: str) -> Triangles:
        found = [part.triangles for part in self.parts if part.layer in layers]
        return np.concatenate(found) if found else np.empty((0, 3, 3))

    def tops(self, *layers: str) -> "Surface":
        """The faces of these layers that can be seen from above."""
        triangles = self.triangles(*layers)
        return Surface(triangles[face_up(triangles)])

    def to_local(self, geometry: BaseGeometry) -> BaseGeometry:
        """Move a geometry from map coordinates to coordinates around the origin."""
        return translate(geometry, -self.origin[0], -self.origin[1])

    @cached_property
    def ground(self) -> "Surface":
        return self.tops(*GROUND)

    @cached_property
    def paint(self) -> "Surface":
        return self.tops(*PAINT)


@dataclass(frozen=True, eq=False)
class Surface:
    """Faces that look up, as a function of the position on the map; several may lie above each other."""

    triangles: Triangles

    @cached_property
    def polygons(self) -> NDArray[np.object_]:
        return (
            shapely.polygons(self.triangles[:, :, :2]) if len(self.triangles) else np.empty(0, dtype=object)
        )

    @cached_property
    def tree(self) -> STRtree:
        return STRtree(self.polygons)

    @cached_property
    def union(self) -> BaseGeometry:
        return shapely.union_all(self.polygons, grid_size=1e-5)

    @property
    def total_area(self) -> float:
        return float(shapely.area(self.polygons).sum())

    def heights_at(self, faces: NDArray[np.int64], points: NDArray[np.float64]) -> NDArray[np.float64]:
        """The height of each given face's plane at the point that goes with it."""
        a, b, c = np.moveaxis(self.triangles[faces], 1, 0)
        normal = np.cross(b - a, c - a)
        step = points - a[:, :2]
        return a[:, 2] - (step * normal[:, :2]).sum(axis=1) / normal[:, 2]

    def faces_under(
        self, points: NDArray[np.float64]
    ) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.float64]]:
        """Pairs of points and faces above each other: point numbers, face numbers, the faces' heights."""
        numbers, faces = self.tree.query(shapely.points(points[:, :2]), predicate="intersects")
        return numbers, faces, self.heights_at(faces, points[numbers, :2])

    def overlaps_with(self, other: "Surface") -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Where faces of the two surfaces lie above each other: each overlap's area and height difference."""
        mine, theirs = other.tree.query(self.polygons, predicate="intersects")
        if other is self:
            keep = mine < theirs
            mine, theirs = mine[keep], theirs[keep]
        shared = shapely.intersection(self.polygons[mine], other.polygons[theirs])
        areas = shapely.area(shared)
        keep = areas > 1e-7
        mine, theirs, shared, areas = mine[keep], theirs[keep], shared[keep], areas[keep]
        centres = shapely.get_coordinates(shapely.centroid(shared))
        return areas, self.heights_at(mine, centres) - other.heights_at(theirs, centres)

    def doubled_area(self) -> float:
        """The area that is covered more than once within one level."""
        areas, differences = self.overlaps_with(self)
        return float(areas[np.abs(differences) < SAME_LEVEL].sum())


def face_up(triangles: Triangles) -> NDArray[np.bool_]:
    """Tell which faces can be seen from above; walls, faces without area and undersides cannot."""
    normal = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    size = np.linalg.norm(normal, axis=1)
    return (normal[:, 2] > 1e-3 * size) & (normal[:, 2] > 1e-7)


def is_closed_when_stored(vertices: NDArray[Any], faces: NDArray[np.int64]) -> bool:
    """Tell whether exactly two faces, one each way, run along every edge once equal vertices are joined.

    Vertices are equal here when they are in the single precision that a scene stores.
    """
    place = np.unique(vertices.astype(np.float32), axis=0, return_inverse=True)[1].ravel()
    forward = np.concatenate([place[faces[:, [k, (k + 1) % 3]]] for k in range(3)])
    edges, counts = np.unique(forward, axis=0, return_counts=True)
    backward = np.unique(forward[:, ::-1], axis=0)
    loops = edges[:, 0] == edges[:, 1]
    return bool((counts == 1).all()) and not loops.any() and np.array_equal(edges, backward)


def read_gltf_json(path: Path) -> dict[str, Any]:
    """Read the JSON part of a binary glTF."""
    data = path.read_bytes()
    magic, version, length = struct.unpack_from("<4sII", data)
    size, kind = struct.unpack_from("<I4s", data, 12)
    if magic != b"glTF" or version != 2 or length != len(data) or kind != b"JSON":
        raise ValueError(f"{path} is not a binary glTF 2.0 file")
    return json.loads(data[20 : 20 + size])


@lru_cache(maxsize=6)
def read_scene(path: Path, origin: tuple[float, float]) -> Scene:
    """Load a scene with trimesh and undo the turn to glTF's y-up axes."""
    loaded = trimesh.load_scene(path, process=False)
    parts = []
    for name in sorted(loaded.graph.nodes_geometry):
        transform, geometry = loaded.graph[name]
        mesh = loaded.geometry[geometry]
        corners = np.asarray(mesh.vertices, dtype=np.float64) @ transform[:3, :3].T + transform[:3, 3]
        x, y, z = corners.T
        parts.append(Part(name, mesh, np.column_stack([x, -z, y])[mesh.faces]))
    return Scene(tuple(parts), read_gltf_json(path), origin)


def sources_of(mesh: dict[str, Any], nodes: Iterable[dict[str, Any]]) -> Iterator[list[Any]]:
    """The runs [source id, first face, face count] that a glTF mesh carries, wherever its extras are."""
    places = [mesh, *mesh["primitives"], *nodes]
    for place in places:
        yield from place.get("extras", {}).get("sources", [])
