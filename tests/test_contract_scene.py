"""The meshes of `dojo-maps convert`: loaded with trimesh, held against the network's own lanes and floors."""

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import networks
import numpy as np
import pytest
import shapely
import trimesh
from conftest import Conversion
from numpy.typing import NDArray
from oracle import ExpectedLane, ExpectedMap, floor
from scene_reader import (
    GROUND,
    LAYERS,
    PAINT,
    SAME_LEVEL,
    Part,
    Scene,
    Surface,
    is_closed_when_stored,
    sources_of,
)
from shapely import LineString

pytestmark = pytest.mark.sampled(5)

KERB_LIMIT = 0.25
LIFT_LEAST, LIFT_MOST = 0.005, 0.05
ROUNDING = 0.001
EDGE = 0.03


def solids(scene: Scene) -> list[Part]:
    return [part for part in scene.parts if part.layer in {"sidewalk", "walking_area"}]


def merged_bodies(mesh: trimesh.Trimesh) -> list[trimesh.Trimesh]:
    """Weld corners at the same place, whatever their normals, and take the mesh apart into its bodies."""
    whole = mesh.copy()
    whole.merge_vertices(merge_tex=True, merge_norm=True)
    return list(whole.split(only_watertight=False))


def spread_points(surface: Surface) -> NDArray[np.float64]:
    """Four points inside each face: the middle, and one near each corner."""
    weights = np.array([[1 / 3] * 3, [0.9, 0.05, 0.05], [0.05, 0.9, 0.05], [0.05, 0.05, 0.9]])
    return np.einsum("wc,ncx->nwx", weights, surface.triangles).reshape(-1, 3)


def centre_points(lane: ExpectedLane, origin: tuple[float, float]) -> NDArray[np.float64]:
    """Points along a lane's centre line, in the scene's frame, with the network's height."""
    corners = np.array(lane.shape)
    line = LineString(corners)
    if line.length < 1.0:
        return np.empty((0, 3))
    count = max(2, min(12, int(line.length / 10)))
    distances = np.linspace(0.5, LineString(corners[:, :2]).length - 0.5, count)
    flat = LineString(corners[:, :2])
    steps = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(corners[:, :2], axis=0).T))])
    heights = np.interp(distances, steps, corners[:, 2])
    places = shapely.get_coordinates(flat.interpolate(distances))
    return np.column_stack([places - origin, heights])


def heights_near(surface: Surface, points: NDArray[np.float64]) -> NDArray[np.float64]:
    """For each point the surface's height above it, on the level nearest to it; nan where there is none."""
    numbers, _, heights = surface.faces_under(points)
    differences = heights - points[numbers, 2]
    nearest = np.full(len(points), np.nan)
    order = np.argsort(-np.abs(differences), kind="stable")
    nearest[numbers[order]] = differences[order]
    return nearest


def test_scene_is_glb_with_y_up(conversion: Conversion) -> None:
    gltf = conversion.scene.gltf
    assert gltf["asset"]["version"] == "2.0"
    assert not gltf.get("extensionsRequired")
    assert all("uri" not in item for item in [*gltf["buffers"], *gltf.get("images", [])])


def test_every_node_is_named_after_its_layer(conversion: Conversion) -> None:
    names = [node.get("name", "") for node in conversion.scene.gltf["nodes"]]
    assert len(names) == len(set(names))
    assert {name.split("/")[0] for name in names} <= LAYERS


def test_expected_layers_are_there(conversion: Conversion) -> None:
    expected = conversion.expected
    layers = {part.layer for part in conversion.scene.parts}
    kinds = [lane.kinds for lane in expected.lanes.values()]
    wanted = {"terrain"}
    wanted |= {"road", "marking"} if {"driving"} in kinds else set()
    wanted |= {"rail"} if {"rail"} in kinds else set()
    wanted |= {"sidewalk"} if {"sidewalk"} in kinds else set()
    wanted |= {"walking_area"} if expected.walking_areas else set()
    wanted |= {"crossing"} if expected.crossings else set()
    wanted |= {"signal", "stop_line"} if expected.signalised_lanes and {"driving"} in kinds else set()
    assert layers >= wanted


