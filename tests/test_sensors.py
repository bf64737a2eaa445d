"""Cameras, their placement, lidar, conditions and noise."""

import json
import math
from dataclasses import replace

import numpy as np
import pytest
import traffic
from rays import nearest_hits

from dojo_env.camera import Camera, read_cameras, write_cameras
from dojo_env.conditions import LIMITS, Conditions, sample_conditions
from dojo_env.errors import ConfigError
from dojo_env.rendering.classes import SEMANTIC_OF_KIND, Semantic
from dojo_env.rendering.renderer import Renderer
from dojo_env.rendering.scene import build_scene
from dojo_env.sensors.lidar import Lidar, LidarScanner
from dojo_env.sensors.mounts import shake_cameras
from dojo_env.sensors.noise import Lens
from dojo_env.sensors.placement import find_approaches, place_cameras
from dojo_env.snapshot import Kind, Snapshot
from dojo_maps.bundle import read_bundle
from dojo_maps.description import LinkKind


@pytest.fixture(scope="module")
def scene(converted):
    return build_scene(read_bundle(converted("cologne1").folder))


def test_projection_of_axes():
    camera = Camera(
        name="c", position=(10.0, 20.0, 5.0), heading_deg=90.0, pitch_deg=0.0, field_of_view_deg=90.0
    )
    pixels, depth = camera.project(
        np.array([(10.0, 30.0, 5.0), (15.0, 30.0, 5.0), (10.0, 30.0, 8.0), (10.0, 10.0, 5.0)])
    )
    np.testing.assert_allclose(depth, [10, 10, 10, -10], atol=1e-9)
    np.testing.assert_allclose(pixels[:3], [(178, 128), (178 + 89, 128), (178, 128 - 53.4)], atol=1e-6)
    assert np.isnan(pixels[3]).all()


def test_nadir_picture_has_its_heading_on_top():
    camera = Camera(name="c", position=(0.0, 0.0, 50.0), heading_deg=90.0, pitch_deg=-90.0)
    pixels, depth = camera.project(np.array([(0.0, 10.0, 0.0), (10.0, 0.0, 0.0)]))
    assert pixels[0, 1] < 128
    assert pixels[1, 0] > 178
    np.testing.assert_allclose(depth, 50.0)


@pytest.mark.parametrize(
    "change",
    [{"width": 0}, {"height": -1}, {"height": 100_000}, {"position": (0.0, math.nan, 1.0)},
     {"near": 5.0, "far": 1.0}, {"field_of_view_deg": 0.0}, {"heading_deg": math.inf},
     {"distortion": (1.0,)}],
)  # fmt: skip
def test_impossible_cameras_are_refused_by_name(change):
    with pytest.raises(ConfigError, match="camera 'roof'"):
        replace(Camera(name="roof", position=(0.0, 0.0, 1.0)), **change)


def test_cameras_are_saved_and_read_back(tmp_path):
    cameras = (Camera(name="a", position=(1.5, 2.5, 3.0), distortion=(-0.1, 0.0, 0.0, 0.0)),
               Camera(name="b", position=(0.0, 0.0, 9.0), roll_deg=3.0))  # fmt: skip
    path = tmp_path / "cameras.json"
    write_cameras(cameras, path)
    assert read_cameras(path) == cameras
    for text in ("", "{}", "[1]", '{"format": "dojo-cameras", "version": 2, "cameras": []}',
                 '{"format": "dojo-cameras", "version": 1, "cameras": [{"name": "x"}]}'):  # fmt: skip
        path.write_text(text)
        with pytest.raises(ConfigError, match=r"cameras\.json"):
            read_cameras(path)
    twice = json.dumps(
        {"format": "dojo-cameras", "version": 1, "cameras": [{"name": "x", "position": [0, 0, 1]}] * 2}
    )
    path.write_text(twice)
    with pytest.raises(ConfigError, match="name"):
        read_cameras(path)


@pytest.mark.sampled(3)
@pytest.mark.parametrize(
    "name",
    [
        "cologne1",
        "cologne3",
        "ingolstadt7",
        "right_hand",
        "left_hand",
        "slope",
        "five_legs",
        "six_legs",
    ],
)
def test_each_approach_has_a_camera_that_sees_its_queue(converted, name):
    scene = build_scene(read_bundle(converted(name).folder))
    lanes = {lane.id: lane for lane in scene.road_map.lanes}
    for signal in scene.road_map.signals:
        approaches = find_approaches(scene.road_map, signal)
        driven = {lanes[link.from_id].road for link in signal.links if link.kind is LinkKind.VEHICLE}
        assert {approach.road for approach in approaches} <= driven
        cameras = place_cameras(scene, signal.id)
        assert [camera.name for camera in cameras] == [
            *(f"approach_{k}" for k in range(len(approaches))),
            "bev",
        ]
        pictures = Renderer(scene).render(Snapshot(time=0), cameras, ("depth",))
        for approach, camera, picture in zip(approaches, cameras, pictures, strict=False):
            assert camera.pitch_deg == -35
            assert camera.position[2] == pytest.approx(approach.stop[2] + 10, abs=1e-3)
            probes = np.array([line[-1] + np.array([0.0, 0.0, 0.5]) for line in approach.lines])
            assert _seen(camera, picture.depth, probes).mean() >= 0.5, (signal.id, camera.name)
        stops = np.array([line[-1] for approach in approaches for line in approach.lines])
        stops[:, 2] += 0.5
        assert _seen(cameras[-1], pictures[-1].depth, stops, above=12.0).all()


