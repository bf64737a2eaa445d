"""Solids of pavement: closed for any outline, also one that touches itself in a point."""

import numpy as np
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st
from scene_reader import is_closed_when_stored

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


def test_extrude_is_closed_when_two_parts_of_a_millimetre_touch_in_a_point() -> None:
    small = solid_of([(0, 0), (1e-3, 0), (0, 1e-3), (-1e-3, 0), (0, -1e-3)], [(0, 1, 2), (0, 3, 4)])
    assert small.is_watertight
    assert small.is_winding_consistent


def test_extrude_is_closed_when_two_faces_run_along_an_edge_the_same_way() -> None:
    # Two levels that have come together along the edge where the upper one ends.
    levels = solid_of([(0, 0), (1, 0), (0, 1), (0.5, 1), (0.5, -1)], [(0, 1, 2), (0, 1, 3), (1, 0, 4)])
    assert levels.is_watertight
    assert levels.is_winding_consistent


def test_extrude_is_closed_where_single_precision_moves_corners_onto_each_other() -> None:
    plan = np.array([(0.0, 0.0), (0.001, 0.0), (0.001, 0.001), (0.0, 1.0), (-1.0, 0.5)])
    ground = np.column_stack([plan + 500_000.0, np.zeros(5)])
    vertices, faces, _ = extrude(ground, np.array([(0, 1, 2), (0, 2, 3), (0, 3, 4)]), np.full(5, 0.12), 0.3)
    assert len(np.unique(ground.astype(np.float32), axis=0)) < len(ground)
    assert is_closed_when_stored(vertices, faces)


places = st.tuples(st.sampled_from([0.0, 1e-3, 1.0, 2.0]), st.sampled_from([0.0, 1e-3, 1.0, 2.0]))
heights = st.sampled_from([0.0, 0.002, 0.1, 0.42, 6.0, 3000.0])


@pytest.mark.slow
@settings(max_examples=300)
@given(
    st.lists(st.tuples(places, heights, st.sampled_from([0.0, 0.02, 0.12])), min_size=3, max_size=8),
    st.lists(st.permutations(range(8)), min_size=1, max_size=12),
    st.sampled_from([0.0, 1000.0, 500_000.0]),
)
def test_extrude_is_closed_for_any_faces(
    corners: list[tuple[tuple[float, float], float, float]], orders: list[list[int]], far: float
) -> None:
    ground = np.array([(x + far, y + far, z) for (x, y), z, _ in corners])
    rise = np.array([height for *_, height in corners])
    faces = np.array([[k for k in order if k < len(ground)][:3] for order in orders])
    vertices, solid, origin = extrude(ground, faces, rise, 0.3)
    assert is_closed_when_stored(vertices, solid)
    assert set(origin.tolist()) == set(range(len(faces)))
