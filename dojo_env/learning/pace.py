"""How far a run of minutes or hours is, and when it will end."""

import time
from collections import deque
from collections.abc import Callable

_TOLD_EVERY = 10.0
"""Seconds between two lines of progress."""


class Pace:
    """How fast a run is, and when it will end; a line now and then."""

    def __init__(self, total: int, tell: Callable[[str], None], unit: str = "steps") -> None:
        """Take the run's steps, what takes the lines, and what a step is called."""
        self._total, self._tell, self._unit = total, tell, unit
        self._seen: deque[tuple[float, int]] = deque(maxlen=10)
        self._last = time.monotonic()

    def note(self, steps: int) -> None:
        """Note how far the run is; says so if nothing was said for a while.

        Args:
            steps: done so far, of the run's whole.
        """
        if not self._seen or steps - self._seen[-1][1] >= self._total / 1000:
            self._seen.append((time.monotonic(), steps))
        if time.monotonic() - self._last > _TOLD_EVERY:
            self.say(steps)

    def say(self, steps: int, words: str = "") -> None:
        """Say how far the run is.

        Args:
            steps: done so far, of the run's whole.
            words: what to tell right behind that, such as figures.
        """
        self._last = time.monotonic()
        (begun, before), (now, after) = (self._seen[0], self._seen[-1]) if self._seen else ((0, 0), (0, 0))
        pace = (after - before) / (now - begun) if now > begun else 0.0
        left = (
            f", {pace:.3g} {self._unit}/s, {max(self._total - steps, 0) / pace / 60:.0f} min left"
            if pace
            else ""
        )
        self._tell(f"{steps:>9,} of {self._total:,} {self._unit}{words}{left}")
