"""From boxes to lanes, tracks, counts and queues; the truth is the simulation's own."""

from dataclasses import replace

import numpy as np
import pytest
import traffic
from tiny_networks import build_network

from dojo_env.camera import BEV, Camera
from dojo_env.cli import main
from dojo_env.conditions import Conditions
from dojo_env.config import build_config
from dojo_env.controllers import make_controller
from dojo_env.detectors.base import NOTHING, Detections
from dojo_env.detectors.grounding import Grounding, build_grid
from dojo_env.detectors.measuring import LaneWatch
from dojo_env.errors import ConfigError
from dojo_env.local_world import LocalWorld
from dojo_env.rendering.renderer import Renderer
from dojo_env.rendering.scene import build_scene
from dojo_env.runs import run_controller
from dojo_env.sensors.mounts import sway
from dojo_env.sensors.placement import place_cameras
from dojo_env.sensors.video_detector import VideoDetector, list_true_boxes
from dojo_env.snapshot import Kind
from dojo_maps.bundle import read_bundle

SIZE = {"width": 640, "height": 448}


@pytest.fixture(scope="module")
def scene(converted):
    return build_scene(read_bundle(converted("cologne1").folder))


@pytest.fixture(scope="module")
def cameras(scene):
    placed = place_cameras(scene, scene.road_map.signals[0].id, **SIZE)
    return [camera for camera in placed if camera.name != BEV]


@pytest.mark.slow
@pytest.mark.sampled(2)
@pytest.mark.parametrize(
    ("change", "kinds"),
    [({}, (Kind.CAR,)), ({"roll_deg": 8.0, "pitch_deg": -20.0}, (Kind.CAR,)),
     ({"distortion": (-0.25, 0.08, 0.001, -0.001)}, (Kind.CAR,)), ({}, (Kind.CAR, Kind.BUS, Kind.TRUCK))],
)  # fmt: skip
def test_vehicles_are_placed_on_their_lanes(change, kinds, scene, cameras):
    """Queues are drawn; the boxes of what is well in view lead back to each vehicle's place."""
    signal = scene.road_map.signals[0]
    snapshot = traffic.rush_hour(scene.road_map, signal.id, kinds=kinds)
    rows = {name: row for row, name in enumerate(snapshot.ids)}
    off, turned, missing = [], 0, 0
    turned_cameras = [replace(camera, **change) for camera in cameras]
    grid = build_grid(scene.road_map, turned_cameras)
    for picture in Renderer(scene).render(snapshot, turned_cameras, ("boxes",)):
        boxes = picture.boxes
        inside = (boxes.picture[:, :2] > 0).all(axis=1) & (boxes.picture[:, 2:] < [640, 448]).all(axis=1)
        heights = boxes.picture[:, 3] - boxes.picture[:, 1]
        clear = np.flatnonzero(inside & (boxes.visible > 0.6) & (heights >= 12))
        found = Detections(
            boxes=boxes.picture[clear].astype(float), scores=np.ones(len(clear)), kinds=boxes.kinds[clear]
        )
        placed = Grounding(picture.camera, grid).locate(found)
        missing += len(clear) - len(placed.rows)
        for number, row, front in zip(placed.detections, placed.rows, placed.fronts, strict=True):
            if boxes.parked[clear[number]]:
                assert grid.lanes[grid.lane[row]] == ""
                continue
            true = rows[boxes.ids[clear[number]]]
            off.append(np.linalg.norm(front - snapshot.positions[true]))
            heading = snapshot.headings[true]
            turned += grid.headings[row] @ [np.cos(heading), np.sin(heading)] < 0.9
    assert len(off) > 15
    assert missing <= 0.05 * len(off)
    assert turned <= 0.05 * len(off)
    assert np.median(off) < 0.5
    assert np.percentile(off, 90) < 2.5