def test_scene_holds_only_finite_numbers(conversion: Conversion) -> None:
    for part in conversion.scene.parts:
        assert len(part.triangles) > 0, part.name
        assert np.isfinite(part.triangles).all(), part.name


def test_scene_has_hardly_any_face_without_area(conversion: Conversion) -> None:
    triangles = np.concatenate([part.triangles for part in conversion.scene.parts])
    sides = triangles[:, 1:] - triangles[:, :1]
    areas = np.linalg.norm(np.cross(sides[:, 0], sides[:, 1]), axis=1) / 2
    assert (areas < 1e-8).mean() < 0.002


def test_scene_stays_near_its_origin(conversion: Conversion) -> None:
    (west, south), (east, north) = conversion.description["bounds"]
    reach = max(east - west, north - south) + 300.0
    triangles = np.concatenate([part.triangles for part in conversion.scene.parts])
    assert np.abs(triangles[:, :, :2]).max() < reach


def test_lanes_lie_on_the_ground_at_their_height(conversion: Conversion) -> None:
    scene = conversion.scene
    for lane in conversion.expected.lanes.values():
        points = centre_points(lane, scene.origin)
        if lane.has_ground and len(points):
            differences = heights_near(scene.ground, points)
            limit = LIFT_MOST if lane.is_driving else KERB_LIMIT
            if not conversion.expected.is_flat:
                # Where a road meets a junction of another height, some ramp has to join the two.
                ends = np.linalg.norm(points[:, None, :2] - points[[0, -1], :2], axis=2).min(axis=1)
                differences[(ends < 20.0) & (np.abs(differences) < 0.5)] = 0.0
            assert not np.isnan(differences).any(), f"no ground under {lane.id}"
            # Networks without heights may have a walking area or sidewalk lie across a lane for a while;
            # the road wins there, so a driving lane is never raised.
            assert np.abs(differences).max() <= limit, (lane.id, differences)


def test_rail_layer_lies_along_rail_lanes(conversion: Conversion) -> None:
    scene = conversion.scene
    rails = scene.tops("rail")
    for lane in conversion.expected.lanes.values():
        points = centre_points(lane, scene.origin)
        if lane.kinds == {"rail"} and len(points) > 2 and lane.shape[0][:2] != lane.shape[-1][:2]:
            near = shapely.dwithin(shapely.points(points[1:-1, :2]), rails.union, lane.width / 2)
            assert near.mean() > 0.9, lane.id


def _check_single_cover(scene: Scene, expected: ExpectedMap) -> None:
    ground = scene.ground
    assert ground.doubled_area() <= 0.005 * ground.union.area
    if expected.is_flat:
        assert ground.total_area == pytest.approx(ground.union.area, rel=0.005)


def test_ground_is_covered_once_with_generated_sidewalks(conversion: Conversion) -> None:
    _check_single_cover(conversion.scene, conversion.expected)


def test_ground_is_covered_once_when_nothing_is_generated(plain_conversion: Conversion) -> None:
    _check_single_cover(plain_conversion.scene, plain_conversion.expected)


def test_ground_is_the_networks_when_nothing_is_generated(plain_conversion: Conversion) -> None:
    scene = plain_conversion.scene
    wanted = scene.to_local(plain_conversion.expected.ground)
    built = scene.ground.union
    if wanted.area == 0.0:
        assert built.area == 0.0
        return
    hole, beside = wanted.difference(built), built.difference(wanted)
    assert hole.area + beside.area <= 0.01 * wanted.area, f"hole {hole.area}, beside {beside.area} m2"


