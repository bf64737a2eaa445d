"""The event camera: silent where nothing moves, ON and OFF as a bright vehicle passes, the same by seed."""

from types import SimpleNamespace

import numpy as np
import pytest

from dojo_env.camera import Camera
from dojo_env.env import TrafficSignalEnv
from dojo_env.errors import ConfigError
from dojo_env.rendering.outputs import Picture
from dojo_env.sensors.base import Look, Site
from dojo_env.sensors.events import OFF, ON, EventCamera
from dojo_env.snapshot import Snapshot

CAMERA = Camera(name="mine", position=(0.0, 0.0, 10.0), width=12, height=8)
DARK, BRIGHT = 60, 200


def mount(seed=0, **settings):
    site = Site(name="e", signal="s", plan=None, eyes=SimpleNamespace(), decision_interval=5.0)
    sensor = EventCamera(camera=CAMERA, **settings).mount(site)
    sensor.reset(np.random.default_rng(seed))
    return sensor


def look(sensor, rgb, time):
    return sensor.observe(
        Look(snapshot=Snapshot(time=time), pictures={CAMERA: Picture(camera=CAMERA, outputs={"rgb": rgb})})
    )


def road(vehicle=None):
    """A dark road, and a bright vehicle of three columns on it."""
    rgb = np.full((8, 12, 3), DARK, dtype=np.uint8)
    if vehicle is not None:
        rgb[2:6, vehicle : vehicle + 3] = BRIGHT
    return rgb


def run(sensor, pictures):
    return np.array([look(sensor, rgb, float(k)) for k, rgb in enumerate(pictures)])


def test_nothing_moves_no_events():
    assert not run(mount(), [road(4)] * 5).any()


def test_bright_vehicle_passes_on_then_off():
    seen = run(mount(), [road(), road(4), road(4), road()])
    there = np.zeros((8, 12), dtype=bool)
    there[2:6, 4:7] = True
    for moment, polarity in ((1, ON), (3, OFF)):
        assert (seen[moment, there, polarity] > 0).all()
        assert not seen[moment, ~there].any()
        assert not seen[moment, :, :, 1 - polarity].any()
    assert not seen[2].any()


def test_number_of_events_is_the_contrast_in_thresholds():
    def light(value):
        return ((value / 255 + 0.055) / 1.055) ** 2.4 + 0.01

    contrast = np.log(light(BRIGHT) / light(DARK))
    for threshold in (0.1, 0.2, 0.5):
        seen = run(mount(threshold=threshold), [road(), road(4)])
        assert seen.max() == int(contrast / threshold)


def test_slow_change_fires_all_the_same():
    steps = [np.full((8, 12, 3), value, dtype=np.uint8) for value in range(DARK, BRIGHT + 1)]
    slow, fast = run(mount(), steps).sum(axis=0), run(mount(), [steps[0], steps[-1]]).sum(axis=0)
    np.testing.assert_allclose(slow, fast, atol=1)


def test_counts_are_clipped_and_summed():
    sensor = mount(threshold=0.01)
    seen = run(sensor, [np.zeros((8, 12, 3), np.uint8), np.full((8, 12, 3), 255, np.uint8)])
    assert seen[1].max() == 255
    assert sensor.deliver([seen[1], seen[1]], None).max() == 255
    ones = [np.full((8, 12, 2), n, dtype=np.uint8) for n in (1, 2, 3)]
    total = sensor.deliver(ones, None)
    assert (total == 6).all()
    assert total.dtype == np.uint8


@pytest.mark.parametrize("noise", [{"mismatch": 0.05}, {"background_rate": 0.5}])
def test_noise_follows_from_the_seed(noise):
    pictures = [road(k) for k in range(9)]
    first, again, other = (run(mount(seed, **noise), pictures) for seed in (1, 1, 2))
    assert first.tobytes() == again.tobytes()
    assert first.tobytes() != other.tobytes()
    assert first.tobytes() != run(mount(), pictures).tobytes()


def test_background_comes_at_its_rate():
    seen = run(mount(background_rate=0.4), [road()] * 200)
    assert seen[1:].mean() == pytest.approx(0.2, rel=0.05)


@pytest.mark.parametrize("wrong", [{"threshold": 0.0}, {"mismatch": -1}, {"background_rate": float("nan")}])
def test_impossible_settings_are_named(wrong):
    with pytest.raises(ConfigError, match=f"{next(iter(wrong))}=.*expected"):
        EventCamera(**wrong)


def episode(seed, **settings):
    wanted = {
        "seldom": "events:bev",
        "often": EventCamera(interval=1, mismatch=0.03, background_rate=0.01, **settings),
    }
    env = TrafficSignalEnv(scenario="two-way", observation=wanted, num_seconds=60, width=89, height=64)
    try:
        seen = [env.reset(seed=seed)[0]] + [env.step(k // 4 % 2)[0] for k in range(12)]
        assert all(env.observation_space.contains(each) for each in seen)
    finally:
        env.close()
    assert env.observation_space["often"].shape == (64, 89, 2)
    return {name: np.array([each[name] for each in seen]) for name in wanted}


def test_traffic_is_seen_between_decisions():
    first, again, other = (episode(seed) for seed in (3, 3, 4))
    assert not first["seldom"][0].any()
    assert first["seldom"][-1].any()
    assert first["often"].sum() > 1.5 * first["seldom"].sum()
    for name in first:
        assert first[name].tobytes() == again[name].tobytes()
        assert first[name].tobytes() != other[name].tobytes()