@pytest.mark.slow
@pytest.mark.parametrize("change", [{}, {"distortion": (-0.25, 0.08, 0.001, -0.001)}])
def test_visible_road_users_are_those_of_the_boxes(change, scene, cameras):
    """Boxes alone tell nearly the same as bodies, also where a lens bends and where the picture is turned."""
    snapshot = traffic.rush_hour(scene.road_map, scene.road_map.signals[0].id)
    hung = [replace(camera, **change) for camera in cameras]
    renderer = Renderer(scene)
    alone = renderer.render(snapshot, hung, ("visible",))
    pictures = renderer.render(snapshot, hung, ("rgb", "boxes"))
    windy = Conditions(sway_deg=2.0)
    for one, both in [
        *zip(alone, pictures, strict=True),
        *((sway(one, windy, 1.0), sway(both, windy, 1.0)) for one, both in zip(alone, pictures, strict=True)),
    ]:
        seen, boxes = one.visible, both.boxes
        moving = np.flatnonzero(~boxes.parked & (boxes.pixels >= 30))
        rows = {snapshot.ids[row]: k for k, row in enumerate(seen.rows)}
        for k in moving:
            box = rows[boxes.ids[k]]
            # Bodies fill more than half of their boxes, and stand out of them only by mirrors and feet.
            assert 0.8 * boxes.pixels[k] < seen.pixels[box] < 2.5 * boxes.pixels[k]
            assert abs(seen.visible[box] - boxes.visible[k]) < 0.35
            assert np.abs(seen.picture[box] - boxes.picture[k]).max() < 20
    assert sum(len(picture.visible.rows) for picture in alone) > 15


def test_what_fits_no_lane_is_left_out(scene, cameras):
    grid = build_grid(scene.road_map, cameras)
    sky, flat, walker = (300.0, 2.0, 340.0, 30.0), (0.0, 200.0, 639.0, 210.0), (300.0, 200.0, 312.0, 240.0)
    found = Detections(
        boxes=np.array([sky, flat, walker]),
        scores=np.ones(3),
        kinds=np.array([Kind.CAR, Kind.CAR, Kind.PEDESTRIAN], np.uint8),
    )
    assert len(Grounding(replace(cameras[0], pitch_deg=-10.0), grid).locate(found).rows) == 0


def test_a_camera_that_sees_no_lane_measures_none(scene):
    away = Camera(name="away", position=(0.0, 0.0, 5000.0), pitch_deg=80.0)
    watch = LaneWatch([away], scene.road_map, ["23429231#1_0"])
    assert watch.regions == (None,)
    measured = watch.update(0.0, [NOTHING])
    assert measured.vehicles.tolist() == [0.0]
    assert np.isnan(measured.mean_speed).all()


@pytest.fixture(scope="module")
def watched():
    """A minute of rush hour, seen every second by perfect boxes: what was measured, and what was true."""
    world = LocalWorld(
        build_config(scenario="cologne1", begin_time=25_600, num_seconds=80, width=1280, height=896)
    )
    (signal,) = world.signals
    cameras = [replace(c, pitch_deg=-20.0) for c in world.eyes.cameras(signal) if c.name != BEV]
    lanes = world.map.plans[signal].lanes[2:]  # The first two are longer than anybody can see.
    watch = LaneWatch(cameras, world.map.bundle.road_map, lanes)
    rows, tracks = [], {}

    def look(snapshot):
        pictures = world.eyes.look(snapshot, cameras, ("boxes",))
        measured = watch.update(snapshot.time, [list_true_boxes(each.boxes) for each in pictures])
        on = [[k for k, each in enumerate(snapshot.lanes) if each == lane] for lane in lanes]
        true = [(len(ks), sum(snapshot.speeds[k] < 0.1 for k in ks), snapshot.speeds[ks]) for ks in on]
        rows.append((measured, true))
        for track in watch.tracks:
            if track.seen == snapshot.time and watch.name_lane(track) in lanes:
                away = np.linalg.norm(snapshot.positions[:, :2] - track.front[:2], axis=1)
                if away.min() < 2:
                    tracks.setdefault(track.number, set()).add(snapshot.ids[int(away.argmin())])

    world.watch(look)
    chooser = make_controller("max-pressure-paper")
    world.reset(1)
    ended = False
    while not ended:
        ended = world.step(chooser.act(world.instant))[2]
    world.close()
    return rows[20:], tracks


@pytest.mark.slow
def test_counts_and_queues_are_the_true_ones(watched):
    rows, _ = watched
    counts = np.array([measured.vehicles for measured, _ in rows])
    true = np.array([[each[0] for each in truth] for _, truth in rows])
    assert true.mean() > 0.8
    assert np.abs(counts - true).mean() < 0.12
    standing = np.array([measured.halting for measured, _ in rows])
    queues = np.array([[each[1] for each in truth] for _, truth in rows])
    assert queues.mean() > 0.3
    # Who creeps counts as standing, too.
    assert np.abs(standing - queues).mean() < 0.4


