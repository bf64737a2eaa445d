"""What each phase is expected to cost, and the rule that goes by it."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from dojo_env.config import build_config
from dojo_env.detectors.measuring import LaneMeasurements
from dojo_env.instant import SignalView, build_approach
from dojo_env.local_world import LocalWorld
from dojo_env.perceived import PerceivedInstant
from dojo_env.phase_features import DELAY, PHASE_FEATURES, PhaseReader
from dojo_env.queue_forecast import QueueForecast
from dojo_env.runs import run_controller

LEFT, THROUGH = 2, 0
"""Links of two-way's northern arm: to the left, which phase 1 serves, and straight on, which phase 0 does."""


@cache
def two_way() -> SignalView:
    world = LocalWorld(build_config(scenario="two-way", num_seconds=60))
    world.reset(1)
    (signal,) = world.signals
    view = replace(world.instant.signals[signal], green_time=10.0)
    world.close()
    return view


def delays(
    *coming: tuple[int, float, float], green_time: float = 10.0, full: tuple[str, ...] = ()
) -> np.ndarray:
    view = replace(two_way(), green_time=green_time)
    beyond = [1e6 if lane in full else 0.0 for lane in view.plan.out_lanes]
    approach = build_approach(view.plan, coming, beyond)
    return QueueForecast(view.plan).measure_delays(view, approach, ())


def impatient(*waits: tuple[int, int]) -> float:
    """Sum the seconds from which until which each waits; one after s seconds of waiting counts 1 + .02 s."""
    return sum(1 + 0.02 * second for first, last in waits for second in range(first, last))


def test_where_nobody_comes_no_phase_costs_anything() -> None:
    assert delays().tolist() == [0.0] * len(two_way().plan.phases)


def test_a_queue_leaves_by_headways_once_its_phase_is_green() -> None:
    """Two seconds of yellow and a start of 2.5 s; then one goes every other second. Or 5 s later."""
    found = delays(*[(LEFT, 0.0, 0.0)] * 3)
    now = impatient((0, 5), (0, 7), (0, 9))
    later = impatient((0, 10), (0, 12), (0, 14))
    assert found[1] == 0.0
    assert found[0] == pytest.approx(later - now)


def test_a_present_phase_that_may_not_change_yet_keeps_its_green() -> None:
    """After 5 s of 10, the model may choose another phase 5 s from now at the earliest."""
    early, late = (delays((LEFT, 0.0, 0.0), green_time=seconds)[0] for seconds in (0.0, 10.0))
    assert early > late


def test_who_comes_costs_nothing_before_he_is_there() -> None:
    """At four fifths of 13.9 m/s, 140 m take 12.6 s: long enough for a change that begins in 5 s, too."""
    assert delays((LEFT, 140.0, 13.9))[:2] == pytest.approx([0.0, 0.0])
    near = delays((LEFT, 10.0, 13.9))
    assert near[1] == 0.0
    assert near[0] == pytest.approx(impatient((0, 9)) - impatient((0, 4)), abs=0.3)


def test_who_has_waited_for_long_counts_more() -> None:
    view = two_way()
    approach = build_approach(view.plan, [(LEFT, 0.0, 0.0)], [0.0] * len(view.plan.out_lanes))
    waiting = np.where(np.array(view.plan.lanes) == view.plan.links[LEFT][1], 60.0, 0.0)

    class Waited:
        accumulated_waiting = waiting

    fresh, tired = (
        QueueForecast(view.plan).measure_delays(each, approach, ())[0]
        for each in (view, replace(view, lanes=Waited()))
    )
    assert fresh == pytest.approx(impatient((5, 10)))
    assert tired == pytest.approx(5 * (1 + 0.02 * 40))  # More than 40 s do not count.


def test_nobody_leaves_where_there_is_no_room_behind() -> None:
    view = two_way()
    behind = view.plan.exits[THROUGH]
    queue = [(THROUGH, 0.0, 0.0)] * 5
    free, full = delays(*queue), delays(*queue, full=behind)
    assert free[0] == full[0] == 0.0
    assert 0.0 < full[1] < free[1]


