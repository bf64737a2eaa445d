"""What an agent sees: SUMO-RL's classes of observation, made with a signal and called at each decision."""

from abc import ABC, abstractmethod
from typing import Any

import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

Signal = Any
"""A `TrafficSignal`, which itself needs these classes."""


class ObservationFunction(ABC):
    """Observes for one signal; subclasses are given as `observation_class`.

    Attributes:
        ts: the signal.
    """

    def __init__(self, ts: Signal) -> None:
        """Take the signal."""
        self.ts = ts

    @abstractmethod
    def __call__(self) -> Any:
        """Observe the signal as it is."""

    @abstractmethod
    def observation_space(self) -> spaces.Space[Any]:
        """Tell the space of the observations."""


class DefaultObservationFunction(ObservationFunction):
    """Phase one-hot, minimum-green flag, lane densities, lane queues."""

    def __call__(self) -> NDArray[np.float32]:
        """Observe the signal as it is."""
        ts = self.ts
        phases = [float(phase == ts.green_phase) for phase in range(ts.num_green_phases)]
        values = [*phases, float(ts.may_change), *ts.get_lanes_density(), *ts.get_lanes_queue()]
        return np.array(values, dtype=np.float32)

    def observation_space(self) -> spaces.Box:
        """Tell the space: all values are shares."""
        size = self.ts.num_green_phases + 1 + 2 * len(self.ts.lanes)
        return spaces.Box(low=0.0, high=1.0, shape=(size,), dtype=np.float32)
