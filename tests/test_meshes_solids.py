"""Solids of pavement: closed for any outline, also one that touches itself in a point."""

import numpy as np
import pytest
import trimesh

from dojo_maps.meshes.solids import extrude


def solid_of(
    vertices: list[tuple[float, float]], faces: list[tuple[int, int, int]], rise: float = 0.12
) -> trimesh.Trimesh:
    ground = np.column_stack([np.array(vertices), np.zeros(len(vertices))])
    found = extrude(ground, np.array(faces), np.full(len(ground), rise), 0.3)
    return trimesh.Trimesh(found[0], found[1], process=True, merge_norm=True)


def test_extrude_is_closed_and_has_the_volume_of_a_slab() -> None:
    slab = solid_of([(0, 0), (4, 0), (4, 2), (0, 2)], [(0, 1, 2), (0, 2, 3)])
    assert slab.is_watertight
    assert slab.volume == pytest.approx(8.0 * 0.42)


def test_extrude_is_closed_when_two_parts_touch_in_a_point() -> None:
    pair = solid_of(
        [(0, 0), (1, 0), (1, 1), (0, 1), (2, 1), (2, 2), (1, 2)], [(0, 1, 2), (0, 2, 3), (2, 4, 5), (2, 5, 6)]
    )
    assert pair.is_watertight
    assert pair.volume == pytest.approx(2.0 * 0.42, rel=0.01)


def test_extrude_is_closed_around_a_hole() -> None:
    ring = solid_of(
        [(0, 0), (3, 0), (3, 3), (0, 3), (1, 1), (2, 1), (2, 2)],
        [(0, 1, 5), (0, 5, 4), (1, 2, 6), (1, 6, 5), (2, 3, 6), (3, 4, 6), (3, 0, 4)],
    )
    assert ring.is_watertight


def test_extrude_names_the_face_that_each_wall_belongs_to() -> None:
    ground = np.array([(0.0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)])
    _, faces, origin = extrude(ground, np.array([(0, 1, 2), (0, 2, 3)]), np.full(4, 0.1), 0.1)
    assert len(faces) == len(origin)
    assert sorted(set(origin.tolist())) == [0, 1]
