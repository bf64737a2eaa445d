"""Generated towns: nothing stands on a street, on another thing, or between a camera and its traffic."""

from dataclasses import replace

import numpy as np
import pytest
import shapely

from dojo_env.rendering.background import street_lamps
from dojo_env.rendering.scene import build_scene
from dojo_maps import RoadMap, convert
from dojo_maps.conversion import ConvertOptions
from dojo_maps.description import LaneKind, Prop, heading_of, points
from dojo_maps.enrichment import furnish
from dojo_maps.enrichment.town import build_town
from dojo_maps.geometry.arrangement import paved_ground
from dojo_maps.geometry.pieces import build_pieces, lane_strips
from dojo_maps.input_files import read_bytes
from dojo_maps.meshes.buildings import raise_outlines
from dojo_maps.meshes.mesh import is_watertight
from dojo_maps.meshes.parked_cars import parked_car_meshes
from dojo_maps.meshes.surroundings import surrounding_meshes
from dojo_maps.sources.files import find_network
from dojo_maps.sources.sumo_net import read_network

pytestmark = pytest.mark.sampled(2)

CAMERA_HEIGHT, CAMERA_AHEAD = 10.0, 8.0


def _furnished(name: str) -> RoadMap:
    path, _ = find_network(name)
    road_map, _ = read_network(read_bytes(path), path=path, name=name, sha256="")
    return furnish(road_map, paved_ground(build_pieces(road_map)), generated=True, surroundings=False)


@pytest.fixture(scope="module", params=["cologne1", "cologne3", "two-way", "ingolstadt1"])
def town(request: pytest.FixtureRequest) -> tuple[RoadMap, RoadMap]:
    """A map without and with its town."""
    bare = _furnished(request.param)
    return bare, build_town(bare)


def _props(road_map: RoadMap, *kinds: str) -> list[Prop]:
    return [prop for prop in road_map.props if prop.kind in kinds]


def _outlines(props: list[Prop]) -> np.ndarray:
    return np.array([shapely.Polygon(prop.polygon[:, :2]) for prop in props], dtype=object)


def _feet(props: list[Prop]) -> np.ndarray:
    return shapely.points([prop.position[:2] for prop in props])


@pytest.mark.parametrize("vehicle", ["car", "van"])
def test_parked_cars_in_the_scene_are_closed_bodies_on_their_outlines(vehicle: str) -> None:
    outline = points([(10, 1.1), (10, 2.9), (5.6, 2.9), (5.6, 1.1)])  # The nose at 10, its right side below.
    car = Prop(id="car", kind="parked_car", height=1.5, polygon=outline, tags=(("vehicle", vehicle),))
    meshes = {mesh.name.rpartition("/")[2]: mesh for mesh in parked_car_meshes([car], np.zeros(3))}
    assert set(meshes) > {"glass", "tyre"}
    assert len(meshes) == 3
    for mesh in meshes.values():
        corners = mesh.vertices[mesh.faces]
        assert is_watertight(mesh)
        assert np.einsum("ij,ij->i", corners[:, 0], np.cross(corners[:, 1], corners[:, 2])).sum() > 0.0
    every = np.concatenate([mesh.vertices for mesh in meshes.values()])
    assert every.min(axis=0) == pytest.approx([5.6, 1.1, 0.0], abs=0.03)
    assert every.max(axis=0) == pytest.approx([10.0, 2.9, 1.5], abs=0.03)
    panes = meshes["glass"].vertices
    assert panes[panes[:, 2] > 1.2, 0].mean() != pytest.approx(7.8, abs=0.05)


def test_parked_cars_of_the_scene_are_drawn_once(tmp_path) -> None:
    bundle, _ = convert("cologne1", tmp_path / "m.dojo")
    names = {mesh.name for mesh in bundle.read_meshes()}
    assert {"building/car/glass", "building/car/tyre", "building/car/white"} <= names
    scene = build_scene(bundle)
    faces = sum(len(mesh.faces) for mesh in bundle.read_meshes() if not mesh.name.startswith("building/car/"))
    assert len(scene.faces) == faces
    assert len(scene.parked.ids) == len(_props(bundle.road_map, "parked_car"))


