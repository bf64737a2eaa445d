"""Queues that are longer than what cameras show of their lanes."""

from dataclasses import replace

import numpy as np
import pytest

from dojo_env.camera import Camera
from dojo_env.sensors.strip_geometry import CELLS, COLUMNS, ROWS, Strip
from dojo_env.sensors.unseen_queues import UnseenQueues

GREEN, RED = np.array([True]), np.array([False])
SHOWN = 10
"""Cells of the lane that are in view, 60 m."""


def strip(length=500.0, shown=SHOWN):
    return Strip(
        lane="a_0", is_outgoing=False, line=np.array([[0.0, 0.0, 0.0], [0.0, length, 0.0]]), sources=("a_0",),
        camera=Camera(name="a", position=(0.0, 0.0, 9.0)),
        pixels=np.zeros((2 * ROWS, 2 * COLUMNS, 2), np.float32),
        geometry=np.zeros((ROWS, COLUMNS, 6), np.float32),
        shares=(np.arange(CELLS) < shown).astype(float),
    )  # fmt: skip


def queue(vehicles):
    """Let so many stand, 0.8 of them on a cell, as far as they are in view."""
    return np.clip(vehicles - 0.8 * np.arange(CELLS), 0.0, 0.8)[None] * strip().shares


def fill(queues, until, vehicles_a_second=0.2):
    for time in range(0, until + 1, 5):
        found = queues.add(time, queue(vehicles_a_second * time), RED)
    return found


def test_a_queue_that_fills_the_view_goes_on_as_fast_as_it_has_grown():
    assert not fill(UnseenQueues([strip()]), 30).any()
    found = fill(UnseenQueues([strip()]), 70)
    assert not found[0, :SHOWN].any()
    assert found[0, SHOWN] == pytest.approx(0.8)
    # Eight are in view from 40 s on; in half a minute six more have come, at as many a second as before.
    assert found.sum() == pytest.approx(6.0, abs=1.5)


def test_it_ends_with_the_lane_and_with_what_counts():
    assert fill(UnseenQueues([strip(length=75.0)]), 200).sum() == pytest.approx(2.0)
    assert fill(UnseenQueues([strip()]), 600).sum() == pytest.approx((150.0 - 60.0) / 7.5)


def test_it_stays_until_its_end_has_moved_up_and_then_comes_into_view():
    queues = UnseenQueues([strip()])
    before = fill(queues, 70).sum()
    assert queues.add(75, queue(8.0), GREEN).sum() >= before
    told = [queues.add(75 + 5 * k, queue(0.0), GREEN).sum() for k in range(1, 6)]
    assert told[0] == pytest.approx(before - 2.5, abs=1.5)
    assert told[-1] == 0.0


def test_where_no_camera_looks_nothing_is_known():
    hidden = UnseenQueues([strip(shown=0)])
    for time in range(0, 300, 5):
        assert not hidden.add(time, np.zeros((1, CELLS)), RED).any()
    whole = UnseenQueues([replace(strip(), shares=np.ones(CELLS))])
    for time in range(0, 300, 5):
        found = whole.add(time, np.full((1, CELLS), 0.8), RED)
    assert found[0, -1] == pytest.approx((150.0 - 96.0) / 7.5)
    assert not found[0, :-1].any()
