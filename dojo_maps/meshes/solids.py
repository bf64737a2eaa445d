"""Pavement as solids: a top behind a kerb, walls along the outline, a bottom below the ground.

A solid is closed by construction, whatever its outline. Faces hang together only along edges that exactly
two of them share; every group of faces around a corner gets a vertex of its own, so that the outline passes
each vertex once; and no two vertices come to lie on one place, also not once they are stored in single
precision. So nobody who joins equal vertices joins more than two faces in one edge.
"""

from collections import defaultdict

import numpy as np

from dojo_maps.geometry.polylines import Floats, Ints
from dojo_maps.meshes.mesh import used_vertices

_APART = 1e-3
"""Vertices above each other lie farther apart than this, metres; where it is more, by `_ROUNDING`."""
_ROUNDING = 2.0**-21
"""Four times the error of a number in single precision, as a share of the number."""


def extrude(vertices: Floats, faces: Ints, rise: Floats, depth: float) -> tuple[Floats, Ints, Ints]:
    """Make a watertight solid of a triangulated surface.

    Args:
        vertices: (n, 3) metres, on the ground; only those that faces use are kept.
        faces: (m, 3), counter-clockwise from above, each with three different vertices.
        rise: (n,) metres from each vertex up to the top.
        depth: metres from each vertex down to the bottom.

    Returns:
        Vertices (k, 3), faces (j, 3), and for each face the index of the input face it stands for.
    """
    used, corners = used_vertices(faces, len(vertices))
    twins = _twins(corners)
    fans = _fans(twins)
    origin = np.empty(fans.max(initial=-1) + 1, dtype=np.int64)
    origin[fans] = corners.ravel()
    faces, ground, rise = fans.reshape(-1, 3), vertices[used][origin], rise[used][origin]
    ground[:, 2] -= _drops(ground, rise, depth)
    top, bottom = ground.copy(), ground.copy()
    top[:, 2] += rise
    bottom[:, 2] -= depth
    free = twins < 0
    start, end, below = faces.ravel()[free], faces[:, [1, 2, 0]].ravel()[free], len(ground)
    solid = np.concatenate(
        [
            faces,
            faces[:, ::-1] + below,
            np.column_stack([start + below, end + below, end]),
            np.column_stack([start + below, end, start]),
        ]
    )
    every = np.arange(len(faces))
    face = np.repeat(every, 3)[free]
    return np.concatenate([top, bottom]), solid, np.concatenate([every, every, face, face])


def _twins(faces: Ints) -> Ints:
    """Find the half-edge that runs the other way along each one's edge; (3 m,), -1 along the outline.

    Half-edge 3 f + k runs from corner k of face f to the next. A face with an edge that another one runs
    along in the same way, as where a level ends on another, has no neighbours: it becomes a solid by itself.
    """
    start, end = faces.ravel(), faces[:, [1, 2, 0]].ravel()
    count = int(faces.max(initial=0)) + 1
    keys, wanted = start * count + end, end * count + start
    unique, index, times = np.unique(keys, return_inverse=True, return_counts=True)
    alone = np.repeat((times[index] > 1).reshape(-1, 3).any(axis=1), 3)
    order = np.argsort(keys, kind="stable")
    place = np.minimum(np.searchsorted(unique, wanted), len(unique) - 1)
    twin = order[np.cumsum(times)[place] - 1]
    return np.where((unique[place] == wanted) & ~alone & ~alone[twin], twin, -1)


def _fans(twins: Ints) -> Ints:
    """Number the groups of faces that hang together by edges around a corner; (3 m,), one per corner."""
    half = np.flatnonzero(twins >= 0)
    # A half-edge starts where its twin ends.
    other = twins[half] // 3 * 3 + (twins[half] + 1) % 3
    group = np.arange(len(twins))
    while True:
        lowest = group.copy()
        np.minimum.at(lowest, group[half], group[other])
        np.minimum.at(lowest, group[other], group[half])
        lowest = lowest[lowest]
        if np.array_equal(lowest, group):
            return np.unique(group, return_inverse=True)[1]
        group = lowest


def _drops(ground: Floats, rise: Floats, depth: float) -> Floats:
    """Find how far to let down each vertex so that no top or bottom lies on the place of another; metres.

    Parts that touch in a point then differ there by some millimetres in height. That leaves no gap between
    them, and unlike a step aside it can neither turn a face over nor end on another vertex.
    """
    drops = np.zeros(len(ground))
    step = _APART + _ROUNDING * float(np.abs(ground[:, 2]).max(initial=0.0))
    x, y = ground[:, :2].T.astype(np.float32)
    _, place, count = np.unique(x + 1j * y, return_inverse=True, return_counts=True)
    heights = np.column_stack([ground[:, 2] - depth, ground[:, 2] + rise])
    levels = np.floor(heights / step).astype(np.int64)
    taken: set[tuple[int, int]] = set()
    steps: dict[int, int] = defaultdict(int)
    shared = np.flatnonzero(count[place] > 1)
    for vertex, at, (low, high) in zip(
        shared.tolist(), place[shared].tolist(), levels[shared].tolist(), strict=True
    ):
        while (at, low - steps[at]) in taken or (at, high - steps[at]) in taken:
            steps[at] += 1
        own = (low - steps[at], high - steps[at])
        taken.update((at, level + near) for level in own for near in (-1, 0, 1))
        drops[vertex] = steps[at] * step
    return drops
