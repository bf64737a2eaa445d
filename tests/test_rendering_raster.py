"""The rasteriser against arithmetic: every pixel once, depths exact, clipping at the near plane."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from dojo_env.rendering.raster import COVER, NEARER, STATIC, draw_face, draw_mesh, fill_triangle

LENS = np.array([100.0, 50.0, 40.0, 0.5, 1000.0])
# On this grid edges that differ do so by far more than rounding.
corner = st.tuples(*(st.integers(-30 * 1024, top * 1024).map(lambda k: k / 1024) for top in (130, 110)))


def blank(height=80, width=100):
    return np.zeros((height, width), dtype=np.float32), np.full((height, width), STATIC, dtype=np.int32)


@given(rim=st.lists(corner, min_size=3, max_size=8, unique=True), hub=corner)
def test_fill_covers_each_pixel_of_a_fan_once(rim, hub):
    """Triangles around a hub, in the order of their angle, tile a star: no gap and nothing twice."""
    rim = sorted(rim, key=lambda p: np.arctan2(p[1] - hub[1], p[0] - hub[0]))
    hits = np.zeros((80, 100), dtype=int)
    for a, b in zip(rim, rim[1:] + rim[:1], strict=True):
        turn = (a[0] - hub[0]) * (b[1] - hub[1]) - (a[1] - hub[1]) * (b[0] - hub[0])
        if turn <= 0:
            continue
        depths, tags = blank()
        fill_triangle(*map(float, hub), 1.0, *map(float, a), 1.0, *map(float, b), 1.0, 0, COVER, depths, tags)
        hits += tags == 0
    assert hits.max(initial=0) <= 1


def test_fill_tiles_a_square_without_gaps():
    generator = np.random.default_rng(4)
    hits = np.zeros((80, 100), dtype=int)
    hub = (*generator.uniform(20, 60, 2), 1.0)
    corners = [(10.0, 10.0, 1.0), (90.0, 10.0, 1.0), (90.0, 70.0, 1.0), (10.0, 70.0, 1.0)]
    for k in range(4):
        depths, tags = blank()
        changed = fill_triangle(*hub, *corners[k], *corners[(k + 1) % 4], 0, COVER, depths, tags)
        assert changed == (tags == 0).sum()
        hits += tags == 0
    assert (hits[10:70, 10:90] == 1).all()
    assert hits.sum() == 60 * 80


def test_depth_is_right_in_perspective_on_a_slanted_plane():
    depths, tags = blank()
    # A plane with normal n at distance d: depth along the ray (x, y, 1) is d / n.(x, y, 1).
    normal, distance = np.array([0.3, -0.5, 1.0]), 12.0
    corners = np.array([(x, y, (distance - normal[0] * x - normal[1] * y) / normal[2])
                        for x, y in ((-4.0, -3.0), (4.0, -3.0), (0.0, 5.0))])  # fmt: skip
    draw_face(corners, LENS, 7, NEARER, depths, tags)
    rows, columns = np.nonzero(tags == 7)
    rays = np.column_stack([(columns + 0.5 - 50) / 100, (rows + 0.5 - 40) / 100, np.ones(len(rows))])
    assert len(rows) > 500
    np.testing.assert_allclose(1 / depths[rows, columns], distance / (rays @ normal), rtol=1e-5)


def test_triangle_through_the_camera_is_clipped_at_the_near_plane():
    depths, tags = blank()
    ground = np.array([(-50.0, 1.0, -40.0), (50.0, 1.0, -40.0), (0.0, 1.0, 60.0)])
    draw_face(ground, LENS, 1, NEARER, depths, tags)
    assert (tags[:40] == STATIC).all()
    assert (tags[45:, 40:60] == 1).all()
    assert np.isfinite(depths).all()
    assert (1 / depths[tags == 1] >= 0.5 - 1e-6).all()


@pytest.mark.parametrize("order", [(0, 1), (1, 0)])
def test_nearer_face_wins_in_any_order(order):
    faces = np.array([(0, 1, 2), (3, 4, 5)], dtype=np.int32)[list(order)]
    vertices = np.array([(-9.0, -9, 10), (9, -9, 10), (0, 9, 10), (-9, -9, 5), (9, -9, 5), (0, 9, 5)])
    depths, tags = blank()
    draw_mesh(vertices, faces, np.eye(3), np.zeros(3), LENS, depths, tags)
    seen = faces[tags[tags >= 0]]
    assert len(seen)
    assert (seen == [3, 4, 5]).all()


def test_degenerate_triangles_leave_no_trace():
    depths, tags = blank()
    for corners in ([(5, 5), (5, 5), (5, 5)], [(0, 0), (50, 50), (99, 99)], [(-1e9, 3), (1e9, 3), (0, 3)]):
        (a, b), (c, d), (e, f) = corners
        fill_triangle(
            float(a), float(b), 1.0, float(c), float(d), 1.0, float(e), float(f), 1.0, 3, COVER, depths, tags
        )
    assert (tags == STATIC).all()