@pytest.mark.parametrize(
    ("name", "count"), [("ingolstadt1", 3), ("cologne1", 4), ("five_legs", 5), ("six_legs", 6)]
)
def test_approaches_are_counted_and_go_round(converted, name, count):
    scene = build_scene(read_bundle(converted(name).folder))
    signal = scene.road_map.signals[0]
    approaches = find_approaches(scene.road_map, signal)
    assert len(approaches) == count
    stops = np.array([approach.stop[:2] for approach in approaches])
    x, y = (stops - stops.mean(axis=0)).T
    clockwise = np.arctan2(x, y) % (2 * np.pi)
    assert (np.diff(clockwise) > 0).all()


def _seen(camera, depth, places, above=1.0):
    pixels, distance = camera.project(places)
    inside = (pixels > 0).all(axis=1) & (pixels < [camera.width, camera.height]).all(axis=1) & (distance > 0)
    columns, rows = np.where(inside[:, None], pixels, 0).astype(int).T
    return inside & (depth[rows, columns] > distance - above)


def test_unknown_signal_is_named(scene):
    with pytest.raises(ConfigError, match="nowhere"):
        place_cameras(scene, "nowhere")


@pytest.mark.slow
def test_lidar_agrees_with_rays_cast_one_by_one(scene):
    signal = scene.road_map.signals[0].id
    snapshot = traffic.rush_hour(scene.road_map, signal)
    x, y = scene.origin[:2]
    lidar = Lidar(name="l", position=(float(x), float(y), 6.0), channels=12, step_deg=3.0, reach=60.0)
    scan = LidarScanner(scene).scan(snapshot, [lidar])[0]
    directions = lidar.directions[::-1].reshape(-1, 3)
    start = np.array(lidar.position) - scene.origin
    static = scan.instance.ravel() == 0
    nearest, _ = nearest_hits(scene.vertices, scene.faces, start, directions)
    nearest[nearest > lidar.reach] = np.inf
    found = scan.ranges.ravel()
    both = static & np.isfinite(nearest)
    assert both.sum() > 500
    assert (np.abs(found[both] - nearest[both]) < 0.05).mean() > 0.99
    assert (found <= nearest + 0.05).mean() > 0.99


def test_lidar_returns_carry_class_and_number(scene):
    x, y = (float(v) for v in scene.origin[:2])
    snapshot = traffic.users(
        [(x + 12.0, y, 0.0, 0.0)], [Kind.BUS], traffic.empty(scene.road_map), numbers=[41]
    )
    lidar = Lidar(name="l", position=(x, y, 2.0), heading_deg=0.0)
    scan = LidarScanner(scene).scan(snapshot, [lidar])[0]
    hit = scan.point_instance == 41
    assert hit.sum() > 50
    assert (scan.point_semantic[hit] == Semantic.BUS).all()
    assert ((scan.points[hit][:, 0] > -0.1) & (scan.points[hit][:, 0] < 12.1)).all()
    assert (np.abs(scan.points[hit][:, 1]) < 1.4).all()
    assert scan.ranges.shape == (32, 900)
    assert np.isfinite(scan.ranges).sum() == len(scan.points)
    assert (scan.semantic[~np.isfinite(scan.ranges)] == Semantic.SKY).all()


def test_lidar_noise_is_seeded_and_bounded(scene):
    x, y = (float(v) for v in scene.origin[:2])
    exact = Lidar(name="l", position=(x, y, 5.0))
    noisy = replace(exact, noise=0.05, dropped=0.2)
    snapshot = Snapshot(time=3.0)
    clean = LidarScanner(scene, seed=1).scan(snapshot, [exact])[0].ranges
    first, again = (LidarScanner(scene, seed=1).scan(snapshot, [noisy])[0].ranges for _ in range(2))
    other = LidarScanner(scene, seed=2).scan(snapshot, [noisy])[0].ranges
    np.testing.assert_array_equal(first, again)
    assert not np.array_equal(first, other)
    lost = np.isfinite(clean) & ~np.isfinite(first)
    assert 0.17 < lost.sum() / np.isfinite(clean).sum() < 0.23
    kept = np.isfinite(first)
    assert 0.04 < np.std(first[kept] - clean[kept]) < 0.06


