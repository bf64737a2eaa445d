"""Any phase at any time, from a seed: the least that a controller has to beat."""

import numpy as np

from dojo_env.controllers.base import Controller
from dojo_env.instant import Instant


class RandomChoice(Controller):
    """A phase drawn at every decision."""

    def __init__(self) -> None:
        """Wait for a seed."""
        super().__init__()
        self._generator = np.random.default_rng(0)

    def reset(self, seed: int) -> None:
        """Begin the same draws for the same seed."""
        self._generator = np.random.default_rng(seed)

    def choose(self, signal: str, instant: Instant) -> int:
        """Draw."""
        return int(self._generator.integers(len(instant.signals[signal].plan.phases)))
