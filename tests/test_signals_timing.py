"""One formula for yellow, one for the way across: import, checks, repairs and the environment share them."""

import pytest

from dojo_maps.signals.timing import clearing_time, walking_time, whole, yellow_needed, yellow_time


def test_yellow_time_follows_the_speed() -> None:
    assert [yellow_time(kmh / 3.6) for kmh in (20, 50, 60, 80, 200)] == [3, 4, 4, 5, 6]


def test_yellow_needed_is_not_rounded_and_bounded_from_below() -> None:
    assert yellow_needed(50 / 3.6) == pytest.approx(3.277, abs=1e-3)
    assert yellow_needed(1.0, shortest=2.0) == 2.0


def test_times_across_are_whole_seconds_for_walkers() -> None:
    assert walking_time(12.0) == 10
    assert walking_time(12.1) == 11
    assert whole(3.0000000001) == 3
    assert clearing_time(14.0, 10.0) == 2
