"""Presets of cameras, what stands before them, and what they see of the lanes."""

import json
from dataclasses import replace
from math import cos, sin

import numpy as np
import pytest
import shapely
from rays import nearest_hits

from dojo_env.camera import Camera, read_cameras
from dojo_env.camera_presets import CAMERA_PRESETS
from dojo_env.cli import main
from dojo_env.config import SensingConfig
from dojo_env.errors import ConfigError
from dojo_env.rendering.scene import build_scene
from dojo_env.sensors.coverage import DISTANCES, list_watched, measure_views
from dojo_env.sensors.eyes import Eyes
from dojo_env.sensors.placement import find_approaches, place_cameras, point_before_end
from dojo_maps.bundle import read_bundle
from dojo_maps.description import LaneKind


@pytest.fixture(scope="module")
def bundle(converted):
    return read_bundle(converted("right_hand").folder)


@pytest.fixture(scope="module")
def scene(bundle):
    return build_scene(bundle)


@pytest.fixture(scope="module")
def approaches(scene):
    return find_approaches(scene.road_map, scene.road_map.signals[0])


def with_wall(scene, approach, ahead, half_width, height):
    """Put a wall across an approach, some way beyond its stop line."""
    along = np.array([cos(approach.heading), sin(approach.heading), 0.0])
    left = np.array([-along[1], along[0], 0.0])
    foot = approach.stop - scene.origin + ahead * along
    top = np.array([0.0, 0.0, height])
    corners = [foot - half_width * left, foot + half_width * left]
    vertices = np.array([corners[0], corners[1], corners[1] + top, corners[0] + top])
    faces = np.array([(0, 1, 2), (0, 2, 3)], dtype=np.int32) + len(scene.vertices)
    return replace(
        scene,
        vertices=np.concatenate([scene.vertices, vertices]),
        faces=np.concatenate([scene.faces, faces]),
        normals=np.concatenate([scene.normals, [along, along]]),
        semantics=np.append(scene.semantics, scene.semantics[-1:].repeat(2)),
        surfaces=np.append(scene.surfaces, scene.surfaces[-1:].repeat(2)),
        colours=np.concatenate([scene.colours, scene.colours[-1:].repeat(2, axis=0)]),
    )


@pytest.mark.parametrize("preset", CAMERA_PRESETS)
def test_each_preset_hangs_as_it_says_and_sees_its_approach(scene, approaches, preset):
    mount = CAMERA_PRESETS[preset]
    assert 3 <= mount.height <= 18
    assert 5 <= -mount.pitch_deg <= 45
    cameras = place_cameras(scene, scene.road_map.signals[0].id, preset=preset)
    assert len(cameras) == len(approaches) + 1
    for camera, approach in zip(cameras, approaches, strict=False):
        assert camera.position[2] == pytest.approx(approach.stop[2] + mount.height, abs=1e-3)
        assert camera.pitch_deg == mount.pitch_deg
        for view in measure_views(scene, camera, [approach]):
            assert view.seen > 0.4  # Trees and arms of signals hide some.
            assert view.pixels_per_metre[1] > 3


def test_the_usual_camera_sees_every_lane_from_the_stop_line_to_60_m(scene, approaches):
    cameras = place_cameras(scene, scene.road_map.signals[0].id, preset="usual")
    for camera, approach in zip(cameras, approaches, strict=False):
        assert 10 <= -camera.pitch_deg <= 20
        for view in measure_views(scene, camera, [approach]):
            assert None not in view.pixels_per_metre
            assert view.seen > 0.8  # Trees hide some.


@pytest.mark.parametrize("name", ["right_hand", "left_hand", "cologne1"])
def test_posts_stand_where_nobody_drives(converted, name):
    scene = build_scene(read_bundle(converted(name).folder))
    road_map = scene.road_map
    lines = [lane.shape[:, :2] for lane in road_map.lanes if lane.kind is not LaneKind.SIDEWALK]
    lines += [connection.shape[:, :2] for connection in road_map.connections]
    driven = shapely.MultiLineString(lines)
    for camera in place_cameras(scene, road_map.signals[0].id, preset="low_pole")[:-1]:
        assert driven.distance(shapely.Point(camera.position[:2])) >= 2.2


