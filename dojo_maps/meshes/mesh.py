"""Triangles that know where they come from."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from dojo_maps.geometry.polylines import Floats, Ints


@dataclass(frozen=True, slots=True, kw_only=True)
class Mesh:
    """One node of the scene.

    Attributes:
        name: its layer, then optionally `/` and more.
        vertices: (n, 3) metres, x east, y north, z up, around the map's origin.
        faces: (m, 3) vertex indices, counter-clockwise seen from outside or above.
        sources: (m,) index into `ids` of the thing each face belongs to.
        ids: ids of the description.
    """

    name: str
    vertices: Floats
    faces: Ints
    sources: Ints
    ids: tuple[str, ...]

    @property
    def layer(self) -> str:
        """The first part of the name."""
        return self.name.partition("/")[0]


def compact(name: str, vertices: Floats, faces: Ints, sources: Ints, ids: Sequence[str]) -> Mesh:
    """Drop unused vertices and ids, and put the faces of each id together, in the ids' order.

    Args:
        name: the mesh's.
        vertices: (n, 3), metres, around the map's origin.
        faces: (m, 3) indices of vertices, counter-clockwise from outside or above.
        sources: (m,) index into `ids` of the thing each face belongs to.
        ids: of the description.

    Returns:
        The mesh.
    """
    order = np.argsort(sources, kind="stable")
    used_ids, sources = np.unique(sources[order], return_inverse=True)
    used, corners = used_vertices(faces[order], len(vertices))
    return Mesh(
        name=name,
        vertices=vertices[used],
        faces=corners,
        sources=sources,
        ids=tuple(ids[i] for i in used_ids),
    )


def used_vertices(faces: Ints, count: int) -> tuple[Ints, Ints]:
    """Number the vertices that faces use anew.

    Args:
        faces: (m, 3) indices of vertices.
        count: of all vertices.

    Returns:
        (n,) the old numbers of those in use, ascending, and the faces (m, 3) with the new ones.
    """
    used = np.zeros(count, dtype=bool)
    used[faces] = True
    return np.flatnonzero(used), (np.cumsum(used) - 1)[faces]


def join(name: str, parts: Iterable[tuple[str, Floats, Ints]]) -> Mesh:
    """Put parts into one mesh.

    Args:
        name: the mesh's.
        parts: id of a thing, vertices (n, 3), metres, and faces (m, 3) of each; parts of one id become one.

    Returns:
        The mesh; without faces where there are no parts.
    """
    vertices: list[Floats] = [np.empty((0, 3))]
    faces: list[Ints] = [np.empty((0, 3), dtype=np.int64)]
    sources: list[Ints] = [np.empty(0, dtype=np.int64)]
    ids: dict[str, int] = {}
    count = 0
    for source, part_vertices, part_faces in parts:
        vertices.append(part_vertices)
        faces.append(part_faces + count)
        sources.append(np.full(len(part_faces), ids.setdefault(source, len(ids))))
        count += len(part_vertices)
    return compact(name, np.concatenate(vertices), np.concatenate(faces), np.concatenate(sources), list(ids))


def concatenate(meshes: Sequence[Mesh]) -> Mesh:
    """Put meshes of one name into one; their vertices stay apart.

    Args:
        meshes: at least one; the first gives the name.

    Returns:
        The mesh; what stands in several of them becomes one thing.
    """
    first, *others = meshes
    if not others:
        return first
    ids = list(dict.fromkeys(id_ for mesh in meshes for id_ in mesh.ids))
    number = {id_: k for k, id_ in enumerate(ids)}
    starts = np.cumsum([0, *(len(mesh.vertices) for mesh in meshes)])
    return compact(
        first.name,
        np.concatenate([mesh.vertices for mesh in meshes]),
        np.concatenate([mesh.faces + start for mesh, start in zip(meshes, starts, strict=False)]),
        np.concatenate([np.array([number[id_] for id_ in mesh.ids])[mesh.sources] for mesh in meshes]),
        ids,
    )


def is_watertight(mesh: Mesh) -> bool:
    """Tell whether every edge is shared by exactly two faces that run along it in opposite ways.

    Args:
        mesh: corners count as one where they have one number, not where they lie on one place.

    Returns:
        False also where two faces run along an edge in the same way.
    """
    edges = mesh.faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2)
    keys = np.sort(edges[:, 0] * len(mesh.vertices) + edges[:, 1])
    twins = np.sort(edges[:, 1] * len(mesh.vertices) + edges[:, 0])
    return bool((np.diff(keys) > 0).all()) and np.array_equal(keys, twins)
