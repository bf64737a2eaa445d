"""What an agent sees. An observer turns an instant into one value per signal; new kinds register here."""

from collections.abc import Callable, Mapping
from typing import Any, Protocol, runtime_checkable

import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from dojo_env.errors import ConfigError, refuse_other_arguments
from dojo_env.instant import Instant, SignalView
from dojo_env.lane_features import read_features
from dojo_env.network_observations import Movements, Neighbours
from dojo_env.phase_features import CONSTRAINTS, PHASE_FEATURES, PhaseReader
from dojo_env.sensors.base import SensorSettings
from dojo_env.sensors.eyes import Eyes
from dojo_env.signals.plan import SignalPlan


@runtime_checkable
class Observer(Protocol):
    """Sees for every signal. `reset` tells the seed of an episode, for those that draw noise."""

    def space(self, signal: str) -> spaces.Space[Any]:
        """Give the space of a signal's observations.

        Args:
            signal: its id.

        Returns:
            The space.
        """
        ...

    def reset(self, seed: int) -> None:
        """Begin an episode.

        Args:
            seed: of the episode.
        """
        ...

    def observe(self, signal: str, instant: Instant) -> Any:
        """Observe for a signal.

        Args:
            signal: its id.
            instant: the decision.

        Returns:
            What its space holds.
        """
        ...


@runtime_checkable
class Perceiver(Protocol):
    """An observer that measures what controllers act on, in place of the truth."""

    def perceive(self, instant: Instant) -> Instant:
        """Give a decision as it has been observed; the instant itself where no sensor measures lanes.

        Args:
            instant: the decision, as it is.

        Returns:
            The decision, as it was measured.
        """
        ...


ObserverFactory = Callable[[Eyes, Mapping[str, SignalPlan]], Observer]


class Features:
    """Phase one-hot, minimum-green flag, lane densities, lane queues, in SUMO-RL's order; all 0 to 1."""

    def __init__(self, _eyes: Eyes, plans: Mapping[str, SignalPlan]) -> None:
        """Measure the signals."""
        self._plans = plans

    def space(self, signal: str) -> spaces.Box:
        """A value per phase, the flag, two per lane."""
        plan = self._plans[signal]
        size = len(plan.phases) + 1 + 2 * len(plan.lanes)
        return spaces.Box(0.0, 1.0, shape=(size,), dtype=np.float32)

    def reset(self, seed: int) -> None:
        """Nothing is kept between decisions."""

    def observe(self, signal: str, instant: Instant) -> NDArray[np.float32]:
        """Measure the lanes as they are."""
        return read_features(instant.signals[signal])


class Phases:
    """A vector per phase, for policies of any junction; as many rows as the signal of the most phases has.

    `phases` (n, features) of `phase_features.PhaseReader`, `mask` (n,) of 1 for each phase that there is, and
    `constraints`.
    """

    def __init__(self, _eyes: Eyes, plans: Mapping[str, SignalPlan]) -> None:
        """Measure the signals."""
        self._readers = {signal: PhaseReader(plan) for signal, plan in plans.items()}
        self._counts = {signal: len(plan.phases) for signal, plan in plans.items()}
        self._rows = max(self._counts.values(), default=0)

    def space(self, signal: str) -> spaces.Dict:
        """The same for every signal."""
        return spaces.Dict(
            phases=spaces.Box(0.0, np.inf, (self._rows, len(PHASE_FEATURES)), np.float32),
            mask=spaces.MultiBinary(self._rows),
            constraints=spaces.Box(0.0, np.inf, (len(CONSTRAINTS),), np.float32),
        )

    def reset(self, seed: int) -> None:
        """Forget when phases were green."""
        for reader in self._readers.values():
            reader.reset()

    def observe(self, signal: str, instant: Instant) -> dict[str, NDArray[Any]]:
        """Read the phases."""
        reader, count = self._readers[signal], self._counts[signal]
        phases = np.zeros((self._rows, len(PHASE_FEATURES)), np.float32)
        phases[:count] = reader.read(signal, instant)
        mask = (np.arange(self._rows) < count).astype(np.int8)
        return {"phases": phases, "mask": mask, "constraints": reader.constraints(instant.signals[signal])}