def _heading_at(shapes: list[np.ndarray], place: np.ndarray) -> float:
    """The heading of the nearest line's nearest piece, radians."""
    pieces = np.concatenate([np.stack([shape[:-1, :2], shape[1:, :2]], axis=1) for shape in shapes])
    nearest = pieces[shapely.distance(shapely.linestrings(pieces), shapely.Point(place)).argmin()]
    return float(np.arctan2(*(nearest[1] - nearest[0])[::-1]))


def _street(road_map: RoadMap) -> shapely.Geometry:
    """Everything that vehicles and people use, before the town came."""
    rings = [j.polygon for j in road_map.junctions if len(j.polygon) > 2]
    rings += [thing.polygon for thing in (*road_map.sidewalks, *road_map.walking_areas)]
    shapes = [shapely.make_valid(shapely.Polygon(ring[:, :2])) for ring in rings]
    return shapely.union_all([*shapes, *lane_strips(road_map.lanes)])


def _driven(road_map: RoadMap) -> shapely.Geometry:
    lanes = [lane for lane in road_map.lanes if lane.kind != "sidewalk"]
    return shapely.union_all(lane_strips(lanes))


def test_houses_and_hedges_stand_on_no_street_and_on_no_other(town: tuple[RoadMap, RoadMap]) -> None:
    bare, built = town
    street = _street(bare)
    for kind in ("building", "hedge"):
        shapes = _outlines(_props(built, kind))
        assert shapely.is_valid(shapes).all()
        assert shapely.area(shapely.intersection(shapes, street)).max(initial=0.0) < 1e-3
        assert shapely.union_all(shapes).area == pytest.approx(shapely.area(shapes).sum(), abs=0.01)
    assert len(_props(built, "building")) > 20


def test_houses_stand_along_the_pavement(town: tuple[RoadMap, RoadMap]) -> None:
    bare, built = town
    pavement = shapely.union_all([shapely.Polygon(walk.polygon[:, :2]).buffer(0) for walk in bare.sidewalks])
    distances = shapely.distance(_outlines(_props(built, "building")), pavement)
    assert distances.min() > 2.0
    assert distances.max() < 6.5


def test_posts_and_trunks_keep_clear_of_lanes_walls_and_crossings(town: tuple[RoadMap, RoadMap]) -> None:
    _, built = town
    feet = _feet(_props(built, "lamp", "sign", "tree"))
    assert shapely.distance(feet, _driven(built)).min() > 0.25
    assert shapely.distance(feet, shapely.union_all(_outlines(_props(built, "building")))).min() > 0.25
    crossings = [shapely.Polygon(crossing.polygon[:, :2]) for crossing in built.crossings]
    assert shapely.distance(feet, shapely.union_all(crossings)).min() > 1.4
    apart = shapely.STRtree(feet).query(feet, "dwithin", distance=1.9)
    assert (apart[0] == apart[1]).all()


def test_crowns_keep_a_metre_from_lanes(town: tuple[RoadMap, RoadMap]) -> None:
    _, built = town
    trees = _props(built, "tree")
    widest = 0.32 * 1.15 * np.array([tree.height for tree in trees])
    assert (shapely.distance(_feet(trees), _driven(built)) - widest).min() > 0.99


