"""How long a signal's changes take: yellow and all-red for vehicles, the way across for walkers; seconds."""

import math

REACTION, DECELERATION = 1.0, 3.05
"""Seconds, m/s². Source: ITE, Guidelines for Determining Traffic Signal Change and Clearance Intervals."""
SHORTEST_YELLOW, LONGEST_YELLOW = 3.0, 6.0
"""Source: MUTCD 11th edition, section 4F.17."""
WALKING_SPEED = 1.2
"""Metres per second, about the 4 ft/s that signal timing manuals use for pedestrians in general."""
_VEHICLE = 6.0
"""Metres of a vehicle, in the time to clear a junction."""


def whole(seconds: float) -> float:
    """Round up to whole seconds, SUMO's usual step.

    Args:
        seconds: what is at most a millionth above a whole number is taken for it.

    Returns:
        Seconds.
    """
    return float(math.ceil(round(seconds, 6)))


def yellow_needed(speed: float, shortest: float = SHORTEST_YELLOW) -> float:
    """Compute the yellow that a speed needs.

    Args:
        speed: m/s.
        shortest: seconds that it has at least.

    Returns:
        Seconds, from `shortest` to 6.
    """
    return min(max(REACTION + speed / (2 * DECELERATION), shortest), LONGEST_YELLOW)


def yellow_time(speed: float) -> float:
    """Give the whole seconds of yellow for a speed.

    Args:
        speed: m/s.

    Returns:
        Seconds, from 3 to 6.
    """
    return whole(yellow_needed(speed))


def clearing_time(length: float, speed: float) -> float:
    """Compute how long a vehicle takes to leave a way. Source: ITE.

    Args:
        length: metres of the way; a vehicle's own 6 m are added.
        speed: m/s, above 0.

    Returns:
        Seconds.
    """
    return (length + _VEHICLE) / speed


def walking_time(length: float, speed: float = WALKING_SPEED) -> float:
    """Give the whole seconds that a walker needs for a way.

    Args:
        length: metres.
        speed: m/s, above 0.

    Returns:
        Seconds, rounded up.
    """
    return whole(length / speed)
