"""What lanes look like without traffic: at each place the median of looks over some minutes.

What differs from it is a vehicle; a shadow, a post or a parked car does not. Under a queue that stands for
most of the time it shows vehicles, too, so it is told to a network beside the look itself.
"""

from collections import deque

import numpy as np
from numpy.typing import NDArray

Strips = NDArray[np.uint8]

_LOOKS = 15
"""The last so many looks."""
_APART, _MOST_APART, _OF_THE_TIME = 15.0, 60.0, 0.1
"""Seconds between them, at least and at the most, and the share of the time that has been watched. Who stands
for minutes, as behind an incident, is not in the background of a quarter of an hour."""


class Background:
    """Follows the strips of some lanes."""

    def __init__(self) -> None:
        """Begin with nothing seen."""
        self._looks = deque[Strips](maxlen=_LOOKS)
        self._begin, self._next = 0.0, -np.inf
        self._median: Strips = np.empty(0, np.uint8)

    def add(self, time: float, strips: Strips, fails: NDArray[np.bool_]) -> Strips:
        """Take a look.

        Args:
            time: simulated seconds, later than the last look's.
            strips: (n, rows, columns, 3).
            fails: (n,) whose camera fails, so that their background stays.

        Returns:
            (n, rows, columns, 3) the background, with this look in it if it is time for one.
        """
        if time >= self._next:
            if not self._looks:
                self._begin, self._median = time, strips
            self._next = time + min(max(_OF_THE_TIME * (time - self._begin), _APART), _MOST_APART)
            self._looks.append(np.where(fails[:, None, None, None], self._median, strips))
            middle = len(self._looks) // 2
            self._median = np.partition(np.stack(self._looks), middle, axis=0)[middle]
        return self._median
