"""What a controller is: it is told of an episode, and chooses a phase for each signal at each decision."""

from collections.abc import Mapping
from typing import Any

from dojo_env.instant import Instant


class Controller:
    """Leaves every signal to a program; the others override `choose`.

    `settings` are keywords that the environment needs for it.
    """

    def __init__(self, settings: Mapping[str, Any] | None = None) -> None:
        """Note the settings."""
        self.settings = dict(settings or {})

    def reset(self, seed: int) -> None:
        """Begin an episode."""

    def choose(self, signal: str, instant: Instant) -> int:
        """Choose a phase; without a change, the present one."""
        return instant.signals[signal].phase

    def act(self, instant: Instant) -> dict[str, int]:
        """Choose for every signal."""
        return {signal: self.choose(signal, instant) for signal in instant.signals}