def test_nothing_hides_traffic_from_a_camera_over_the_junction(town: tuple[RoadMap, RoadMap]) -> None:
    _, built = town
    solids = list(_outlines(_props(built, "building", "hedge")))
    trees = _props(built, "tree")
    solids += list(shapely.buffer(_feet(trees), 0.32 * np.array([tree.height for tree in trees])))
    tree = shapely.STRtree(solids)
    stopped = {link.from_id for signal in built.signals for link in signal.links if link.kind == "vehicle"}
    for lane in built.lanes:
        line = shapely.LineString(lane.shape[:, :2])
        if lane.id not in stopped or lane.kind == "sidewalk":
            continue
        step = lane.shape[-1, :2] - lane.shape[-2, :2]
        eye = lane.shape[-1, :2] + CAMERA_AHEAD * step / np.hypot(*step)
        for back in range(0, int(min(line.length, 75.0)), 5):
            ray = shapely.LineString([eye, line.interpolate(line.length - back).coords[0]])
            assert not len(tree.query(ray, predicate="intersects")), (lane.id, back)


def test_what_is_generated_says_so_and_has_names_of_its_own(town: tuple[RoadMap, RoadMap]) -> None:
    bare, built = town
    new = built.props[len(bare.props) :]
    assert built.props[: len(bare.props)] == bare.props
    assert all(("origin", "generated") in prop.tags and prop.id.startswith("generated:") for prop in new)
    for things in (built.props, built.sidewalks):
        assert len({thing.id for thing in things}) == len(things)


def test_forecourts_have_no_holes_and_sidewalks_give_way_to_bays_only(town: tuple[RoadMap, RoadMap]) -> None:
    bare, built = town
    bays = shapely.union_all(_outlines(_props(built, "parking")))
    kept = {walk.id: walk for walk in built.sidewalks}
    for walk in bare.sidewalks:
        before, after = (shapely.Polygon(each.polygon[:, :2]) for each in (walk, kept[walk.id]))
        if not before.buffer(0).intersects(bays):
            assert kept[walk.id] is walk
        assert after.is_valid
    paved = [walk for walk in built.sidewalks if "forecourt" in walk.id]
    assert all(shapely.Polygon(walk.polygon[:, :2]).is_valid and not walk.holes for walk in paved)


def _pavement(road_map: RoadMap) -> shapely.Geometry:
    rings = [(thing.polygon, thing.holes) for thing in road_map.sidewalks]
    rings += [(thing.polygon, ()) for thing in road_map.walking_areas]
    return shapely.union_all(
        [shapely.Polygon(ring[:, :2], [hole[:, :2] for hole in holes]).buffer(0) for ring, holes in rings]
    )


def test_cars_are_parked_in_bays_and_in_nobodys_way(town: tuple[RoadMap, RoadMap]) -> None:
    _, built = town
    cars, bays = _outlines(_props(built, "parked_car")), _outlines(_props(built, "parking"))
    assert len(cars) >= (0 if built.name == "ingolstadt1" else 20)
    assert shapely.union_all(cars).area == pytest.approx(shapely.area(cars).sum(), abs=1e-6)
    assert shapely.covered_by(cars, shapely.union_all(bays).buffer(1e-3)).all()
    assert shapely.intersection(shapely.union_all(bays), _pavement(built)).area < 0.05
    junctions = [shapely.Polygon(j.polygon[:, :2]) for j in built.junctions if len(j.polygon) > 2]
    crossings = [shapely.Polygon(crossing.polygon[:, :2]) for crossing in built.crossings]
    posts = _feet([prop for prop in built.props if prop.position is not None])
    for others, distance in (
        (_driven(built), 0.05),
        (shapely.union_all(junctions), 10.0),
        (shapely.union_all(crossings), 4.0),
        (shapely.union_all(_outlines(_props(built, "building"))), 1.5),
        (shapely.union_all(posts), 0.5),
    ):
        assert shapely.distance(cars, others).min(initial=100.0) > distance


def test_pavement_leads_around_every_bay(town: tuple[RoadMap, RoadMap]) -> None:
    _, built = town
    walks = {walk.id: shapely.Polygon(walk.polygon[:, :2]) for walk in built.sidewalks if walk.road}
    for bay in _props(built, "parking"):
        there, back = np.split(bay.polygon[:, :2], 2)
        behind = shapely.LineString(back + 1.0 * (back - there[::-1]) / 2.2)
        own = [shape for name, shape in walks.items() if name.split(":")[1] == dict(bay.tags)["road"]]
        assert shapely.union_all(own).buffer(1e-3).covers(behind)