def test_ground_has_no_large_hole_or_extra_piece_when_nothing_is_generated(
    plain_conversion: Conversion,
) -> None:
    # One per cent of a city hides a whole missing junction; a single piece of any size does not.
    scene = plain_conversion.scene
    wanted = scene.to_local(plain_conversion.expected.ground)
    built = scene.ground.union
    for name, rest in (("hole", wanted.difference(built)), ("extra", built.difference(wanted))):
        pieces = shapely.get_parts(rest.buffer(-0.2))
        worst = max(pieces, key=shapely.area, default=rest)
        # The wedge between a lane's end and an oblique border is filled; it is wider where lanes are.
        widest = max(lane.width for lane in plain_conversion.expected.lanes.values())
        assert worst.area < max(2.0, widest / 2), (
            f"{name} of {worst.area} m2 at {worst.centroid} from the origin"
        )


def test_generated_ground_only_adds_to_the_networks(conversion: Conversion) -> None:
    scene = conversion.scene
    wanted = scene.to_local(conversion.expected.ground)
    assert wanted.difference(scene.ground.union).area <= 0.01 * wanted.area


def test_driving_lanes_win_over_pavement(conversion: Conversion) -> None:
    scene, expected = conversion.scene, conversion.expected
    driving = scene.to_local(expected.driving_ground)
    pavement = scene.tops("sidewalk")
    if expected.is_flat:
        assert pavement.union.intersection(driving).area <= 0.002 * driving.area
        return
    for lane in expected.lanes.values():
        points = centre_points(lane, scene.origin)
        if lane.is_driving and len(points):
            numbers, _, heights = pavement.faces_under(points)
            assert not (np.abs(heights - points[numbers, 2]) < SAME_LEVEL).any(), lane.id


def test_walking_areas_win_over_the_junction_floor(plain_conversion: Conversion) -> None:
    scene, expected = plain_conversion.scene, plain_conversion.expected
    if not expected.is_flat or not expected.walking_areas:
        pytest.skip("nothing to compare")
    pavement = expected.walking_ground.difference(expected.vehicle_ground)
    floors = scene.tops("junction").union
    assert floors.intersection(scene.to_local(pavement)).area <= 0.01 * pavement.area


def test_walking_areas_are_pavement(plain_conversion: Conversion) -> None:
    scene, expected = plain_conversion.scene, plain_conversion.expected
    if not expected.is_flat:
        pytest.skip("on several levels a walking area may lie under a road")
    pavement = scene.tops("sidewalk", "walking_area").union
    for area_id, shape in expected.walking_areas.items():
        area = scene.to_local(floor(shape).difference(expected.vehicle_ground))
        other = area.difference(pavement)
        assert other.area <= 0.02 * area.area + 0.1, f"{area_id}: {other.area} of {area.area} m2 are not"


def check_closed_when_stored(scene: Scene) -> None:
    for part in scene.parts:
        if part.layer in {"sidewalk", "walking_area", "island"}:
            assert is_closed_when_stored(part.mesh.vertices, part.mesh.faces), part.name


def test_pavement_and_islands_are_closed_once_equal_corners_are_joined(conversion: Conversion) -> None:
    check_closed_when_stored(conversion.scene)


@pytest.mark.slow
@pytest.mark.sampled(1)
@pytest.mark.parametrize("flags", [(), ("--enrich-net",)], ids=["as_it_is", "enriched"])
@pytest.mark.parametrize("seed", range(networks.GENERATED_SAMPLE))
def test_pavement_and_islands_of_a_generated_network_are_closed(
    seed: int, flags: tuple[str, ...], tmp_path: Path, converted: Callable[..., Conversion]
) -> None:
    # As each network is used only here, none needs to be kept for other tests.
    check_closed_when_stored(converted(networks.generate_network(tmp_path, seed), *flags).scene)


def test_sidewalks_and_walking_areas_are_watertight_for_trimesh(conversion: Conversion) -> None:
    loaded = trimesh.load_scene(conversion.folder / "scene.glb")
    for name in loaded.graph.nodes_geometry:
        if name.split("/")[0] in {"sidewalk", "walking_area"}:
            mesh = loaded.geometry[loaded.graph[name][1]]
            assert mesh.is_watertight, name
            assert mesh.is_winding_consistent, name