@pytest.mark.parametrize("change", [{"channels": 0}, {"step_deg": 0.0}, {"reach": -1.0}, {"noise": -0.1},
                                    {"position": (0.0, 0.0, math.nan)}, {"step_deg": 1e-5},
                                    {"lowest_deg": 10.0, "highest_deg": 0.0}])  # fmt: skip
def test_impossible_lidars_are_refused(change):
    with pytest.raises(ConfigError, match="lidar 'l'"):
        replace(Lidar(name="l", position=(0.0, 0.0, 1.0)), **change)


def test_conditions_are_drawn_within_their_ranges_by_seed():
    ranges = {"hour": (6.0, 22.0), "rain": (0.0, 0.5), "noise": (0.0, 4.0)}
    drawn = [sample_conditions(ranges, seed) for seed in range(200)]
    assert drawn == [sample_conditions(ranges, seed) for seed in range(200)]
    for name, (low, high) in ranges.items():
        values = [getattr(each, name) for each in drawn]
        assert low <= min(values) < max(values) <= high
    assert all(each.fog == 0 for each in drawn)
    fixed = [sample_conditions({**ranges, "fog": 0.01}, seed) for seed in range(200)]
    assert fixed == [replace(each, fog=0.01) for each in drawn]
    for wrong in (
        {"wind": (0, 1)},
        {"rain": (1.0, 0.5)},
        {"rain": (0.0, 9.0)},
        {"rain": "wet"},
        {"rain": "01"},
        {"rain": (1,)},
    ):
        with pytest.raises(ConfigError, match=r"wind|rain"):
            for seed in range(30):
                sample_conditions(wrong, seed)


@pytest.mark.parametrize("name", sorted(LIMITS))
def test_conditions_out_of_range_are_refused(name):
    with pytest.raises(ConfigError, match=name):
        Conditions(**{name: LIMITS[name][1] + 1})


@pytest.mark.sampled(8)
@pytest.mark.parametrize("hour", np.linspace(0, 24, 9).tolist())
@pytest.mark.parametrize("weather", [{}, {"overcast": 1.0}, {"rain": 1.0}, {"fog": 0.05}])
def test_every_hour_and_weather_gives_a_picture_that_can_be_seen(scene, hour, weather):
    camera = Camera(name="c", position=(*map(float, scene.origin[:2]), 12.0), width=48, height=32)
    rgb = (
        Renderer(scene, conditions=Conditions(hour=hour, **weather)).render(Snapshot(time=0), [camera])[0].rgb
    )
    assert 4 < rgb.mean() < 250


def test_lens_spoils_by_seed_camera_and_time():
    clean = np.full((60, 80, 3), 128, dtype=np.uint8)
    camera = Camera(name="a", position=(0.0, 0.0, 8.0), width=80, height=60)
    state = Conditions(noise=6.0, blur=0.8, dirt=0.5, rain=0.5, seed=3)
    first = Lens(state).spoil(clean, camera, 5.0)
    assert first.dtype == np.uint8
    np.testing.assert_array_equal(first, Lens(state).spoil(clean, camera, 5.0))
    for other in (Lens(state).spoil(clean, replace(camera, name="b"), 5.0),
                  Lens(state).spoil(clean, camera, 6.0),
                  Lens(replace(state, seed=4)).spoil(clean, camera, 5.0)):  # fmt: skip
        assert not np.array_equal(first, other)
    np.testing.assert_array_equal(Lens(Conditions()).spoil(clean, camera, 5.0), clean)
    assert (clean == 128).all()


def test_dropped_frames_show_the_last_one_again():
    lens, camera = Lens(Conditions(dropped=0.5, seed=1)), Camera(name="a", position=(0.0, 0.0, 8.0))
    frames = [np.full((4, 4, 3), k, dtype=np.uint8) for k in range(200)]
    shown = [int(lens.spoil(frame, camera, float(k))[0, 0, 0]) for k, frame in enumerate(frames)]
    late = [k - value for k, value in enumerate(shown)]
    assert shown[0] == 0
    assert min(late) == 0
    assert 0.4 < np.mean(np.array(late) > 0) < 0.6


def test_shaken_cameras_are_near_where_they_were():
    cameras = [Camera(name=f"c{k}", position=(0.0, 0.0, 10.0)) for k in range(300)]
    state = Conditions(shake_m=0.1, shake_deg=1.0)
    shaken = shake_cameras(cameras, state)
    assert shaken == shake_cameras(cameras, state)
    assert 0.08 < np.std([camera.position[0] for camera in shaken]) < 0.12
    assert 0.8 < np.std([camera.roll_deg for camera in shaken]) < 1.2
    assert shake_cameras(cameras, Conditions()) == tuple(cameras)


def test_every_kind_has_a_class_of_its_own_sort():
    assert len(SEMANTIC_OF_KIND) == len(Kind)
    assert SEMANTIC_OF_KIND.min() >= Semantic.CAR