def test_shelters_stand_on_the_pavement_and_face_the_street(town: tuple[RoadMap, RoadMap]) -> None:
    _, built = town
    shelters = _props(built, "shelter")
    cars, driven = shapely.union_all(_outlines(_props(built, "parked_car"))), _driven(built)
    for shelter in shelters:
        heading = heading_of(shelter)
        ahead = np.array([np.cos(heading), np.sin(heading)])
        place = np.array(shelter.position[:2])
        ground = shapely.LineString(
            [place - 1.7 * ahead[::-1] * [-1, 1], place + 1.7 * ahead[::-1] * [-1, 1]]
        )
        assert driven.distance(ground.buffer(0.6, cap_style="flat")) > 0.3
        assert driven.distance(shapely.Point(place + 1.5 * ahead)) == 0.0
        assert cars.distance(ground) > 7.0 or cars.is_empty
    assert shelters or built.name == "cologne1"


def test_stops_that_a_source_tells_of_get_shelters_beside_their_street() -> None:
    bare = _furnished("cologne1")
    (invented,) = _props(build_town(bare), "shelter")
    x, y = np.array(invented.position[:2]) + 3.0 * np.array([np.cos(heading_of(invented)), 0.0])
    stop = Prop(id="stop", kind="bus_stop", height=0.0, position=(float(x), float(y), 0.0))
    source = replace(bare.source, kind="osm")
    pole = replace(stop, id="pole", tags=(("shelter", "no"),))
    town = build_town(replace(bare, source=source, props=(*bare.props, stop, pole)))
    (shelter,) = _props(town, "shelter")
    assert np.hypot(*(np.array(shelter.position[:2]) - [x, y])) < 4.0
    assert heading_of(shelter) == pytest.approx(heading_of(invented), abs=0.1)


def test_a_source_that_tells_of_houses_gets_lamps_only() -> None:
    bare = _furnished("cologne1")
    told = build_town(replace(bare, source=replace(bare.source, kind="osm")))
    assert {prop.kind for prop in told.props[len(bare.props) :]} == {"lamp"}
    assert told.sidewalks == bare.sidewalks


@pytest.mark.parametrize(("width", "turned"), [(2.0, 0.0), (4.3, 36.0), (5.0, 90.0), (1.0, None)])
def test_cars_stand_on_the_parking_lanes_that_a_source_tells_of(width: float, turned: float | None) -> None:
    bare = _furnished("cologne1")
    roads = {lane.road for lane in bare.lanes if lane.index == 1}
    parking = {lane.id for lane in bare.lanes if lane.index == 0 and lane.road in roads}
    lanes = tuple(
        replace(lane, kind=LaneKind.SHOULDER, allow=(), width=width) if lane.id in parking else lane
        for lane in bare.lanes
    )
    cars = _props(
        build_town(replace(bare, source=replace(bare.source, kind="osm"), lanes=lanes)), "parked_car"
    )
    assert bool(cars) == (turned is not None)
    shapes = [lane.shape for lane in lanes if lane.id in parking]
    ground = shapely.union_all(lane_strips([lane for lane in lanes if lane.id in parking]))
    for car in cars:
        outline = shapely.Polygon(car.polygon[:, :2])
        assert shapely.area(shapely.difference(outline, ground.buffer(0.2))) < 0.1
        ahead = car.polygon[0, :2] - car.polygon[3, :2]
        along = _heading_at(shapes, np.array(outline.centroid.coords[0]))
        turn = np.degrees(np.arctan2(ahead[1], ahead[0]) - along)
        assert abs(np.remainder(turn + 180.0, 360.0) - 180.0) == pytest.approx(turned, abs=4.0)
        assert turned == 0.0 or np.remainder(turn + 180.0, 360.0) < 180.0  # To the right, as the kerb is.


