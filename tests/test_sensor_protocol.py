"""Sensors as a protocol: a user's own kind, intervals and delays, and the table of outputs."""

import warnings
from dataclasses import dataclass

import gymnasium
import numpy as np
import pytest
from gymnasium import spaces
from gymnasium.utils.env_checker import check_env

from dojo_env.camera import Camera
from dojo_env.env import TrafficSignalEnv
from dojo_env.errors import ConfigError
from dojo_env.rendering.boxes import Boxes
from dojo_env.rendering.outputs import OUTPUTS, Output, check_outputs
from dojo_env.rendering.renderer import Renderer
from dojo_env.rendering.scene import build_scene
from dojo_env.scenario import find_scenario, open_map
from dojo_env.sensors.base import SENSORS, Sensor
from dojo_env.sensors.detector import Detector
from dojo_env.sensors.picture import CameraSensor
from dojo_env.snapshot import Snapshot

SMALL = Camera(name="small", position=(0.0, 0.0, 60.0), pitch_deg=-90.0, width=32, height=24)


class Clock(Sensor):
    """Sees the time of its look, and a random number."""

    def __init__(self, interval, delay):
        self.space = spaces.Box(0.0, np.inf, (2,), np.float64)
        self.interval, self.delay = interval, delay

    def reset(self, random):
        self.random = random

    def observe(self, look):
        return np.array([look.snapshot.time, self.random.random()])


class AllLooks(Clock):
    """Tells how many looks have arrived, and when the newest was."""

    def deliver(self, looks, view):  # noqa: ARG002
        return np.array([len(looks), looks[-1][0]])


@dataclass(frozen=True, slots=True, kw_only=True)
class ClockSettings:
    interval: float = 0.0
    delay: float = 0.0
    kind: type = Clock

    def mount(self, site):  # noqa: ARG002
        return self.kind(self.interval, self.delay)


@pytest.fixture
def make():
    made = []

    def build(observation, **keywords):
        settings = {"scenario": "two-way", "num_seconds": 60, **keywords}
        made.append(TrafficSignalEnv(observation=observation, **settings))
        return made[-1]

    yield build
    for env in made:
        env.close()


def times_seen(env, steps=6, name=None):
    """The first value of each decision's observation, in seconds after the first decision."""
    seen = [env.reset(seed=1)[0]] + [env.step(0)[0] for _ in range(steps)]
    return np.array([each if name is None else each[name] for each in seen])


def test_own_kind_is_used_by_its_name(monkeypatch):
    monkeypatch.setitem(SENSORS, "clock", lambda text, _site: Clock(float(text or 0), 0.0))
    env = gymnasium.make(
        "dojo_env/TrafficSignal-v0", scenario="two-way", num_seconds=30,
        observation={"slow": "clock:10", "always": "clock", "top": "bev"},
    )  # fmt: skip
    assert env.observation_space["slow"] == spaces.Box(0.0, np.inf, (2,), np.float64)
    times = [times_seen(env.unwrapped, steps=2, name=name)[:, 0].tolist() for name in ("slow", "always")]
    assert times == [[0, 0, 10], [0, 5, 10]]
    env.close()


@pytest.mark.slow
def test_gymnasium_accepts_own_settings():
    env = gymnasium.make(
        "dojo_env/TrafficSignal-v0", scenario="two-way", num_seconds=30,
        observation={"clock": ClockSettings(interval=1, delay=2), "events": "events", "lanes": "detector"},
    )  # fmt: skip
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", message=".*can be closed.*|.*spec.*|.*infinity.*")
        check_env(env.unwrapped)
    env.close()


@pytest.mark.parametrize(
    ("interval", "delay", "expected"),
    [
        (0, 0, [0, 5, 10, 15, 20, 25, 30]),
        (10, 0, [0, 0, 10, 10, 20, 20, 30]),
        (7, 0, [0, 0, 7, 14, 14, 21, 28]),
        (2, 0, [0, 4, 10, 14, 20, 24, 30]),
        (2.5, 0, [0, 5, 10, 15, 20, 25, 30]),
        (0, 5, [0, 0, 5, 10, 15, 20, 25]),
        (0, 7, [0, 0, 0, 5, 10, 15, 20]),
        (1, 3, [0, 2, 7, 12, 17, 22, 27]),
        (0, 1000, [0] * 7),
    ],
)
def test_interval_and_delay(make, interval, delay, expected):
    env = make(ClockSettings(interval=interval, delay=delay))
    assert times_seen(env)[:, 0].tolist() == expected


def test_all_looks_that_arrived_are_delivered(make):
    env = make({"all": ClockSettings(interval=1, kind=AllLooks), "one": ClockSettings(interval=5)})
    assert times_seen(env, name="all").tolist() == [[1, 0], *([5, 5 * k] for k in range(1, 7))]


def test_what_would_not_be_used_is_not_looked_at(make):
    class LastLooks(AllLooks):
        idle = 3.0

    env = make(ClockSettings(interval=1, kind=LastLooks))
    assert times_seen(env).tolist() == [[1, 0], *([3, 5 * k] for k in range(1, 7))]


