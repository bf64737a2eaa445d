"""Islands: which ground between carriageways is raised, and that it is raised as a whole."""

from pathlib import Path

import pytest
import shapely
from osm_drawings import Drawing

from dojo_maps.conversion import ConvertOptions, convert


def draw_median(narrow: float, wide: float, **tags: str) -> Drawing:
    """Two one-way ways of 250 m, so far apart in the west and in the east, joined at both ends."""
    d = Drawing()
    near, far = narrow / 2, wide / 2
    d.way((-130, -near), (0, -near), (40, -far), (120, -far), **tags)
    d.way((120, far), (40, far), (0, near), (-130, near), **tags)
    d.way((-130, -80), (-130, -near), (-130, near), (-130, 80), highway="tertiary", lanes="2")
    d.way((120, -80), (120, -far), (120, far), (120, 80), highway="tertiary", lanes="2")
    return d


@pytest.mark.parametrize(
    ("kind", "narrow", "wide", "least", "most"),
    [
        ("primary", 8, 14, 210, 250),
        ("primary", 8, 30, 80, 140),
        ("primary", 14, 30, 0, 0),
        ("cycleway", 4, 4, 0, 0),
    ],
    ids=["whole", "its narrow end", "none", "between paths"],
)
def test_ground_with_carriageways_all_around_is_one_island(
    kind: str, narrow: int, wide: int, least: float, most: float, tmp_path: Path
) -> None:
    drawing = draw_median(narrow, wide, highway=kind, oneway="yes", lanes="1", sidewalk="no")
    source = drawing.write(tmp_path / "a.osm")
    bundle, _ = convert(str(source), tmp_path / "a.dojo", ConvertOptions(surroundings=False))
    shapes = [shapely.Polygon(prop.polygon[:, :2]) for prop in bundle.road_map.props if prop.kind == "island"]
    # Longer than wide by far: half the way around is the length.
    lengths = [shapely.minimum_rotated_rectangle(shape).length / 2 for shape in shapes]
    assert least <= sum(lengths) <= most
    assert len([length for length in lengths if length > 5]) == (most > 0)
