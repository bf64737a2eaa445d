"""Observations through sensors: their spaces, what they show, the same bytes again, and bad input."""

import hashlib
import subprocess
import sys
import warnings

import gymnasium
import numpy as np
import pytest
from conftest import command_environment
from gymnasium.utils.env_checker import check_env
from pettingzoo.test import parallel_api_test

import dojo_env
from dojo_env.camera import Camera
from dojo_env.conditions import Conditions
from dojo_env.config import build_config
from dojo_env.env import TrafficSignalEnv
from dojo_env.errors import ConfigError
from dojo_env.local_world import LocalWorld
from dojo_env.sensor_observations import build_sensor_observer
from dojo_env.sensors.detector import Detector
from dojo_env.sensors.lidar import Lidar
from dojo_env.sensors.picture import CameraSensor

NAMED = {
    "top": "bev",
    "far": "approach_1:depth",
    "what": "approach_0:semantic",
    "who": CameraSensor(output="instance"),
    "spin": "lidar",
    "mine": Camera(name="mine", position=(0.0, 0.0, 30.0), width=64, height=48),
}


@pytest.fixture
def make():
    made = []

    def build(scenario="two-way", **keywords):
        made.append(TrafficSignalEnv(scenario=scenario, **{"num_seconds": 60, **keywords}))
        return made[-1]

    yield build
    for env in made:
        env.close()


@pytest.mark.slow
@pytest.mark.sampled(1)
@pytest.mark.parametrize(
    ("scenario", "observation"),
    [("two-way", "bev"), ("ingolstadt1", "multi_view"), ("two-way", "detector"), ("ingolstadt1", NAMED)],
    ids=str,
)
def test_gymnasium_accepts_every_observation(scenario, observation):
    env = gymnasium.make(
        "dojo_env/TrafficSignal-v0", scenario=scenario, observation=observation, num_seconds=30
    )
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", message=".*can be closed.*|.*spec.*|.*infinity.*")
        check_env(env.unwrapped)
    env.close()


@pytest.mark.filterwarnings("ignore:.*render_mode.*")
def test_pettingzoo_accepts_pictures():
    env = dojo_env.parallel_env(scenario="cologne3", observation="bev", num_seconds=30)
    parallel_api_test(env, num_cycles=8)
    env.close()


def test_pictures_have_the_sizes_that_the_contract_names(make):
    bev = make(observation="bev").observation_space
    assert bev == gymnasium.spaces.Box(0, 255, (256, 356, 3), np.uint8)
    views = make(observation="multi_view").observation_space
    assert list(views) == ["approach_0", "approach_1", "approach_2", "approach_3"]
    assert all(view == bev for view in views.values())


def test_vehicles_are_seen_once_they_are_there(make):
    env = make(observation={"who": "bev:instance", "top": "bev"}, num_seconds=120)
    first, _ = env.reset(seed=1)
    assert not first["who"].any()
    for _ in range(20):
        last, *_ = env.step(0)
    assert last["who"].any()
    assert set(np.unique(last["who"])) - {0} <= set(env.instant.snapshot.numbers.tolist())
    assert (first["top"] != last["top"]).any()


SCRIPT = """
import hashlib, sys
from dojo_env.env import TrafficSignalEnv
digest = hashlib.sha256()
env = TrafficSignalEnv(
    scenario="two-way", observation={"a": "bev", "b": "approach_2:depth", "c": "lidar"}, num_seconds=60,
    conditions={"hour": (6.0, 22.0), "noise": (1.0, 4.0), "shake_deg": (0.5, 1.0)},
)
for _ in range(2):
    seen, _ = env.reset(seed=5)
    for step in range(12):
        for name in sorted(seen):
            digest.update(seen[name].tobytes())
        seen, *_ = env.step(step // 4 % 4)
    print(digest.hexdigest())
    digest = hashlib.sha256()
env.close()
"""


@pytest.mark.slow
def test_same_seed_gives_the_same_pictures_in_every_process_and_after_reset():
    runs = [
        subprocess.run(
            [sys.executable, "-c", SCRIPT], env=command_environment(PYTHONHASHSEED=seed), check=True,
            capture_output=True, text=True,
        ).stdout
        for seed in ("1", "2")
    ]  # fmt: skip
    assert len(set("".join(runs).split())) == 1


def test_conditions_are_drawn_anew_for_each_episode(make):
    env = make(observation="bev", conditions={"hour": (8.0, 16.0), "rain": (0.0, 1.0)})
    seen = [env.reset(seed=seed)[0] for seed in (1, 2, 1)]
    assert hashlib.sha256(seen[0]).digest() == hashlib.sha256(seen[2]).digest()
    assert (seen[0] != seen[1]).mean() > 0.5