def test_who_stands_far_behind_the_queue_counts_for_nothing() -> None:
    """He waits for something else, and so do those who stand behind him; who drives there still comes."""
    queue = [(LEFT, 0.0, 0.0), (LEFT, 7.5, 0.0)]
    alone = delays(*queue)
    assert delays(*queue, (LEFT, 90.0, 0.0), (LEFT, 97.5, 0.0)) == pytest.approx(alone)
    assert delays(*queue, (LEFT, 15.0, 0.0))[0] > alone[0]
    assert delays(*queue, (LEFT, 90.0, 0.0), (LEFT, 97.5, 9.0))[0] > alone[0]
    assert delays((LEFT, 90.0, 0.0)).tolist() == delays().tolist()


def test_the_order_in_which_vehicles_are_told_does_not_matter() -> None:
    draw = np.random.default_rng(1)
    links = [link for link, _, _ in two_way().plan.links]
    coming = [(int(draw.choice(links)), float(draw.uniform(0, 200)), float(draw.choice([0.0, 9.0])))
              for _ in range(30)]  # fmt: skip
    shuffled = [coming[k] for k in draw.permutation(len(coming))]
    assert delays(*coming) == pytest.approx(delays(*shuffled))


@pytest.mark.parametrize("scenario", ["cologne1", "two-way"])
def test_looking_ahead_beats_the_rule_that_counts(scenario: str) -> None:
    """Every vehicle's travel time, in two half hours."""
    ahead, counts = (
        run_controller(controller, [1, 2], scenario=scenario, num_seconds=1800)
        for controller in ("rolling-horizon", "queue-pressure")
    )
    assert not any(each["violations"] for each in ahead)
    times = [sum(each["travel_time_all"] for each in episodes) for episodes in (ahead, counts)]
    assert times[0] < 0.97 * times[1]


def test_who_stands_in_a_lane_that_a_camera_counts_is_in_front() -> None:
    world = LocalWorld(build_config(scenario="two-way", num_seconds=60))
    world.reset(1)
    (signal,), now = world.signals, world.instant
    plan = now.signals[signal].plan
    lanes = (*plan.lanes, *plan.out_lanes)
    counts = {"n_t_0": (3, 1), "e_t_0": (1, 2)}  # The second more than there are, which noise may tell.
    vehicles, halting = (np.array([counts.get(lane, (0, 0))[k] for lane in lanes], float) for k in range(2))
    none = np.zeros(len(lanes))
    measured = LaneMeasurements(
        time=now.time, lanes=lanes, vehicles=vehicles, halting=halting, mean_speed=none, mean_length=none,
        waiting=none, tracks=((),) * len(lanes),
    )  # fmt: skip
    perceived = PerceivedInstant(now, {signal: measured})
    approach = perceived.approach(signal)
    coming = approach.coming
    world.close()
    assert [(link, speed) for link, _, speed in coming] == [
        (0, 0.0), (1, pytest.approx(13.9, abs=0.1)), (0, pytest.approx(13.9, abs=0.1)), (3, 0.0),
    ]  # fmt: skip
    metres = [far for _, far, _ in coming[:3]]
    assert metres[0] == 0.0
    assert 7.5 < metres[1] < metres[2] < 150.0
    # Where they are is guessed: a policy is told no delay of it.
    view = perceived.signals[signal]
    assert QueueForecast(plan).measure_delays(view, approach, ()).max() > 0.0
    told = PhaseReader(plan).read(signal, perceived)
    assert not told[:, PHASE_FEATURES.index("delay")].any()
    assert told[:, PHASE_FEATURES.index("halting")].any()
    # Where they have been measured it is.
    places = dict.fromkeys(lanes, ()) | {"n_t_0": ((4.0, False), (20.0, True))}
    perceived = PerceivedInstant(now, {signal: replace(measured, places=places)})
    view, approach = perceived.signals[signal], perceived.approach(signal)
    assert approach.coming == ((0, 4.0, pytest.approx(13.9, abs=0.1)), (1, 20.0, 0.0))
    delays = QueueForecast(plan).measure_delays(view, approach, ())
    told = PhaseReader(plan).read(signal, perceived)
    assert DELAY * told[:, PHASE_FEATURES.index("delay")] == pytest.approx(delays, abs=0.01)
    assert delays.max() > 0.0
    # Ten seconds later they are elsewhere.
    late = PerceivedInstant(now, {signal: replace(measured, time=now.time - 10.0, places=places)})
    assert not PhaseReader(plan).read(signal, late)[:, PHASE_FEATURES.index("delay")].any()
