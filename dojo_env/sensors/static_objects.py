"""What seems to stand on lanes and never leaves: posts, shadows, parked cars, edges of pictures.

Where a green lets all go and they have room, nobody stands after a while: what does is no vehicle. Where
greens are short, or some must yield, what stays in its place for several greens is none.
"""

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.floating]
Lanes = NDArray[np.bool_]

_FLOWS, _WAVE = 15.0, 1.5
"""Seconds of green until who stood first is on his way, and for each cell behind until its queue moves."""
_FREE = 9
"""The median of so many looks at a lane that flows tells what stands there always."""
_GREENS = 4
"""After so many of a lane's greens what has stood all along is left out, until it changes."""
_MOST = 2.5
"""Vehicles of a lane beyond which it is a queue that cannot go, whatever the reason."""
_LOOKS = 3
"""So many looks at which it does not stand tell that it has changed; at each green a queue has one."""


class StaticObjects:
    """Knows how sure the network is of vehicles in each cell of some lanes when there are none."""

    def __init__(self, lanes: int, cells: int) -> None:
        """Begin with nothing known.

        Args:
            lanes: how many there are.
            cells: of each.
        """
        self._static, self._least = np.zeros((lanes, cells)), np.ones((_LOOKS, lanes, cells))
        self._green, self._greens = np.zeros(lanes, bool), np.zeros((lanes, cells), int)
        self._since, self._free = np.full(lanes, np.inf), np.zeros((_FREE, lanes, cells))

    def leave_out(self, time: float, standing: Floats, green: Lanes, must_go: Lanes) -> Floats:
        """Take a look at the lanes.

        Args:
            time: of the look, seconds.
            standing: (lanes, cells) the chance that somebody stands in each.
            green: (lanes,) whether any of a lane's links is green.
            must_go: (lanes,) whether nothing keeps anybody on it: no red, no yielding, no queue behind.

        Returns:
            (lanes, cells) the chance that it is a vehicle.
        """
        self._least = np.sort(np.concatenate([self._least, standing[None]]), axis=0)[:_LOOKS]
        self._greens += (self._green & ~green)[:, None]
        self._green = green.copy()
        waited = self._greens >= _GREENS
        self._since = np.where(must_go, np.minimum(self._since, time), np.inf)
        flows = (time - self._since)[:, None] >= _FLOWS + _WAVE * np.arange(standing.shape[1])
        flows[standing.sum(axis=1) > _MOST] = False
        self._free = np.where(flows, np.concatenate([self._free[1:], standing[None]]), self._free)
        self._static = np.where(waited, self._least[-1], self._static)
        self._static = np.where(flows, np.median(self._free, axis=0), self._static)
        known = waited | flows
        self._least[:, known], self._greens[known] = 1.0, 0
        self._static = np.minimum(self._static, self._least[-1])
        self._static[self._static.sum(axis=1) > _MOST] = 0.0
        return np.maximum(standing - self._static, 0.0)
