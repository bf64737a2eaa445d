"""What seems to stand on lanes and never leaves: posts, shadows, parked cars, edges of pictures.

A vehicle leaves at green, or at one of the next greens. What stays in its place for several of them is none.
"""

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.floating]

_GREENS = 4
"""After so many of a lane's greens what has stood all along is left out, until it changes."""


class StaticObjects:
    """Knows how sure the network has been, at the least, that somebody stands in each cell of some lanes."""

    def __init__(self, lanes: int, cells: int) -> None:
        """Begin with nothing known.

        Args:
            lanes: how many there are.
            cells: of each.
        """
        self._static, self._least = np.zeros((lanes, cells)), np.ones((lanes, cells))
        self._green, self._greens = np.zeros(lanes, bool), np.zeros(lanes, int)

    def leave_out(self, standing: Floats, green: NDArray[np.bool_]) -> Floats:
        """Take a look at the lanes.

        Args:
            standing: (lanes, cells) the chance that somebody stands in each.
            green: (lanes,) whether any of a lane's links is green.

        Returns:
            (lanes, cells) the chance that it is a vehicle.
        """
        self._least = np.minimum(self._least, standing)
        self._greens += self._green & ~green
        self._green = green.copy()
        known = self._greens >= _GREENS
        self._static[known] = self._least[known]
        self._least[known], self._greens[known] = 1.0, 0
        self._static = np.minimum(self._static, standing)
        return standing - self._static