@pytest.mark.slow
def test_speeds_are_the_true_ones(watched):
    off = [
        abs(speed - float(np.mean(truth[k][2])))
        for measured, truth in watched[0]
        for k, speed in enumerate(measured.mean_speed.tolist())
        if not np.isnan(speed) and len(truth[k][2]) == measured.vehicles[k]
    ]
    assert len(off) > 100
    assert np.mean(off) < 1.0


def test_a_vehicle_is_one_track(watched):
    _, tracks = watched
    assert len(tracks) > 12
    assert np.mean([len(names) == 1 for names in tracks.values()]) > 0.9
    vehicles = set().union(*tracks.values())
    assert len(tracks) < 1.2 * len(vehicles)


@pytest.fixture(scope="module")
def drive():
    """Run MaxPressure by perfect boxes."""

    def run(seconds=60, **settings):
        seen = VideoDetector(model="boxes", **settings)
        return LocalWorld(
            build_config(
                scenario="cologne1", begin_time=25_600, num_seconds=seconds, observation=seen, **SIZE
            )
        )

    return run


@pytest.mark.slow
def test_the_observation_is_the_features_as_far_as_cameras_see(drive):
    world = drive(seconds=80)
    (signal,) = world.signals
    view_sizes = world.spaces()[signal][0].shape
    world.reset(1)
    chooser, off = make_controller("cycle"), []
    for _ in range(14):
        seen = world.step(chooser.act(world.instant))[0][signal]
        view = world.instant.signals[signal]
        true = np.array([*np.eye(len(view.plan.phases))[view.phase], view.may_change, *view.lanes.shares])
        assert seen.shape == true.shape == view_sizes
        np.testing.assert_array_equal(seen[: len(view.plan.phases) + 1], true[: len(view.plan.phases) + 1])
        off.append(np.abs(seen - true))
    world.close()
    assert np.mean(off) < 0.03


@pytest.mark.slow
@pytest.mark.sampled(1)
@pytest.mark.parametrize("name", ["max-pressure", "max-pressure-paper", "webster"])
def test_controllers_act_on_what_is_measured(name, drive):
    world = drive(seconds=30)
    (signal,) = world.signals
    world.reset(1)
    chooser = make_controller(name)
    chooser.reset(1)
    for _ in range(4):
        seen = world.perceive()
        assert seen is not world.instant
        assert 0 <= chooser.act(seen)[signal] < len(seen.signals[signal].plan.phases)
        world.step({signal: 0})
    view = seen.signals[signal]
    assert np.array_equal(seen.count_vehicles(view.plan.lanes), view.lanes.vehicles)
    assert len(seen.approach(signal).links) == view.lanes.total_vehicles > 0
    assert sum(seen.approach(signal).halting) == view.lanes.total_halting
    with pytest.raises(ConfigError, match="no camera tells the snapshot"):
        _ = seen.snapshot
    world.close()


@pytest.mark.slow
def test_the_same_seed_gives_the_same_episode():
    settings = {"scenario": "cologne1", "begin_time": 25_600, "num_seconds": 40, **SIZE}
    first, again = run_controller(
        "max-pressure", [3, 3], observation=VideoDetector(model="boxes"), **settings
    )
    assert first == again


@pytest.mark.slow
def test_run_takes_a_detector_file(tmp_path, capsys):
    file = tmp_path / "red.onnx"
    file.write_bytes(build_network("yolo8"))
    arguments = ["run", "--scenario", "cologne1", "--controller", "max-pressure", "--seconds", "10"]
    assert main([*arguments, "--detector", str(file)]) == 0
    assert "travel_time" in capsys.readouterr().out
    assert main([*arguments, "--detector", str(tmp_path / "none.onnx")]) == 3
    assert "none.onnx: no such file" in capsys.readouterr().err


@pytest.mark.parametrize(
    "wrong", [{"model": 3}, {"model": "boxes", "interval": -1}, {"model": "boxes", "latency": -1}]
)
def test_impossible_video_detectors_are_refused(wrong):
    with pytest.raises(ConfigError, match="expected"):
        VideoDetector(**wrong)


@pytest.mark.slow
def test_parked_cars_are_found_and_counted_on_no_lane(scene, cameras):
    """Who sees every box sees the parked cars, too; the map says that their bays are no lanes."""
    pictures = Renderer(scene).render(traffic.empty(scene.road_map), cameras, ("boxes",))
    found = [list_true_boxes(picture.boxes) for picture in pictures]
    assert sum(len(each.boxes) for each in found) > 10
    lanes = [lane.id for lane in scene.road_map.lanes]
    assert LaneWatch(cameras, scene.road_map, lanes).update(0.0, found).vehicles.sum() == 0
