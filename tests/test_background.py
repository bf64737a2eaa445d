"""The background of lanes: what is there most of the time, and from the first look on."""

import numpy as np

from dojo_env.sensors.background import Background

STREET = np.random.default_rng(0).integers(0, 200, (2, 64, 12, 3), np.uint8)
WORKS = np.zeros(2, bool)


def with_vehicle(row, shade):
    strips = STREET.copy()
    strips[:, row : row + 4] = shade
    return strips


def test_who_passes_is_not_in_it():
    draw = np.random.default_rng(1)
    background = Background()
    for second in range(0, 400, 5):
        usual = background.add(second, with_vehicle(int(draw.integers(0, 60)), second % 200), WORKS)
    np.testing.assert_array_equal(usual, STREET)


def test_it_begins_with_the_first_look_and_follows_the_light():
    background = Background()
    np.testing.assert_array_equal(background.add(0.0, STREET, WORKS), STREET)
    # A look that comes too soon after another one changes nothing.
    np.testing.assert_array_equal(background.add(1.0, STREET + 50, WORKS), STREET)
    for second in range(20, 200, 20):
        usual = background.add(second, STREET + 50, WORKS)
    np.testing.assert_array_equal(usual, STREET + 50)


def test_who_stands_for_minutes_is_not_in_it():
    background = Background()
    for second in range(0, 1200, 5):
        usual = background.add(second, with_vehicle(8, 250) if second >= 900 else STREET, WORKS)
    np.testing.assert_array_equal(usual, STREET)


def test_that_of_a_camera_that_fails_stays():
    background, first = Background(), np.array([True, False])
    for second in range(0, 3000, 5):
        fails = second >= 300
        usual = background.add(second, STREET * (not fails), first & fails)
    np.testing.assert_array_equal(usual[0], STREET[0])
    assert not usual[1].any()