@pytest.mark.parametrize(("preset", "ahead", "half_width"), [("paper", 6.0, 4.0), ("usual", 20.0, 8.0)])
def test_a_camera_moves_from_behind_a_wall(scene, approaches, preset, ahead, half_width):
    signal = scene.road_map.signals[0].id
    blocked = with_wall(scene, approaches[0], ahead, half_width, 15.0)
    before, after = (place_cameras(each, signal, preset=preset) for each in (scene, blocked))
    assert before[-1] == after[-1]
    hidden = measure_views(blocked, before[0], approaches[:1])
    moved = measure_views(blocked, after[0], approaches[:1])
    free = measure_views(scene, before[0], approaches[:1])
    assert max(view.seen for view in hidden) < 0.3
    assert min(view.seen for view in moved) > 0.9 * min(view.seen for view in free)
    assert after[0].position[2] == before[0].position[2]
    assert np.hypot(*np.subtract(after[0].position, before[0].position)[:2]) < 20


@pytest.mark.slow
def test_shares_seen_are_those_of_rays(scene, approaches):
    blocked = with_wall(scene, approaches[0], -20.0, 2.5, 3.0)
    signal = scene.road_map.signals[0].id
    camera = place_cameras(scene, signal, preset="mast_arm", width=720, height=512)[0]
    views = measure_views(blocked, camera, approaches[:1])
    start = np.array(camera.position) - scene.origin
    for line, view in zip(approaches[0].lines, views, strict=True):
        ground = np.array([point_before_end(line, d) for d in np.arange(0.0, view.length + 1e-6)])
        points = np.concatenate([ground + np.array([0.0, 0.0, height]) for height in (0.75, 1.5)])
        pixels, depth = camera.project(points)
        inside = (depth > 0) & (pixels > 0).all(axis=1) & (pixels < [camera.width, camera.height]).all(axis=1)
        rays = points - scene.origin - start
        nearest, _ = nearest_hits(blocked.vertices, blocked.faces, start, rays)
        assert view.seen == pytest.approx((inside & (nearest > 1.0)).mean(), abs=0.04)
        assert 0.2 < view.seen < 0.9


def test_pixels_across_a_lane_seen_from_above_are_those_of_a_pinhole(scene, approaches):
    x, y = approaches[0].stop[:2]
    above = Camera(name="above", position=(x, y, 100.0), pitch_deg=-90.0, field_of_view_deg=90.0)
    for view in measure_views(scene, above, approaches[:1]):
        assert view.pixels_per_metre == pytest.approx([178 / 100] * len(DISTANCES), rel=0.01)
    assert len(list_watched(above, approaches)) == len(approaches)


def test_an_environment_hangs_cameras_by_a_presets_name(bundle):
    signal = bundle.road_map.signals[0].id
    placed = Eyes(bundle, SensingConfig(cameras="usual", width=64, height=48)).cameras(signal)
    assert placed[0].field_of_view_deg == 60
    assert (placed[0].width, placed[0].height) == (64, 48)
    own = (Camera(name="own", position=(0.0, 0.0, 9.0)),)
    assert Eyes(bundle, SensingConfig(cameras={signal: own})).cameras(signal) == own
    with pytest.raises(ConfigError, match="no preset 'balcony'"):
        SensingConfig(cameras="balcony")


def test_the_command_lists_cameras_and_writes_what_it_reads(converted, bundle, tmp_path, capsys):
    folder, signal = str(converted("right_hand").folder), bundle.road_map.signals[0].id
    values, cameras = tmp_path / "views.json", tmp_path / "cameras.json"
    command = ["cameras", folder, "--preset", "mast_arm", "--json", str(values), "-o", str(cameras)]
    assert main(command) == 0
    printed = capsys.readouterr().out
    assert "approach_0: at" in printed
    found = json.loads(values.read_text())["signals"]
    assert [each["signal"] for each in found] == [signal]
    placed = Eyes(bundle, SensingConfig(cameras="mast_arm")).cameras(signal)
    assert read_cameras(cameras) == placed
    assert [each["name"] for each in found[0]["cameras"]] == [camera.name for camera in placed]
    first = found[0]["cameras"][0]["lanes"]
    assert all(lane["lane"] in printed and 0.5 < lane["seen"] <= 1 for lane in first)
    assert main(["cameras", folder, "--cameras", str(cameras)]) == 0
    assert capsys.readouterr().out == printed
    assert main(["cameras", folder, "--cameras", str(values)]) == 3
    assert main(["cameras", folder, "--signals", "nowhere"]) == 2
