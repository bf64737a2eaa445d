"""Buildings, trees, water and green areas: from drawn extracts to props and closed solids."""

from collections import Counter
from pathlib import Path

import numpy as np
import osm_drawings
import pytest
import shapely
import trimesh

from dojo_maps.bundle import Bundle
from dojo_maps.conversion import convert
from dojo_maps.description import LaneKind, Prop, RoadMap
from dojo_maps.geometry.pieces import lane_strips
from dojo_maps.sources.osm import read_osm
from dojo_maps.sources.osm.read.lengths import read_length
from dojo_maps.sources.osm.rules import SurroundingRules, ThingRules
from dojo_maps.sources.osm.surroundings.props import building_height, read_context, tree_height

Place = tuple[float, float]


def square(x: float, y: float, side: float) -> list[Place]:
    return [(x, y), (x + side, y), (x + side, y + side), (x, y + side), (x, y)]


def street() -> osm_drawings.Drawing:
    """Draw a crossroads with one of everything around it."""
    drawing = osm_drawings.cross()
    drawing.way(*square(20, 20, 30), building="apartments", building__levels="6", name="Tall & <old>")
    drawing.way(*square(35, 35, 30), building="yes", height="9")
    drawing.way(*square(-60, -2, 20), building="house")
    drawing.way(*square(-60, 30, 10), building="roof")
    drawing.way(*square(-60, 45, 10), building="yes", location="underground")
    outer = drawing.way(*square(-60, -70, 40))
    inner = drawing.way(*square(-50, -60, 15))
    drawing.relations.append(
        ([("way", outer, "outer"), ("way", inner, "inner")], {"type": "multipolygon", "building": "school"})
    )
    drawing.way(*square(20, -60, 35), leisure="park")
    drawing.way(*square(30, -50, 10), natural="water")
    drawing.node(60, -15, natural="tree", height="14")
    drawing.node(0, 30, natural="tree")
    drawing.node(25, 25, natural="tree")
    drawing.node(-95, -10, highway="bus_stop")
    drawing.node(40, 9, highway="bus_stop", shelter="no")
    drawing.node(5000, 5000, natural="tree")
    drawing.way((20, 70), (60, 70), natural="tree_row", leaf_type="needleleaved")
    return drawing


@pytest.fixture(scope="module")
def bundle(tmp_path_factory: pytest.TempPathFactory) -> Bundle:
    folder = tmp_path_factory.mktemp("context")
    return convert(str(street().write(folder / "street.osm")), folder / "street.dojo")[0]


def of_kind(road_map: RoadMap, kind: str) -> list[Prop]:
    return [prop for prop in road_map.props if prop.kind == kind]


def polygon(prop: Prop) -> shapely.Polygon:
    assert prop.polygon is not None
    return shapely.Polygon(prop.polygon[:, :2], [hole[:, :2] for hole in prop.holes])


def test_context_is_described(bundle: Bundle) -> None:
    road_map = bundle.road_map
    kinds = Counter(prop.kind for prop in road_map.props)
    assert (kinds["water"], kinds["green"]) == (1, 1)
    heights = {prop.id: prop.height for prop in of_kind(road_map, "building")}
    assert sorted(set(heights.values())) == [7.4, 9.0, 10.6, 20.2]
    assert dict(of_kind(road_map, "building")[0].tags)["name"] == "Tall & <old>"
    assert len({prop.id for prop in road_map.props}) == len(road_map.props)


def test_stops_stay_and_only_those_with_a_shelter_get_one(bundle: Bundle) -> None:
    assert len(of_kind(bundle.road_map, "bus_stop")) == 2
    (shelter,) = of_kind(bundle.road_map, "shelter")
    stops = {dict(stop.tags).get("shelter"): stop.position for stop in of_kind(bundle.road_map, "bus_stop")}
    assert np.linalg.norm(np.subtract(shelter.position, stops[None])[:2]) < 6.0


def test_courtyard_stays_open(bundle: Bundle) -> None:
    school = next(prop for prop in of_kind(bundle.road_map, "building") if prop.id.startswith("relation/"))
    assert len(school.holes) == 1
    assert polygon(school).area == pytest.approx(40**2 - 15**2, rel=0.01)


def test_buildings_overlap_neither_each_other_nor_the_street(bundle: Bundle) -> None:
    shapes = [polygon(prop) for prop in of_kind(bundle.road_map, "building")]
    assert all(shape.is_valid for shape in shapes)
    assert sum(shape.area for shape in shapes) == pytest.approx(shapely.union_all(shapes).area, abs=0.01)
    paved = shapely.union_all(
        [
            *lane_strips(bundle.road_map.lanes),
            *(
                shapely.make_valid(shapely.Polygon(area.polygon[:, :2]))
                for area in bundle.road_map.walking_areas
            ),
        ]
    )
    assert shapely.union_all(shapes).intersection(paved).area < 0.01
    cut = [prop for prop in of_kind(bundle.road_map, "building") if polygon(prop).area < 20**2 - 10]
    assert cut, "the house that lies over the street is cut back, not left out"


def test_trees_stand_neither_on_the_road_nor_in_a_building_nor_far_away(bundle: Bundle) -> None:
    trees = of_kind(bundle.road_map, "tree")
    assert len(trees) == 1 + 6
    driven = [lane for lane in bundle.road_map.lanes if lane.kind is LaneKind.DRIVING]
    blocked = shapely.union_all(
        [*lane_strips(driven), *(polygon(prop) for prop in of_kind(bundle.road_map, "building"))]
    )
    for tree in trees:
        assert tree.position is not None
        assert shapely.Point(tree.position[:2]).distance(blocked) > 0.5
    assert sorted({tree.height for tree in trees}) == [9.0, 14.0]


