"""The raster renderer and the lidar against pybullet's own eyes, on real maps."""

import sys
from dataclasses import replace

import numpy as np
import pytest
import traffic

from dojo_env.camera import Camera
from dojo_env.errors import ConfigError
from dojo_env.rendering.bullet import BulletWorld
from dojo_env.rendering.renderer import Renderer
from dojo_env.rendering.scene import build_scene
from dojo_env.sensors.lidar import Lidar, LidarScanner
from dojo_env.sensors.placement import place_cameras
from dojo_env.snapshot import Kind, Snapshot
from dojo_maps.bundle import read_bundle
from dojo_maps.errors import ToolMissingError

pytest.importorskip("pybullet")

OUTPUTS = ("rgb", "depth", "semantic", "instance")
LARGE = 400


@pytest.fixture(scope="module")
def scenes(converted):
    return {
        name: build_scene(read_bundle(converted(name).folder)) for name in ("cologne1", "slope", "right_hand")
    }


@pytest.mark.slow
@pytest.mark.sampled(1)
@pytest.mark.parametrize("name", ["cologne1", "slope", "right_hand"])
def test_pictures_agree_with_bullet(scenes, name):
    scene = scenes[name]
    signal = scene.road_map.signals[0].id
    street = tuple(set(Kind) - {Kind.TRAIN, Kind.SHIP})
    cameras = place_cameras(scene, signal)
    compared = 0
    with BulletWorld(scene) as world:
        for seed in (1, 2):
            snapshot = traffic.rush_hour(scene.road_map, signal, seed=seed, kinds=street)
            snapshot = replace(snapshot, signals={})
            pictures = zip(
                Renderer(scene).render(snapshot, cameras, OUTPUTS),
                world.render(snapshot, cameras, OUTPUTS),
                strict=True,
            )
            for mine, theirs in pictures:
                assert (mine.semantic == theirs.semantic).mean() > 0.99
                near = mine.depth < 0.9 * mine.camera.far
                assert (np.abs(mine.depth - theirs.depth)[near] < 0.02 * mine.depth[near]).mean() > 0.99
                for number in np.unique(mine.instance[mine.instance > 0]):
                    a, b = mine.instance == number, theirs.instance == number
                    if max(a.sum(), b.sum()) > LARGE:
                        compared += 1
                        assert (a & b).sum() / (a | b).sum() >= 0.95, (mine.camera.name, number)
    assert compared > 10


def test_lidar_agrees_with_bullet_rays(scenes):
    scene = scenes["cologne1"]
    signal = scene.road_map.signals[0].id
    camera = place_cameras(scene, signal)[0]
    kinds = (Kind.CAR, Kind.BUS, Kind.TRUCK, Kind.BICYCLE, Kind.PEDESTRIAN)
    snapshot = traffic.rush_hour(scene.road_map, signal, kinds=kinds)
    lidar = Lidar(name="pole", position=camera.position, channels=24, step_deg=1.0, reach=80.0)
    scan = LidarScanner(scene).scan(snapshot, [lidar])[0]
    directions = lidar.directions[::-1].reshape(-1, 3)
    start = np.tile(np.array(lidar.position), (len(directions), 1))
    with BulletWorld(scene) as world:
        world.show(snapshot)
        hits = world.cast_rays(start, start + lidar.reach * directions)
    ranges = scan.ranges.ravel()
    both = np.isfinite(ranges) & np.isfinite(hits.distances)
    assert both.sum() > 3000
    agree = np.isfinite(ranges) == np.isfinite(hits.distances)
    agree[both] &= np.abs(ranges[both] - hits.distances[both]) < 0.05
    assert agree.mean() >= 0.99
    assert (scan.instance.ravel() == hits.instance).mean() >= 0.99
    assert (scan.semantic.ravel() == hits.semantic).mean() >= 0.98
    assert (hits.instance > 0).sum() > 100


def test_contacts_are_those_that_are_near(scenes):
    scene = scenes["cologne1"]
    x, y = (float(v) for v in scene.origin[:2])
    poses = [(x, y, 0.0, 0.0), (x - 4.7, y, 0.0, 0.0), (x - 1.0, y + 0.5, 0.0, 1.0), (x + 60.0, y, 0.0, 0.0)]
    snapshot = traffic.users(poses, [Kind.CAR] * 4, traffic.empty(scene.road_map))
    with BulletWorld(scene) as world:
        assert world.contacts(1.0) == ()
        world.show(snapshot)
        near = {(c.first, c.second): c for c in world.contacts(0.5)}
        touching = {(c.first, c.second) for c in world.contacts(0.0)}
    assert set(near) == {("user0", "user1"), ("user0", "user2")}
    assert near["user0", "user1"].distance == pytest.approx(0.2, abs=0.06)
    assert near["user0", "user2"].distance < 0
    assert touching == {("user0", "user2")}


def test_road_users_come_move_and_go(scenes):
    scene = scenes["cologne1"]
    x, y = (float(v) for v in scene.origin[:2])
    above = Camera(name="above", position=(x, y, 40.0), heading_deg=90.0, pitch_deg=-90.0)
    base = traffic.empty(scene.road_map)
    with BulletWorld(scene) as world:
        seen = []
        for place in (x - 10.0, x + 10.0):
            snapshot = traffic.users([(place, y, 0.0, 0.0)], [Kind.BUS], base)
            seen.append(world.render(snapshot, [above], ("instance",))[0].instance == 1)
        gone = world.render(base, [above], ("instance",))[0].instance
    assert seen[0].sum() > 100
    assert seen[1].sum() > 100
    assert not (seen[0] & seen[1]).any()
    assert not (gone == 1).any()


def test_worlds_are_apart_and_close_twice(scenes):
    scene = scenes["slope"]
    first, second = BulletWorld(scene), BulletWorld(scene)
    first.close()
    first.close()
    with pytest.raises(ConfigError, match="closed"):
        first.contacts()
    camera = Camera(name="c", position=(*map(float, scene.origin[:2]), 60.0), pitch_deg=-90.0)
    assert second.render(Snapshot(time=0), [camera])[0].rgb.std() > 1
    second.close()


def test_what_bullet_cannot_do_is_said(scenes):
    with BulletWorld(scenes["slope"]) as world:
        with pytest.raises(ConfigError, match="boxes"):
            world.render(Snapshot(time=0), [], ("boxes",))
        bent = Camera(name="fish", position=(0.0, 0.0, 9.0), distortion=(-0.2, 0.0, 0.0, 0.0))
        with pytest.raises(ConfigError, match="fish"):
            world.render(Snapshot(time=0), [bent])


def test_missing_pybullet_is_named(scenes, monkeypatch):
    monkeypatch.setitem(sys.modules, "pybullet", None)
    with pytest.raises(ToolMissingError, match=r"traffic-dojo\[bullet\]"):
        BulletWorld(scenes["slope"])
