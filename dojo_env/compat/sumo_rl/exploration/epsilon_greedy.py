"""Mostly the best action known, now and then any, with SUMO-RL's names."""

from collections.abc import Hashable, Mapping, Sequence
from typing import Any

import numpy as np


class EpsilonGreedy:
    """Chooses any action with a chance that decays.

    Attributes:
        epsilon: the chance.
    """

    def __init__(self, initial_epsilon: float = 1.0, min_epsilon: float = 0.0, decay: float = 0.99) -> None:
        """Begin with a chance that is multiplied by `decay` at each choice, down to `min_epsilon`."""
        self.initial_epsilon, self.min_epsilon, self.decay = initial_epsilon, min_epsilon, decay
        self.epsilon = initial_epsilon

    def choose(self, q_table: Mapping[Hashable, Sequence[float]], state: Hashable, action_space: Any) -> Any:
        """Choose an action in a state; chance is NumPy's global one, as SUMO-RL has it.

        Args:
            q_table: by state, a value for each action.
            state: a key of the table.
            action_space: Gymnasium's, from which any action is drawn.

        Returns:
            The action's number.
        """
        explores = np.random.rand() < self.epsilon  # noqa: NPY002
        self.epsilon = max(self.epsilon * self.decay, self.min_epsilon)
        return int(action_space.sample()) if explores else int(np.argmax(q_table[state]))

    def reset(self) -> None:
        """Begin anew."""
        self.epsilon = self.initial_epsilon
