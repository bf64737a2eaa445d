"""The five hooks of an episode, no-ops by default."""

from collections.abc import Mapping
from dataclasses import dataclass, field


@dataclass(frozen=True, slots=True, kw_only=True)
class Turn:
    """What the managers are told: the episode's seed and number, and what each agent wants now."""

    seed: int
    episode: int
    actions: Mapping[str, int] = field(default_factory=dict)


class Manager:
    """One concern of an episode.

    `before_reset` and `reset` run once an episode, `before_step` and `after_step` once a decision, `step`
    once a simulated second. All managers run a hook before any runs the next one.
    """

    def before_reset(self, turn: Turn) -> None:
        """Put away what is left of the last episode."""

    def reset(self, turn: Turn) -> None:
        """Begin an episode."""

    def before_step(self, turn: Turn) -> None:
        """Take in the actions."""

    def step(self, turn: Turn) -> None:
        """Let a simulated second pass."""

    def after_step(self, turn: Turn) -> None:
        """Finish the interval, before anything is observed."""

    def close(self) -> None:
        """Give everything back; called in reverse order, also after a failure."""
