"""The background of lanes: what is there most of the time, and from the first look on."""

import numpy as np

from dojo_env.sensors.background import Background


def look(street, rows, shade):
    strips = street.copy()
    strips[:, rows] = shade
    return strips


def test_who_passes_is_not_in_it():
    draw = np.random.default_rng(0)
    street = draw.integers(0, 256, (3, 64, 12, 3), np.uint8)
    background = Background()
    for second in range(0, 400, 5):
        row = int(draw.integers(0, 60))
        usual = background.add(second, look(street, slice(row, row + 4), second % 200))
    np.testing.assert_array_equal(usual, street)


def test_it_begins_with_the_first_look_and_follows_the_light():
    street = np.full((1, 64, 12, 3), 90, np.uint8)
    background = Background()
    np.testing.assert_array_equal(background.add(0.0, street), street)
    # A look that comes too soon after another one changes nothing.
    np.testing.assert_array_equal(background.add(1.0, street + 50), street)
    for second in range(20, 200, 20):
        usual = background.add(second, street + 50)
    np.testing.assert_array_equal(usual, street + 50)


def test_who_stands_for_minutes_is_not_in_it():
    street = np.full((1, 64, 12, 3), 90, np.uint8)
    background = Background()
    for second in range(0, 1200, 5):
        stands = 900 <= second < 1200
        usual = background.add(second, look(street, slice(8, 12), 200) if stands else street)
    np.testing.assert_array_equal(usual, street)
