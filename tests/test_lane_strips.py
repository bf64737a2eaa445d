"""Lane strips: where lanes lie in pictures, what is cut out of them, and cameras that fail."""

from contextlib import closing
from dataclasses import replace
from itertools import pairwise

import gymnasium
import numpy as np
import pytest

from dojo_env.camera import Camera
from dojo_env.config import build_config
from dojo_env.controllers import make_controller
from dojo_env.errors import ConfigError, PolicyError
from dojo_env.local_world import LocalWorld
from dojo_env.outages import CameraOutage
from dojo_env.sensors.camera_watch import CameraWatch
from dojo_env.sensors.lane_network import CHANNELS, LAYERS, PACKAGED, SEEN, find_chances, read_weights
from dojo_env.sensors.static_objects import StaticObjects
from dojo_env.sensors.strip_geometry import (
    CELL,
    CELLS,
    COLUMNS,
    GEOMETRY,
    REACH,
    ROWS,
    Strip,
    build_strips,
    cut_strips,
    measure_along,
)


@pytest.fixture(scope="module")
def world():
    with closing(LocalWorld(build_config(scenario="cologne1", observation="lane-strips"))) as opened:
        yield opened


@pytest.fixture(scope="module")
def strips(world):
    return find_strips(world)


def find_strips(world: LocalWorld) -> tuple[Strip, ...]:
    (signal,) = world.signals
    return build_strips(world.eyes.scene, world.map.plans[signal], world.eyes.cameras(signal))


