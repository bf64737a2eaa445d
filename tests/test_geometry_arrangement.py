"""The division of the ground: any claims, one owner per face and level, nothing lost and nothing twice."""

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st

from dojo_maps.geometry.arrangement import TERRAIN, divide_ground, paved_ground
from dojo_maps.geometry.pieces import GRID, Layer, Pieces
from dojo_maps.meshes.mesh import Mesh, is_watertight
from dojo_maps.meshes.surfaces import build_ground, surface_meshes

NOTHING = np.empty(0, dtype=object)

Box = tuple[tuple[float, float], float, float, float, Layer]
"""A corner, width and height, metres, the angle it is turned by, degrees, and what it is."""

corner = st.tuples(st.floats(-50, 50), st.floats(-50, 50))
boxes = st.lists(
    st.tuples(
        corner, st.floats(0.5, 30), st.floats(0.5, 30), st.floats(0, 90), st.sampled_from([*Layer][:5])
    ),
    min_size=1,
    max_size=8,
)


def make_pieces(
    polygons: list[shapely.Geometry], layers: list[Layer], heights: list[float] | None = None
) -> Pieces:
    heights = heights or [0.0] * len(polygons)
    lines = [
        np.column_stack([shapely.get_coordinates(p.exterior), np.full(len(p.exterior.coords), z)])
        for p, z in zip(polygons, heights, strict=True)
    ]
    return Pieces(
        polygons=shapely.set_precision(np.array(polygons, dtype=object), GRID),
        layers=tuple(layers),
        ids=tuple(str(k) for k in range(len(polygons))),
        lines=tuple(lines),
        flush=(False,) * len(polygons),
        paved=len(polygons),
        mouths=NOTHING,
        cuts=NOTHING,
    )


def rotated_boxes(drawn: list[Box]) -> Pieces:
    polygons = [
        shapely.affinity.rotate(shapely.box(x, y, x + w, y + h), angle) for (x, y), w, h, angle, _ in drawn
    ]
    return make_pieces(polygons, [layer for *_, layer in drawn])


def upward_area(mesh: Mesh) -> float:
    """Measure the ground that a mesh's upward faces cover, square metres."""
    a, b, c = (mesh.vertices[mesh.faces[:, k], :2] for k in range(3))
    doubled = (b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0]
    return float(np.maximum(doubled, 0.0).sum() / 2)


@settings(max_examples=40)
@given(boxes)
def test_divide_ground_covers_every_claim_once(drawn: list[Box]) -> None:
    pieces = rotated_boxes(drawn)
    paved = paved_ground(pieces)
    parts = divide_ground(pieces, paved, NOTHING, margin=5.0)
    owned = parts.polygons[parts.owners != TERRAIN]
    union = shapely.union_all(pieces.polygons)
    assert shapely.area(owned).sum() == pytest.approx(shapely.union_all(owned).area, abs=1e-3)
    # Every corner may move by a raster's width.
    assert union.difference(shapely.union_all(owned)).area < GRID * union.length
    frame = shapely.union_all(parts.polygons)
    assert shapely.area(parts.polygons).sum() == pytest.approx(frame.area, abs=1e-3)
    assert frame.equals(frame.envelope)


@settings(max_examples=40)
@given(boxes)
def test_raised_surfaces_are_watertight_and_as_large_as_their_parts(drawn: list[Box]) -> None:
    pieces = rotated_boxes(drawn)
    parts = divide_ground(pieces, paved_ground(pieces), NOTHING, margin=5.0)
    ground = build_ground(pieces, parts)
    for mesh in surface_meshes(ground, pieces):
        area = sum(
            polygon.area
            for polygon, owner in zip(parts.polygons, parts.owners, strict=True)
            if (pieces.layers[owner] if owner != TERRAIN else Layer.TERRAIN) == mesh.name
        )
        assert upward_area(mesh) == pytest.approx(area, rel=1e-3, abs=0.05)
        if mesh.name in ("walking_area", "sidewalk", "island"):
            assert is_watertight(mesh)


def test_divide_ground_gives_the_first_claim_the_overlap() -> None:
    pieces = make_pieces([shapely.box(0, 0, 10, 10), shapely.box(5, 0, 15, 10)], [Layer.ROAD, Layer.SIDEWALK])
    parts = divide_ground(pieces, paved_ground(pieces), NOTHING, margin=1.0)
    areas = {int(owner): polygon.area for owner, polygon in zip(parts.owners, parts.polygons, strict=True)}
    assert areas[0] == pytest.approx(100.0)
    assert areas[1] == pytest.approx(50.0)


def test_divide_ground_keeps_both_levels_when_one_passes_over_the_other() -> None:
    polygons = [shapely.box(0, 4, 20, 8), shapely.box(8, 0, 12, 12)]
    pieces = make_pieces(polygons, [Layer.ROAD, Layer.ROAD], [0.0, 6.0])
    parts = divide_ground(pieces, paved_ground(pieces), NOTHING, margin=1.0)
    for owner, polygon in enumerate(polygons):
        assert shapely.area(parts.polygons[parts.owners == owner]).sum() == pytest.approx(polygon.area)
    assert not parts.lowest[parts.owners == 1].all()
    assert parts.lowest[parts.owners == 0].all()


def test_paved_ground_closes_rounding_seams_and_leaves_slits() -> None:
    seam = make_pieces([shapely.box(0, 0, 10, 3), shapely.box(0, 3.02, 10, 6)], [Layer.ROAD, Layer.ROAD])
    slit = make_pieces([shapely.box(0, 0, 10, 3), shapely.box(0, 3.1, 10, 6)], [Layer.ROAD, Layer.ROAD])
    assert paved_ground(seam).area == pytest.approx(60.0, abs=0.01)
    assert paved_ground(slit).area == pytest.approx(59.0, abs=0.01)