def test_a_map_without_signals_has_no_town() -> None:
    bare = replace(_furnished("cologne1"), signals=())
    assert build_town(bare) is bare


def test_fast_roads_have_no_houses() -> None:
    bare = _furnished("cologne1")
    fast = replace(bare, lanes=tuple(replace(lane, speed=25.0) for lane in bare.lanes))
    assert not _props(build_town(fast), "building")


def test_convert_leaves_surroundings_out_and_keeps_sidewalks(tmp_path) -> None:
    bundle, _ = convert("cologne1", tmp_path / "m.dojo", ConvertOptions(surroundings=False))
    assert not _props(bundle.road_map, "building", "tree", "lamp")
    assert bundle.road_map.sidewalks


def test_the_lamps_that_light_the_night_are_those_that_stand_there(tmp_path) -> None:
    bundle, _ = convert("cologne1", tmp_path / "m.dojo")
    scene = build_scene(bundle)
    lamps = street_lamps(scene, np.zeros(3), 5000.0)
    assert len(lamps) == len(_props(bundle.road_map, "lamp"))
    names = [mesh for mesh in bundle.read_meshes() if mesh.name == "building/lamp"]
    corners = names[0].vertices
    nearest = [np.linalg.norm(corners - lamp, axis=1).min() for lamp in lamps]
    assert max(nearest) < 0.5


def test_a_gable_roof_is_closed_and_encloses_what_it_should() -> None:
    tags = (("roof:shape", "gabled"), ("roof:direction", "0"), ("roof:height", "4.0"))
    outline = points([(0, 0), (12, 0), (12, 10), (0, 10)])
    house = Prop(id="house", kind="building", height=13.0, polygon=outline, tags=tags)
    mesh = raise_outlines("building", [house], np.zeros(3))
    corners = mesh.vertices[mesh.faces]
    volume = np.einsum("ij,ij->i", corners[:, 0], np.cross(corners[:, 1], corners[:, 2])).sum() / 6
    assert is_watertight(mesh)
    assert volume == pytest.approx(120.0 * (9.0 + 4.0 / 2 + 0.3), rel=1e-3)
    assert mesh.vertices[:, 2].max() == pytest.approx(13.0, abs=0.01)


@pytest.mark.parametrize("text", ["", "nan", "1e400", "north", "12345678"])
def test_heading_of_is_east_where_the_tag_is_no_heading(text: str) -> None:
    prop = Prop(id="a", kind="lamp", height=8.0, position=(0.0, 0.0, 0.0), tags=(("heading", text),))
    assert heading_of(prop) == 0.0


def test_conifers_alone_have_crowns_and_no_leaves() -> None:
    bare = _furnished("cologne1")
    x, y = bare.origin
    fir = Prop(id="fir", kind="tree", height=9.0, position=(x, y, 0.0), tags=(("leaf_type", "needleleaved"),))
    (crown, trunk) = surrounding_meshes(replace(bare, props=(fir,)))
    assert (crown.name, trunk.name) == ("tree", "tree/trunk")
    assert is_watertight(crown)
    assert crown.vertices[:, 2].max() == pytest.approx(9.0)


def test_a_crown_stays_within_its_room_whatever_the_species() -> None:
    bare = _furnished("cologne1")
    trees = [
        Prop(id=f"{k}", kind="tree", height=10.0, position=(bare.origin[0] + 70.0 * k, bare.origin[1], 0.0))
        for k in range(12)
    ]
    crowns, leaves, _ = surrounding_meshes(replace(bare, props=tuple(trees)))
    for mesh in (crowns, leaves):
        for k, name in enumerate(mesh.ids):
            places = mesh.vertices[np.unique(mesh.faces[mesh.sources == k])]
            away = np.hypot(places[:, 0] - 70.0 * int(name), places[:, 1])
            assert away.max() < 1.25 * 0.32 * 1.15 * 10.0
            assert 1.0 < places[:, 2].min() < places[:, 2].max() < 10.6