def test_looks_follow_sumo_s_steps(make):
    env = make(ClockSettings(interval=0.5, kind=AllLooks), additional_sumo_cmd="--step-length 0.5")
    assert times_seen(env)[1:, 0].tolist() == [10] * 6


@pytest.mark.slow
def test_noise_follows_from_seed_and_name_alone(make):
    alone = times_seen(make({"a": ClockSettings()}), name="a")
    beside = times_seen(make({"z": ClockSettings(interval=1), "a": ClockSettings()}), name="a")
    other = times_seen(make({"b": ClockSettings()}), name="b")
    np.testing.assert_array_equal(alone, beside)
    assert (alone[:, 1] != other[:, 1]).all()


@pytest.mark.slow
def test_sensors_that_share_a_camera_draw_it_once(make, monkeypatch):
    drawn = []
    picture = Renderer._picture

    def count(self, snapshot, users, camera, *more):
        drawn.append(camera.name)
        return picture(self, snapshot, users, camera, *more)

    monkeypatch.setattr(Renderer, "_picture", count)
    env = make({"a": "bev", "b": "bev:depth", "c": "events:bev", "d": "approach_0", "e": "detector"})
    env.reset(seed=1)
    assert sorted(drawn) == ["approach_0", "approach_1", "approach_2", "approach_3", "bev"]


def test_pictures_come_as_often_and_as_late_as_asked(make):
    late, rare = CameraSensor(camera=SMALL, delay=10), CameraSensor(camera=SMALL, interval=10)
    env = make({"now": SMALL, "late": late, "rare": rare}, num_seconds=100)
    seen = [env.reset(seed=1)[0]] + [env.step(k // 3 % 2)[0] for k in range(12)]
    for k in range(13):
        np.testing.assert_array_equal(seen[k]["late"], seen[max(0, k - 2)]["now"])
        np.testing.assert_array_equal(seen[k]["rare"], seen[k - k % 2]["now"])


@pytest.mark.sampled(2)
@pytest.mark.parametrize("observation", ["detector", Detector(), {"d": "detector"}, {"d": Detector()}])
def test_detector_in_any_way(make, observation):
    env = make(observation)
    seen, _ = env.reset(seed=1)
    assert env.observation_space.contains(seen)
    assert (seen["d"] if isinstance(seen, dict) else seen)[:4].sum() == 1


@pytest.mark.parametrize(
    ("observation", "words"),
    [
        ({"a": ClockSettings(interval=-1)}, "sensor 'a': interval=-1"),
        ({"a": ClockSettings(delay=float("nan"))}, "sensor 'a': delay=nan"),
        ({"a": ClockSettings(kind=lambda *_: 3)}, "Sensor"),
        ({"a": Clock}, "mount"),
        ({"a": "detector:bev"}, "Detector"),
        ({"a": "events:nowhere"}, "approach_0"),
        ({"a": "lidar:nowhere"}, "approach_0"),
        ({"a": "bev:boxes"}, "rgb, depth, semantic, instance"),
    ],
)
def test_what_no_sensor_can_be_is_named(make, observation, words):
    with pytest.raises(ConfigError, match=words):
        make(observation)


def test_table_of_outputs_tells_what_renderers_make():
    scene = build_scene(open_map(find_scenario("two-way")))
    (picture,) = Renderer(scene).render(Snapshot(time=0.0), [SMALL], tuple(OUTPUTS))
    assert isinstance(picture.boxes, Boxes)
    for name, output in OUTPUTS.items():
        if output.dtype is not None:
            made = picture.outputs[name]
            assert (made.dtype, made.shape) == (np.dtype(output.dtype), output.shape(SMALL))
            assert output.low <= made.min() <= made.max() <= output.high(SMALL)
            assert getattr(picture, name) is made
    (plain,) = Renderer(scene).render(Snapshot(time=0.0), [SMALL])
    assert plain.depth is None
    with pytest.raises(AttributeError, match="instance"):
        _ = plain.smell


def test_another_output_is_one_entry(make, monkeypatch):
    inverse = Output(
        what="1 / depth, 1/m", dtype=np.float32, high=lambda camera: 1 / camera.near,
        make=lambda drawing: drawing.target.depths.copy(),
    )  # fmt: skip
    table = {**OUTPUTS, "nearness": inverse}
    for module in ("outputs", "renderer"):
        monkeypatch.setattr(f"dojo_env.rendering.{module}.OUTPUTS", table)
    monkeypatch.setattr("dojo_env.sensors.picture.OUTPUTS", table)
    env = make({"near": "bev:nearness", "far": "bev:depth"})
    seen, _ = env.reset(seed=1)
    assert env.observation_space.contains(seen)
    np.testing.assert_allclose(1 / seen["near"], seen["far"], rtol=1e-5)


def test_bullet_has_no_boxes():
    assert check_outputs(["rgb"], bullet=True) == {"rgb"}
    with pytest.raises(ConfigError, match="from bullet; choose from rgb, depth, semantic, instance"):
        check_outputs(["boxes"], bullet=True)
