"""What lanes look like without traffic: at each place the median of looks over some minutes.

What differs from it is a vehicle; a shadow, a post or a parked car does not. Under a queue that stands for
most of the time it shows vehicles, too, so it is told to a network beside the look itself.
"""

from collections import deque

import numpy as np
from numpy.typing import NDArray

Strips = NDArray[np.uint8]

_LOOKS, _APART = 15, 15.0
"""The last so many looks, at least so many seconds apart."""


class Background:
    """Follows the strips of some lanes."""

    def __init__(self) -> None:
        """Begin with nothing seen."""
        self._looks = deque[Strips](maxlen=_LOOKS)
        self._next = -np.inf
        self._median: Strips = np.empty(0, np.uint8)

    def add(self, time: float, strips: Strips) -> Strips:
        """Take a look.

        Args:
            time: simulated seconds, later than the last look's.
            strips: of any shape, always the same.

        Returns:
            The background of that shape, with this look in it if it is time for one.
        """
        if time >= self._next:
            self._next = time + _APART
            self._looks.append(strips)
            middle = len(self._looks) // 2
            self._median = np.partition(np.stack(self._looks), middle, axis=0)[middle]
        return self._median
