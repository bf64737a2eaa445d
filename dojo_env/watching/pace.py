"""How fast a watched episode runs: pause, step, and simulated seconds per second."""

import threading
import time

SPEEDS = (1, 2, 5, 10, 20, 0)
"""Simulated seconds per second that a page offers; 0 is as fast as it goes."""


class Pace:
    """Holds the simulation back; one thread simulates, others say how fast."""

    def __init__(self, speed: float = 10) -> None:
        """Begin to run at once, at a speed in simulated seconds per second; 0 is as fast as it goes."""
        self._changed = threading.Condition()
        self._paused, self._speed, self._steps = False, speed, 0
        self._due = 0.0
        self._nudged = False

    @property
    def paused(self) -> bool:
        """Whether it waits to be told."""
        return self._paused

    @property
    def speed(self) -> float:
        """Simulated seconds per second, 0 for as fast as it goes."""
        return self._speed

    def pause(self) -> None:
        """Stop before the next second."""
        self._set(paused=True)

    def play(self) -> None:
        """Go on."""
        self._set(paused=False)

    def step(self) -> None:
        """Simulate one second and stop."""
        with self._changed:
            self._paused = True
            self._steps += 1
            self._changed.notify_all()

    def set_speed(self, speed: float) -> None:
        """Change the speed; a paused episode stays paused.

        Args:
            speed: simulated seconds per second; 0 is as fast as it goes.
        """
        self._set(speed=speed)

    def nudge(self) -> None:
        """Let `wait` return once, because there is something to draw anew."""
        with self._changed:
            self._nudged = True
            self._changed.notify_all()

    def wait(self) -> bool:
        """Wait for the next second's turn; False where it has not come, and the present one is drawn anew."""
        with self._changed:
            while not self._nudged:
                now = time.monotonic()
                if self._steps:
                    self._steps -= 1
                    return True
                if not self._paused and (not self._speed or now >= self._due):
                    if self._speed:
                        # Who is late by less than a second's turn catches up; who is later does not.
                        self._due = max(self._due, now - 1 / self._speed) + 1 / self._speed
                    return True
                self._changed.wait(None if self._paused else self._due - now)
            self._nudged = False
            return False

    def _set(self, *, paused: bool | None = None, speed: float | None = None) -> None:
        with self._changed:
            self._paused = self._paused if paused is None else paused
            self._speed = self._speed if speed is None else speed
            self._due = time.monotonic()
            self._changed.notify_all()