def test_each_pavement_body_has_a_positive_volume(conversion: Conversion) -> None:
    for part in solids(conversion.scene):
        # A body of a few square millimetres has no measurable volume in single precision.
        volumes = [body.volume for body in merged_bodies(part.mesh) if body.area > 0.05]
        assert min(volumes) > 0.0, part.name


def test_pavement_stands_a_kerb_above_the_road(conversion: Conversion) -> None:
    scene, expected = conversion.scene, conversion.expected
    if not expected.is_flat:
        pytest.skip("on a slope there is no one height of the road")
    for layer in ("sidewalk", "walking_area"):
        tops = scene.tops(layer)
        if len(tops.triangles):
            heights = tops.triangles[:, :, 2]
            assert heights.min() >= -ROUNDING
            assert heights.max() <= KERB_LIMIT
            # The rest is let down to the road at crossings.
            raised = shapely.area(tops.polygons[heights.mean(axis=1) > 0.05]).sum()
            assert raised >= 0.6 * tops.total_area, layer


def test_paint_lies_just_above_the_ground(conversion: Conversion) -> None:
    scene = conversion.scene
    ground = scene.tops(*GROUND, "terrain", "island")
    for layer in PAINT:
        paint = scene.tops(layer)
        points = spread_points(paint)
        gaps = -heights_near(ground, points)
        outside = points[np.isnan(gaps)]
        beyond = shapely.distance(shapely.points(outside[:, :2]), ground.union)
        assert beyond.max(initial=0.0) < EDGE, f"{layer}: no ground under {outside[:3, :2] + scene.origin}"
        low, high = gaps < LIFT_LEAST - ROUNDING, gaps > LIFT_MOST + ROUNDING
        assert not low.any(), f"{layer}: {low.sum()} of {len(low)} buried, e.g. {gaps[low][:3]}"
        assert not high.any(), f"{layer}: {high.sum()} of {len(high)} floating, e.g. {gaps[high][:3]}"


def test_paint_faces_up(conversion: Conversion) -> None:
    scene = conversion.scene
    for layer in PAINT:
        assert len(scene.tops(layer).triangles) >= 0.99 * len(scene.triangles(layer)), layer


def test_no_two_faces_flicker(conversion: Conversion) -> None:
    scene = conversion.scene
    flat = [*GROUND, *PAINT, "terrain", "rail", "island"]
    surface = scene.tops(*flat)
    areas, differences = surface.overlaps_with(surface)
    assert areas[np.abs(differences) < 0.002].sum() <= 0.0005 * scene.ground.total_area + 0.01


def test_terrain_does_not_cover_the_ground(conversion: Conversion) -> None:
    scene = conversion.scene
    areas, above = scene.tops("terrain").overlaps_with(scene.ground)
    covered = areas[(above > -ROUNDING) & (above < SAME_LEVEL)].sum()
    assert covered <= 0.005 * max(scene.ground.total_area, 1.0)


def test_terrain_surrounds_the_ground(conversion: Conversion) -> None:
    scene = conversion.scene
    terrain, ground = scene.tops("terrain").union, scene.ground.union
    around = ground.buffer(2.0).difference(ground.union(scene.tops("rail", "island").union))
    assert around.difference(terrain.buffer(0.05)).area <= 0.02 * around.area


def test_bridge_deck_stays_six_metres_above_the_lower_road(converted: Callable[..., Conversion]) -> None:
    scene, lanes = converted("bridge").scene, converted("bridge").expected.lanes
    decks = [lane for lane in lanes.values() if lane.edge in {"deck", "-deck"} and lane.is_driving]
    lower = [lane for lane in lanes.values() if lane.edge in {"lower", "-lower"} and lane.is_driving]
    places = [LineString(deck.shape).intersection(LineString(road.shape)) for deck in decks for road in lower]
    points = np.array([[place.x, place.y] for place in places]) - scene.origin
    assert len(points) == 16
    numbers, _, heights = scene.tops("road", "junction").faces_under(points)
    for number in range(len(points)):
        # A point on the edge between two faces is found on both.
        found = np.unique(np.round(heights[numbers == number], 2))
        assert found == pytest.approx([0.0, 6.0], abs=0.02)


