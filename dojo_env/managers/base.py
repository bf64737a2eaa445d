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
    once for each of SUMO's steps. All managers run a hook before any runs the next one.
    """

    def before_reset(self, turn: Turn) -> None:
        """Put away what is left of the last episode.

        Args:
            turn: of the episode that begins; it has no actions.
        """

    def reset(self, turn: Turn) -> None:
        """Begin an episode.

        Args:
            turn: of the episode that begins; it has no actions.
        """

    def before_step(self, turn: Turn) -> None:
        """Take in the actions.

        Args:
            turn: of the decision; an agent that its actions do not name asks for nothing.
        """

    def step(self, turn: Turn) -> None:
        """Let one of SUMO's steps pass.

        Args:
            turn: of the decision that the step follows.
        """

    def after_step(self, turn: Turn) -> None:
        """Finish the interval, before anything is observed.

        Args:
            turn: of the decision that the interval follows.
        """

    def close(self) -> None:
        """Give everything back; called in reverse order, also after a failure."""
