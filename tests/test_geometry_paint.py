"""Cutting paint to the carriageway: whole where surfaces join, a little short of where they end."""

import numpy as np
import pytest
import shapely
from test_geometry_arrangement import NOTHING, make_pieces

from dojo_maps.geometry.arrangement import divide_ground, paved_ground
from dojo_maps.geometry.paint import KERB_GAP, Canvas
from dojo_maps.geometry.pieces import Layer


def make_canvas(polygons: list[shapely.Geometry], layers: list[Layer]) -> Canvas:
    pieces = make_pieces(polygons, layers)
    return Canvas(pieces, divide_ground(pieces, paved_ground(pieces), NOTHING, margin=5.0))


def test_cut_keeps_paint_off_the_border_and_whole_between_lanes() -> None:
    squares = [shapely.box(0, 0, 3, 9), shapely.box(3, 0, 6, 9), shapely.box(6, 0, 8, 9)]
    canvas = make_canvas(squares, [Layer.ROAD, Layer.JUNCTION, Layer.SIDEWALK])
    cut, index = canvas.cut(np.array([shapely.box(-1, 4, 9, 5), shapely.box(7, 1, 8, 2)]))
    assert set(index) == {0}
    whole = shapely.union_all(cut)
    assert whole.geom_type == "Polygon"
    assert whole.bounds == pytest.approx((KERB_GAP, 4.0, 6.0 - KERB_GAP, 5.0))
    assert whole.area == pytest.approx(6.0 - 2 * KERB_GAP)


def test_cut_paints_nothing_where_there_is_no_carriageway() -> None:
    canvas = make_canvas([shapely.box(0, 0, 3, 9)], [Layer.SIDEWALK])
    assert len(canvas.cut(np.array([shapely.box(0, 0, 3, 3)]))[0]) == 0
    assert len(canvas.cut(NOTHING)[0]) == 0