def test_bridge_has_nothing_in_the_way_of_the_lower_road(converted: Callable[..., Conversion]) -> None:
    conversion = converted("bridge")
    scene = conversion.scene
    lane = conversion.expected.lanes["lower_1"]
    points = centre_points(lane, scene.origin)
    everything = Surface(np.concatenate([part.triangles for part in scene.parts]))
    normals = np.cross(
        everything.triangles[:, 1] - everything.triangles[:, 0],
        everything.triangles[:, 2] - everything.triangles[:, 0],
    )
    level = Surface(everything.triangles[np.abs(normals[:, 2]) > 1e-6])
    _, _, heights = level.faces_under(points)
    assert not ((heights > LIFT_MOST) & (heights < 4.5)).any()


def test_slope_follows_the_hillside(converted: Callable[..., Conversion]) -> None:
    scene = converted("slope").scene
    for layer in ("road", "junction"):
        corners = scene.tops(layer).triangles.reshape(-1, 3)
        x, y = (corners[:, :2] + scene.origin).T
        # netconvert lays each road flat from side to side, and its end at the height of the junction.
        assert np.abs(corners[:, 2] - (0.08 * x + 0.05 * y)).max() < 1.5, layer


def _gltf_meshes(gltf: dict[str, Any]) -> Iterator[tuple[str, dict[str, Any], list[dict[str, Any]]]]:
    for index, mesh in enumerate(gltf["meshes"]):
        nodes = [node for node in gltf["nodes"] if node.get("mesh") == index]
        yield nodes[0]["name"], mesh, nodes


def _source_ids(description: dict[str, Any]) -> set[str]:
    lists = ("roads", "lanes", "junctions", "sidewalks", "crossings", "walking_areas", "signals", "props")
    known = {item["id"] for name in lists for item in description[name]}
    known |= {f"{link['from']}->{link['to']}" for link in description["connections"]}
    return known | {description["name"]}


def test_every_face_can_be_traced_to_its_source(conversion: Conversion) -> None:
    gltf, known = conversion.scene.gltf, _source_ids(conversion.description)
    for name, mesh, nodes in _gltf_meshes(gltf):
        indices = [gltf["accessors"][item["indices"]]["count"] for item in mesh["primitives"]]
        runs = list(sources_of(mesh, nodes))
        own = {"terrain"} if name.startswith("terrain") else set()
        assert {run[0] for run in runs} <= known | own, name
        position = 0
        for _, first, count in runs:
            assert first == position, f"{name}: faces without a source, or with two"
            position = first + count
        assert position == sum(indices) // 3, f"{name}: faces without a source"


def test_lane_faces_lie_on_the_lane_they_name(plain_conversion: Conversion) -> None:
    scene, expected = plain_conversion.scene, plain_conversion.expected
    for part in scene.parts:
        if part.layer != "road":
            continue
        nodes = [node for node in scene.gltf["nodes"] if node["name"] == part.name]
        mesh = scene.gltf["meshes"][nodes[0]["mesh"]]
        for source, first, count in sources_of(mesh, nodes):
            lane = expected.lanes.get(source)
            if lane is None:
                continue
            faces = Surface(part.triangles[first : first + count])
            strip = scene.to_local(lane.strip).buffer(0.3)
            beside = sum(shapely.area(shapely.difference(faces.polygons, strip)))
            # At each end, the wedge towards an oblique border may be filled.
            assert beside <= 0.01 * lane.strip.area + lane.width / 2, (source, beside)