class Blind(Features):
    """Features of which nothing is left but the phase, and in the flag's place how long it has been green."""

    def observe(self, signal: str, instant: Instant) -> NDArray[np.float32]:
        """Tell the phase and the share of a minute; no lane."""
        view = instant.signals[signal]
        seen = np.zeros(self.space(signal).shape, np.float32)
        seen[view.phase] = 1.0
        seen[len(view.plan.phases)] = _share_of_a_minute(view)
        return seen


class BlindPicture:
    """A black picture; above, a white block tells the phase, below, a bar how long it has been green.

    What a policy of pictures learns from it, it would without any camera.
    """

    def __init__(self, eyes: Eyes, plans: Mapping[str, SignalPlan]) -> None:
        """Take the size of the pictures."""
        self._shape = (eyes.config.height, eyes.config.width, 3)
        self._plans = plans

    def space(self, signal: str) -> spaces.Box:
        """An image."""
        return spaces.Box(0, 255, self._shape, np.uint8)

    def reset(self, seed: int) -> None:
        """Nothing is kept between decisions."""

    def observe(self, signal: str, instant: Instant) -> NDArray[np.uint8]:
        """Draw the phase and the share of a minute."""
        view = instant.signals[signal]
        height, width, _ = self._shape
        picture = np.zeros(self._shape, np.uint8)
        first, last = (width * place // len(view.plan.phases) for place in (view.phase, view.phase + 1))
        picture[: height // 2, first:last] = 255
        picture[height // 2 :, : round(width * _share_of_a_minute(view))] = 255
        return picture


def _share_of_a_minute(view: SignalView) -> float:
    return min(view.green_time / 60.0, 1.0)


OBSERVERS: dict[str, ObserverFactory] = {
    "features": Features,
    "phases": Phases,
    "movements": Movements,
    "neighbours": Neighbours,
    "blind": Blind,
    "blind_picture": BlindPicture,
}
"""Observers by name, beside those of `sensor_observations`."""
_SEEING = ("bev", "multi_view", "detector", "lane-strips")


def build_observer(wanted: Any, eyes: Eyes, plans: Mapping[str, SignalPlan], *, interval: float) -> Observer:
    """Find an observer by name, mount sensors, call a factory, or take an observer as it is.

    Args:
        wanted: as `observation=` of an environment.
        eyes: what sensors draw with.
        plans: of the signals to observe.
        interval: seconds from decision to decision.

    Returns:
        The observer.

    Raises:
        ConfigError: there is none of that name.
    """
    if isinstance(wanted, str) and wanted in OBSERVERS:
        return OBSERVERS[wanted](eyes, plans)
    if isinstance(wanted, Mapping) or _is_settings(wanted) or _names_sensor(wanted):
        # Who only measures does without the compiler that drawing loads.
        from dojo_env.sensor_observations import build_sensor_observer  # noqa: PLC0415

        return build_sensor_observer(wanted, eyes, plans, interval=interval)
    if isinstance(wanted, Observer) and not isinstance(wanted, type):
        return wanted
    if callable(wanted):
        refuse_other_arguments("observation", wanted, ("eyes", "plans"))
        built: Observer = wanted(eyes, plans)
        return built
    known = ", ".join((*OBSERVERS, *_SEEING))
    raise ConfigError(
        f"observation={wanted!r}: expected one of {known}, a dict of sensors, the settings of one, "
        "or an observer"
    )


def _names_sensor(wanted: Any) -> bool:
    """Tell whether it is one of the names of sensors, which a file may follow."""
    return isinstance(wanted, str) and wanted.partition(":")[0] in _SEEING


def _is_settings(wanted: Any) -> bool:
    return isinstance(wanted, SensorSettings) and not isinstance(wanted, type)
