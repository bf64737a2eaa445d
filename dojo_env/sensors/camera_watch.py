"""Whether a camera can be believed: a blocked or dead one is dark, or one shade; a hung one never changes."""

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

_LEAST_CONTRAST = 2.0
"""Standard deviation of a picture's levels, of 255, below which nothing can be seen in it."""
_STILL, _STILL_AT_GREEN = 300.0, 20.0
"""Seconds without any change that no street has: at all, and while those whom it shows have green."""
_SAMPLED = 4
"""Of so many rows and columns one is looked at."""


@dataclass(slots=True)
class CameraWatch:
    """Judges the pictures of one camera, in the order of time.

    Attributes:
        fault: what is wrong with it, for people; "" where nothing is.
        since: simulated seconds from which on that has been so.
    """

    fault: str = ""
    since: float = -np.inf
    _last: NDArray[np.uint8] | None = None
    _changed: float = -np.inf
    _expected: float = field(default=np.inf)

    def note(self, time: float, picture: NDArray[np.uint8], *, must_move: bool) -> bool:
        """Take a picture.

        Args:
            time: simulated seconds.
            picture: (h, w, 3).
            must_move: somebody whom the last picture shows has green.

        Returns:
            Whether the camera has begun to fail with it, or to work again.
        """
        if self._last is None or not np.array_equal(self._last, picture):
            self._changed = time
        self._last = picture
        self._expected = min(self._expected, time) if must_move else np.inf
        before, self.fault = self.fault, self._judge(time, picture)
        if bool(before) == bool(self.fault):
            return False
        self.since = time
        return True

    def _judge(self, time: float, picture: NDArray[np.uint8]) -> str:
        if float(picture[::_SAMPLED, ::_SAMPLED].std()) < _LEAST_CONTRAST:
            return "shows nothing"
        still = time - self._changed
        if (
            still >= _STILL
            or (self.fault and still > 0)
            or time - max(self._changed, self._expected) >= (_STILL_AT_GREEN)
        ):
            return "has frozen"
        return ""
