"""Pavement as solids: a top behind a kerb, walls along the outline, a bottom below the ground."""

import numpy as np

from dojo_maps.geometry.polylines import Floats, Ints
from dojo_maps.meshes.mesh import used_vertices

_APART = 2e-3
"""How far parts of an outline that touch in one point are drawn apart, metres."""


def extrude(vertices: Floats, faces: Ints, rise: Floats, depth: float) -> tuple[Floats, Ints, Ints]:
    """Make a watertight solid of a triangulated surface.

    Args:
        vertices: (n, 3) metres, on the ground; only those that faces use are kept.
        faces: (m, 3), counter-clockwise from above, edge to edge.
        rise: (n,) metres from each vertex up to the top.
        depth: metres from each vertex down to the bottom.

    Returns:
        Vertices (k, 3), faces (j, 3), and for each face the index of the input face it stands for.
    """
    used, corners = used_vertices(faces, len(vertices))
    ground, faces, origin = _split_pinches(vertices[used], corners)
    rise = rise[used][origin]
    top, bottom = ground.copy(), ground.copy()
    top[:, 2] += rise
    bottom[:, 2] -= depth
    start, end, face = _outline(faces)
    below = len(ground)
    solid = np.concatenate(
        [
            faces,
            faces[:, ::-1] + below,
            np.column_stack([start + below, end + below, end]),
            np.column_stack([start + below, end, start]),
        ]
    )
    every = np.arange(len(faces))
    return np.concatenate([top, bottom]), solid, np.concatenate([every, every, face, face])


def _outline(faces: Ints) -> tuple[Ints, Ints, Ints]:
    """Find the edges with a face on one side only: start, end and face of each, the face on the left."""
    start, end = faces.ravel(), faces[:, [1, 2, 0]].ravel()
    count = int(faces.max(initial=0)) + 1
    twins = np.sort(end * count + start)
    keys = start * count + end
    found = np.minimum(np.searchsorted(twins, keys), len(twins) - 1)
    free = twins[found] != keys
    return start[free], end[free], np.repeat(np.arange(len(faces)), 3)[free]


def _split_pinches(ground: Floats, faces: Ints) -> tuple[Floats, Ints, Ints]:
    """Give each fan of faces its own vertex where an outline touches itself in a point.

    Returns:
        Vertices, faces, and for each vertex the index of the one it was.
    """
    start, _, _ = _outline(faces)
    pinched = np.flatnonzero(np.bincount(start, minlength=len(ground)) > 1)
    before, faces = faces, faces.copy()
    origin, moved = list(range(len(ground))), list(ground)
    for vertex in pinched:
        for fan in _fans(faces, int(vertex)):
            inward = ground[before[fan]].mean(axis=(0, 1)) - ground[vertex]
            length = np.hypot(*inward[:2])
            shift = inward * (_APART / length) if length > _APART else np.zeros(3)
            block = faces[fan]
            block[block == vertex] = len(moved)
            faces[fan] = block
            origin.append(int(vertex))
            moved.append(ground[vertex] + [shift[0], shift[1], 0.0])
    return np.array(moved), faces, np.array(origin)


def _fans(faces: Ints, vertex: int) -> list[Ints]:
    """Group the faces around a vertex into those that hang together by edges."""
    around = np.flatnonzero((faces == vertex).any(axis=1))
    fans: list[tuple[set[int], list[int]]] = []
    for face in around:
        rim = {int(v) for v in faces[face] if v != vertex}
        members = [int(face)]
        for fan in [f for f in fans if f[0] & rim]:
            rim |= fan[0]
            members += fan[1]
            fans.remove(fan)
        fans.append((rim, members))
    return [np.array(sorted(members)) for _, members in fans]
