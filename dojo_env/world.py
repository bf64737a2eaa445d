"""What an environment asks of the world that it is a face of, wherever that runs.

`LocalWorld` runs in the environment's own process, `WorldProcess` hands every call to one in another.
"""

from collections.abc import Callable, Mapping
from typing import Any, Protocol

from gymnasium import spaces

from dojo_env.controllers import Controller
from dojo_env.instant import Instant
from dojo_env.snapshot import Snapshot
from dojo_env.watching.views import Frame

Beginning = tuple[dict[str, Any], dict[str, Any]]
"""Observations by signal, and figures by name."""
Answer = tuple[dict[str, Any], dict[str, float], bool, dict[str, Any]]
"""Observations and rewards by signal, whether the episode has ended, and figures by name."""
Episode = tuple[list[dict[str, Any]], dict[str, Any]]
"""What was told at each decision, and the figures of the whole."""


class World(Protocol):
    """The traffic and the signals of one environment, a decision at a time.

    Attributes:
        signals: ids of those that agents control.
    """

    signals: tuple[str, ...]

    @property
    def instant(self) -> Instant:
        """The present decision.

        Raises:
            EpisodeOverError: no episode is running.
        """
        ...

    def spaces(self) -> dict[str, tuple[spaces.Space[Any], spaces.Discrete]]:
        """Give each signal's observation and action space.

        Returns:
            Both, by signal.
        """
        ...

    def reset(self, seed: int) -> Beginning:
        """Begin an episode.

        Args:
            seed: of all that is random in it.

        Returns:
            Observations by signal, and figures by name.

        Raises:
            SimulationError: SUMO refuses the input.
        """
        ...

    def step(self, actions: Mapping[str, int]) -> Answer:
        """Act and simulate until the next decision.

        Args:
            actions: by signal; who is not named goes on as before.

        Returns:
            Observations and rewards by signal, whether the episode has ended, and figures by name.

        Raises:
            EpisodeOverError: no episode is running.
            ConfigError: an action is none of its signal's; nothing has happened then.
            SimulationError: SUMO stopped; `reset` begins anew.
        """
        ...

    def run(self, controller: Controller, seed: int) -> Episode:
        """Run a whole episode.

        Args:
            controller: chooses the actions; by what a `VideoDetector` measures, where that is observed.
            seed: of all that is random in it.

        Returns:
            What `step` told at each decision, and the figures of the whole.

        Raises:
            SimulationError: SUMO refuses the input, or stopped.
        """
        ...

    def watch(self, on_second: Callable[[Snapshot], None]) -> None:
        """Show every simulated second to a function, which may take its time, from the next reset on.

        Args:
            on_second: takes each second, as a snapshot.
        """
        ...

    def draw(self, signal: str | None = None) -> Frame:
        """Draw what there is to see of the present decision, or of one signal, with the figures of all.

        Args:
            signal: the only one to look at; None for all.

        Returns:
            The views, and the figures.

        Raises:
            EpisodeOverError: no episode is running.
        """
        ...

    def metrics(self) -> dict[str, Any]:
        """Compute the figures of the episode so far; see `metrics`.

        Returns:
            Figures by name.
        """
        ...

    def save(self) -> dict[str, Any]:
        """Save the full state: the seed and every action, from which `restore` simulates it anew, exactly.

        SUMO's own saved states lose the last digits of positions, so that a branch would drift.

        Returns:
            The seed, and the actions of each step.

        Raises:
            EpisodeOverError: no episode is running.
        """
        ...

    def restore(self, state: Mapping[str, Any]) -> Beginning:
        """Go to a saved state.

        Args:
            state: what `save` gave.

        Returns:
            Observations and figures.

        Raises:
            ConfigError: the state was not made by `save`, or by another scenario's.
        """
        ...

    def close(self) -> None:
        """End everything, and write what is left of the episode; safe at any time."""
        ...