@pytest.mark.slow
def test_perfect_detector_agrees_with_the_features_near_the_junction(make):
    env = make("cologne1", observation={"top": "bev"}, num_seconds=400)
    env.reset(seed=2)
    plans, eyes = env.world.map.plans, env.world.eyes
    detector, features = (
        build_sensor_observer(Detector(), eyes, plans, interval=5),
        dojo_env.observations.Features(eyes, plans),
    )
    detector.reset(2)
    pairs = []
    for step in range(60):
        env.step(step // 6 % 4)
        pairs.append((detector.observe(env.signal, env.instant), features.observe(env.signal, env.instant)))
    seen, true = (np.array(side)[:, 5:] for side in zip(*pairs, strict=True))
    assert (seen <= true + 0.02).all()
    assert seen.sum() > 0.5 * true.sum()


@pytest.mark.slow
def test_detector_misses_and_is_late(make):
    env = make("cologne1", observation={"top": "bev"}, num_seconds=300)
    env.reset(seed=2)
    plans, eyes = env.world.map.plans, env.world.eyes
    kinds = {"perfect": Detector(), "blind": Detector(missed=1.0), "late": Detector(latency=2),
             "scared": Detector(false_alarms=3.0)}  # fmt: skip
    observers = {name: build_sensor_observer(kind, eyes, plans, interval=5) for name, kind in kinds.items()}
    seen = {name: [] for name in kinds}
    for observer in observers.values():
        observer.reset(1)
    for step in range(50):
        env.step(step // 6 % 4)
        for name, observer in observers.items():
            seen[name].append(observer.observe(env.signal, env.instant)[5:])
    assert not np.any(seen["blind"])
    np.testing.assert_array_equal(seen["late"][2:], seen["perfect"][:-2])
    assert np.sum(seen["scared"]) > np.sum(seen["perfect"])


@pytest.mark.slow
@pytest.mark.parametrize("false_alarms", [0.0, 2.0])
def test_detector_tells_places_and_blue_lights(false_alarms):
    detector = Detector(least_pixels=1, least_visible=0.0, false_alarms=false_alarms)
    world = LocalWorld(build_config(scenario="two-way-priority", num_seconds=1500, observation=detector))
    (signal,) = world.signals
    world.reset(2)
    told = urgent = 0
    for step in range(300):
        seen, true = (now.approach(signal) for now in (world.perceive(), world.instant))
        lanes = world.perceive().signals[signal].lanes
        assert len(seen.coming) == lanes.total_vehicles
        assert sum(speed == 0 for _, _, speed in seen.coming) == lanes.total_halting
        if not false_alarms:
            real = [metres for _, metres, _ in true.coming]
            for _, metres, _ in seen.coming:
                nearest = min(real, key=lambda each: abs(each - metres))
                assert nearest == pytest.approx(metres, abs=0.5)
                told += 1
            urgent += bool(seen.urgent & true.urgent)
            # Who comes with blue lights on, and takes another link of his lane, is told at all of them.
            assert bool(seen.urgent) <= bool(true.urgent)
        world.step({signal: step // 6 % len(world.map.plans[signal].phases)})
    world.close()
    assert false_alarms or (told > 1000 and urgent > 3)


@pytest.mark.slow
def test_bullet_draws_where_it_is_asked_for(make):
    pytest.importorskip("pybullet")
    env = make(observation="bev", renderer="bullet")
    observation, _ = env.reset(seed=1)
    assert env.observation_space.contains(observation)
    assert observation.std() > 5


def test_own_cameras_take_the_place_of_the_map_s(make):
    signal = make().signal
    mine = (Camera(name="north", position=(0.0, 0.0, 9.0)), Camera(name="bev", position=(0.0, 0.0, 80.0)))
    env = make(observation="multi_view", cameras={signal: mine}, width=100)
    assert list(env.observation_space) == ["north"]


@pytest.mark.slow
def test_measuring_alone_loads_no_compiler():
    script = (
        "import sys; from dojo_env.env import TrafficSignalEnv\n"
        "env = TrafficSignalEnv(scenario='two-way', num_seconds=10)\n"
        "env.reset(seed=1); env.step(0); env.close()\n"
        "print(sorted({'numba', 'cv2', 'pybullet', 'trimesh'} & set(sys.modules)))"
    )
    done = subprocess.run(
        [sys.executable, "-c", script], env=command_environment(), check=True, capture_output=True
    )
    assert done.stdout.decode().strip() == "[]"


@pytest.mark.parametrize(
    ("keywords", "words"),
    [
        ({"observation": "birds"}, "multi_view"),
        ({"observation": {}}, "at least one sensor"),
        ({"observation": {"a": 3}}, "sensor 'a'"),
        ({"observation": {"a": "approach_9"}}, "approach_0"),
        ({"observation": {"a": "bev:smell"}}, "smell"),
        ({"observation": CameraSensor}, "CameraSensor"),
        ({"conditions": {"wind": (0, 1)}}, "wind"),
        ({"conditions": {"rain": (0, 7)}}, "rain"),
        ({"conditions": 3}, "Conditions"),
        ({"renderer": "crayon"}, "raster"),
        ({"cameras": {"x": ()}}, "at least one"),
    ],
)
def test_bad_settings_are_named(make, keywords, words):
    with pytest.raises(ConfigError, match=words):
        make(**{"observation": "bev", **keywords})


@pytest.mark.slow
def test_lidar_and_fixed_conditions_are_taken_as_they_are(make):
    lidar = Lidar(name="roof", position=(0.0, 0.0, 5.0), channels=4, step_deg=5.0)
    env = make(observation={"roof": lidar}, conditions=Conditions(hour=20.0))
    observation, _ = env.reset(seed=1)
    assert observation["roof"].shape == (4, 72)
    assert observation["roof"].max() <= lidar.reach
