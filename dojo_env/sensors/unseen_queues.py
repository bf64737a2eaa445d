"""Queues that reach beyond what cameras show: they go on behind it, and grow as fast as they have grown."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from dojo_env.sensors.strip_geometry import CELL, CELLS, Strip, measure_length
from dojo_env.signals.plan import REACH, ROOM_OF_A_VEHICLE

Floats = NDArray[np.float64]
Flags = NDArray[np.bool_]

_EDGE, _FULL = 3, 1.5
"""The last cells in view, and how many vehicles stand on them where a queue goes on."""
_MOST_COMING, _DISCHARGE = 0.25, 0.5
"""Vehicles a second: that come at the most, and that move up into view at green."""
_LEAST_RED = 20.0
"""Seconds of red over which a queue's growth is taken at least."""
_OF_A_CELL = CELL / ROOM_OF_A_VEHICLE
"""Vehicles that stand on a cell in a queue."""


class UnseenQueues:
    """Follows how many vehicles stand behind what is in view of some lanes."""

    def __init__(self, strips: Sequence[Strip]) -> None:
        """Begin with empty lanes.

        Args:
            strips: of the lanes.
        """
        number = np.arange(CELLS)
        in_view = np.stack([strip.shares for strip in strips]) > 0
        ends = np.where(in_view, number + 1, 0).max(axis=1)
        lengths = np.array([measure_length(strip.line) for strip in strips])
        self._edge = in_view & (number >= ends[:, None] - _EDGE)
        behind = number - ends[:, None]
        self._behind = np.where(behind < 0, np.inf, behind * _OF_A_CELL)
        self._behind[ends == CELLS, -1] = 0.0
        self._most = np.maximum(np.minimum(lengths, REACH) - ends * CELL, 0.0) / ROOM_OF_A_VEHICLE
        self._most[ends == 0] = 0.0
        self._unseen, self._red_since = np.zeros(len(strips)), np.full(len(strips), np.nan)
        self._time = np.nan

    def add(self, time: float, standing: Floats, green: Flags) -> Floats:
        """Take a look.

        Args:
            time: seconds, later than the last look's.
            standing: (lanes, cells) how many vehicles stand on each cell; 0 where it is not seen.
            green: (lanes,) whether any of a lane's links is green.

        Returns:
            (lanes, cells) how many stand on each cell that is not seen; on the last one also those beyond.
        """
        passed = 0.0 if np.isnan(self._time) else time - self._time
        self._time = time
        self._red_since = np.where(green, np.nan, np.fmin(self._red_since, time))
        red = np.maximum(np.nan_to_num(time - self._red_since), _LEAST_RED)
        coming = np.minimum((standing.sum(axis=1) + self._unseen) / red, _MOST_COMING)
        goes_on = (standing * self._edge).sum(axis=1) >= _FULL
        rate = np.where(goes_on, coming, -_DISCHARGE)
        self._unseen = np.clip(self._unseen + rate * passed, 0.0, self._most)
        left = np.maximum(self._unseen[:, None] - self._behind, 0.0)
        left[:, :-1] = np.minimum(left[:, :-1], _OF_A_CELL)
        return left
