"""A decision's state is a value: it never answers about another time than its own."""

import pickle
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from dojo_env.config import build_config
from dojo_env.errors import SimulationError, StaleInstantError
from dojo_env.instant import Instant
from dojo_env.local_world import LocalWorld
from dojo_env.world_process import WorldProcess

QUESTIONS: dict[str, Callable[[Instant], Any]] = {
    "snapshot": lambda instant: (instant.snapshot.ids, instant.snapshot.positions.tolist()),
    "list_vehicles": lambda instant: instant.list_vehicles(instant.signals["t"].plan.out_lanes[0]),
    "count_vehicles": lambda instant: instant.count_vehicles(instant.signals["t"].plan.out_lanes).tolist(),
    "approach": lambda instant: instant.approach("t"),
    "time": lambda instant: instant.time,
    "traffic": lambda instant: instant.traffic,
    "signals": lambda instant: [
        (v.phase, v.state, v.green_time, v.lanes.rows) for v in instant.signals.values()
    ],
    "list_wanted_walks": lambda instant: instant.list_wanted_walks("t"),
    "measure_all": lambda instant: instant.measure_all().time,
    "of_views": lambda instant: Instant.of_views(7.0, instant.signals).time,
    "tells_places": lambda instant: instant.tells_places,
}
"""One for every public name of an instant."""
LATE = ("snapshot", "list_vehicles", "count_vehicles", "approach", "measure_all")
"""What costs more than a glance."""


@pytest.fixture
def world() -> Any:
    made = LocalWorld(build_config(scenario="two-way", num_seconds=600))
    made.reset(1)
    for _ in range(20):
        made.step({"t": 0})
    yield made
    made.close()


def test_every_public_name_is_asked() -> None:
    assert {name for name in dir(Instant) if not name.startswith("_")} == set(QUESTIONS)


@pytest.mark.parametrize("name", QUESTIONS)
def test_what_was_asked_in_time_stays_as_it_was(world: LocalWorld, name: str) -> None:
    old = world.instant
    then = QUESTIONS[name](old)
    for _ in range(6):
        world.step({"t": 2})
    assert QUESTIONS[name](old) == then
    world.close()
    assert QUESTIONS[name](old) == then


@pytest.mark.parametrize("name", QUESTIONS)
def test_what_was_not_asked_in_time_is_refused_not_made_up(world: LocalWorld, name: str) -> None:
    old = world.instant
    world.step({"t": 0})
    if name not in LATE:
        QUESTIONS[name](old)
        return
    with pytest.raises(StaleInstantError, match=r"at 100 s can no longer be measured"):
        QUESTIONS[name](old)


def test_another_episode_makes_an_instant_old_even_at_the_same_time(world: LocalWorld) -> None:
    world.reset(1)
    old = world.instant
    world.reset(2)
    with pytest.raises(StaleInstantError):
        _ = old.snapshot


def test_lists_and_counts_are_sumos_own(world: LocalWorld) -> None:
    count = world.traffic.simulation._get.lane_getLastStepVehicleNumber
    lanes = world.traffic.simulation.lane_ids
    assert world.instant.count_vehicles(lanes).tolist() == [count(lane) for lane in lanes]
    assert world.instant.count_vehicles(lanes).sum() > 10


def test_a_lane_that_is_not_there_is_one_clear_error(world: LocalWorld) -> None:
    with pytest.raises(SimulationError, match="gone"):
        world.instant.list_vehicles("gone")


class Comparing:
    """A reward that asks both of its decisions for everything."""

    def __init__(self) -> None:
        self.befores: list[Any] = []
        self.nows: list[Any] = []

    def __call__(self, _signal: str, before: Instant, now: Instant) -> float:
        self.befores.append([QUESTIONS[name](before) for name in sorted(QUESTIONS)])
        self.nows.append([QUESTIONS[name](now) for name in sorted(QUESTIONS)])
        return 0.0


@pytest.mark.parametrize("several", [False, True])
def test_before_means_before_in_a_reward(*, several: bool) -> None:
    reward = Comparing()
    world = LocalWorld(build_config(scenario="two-way", reward_fn={"t": reward} if several else reward))
    world.reset(1)
    for _ in range(20):
        world.step({"t": 0})
    world.close()
    assert reward.befores[1:] == reward.nows[:-1]
    assert reward.befores[10] != reward.nows[10]


def test_an_instant_arrives_whole_in_another_process(world: LocalWorld) -> None:
    arrived = pickle.loads(pickle.dumps(world.instant))  # noqa: S301 - our own
    for name, ask in QUESTIONS.items():
        assert ask(arrived) == ask(world.instant), name
    assert not arrived.snapshot.positions.flags.writeable
    with pytest.raises(TypeError):
        arrived.signals["t"] = None


@pytest.mark.slow
def test_an_own_process_tells_its_instant_like_any_other(world: LocalWorld) -> None:
    apart = WorldProcess(world.config)
    apart.reset(1)
    for _ in range(20):
        apart.step({"t": 0})
    told = apart.instant
    apart.close()
    for name, ask in QUESTIONS.items():
        assert ask(told) == ask(world.instant), name
    assert np.array_equal(told.snapshot.speeds, world.instant.snapshot.speeds)