def test_solids_are_watertight_and_as_high_as_described(bundle: Bundle) -> None:
    meshes = {mesh.name: mesh for mesh in bundle.read_meshes()}
    for name in ("building", "tree", "tree/trunk"):
        solid = trimesh.Trimesh(meshes[name].vertices, meshes[name].faces)
        assert solid.is_watertight, name
        assert solid.volume > 0
    building = meshes["building"]
    heights = {prop.id: prop.height for prop in of_kind(bundle.road_map, "building")}
    volume = sum(polygon(prop).area * (prop.height + 0.3) for prop in of_kind(bundle.road_map, "building"))
    assert trimesh.Trimesh(building.vertices, building.faces).volume == pytest.approx(volume, rel=1e-3)
    for source, name in enumerate(building.ids):
        corners = building.vertices[building.faces[building.sources == source]].reshape(-1, 3)
        assert corners[:, 2].max() == pytest.approx(heights[name], abs=1e-3)
        assert corners[:, 2].min() < -0.2


def test_areas_share_the_ground_with_the_terrain(bundle: Bundle) -> None:
    meshes = {mesh.name: mesh for mesh in bundle.read_meshes()}
    areas = {}
    for name in ("terrain", "terrain/water", "terrain/green"):
        corners = meshes[name].vertices[meshes[name].faces][:, :, :2]
        areas[name] = shapely.union_all(shapely.polygons(corners))
    assert areas["terrain/water"].area == pytest.approx(100, rel=0.01)
    assert areas["terrain/green"].area == pytest.approx(35**2 - 100, rel=0.01)
    assert areas["terrain"].intersection(areas["terrain/green"]).area < 0.1


def test_context_is_bounded(bundle: Bundle, tmp_path: Path) -> None:
    data = read_osm(street().write(tmp_path / "street.osm"))
    few = SurroundingRules(things={"building": ThingRules(most=2, least_area=4.0)})
    props, issues = read_context(data, bundle.road_map, few)
    kept = [prop for prop in props if prop.kind == "building"]
    assert len(kept) == 2
    assert [issue.check for issue in issues] == ["osm.context_left_out"]
    assert issues[0].measured == 4


def test_context_takes_broken_areas_as_far_as_they_go(tmp_path: Path) -> None:
    drawing = osm_drawings.cross()
    drawing.way((20, 20), (40, 40), (40, 20), (20, 40), (20, 20), building="yes")
    drawing.way((60, 20), (80, 20), (60, 20), building="yes")
    drawing.way((60, 40), (60, 40), (60, 40), (60, 40), building="yes")
    half = drawing.way((20, -20), (40, -20), (40, -40))
    members = [("way", half, "outer"), ("way", 99_999, "outer"), ("node", 1, ""), ("relation", 1, "outer")]
    drawing.relations.append((members, {"type": "multipolygon", "building": "yes"}))
    chance = np.random.default_rng(1).random((900, 2)) * 90
    scribble = [(float(x) + 20, float(y) + 60) for x, y in chance]
    drawing.way(*scribble, scribble[0], building="yes")
    path = drawing.write(tmp_path / "broken.osm")
    written = convert(str(path), tmp_path / "broken.dojo")[0]
    buildings = of_kind(written.road_map, "building")
    assert sorted(polygon(prop).area for prop in buildings) == pytest.approx([100, 100], rel=0.02)


@pytest.mark.parametrize(
    ("text", "metres"),
    [("12", 12.0), ("12.5 m", 12.5), ("12,5", 12.5), ("40 ft", 12.192), ("40'", 12.192), ("", None),
     ("high", None), ("-3", None), ("1e9", None), ("12;13", None), ("٣", None), ("9" * 400, None)],
)  # fmt: skip
def test_read_length(text: str, metres: float | None) -> None:
    assert read_length(text) == pytest.approx(metres)


def test_buildings_of_no_kind_are_as_high_as_those_around_them(tmp_path: Path) -> None:
    drawing = osm_drawings.cross()
    for k, floors in enumerate((4, 5, 9)):
        drawing.way(*square(-20 - 40 * k, 20, 20), building="apartments", building__levels=str(floors))
    drawing.way(*square(20, 20, 20), building="yes")
    drawing.way(*square(60, 20, 6), building="yes")
    drawing.way(*square(60, 40, 20), building="house")
    bundle = convert(str(drawing.write(tmp_path / "a.osm")), tmp_path / "a.dojo")[0]
    floors = sorted(round((prop.height - 1) / 3.2) for prop in of_kind(bundle.road_map, "building"))
    assert floors == [1, 2, 4, 5, 5, 9]


def test_heights_fall_back_and_stay_within_reason() -> None:
    assert building_height({"building": "yes", "height": "9999"}) == 600.0
    assert building_height({"building": "garage"}) == pytest.approx(4.2)
    assert building_height({"building": "yes", "building:levels": "2", "roof:levels": "1"}) == pytest.approx(
        10.6
    )
    assert building_height({"building": "yes", "height": "0"}) == 2.2
    assert tree_height({"height": "900"}) == 40.0
    assert tree_height({}) == 9.0
