"""Trees: sprays of leaves grow out of their crowns."""

import numpy as np
import pytest

from dojo_maps.description import Prop
from dojo_maps.meshes.trees import build_crown, build_leaves


def is_inside(points: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    """Count how often a ray from each point crosses a closed surface: an odd number if it is inside."""
    a, b, c = (triangles[:, k] for k in range(3))
    u, v, ray = b - a, c - a, np.array([1.0, 1e-4, 2e-4])
    across = np.cross(ray, v)
    scale = (u * across).sum(axis=1)
    from_a = points[:, None] - a
    one = (from_a * across).sum(axis=2) / scale
    turned = np.cross(from_a, u)
    other = turned @ ray / scale
    ahead = (turned * v).sum(axis=2) / scale
    hits = (one >= 0) & (other >= 0) & (one + other <= 1) & (ahead > 0)
    return hits.sum(axis=1) % 2 == 1


@pytest.mark.parametrize("place", [(10.0, 10.0), (500.0, 80.0), (90.0, 400.0), (-300.0, 20.0)])
def test_no_spray_of_leaves_floats(place: tuple[float, float]) -> None:
    tree = Prop(id="tree", kind="tree", height=9.0, position=(*place, 1.0))
    corners, faces = build_crown(tree, np.zeros(3))
    leaves, sprays = build_leaves(tree, np.zeros(3))
    balls = corners[faces].reshape(-1, 32, 3, 3)
    touches = [is_inside(leaves, ball)[sprays].any(axis=1) for ball in balls]
    assert len(sprays) > 50
    assert np.any(touches, axis=0).all()
