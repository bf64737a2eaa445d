"""What a controller is: it is told of an episode, and chooses a phase for each signal at each decision."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from gymnasium import spaces

from dojo_env.instant import Instant


class Controller:
    """Leaves every signal to a program; the others override `choose`.

    Attributes:
        name: what people call it.
        settings: keywords that the environment needs for it.
        preferred: keywords with which it does best; those that a user gives go before them.
        weights: the files of what it has learned; a rule has none.
    """

    name = ""
    weights: tuple[Path, ...] = ()

    def __init__(self, settings: Mapping[str, Any] | None = None) -> None:
        """Note the settings.

        Args:
            settings: keywords that the environment needs for it; see `Settings`.
        """
        self.settings = dict(settings or {})
        self.preferred: dict[str, Any] = {}

    def __str__(self) -> str:
        """Tell its name."""
        return self.name or type(self).__name__

    def complete(self, keywords: Mapping[str, Any]) -> dict[str, Any]:
        """Add to what a user gives what this controller needs and prefers.

        Args:
            keywords: of an environment.

        Returns:
            All keywords of its environment.
        """
        return {**self.preferred, **keywords, **self.settings}

    def reset(self, seed: int) -> None:
        """Begin an episode.

        Args:
            seed: of the episode.
        """

    def meet(self, known: Mapping[str, tuple[spaces.Space[Any], spaces.Discrete]]) -> None:
        """Take each signal's observation and action space, before an episode's first decision.

        Args:
            known: by the signal's id.
        """

    def see(self, observations: Mapping[str, Any]) -> None:
        """Take what each signal observes, before `act` at every decision.

        Args:
            observations: by the signal's id.
        """

    def choose(self, signal: str, instant: Instant) -> int:
        """Choose a phase; without a change, the present one.

        Args:
            signal: its id.
            instant: the decision.

        Returns:
            The phase's number; the signal changes to it under the constraints that hold for all.
        """
        return instant.signals[signal].phase

    def act(self, instant: Instant) -> dict[str, int]:
        """Choose for every signal.

        Args:
            instant: the decision.

        Returns:
            A phase's number for each signal.
        """
        return {signal: self.choose(signal, instant) for signal in instant.signals}