def test_every_lane_has_a_strip_and_its_row_is_its_distance(world, strips) -> None:
    (plan,) = world.map.plans.values()
    assert tuple(strip.lane for strip in strips[: len(plan.lanes)]) == plan.lanes
    assert {strip.lane for strip in strips} == {*plan.lanes, *plan.out_lanes}
    for strip in strips:
        assert strip.camera is not None
        for row in (20, 70):
            # Where the middle of a row lies in the picture, by the camera's own projection.
            at = (row + 0.5) * REACH / len(strip.pixels)
            along, _ = measure_along(strip.line, strip.line)
            point = np.array([[np.interp(at, along, strip.line[:, axis]) for axis in range(3)]])
            ((x, y),), _ = strip.camera.project(point)
            middle = strip.pixels[row, strip.pixels.shape[1] // 2 - 1 :][:2].mean(axis=0) + 0.5
            if strip.geometry[row // 2, COLUMNS // 2, GEOMETRY.index("in_view")] == 1:
                assert middle == pytest.approx([x, y], abs=1.0)


@pytest.mark.parametrize("scenario", ["cologne1", "ingolstadt1"])
def test_the_long_view_shows_lanes_from_the_stop_line_as_far_as_strips_reach(scenario: str) -> None:
    unseen = {}
    for preset in ("paper", "long_view"):
        with closing(LocalWorld(build_config(scenario=scenario, cameras=preset))) as opened:
            long = [
                strip.shares
                for strip in find_strips(opened)
                if not strip.is_outgoing and measure_along(strip.line, strip.line)[0].max() >= REACH
            ]
            unseen[preset] = [int((shares == 0).sum()) for shares in long]
    assert max(unseen["long_view"]) == 0
    assert min(unseen["paper"]) >= 3


def test_a_strip_shows_what_stands_on_its_lane(strips) -> None:
    strip = strips[0]
    picture = np.zeros((strip.camera.height, strip.camera.width, 3), np.uint8)
    row = 30
    place = strip.pixels[2 * row : 2 * row + 2, 10:14].reshape(-1, 2).mean(axis=0) + 0.5
    x, y = place.astype(int)
    picture[y - 1 : y + 2, x - 2 : x + 3] = 255
    (seen, *others) = cut_strips(strips, {strip.camera: picture})
    assert seen.shape == (ROWS, COLUMNS, 3)
    brightest = np.unravel_index(seen[..., 0].argmax(), seen.shape[:2])
    assert abs(brightest[0] - row) <= 1
    assert COLUMNS // 2 - 2 <= brightest[1] <= COLUMNS // 2 + 1
    assert not any(each.any() for each, other in zip(others, strips[1:], strict=True)
                   if other.camera is not strip.camera)  # fmt: skip


def test_a_lane_that_divides_counts_once_for_its_parts(strips) -> None:
    for strip in strips:
        assert strip.shares.shape == (CELLS,)
        assert set(np.round(1 / strip.shares[strip.shares > 0])) <= {1.0, 2.0, 3.0}
        in_view = strip.geometry[:, COLUMNS // 2, 0].reshape(CELLS, -1).mean(axis=1)
        assert not strip.shares[in_view == 0].any()


def test_a_birds_eye_view_and_a_camera_that_looks_away_show_no_lane(world) -> None:
    (signal,) = world.signals
    away = Camera(name="away", position=(0.0, 0.0, 10.0), heading_deg=0.0)
    found = build_strips(world.eyes.scene, world.map.plans[signal], [*world.eyes.cameras(signal)[-1:], away])
    assert all(strip.camera is None and not strip.shares.any() for strip in found)
    assert not cut_strips(found, {}).any()


def test_what_is_hidden_or_too_small_is_not_seen(world, strips) -> None:
    (signal,) = world.signals
    scene, plan, strip = world.eyes.scene, world.map.plans[signal], strips[0]
    place = np.asarray(strip.camera.position)
    (seen, *_) = build_strips(scene, plan, [strip.camera])
    assert seen.shares[2:8].all()
    # A wall across the lane, between 30 and 31 m out: all that is behind it is hidden.
    along, _ = measure_along(strip.line, strip.line)
    near, far = (np.array([np.interp(at, along, strip.line[:, k]) for k in range(2)]) for at in (30.0, 31.0))
    aside = 40.0 * np.array([near[1] - far[1], far[0] - near[0]])
    corners = [[*(near + side * aside), height] for side in (-1, 1) for height in (0.0, 30.0)]
    count = len(scene.vertices)
    wall = replace(
        scene,
        vertices=np.vstack([scene.vertices, np.array(corners) - scene.origin]),
        faces=np.vstack([scene.faces, np.array([[0, 1, 2], [2, 1, 0], [1, 2, 3], [3, 2, 1]]) + count]),
    )
    (hidden, *_) = build_strips(wall, plan, [strip.camera])
    assert (hidden.shares[:4] == seen.shares[:4]).all()
    assert not hidden.shares[6:].any()
    assert not hidden.geometry[24:, :, GEOMETRY.index("in_view")].any()
    # The same camera, so far away that a vehicle is a few pixels.
    heading = np.radians(strip.camera.heading_deg)
    x, y, z = place - 400.0 * np.array([np.sin(heading), np.cos(heading), -0.5])
    away = replace(strip.camera, position=(x, y, z))
    assert not any(each.shares.any() for each in build_strips(scene, plan, [away]))


def test_places_along_a_line_are_those_of_its_length() -> None:
    line = np.array([[0.0, 0.0, 0.0], [10.0, 0.0, 0.0], [10.0, 10.0, 5.0]])
    along, aside = measure_along(line, np.array([[3.0, 2.0], [11.0, 4.0], [-5.0, 0.0]]))
    assert along == pytest.approx([3.0, 14.0, 0.0])
    assert aside == pytest.approx([2.0, 1.0, 5.0])


@pytest.mark.slow
def test_strips_are_observed_in_gymnasiums_way_and_are_the_same_twice() -> None:
    seen = []
    for _ in range(2):
        env = gymnasium.make("dojo_env/TrafficSignal-v0", scenario="cologne1", observation="lane-strips",
                             num_seconds=60, look="plain")  # fmt: skip
        first, _ = env.reset(seed=3)
        assert env.observation_space.contains(first)
        last = env.step(1)[0]
        assert env.observation_space.contains(last)
        seen.append(last)
        env.close()
    assert np.array_equal(*seen)


def test_weights_that_do_not_fit_are_refused(tmp_path) -> None:
    weights, path = read_weights(PACKAGED), tmp_path / "lanes.npz"
    np.savez(path, **{**weights, "join_weight": weights["join_weight"][:, 1:]})
    with pytest.raises(PolicyError, match="join does not fit"):
        read_weights(path)


def test_torch_and_numpy_see_alike() -> None:
    torch = pytest.importorskip("torch")
    from dojo_env.learning.vision.network import LaneNet  # noqa: PLC0415 - torch is not everywhere
    from dojo_env.sensors.lane_network import scale_colours  # noqa: PLC0415

    torch.manual_seed(1)
    network, draw = LaneNet(), np.random.default_rng(0)
    network(torch.rand(4, ROWS, COLUMNS, CHANNELS))  # So that what normalises has seen something.
    network.eval()
    strips = draw.integers(0, 256, (3, ROWS, COLUMNS, 9), np.uint8)
    geometry = draw.random((3, ROWS, COLUMNS, len(GEOMETRY)), np.float32)
    values = torch.from_numpy(np.concatenate([scale_colours(strips), geometry], axis=3))
    wanted = network(values).sigmoid().detach().numpy()
    found = find_chances(network.export(), strips, geometry)
    assert found.shape == (3, CELLS, len(SEEN))
    assert found == pytest.approx(wanted, abs=1e-5)
    assert set(LAYERS) == {name.rsplit("_", 1)[0] for name in network.export()}


def test_a_camera_that_is_dark_or_never_changes_is_noticed_and_comes_back() -> None:
    draw, watch = np.random.default_rng(0), CameraWatch()
    good = draw.integers(0, 256, (8, 8, 3), np.uint8)
    assert not watch.note(0.0, good, must_move=False)
    assert not watch.note(100.0, good, must_move=True)
    assert watch.note(120.0, good, must_move=True)
    assert watch.fault == "has frozen"
    assert not watch.note(130.0, good, must_move=False)
    assert watch.note(131.0, draw.integers(0, 256, (8, 8, 3), np.uint8), must_move=False)
    assert not watch.fault
    assert watch.note(132.0, np.full((8, 8, 3), 9, np.uint8), must_move=False)
    assert (watch.fault, watch.since) == ("shows nothing", 132.0)


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["black", "frozen"])
def test_a_dead_camera_is_told_of_and_its_lanes_get_their_turn(
    kind: str, caplog: pytest.LogCaptureFixture
) -> None:
    outage = CameraOutage(camera="approach_0", begin=100, end=500 + len(kind), kind=kind)
    config = build_config(
        scenario="cologne1", observation="lane-strips", outages=[outage], num_seconds=700, look="plain"
    )
    acting, greens = make_controller("learned-vision"), []
    with closing(LocalWorld(config)) as world:
        world.reset(1)
        (signal,) = world.signals
        strips = build_strips(world.eyes.scene, world.map.plans[signal], world.eyes.cameras(signal))
        dead = {strip.lane for strip in strips if strip.camera.name == "approach_0" and not strip.is_outgoing}
        links = [link for link, lane, _ in world.map.plans[signal].links if lane in dead]
        ended = False
        while not ended:
            now = world.perceive()
            if outage.begin + 20 <= now.time - 25_200 < outage.end:
                greens.append(any(now.signals[signal].state[link] in "Gg" for link in links))
            ended = world.step(acting.act(now))[2]
        told = {record.getMessage() for record in caplog.records}
    assert sum(after and not before for before, after in pairwise(greens)) >= 2
    assert any("approach_0 has frozen" in line or "approach_0 shows nothing" in line for line in told)
    assert any("approach_0 is back" in line for line in told)


def test_vehicles_stand_where_the_network_sees_them() -> None:
    config = build_config(scenario="cologne1", observation="lane-strips", num_seconds=200)
    apart: list[float] = []
    with closing(LocalWorld(config)) as world:
        world.reset(2)
        (plan,) = world.map.plans.values()
        limits = dict(zip(plan.lanes, plan.limits, strict=True))
        ended = False
        while not ended:
            real, seen = (now.approach(plan.signal) for now in (world.instant, world.perceive()))
            for lane in plan.lanes:
                links = {link for link, source, _ in plan.links if source == lane}
                there, told = (
                    sorted(far for link, far, _ in each.coming if link in links and far < REACH)
                    for each in (real, seen)
                )
                if len(there) == len(told) > 0:
                    apart += np.abs(np.subtract(there, told)).tolist()
            assert {fast for _, _, fast in seen.coming} <= {0.0, *limits.values()}
            ended = world.step({plan.signal: world.instant.signals[plan.signal].phase})[2]
    assert len(apart) > 100
    assert np.median(apart) < 3.0
    assert np.mean(apart) < 4.0


def test_where_no_camera_looks_somebody_may_stand() -> None:
    with closing(LocalWorld(build_config(scenario="cologne1"))) as world:
        (signal,) = world.signals
        one, *_ = world.eyes.cameras(signal)
    config = build_config(scenario="cologne1", observation="lane-strips", cameras={signal: [one]})
    with closing(LocalWorld(config)) as world:
        world.reset(1)
        (plan,) = world.map.plans.values()
        strips = build_strips(world.eyes.scene, plan, [one])
        unseen = [row for row, strip in enumerate(strips[: len(plan.lanes)]) if strip.camera is None]
        assert 0 < len(unseen) < len(plan.lanes)
        for _ in range(12):
            view = world.perceive().signals[signal]
            world.step({signal: view.phase})
        green = {lane for link, lane, _ in plan.links if view.state[link] in "Gg"}
        red = [row for row in unseen if plan.lanes[row] not in green]
        assert red
        assert (view.lanes.halting[red] == 1).all()
        assert not view.lanes.halting[[row for row in unseen if row not in red]].any()


def test_what_stands_through_several_greens_is_no_vehicle() -> None:
    objects, green, none = StaticObjects(2, 3), np.zeros(2, bool), np.zeros(2, bool)
    told = []
    for time in range(0, 600, 5):
        # The first lane has a post in its first cell, and a queue behind it which leaves at green; the second
        # has a queue and no green.
        green[0] = time % 60 >= 40
        standing = np.array([[0.9, 0.0 if time % 60 > 45 else 0.8, 0.1], [0.9, 0.9, 0.0]])
        told.append(objects.leave_out(time, standing, green, none))
    found = np.array(told)
    assert found[:48, 0, 0] == pytest.approx(0.9)
    assert found[48:, 0, 0] == pytest.approx(0.0)
    assert found[:, 0, 1].max() == pytest.approx(0.8)
    assert found[:, 1, :2] == pytest.approx(0.9)
    # Who passes hides it at a look; who stands where it has been empty for a while counts again.
    for looks, expected in ((1, 0.0), (2, 0.9)):
        for _ in range(looks):
            objects.leave_out(600, np.zeros((2, 3)), green, none)
        found = objects.leave_out(600, np.full((2, 3), 0.9), green, none)
        assert found[0, 0] == pytest.approx(expected)
        assert found[1] == pytest.approx(0.9)


def test_what_stands_in_a_lane_that_flows_is_no_vehicle_but_a_queue_that_cannot_go_is_one() -> None:
    objects, green = StaticObjects(3, 4), np.ones(3, bool)
    told = []
    for time in range(0, 120, 5):
        # A parked car that every third look is hidden by who drives past; a queue; the car where some yield.
        parked, queue = [0.0 if time % 15 == 0 else 0.8, 0.0, 0.0, 0.0], [1.0, 1.0, 0.9, 0.9]
        standing = np.array([parked, queue, parked])
        told.append(objects.leave_out(time, standing, green, np.array([True, True, False])))
    found = np.array(told)
    assert found[:4, 0, 0].max() == pytest.approx(0.8)
    assert found[12:, 0] == pytest.approx(0.0)
    assert (found[:, 1] == queue).all()
    assert found[12:, 2, 0].max() == pytest.approx(0.8)


def test_outages_that_cannot_be_are_one_line() -> None:
    for words, make in (
        ("begin < end", lambda: CameraOutage(begin=5, end=5)),
        ("black, frozen", lambda: CameraOutage(begin=5, kind="gone")),
        ("CameraOutage", lambda: build_config(scenario="cologne1", outages=["approach_0"])),
    ):
        with pytest.raises(ConfigError, match=words):
            make()
    assert CELL * CELLS == REACH
