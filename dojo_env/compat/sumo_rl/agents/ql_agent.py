"""Q-learning over a table (Watkins and Dayan, 1992), with SUMO-RL's names."""

from collections.abc import Hashable
from typing import Any

from dojo_env.compat.sumo_rl.exploration.epsilon_greedy import EpsilonGreedy


class QLAgent:
    """Learns what each action is worth in each state that it has met.

    Attributes:
        state: where it is.
        action: what it did there.
        q_table: by state, a value per action.
        acc_reward: all that it was paid.
    """

    def __init__(
        self,
        starting_state: Hashable,
        state_space: Any,
        action_space: Any,
        alpha: float = 0.5,
        gamma: float = 0.95,
        exploration_strategy: EpsilonGreedy | None = None,
    ) -> None:
        """Begin in a state, with all values zero.

        Args:
            starting_state: a key of the table.
            state_space: nothing heeds it.
            action_space: Discrete.
            alpha: the share of each error that is learned.
            gamma: what a reward is worth a decision later.
            exploration_strategy: chooses actions; None is `EpsilonGreedy()`.
        """
        self.state, self.state_space, self.action_space = starting_state, state_space, action_space
        self.alpha, self.gamma = alpha, gamma
        self.exploration = exploration_strategy or EpsilonGreedy()
        self.action: Any = None
        self.acc_reward = 0.0
        self.q_table: dict[Hashable, list[float]] = {}
        self._values(starting_state)

    def act(self) -> Any:
        """Choose an action."""
        self.action = self.exploration.choose(self.q_table, self.state, self.action_space)
        return self.action

    def learn(self, next_state: Hashable, reward: float, done: bool = False) -> None:  # noqa: ARG002
        """Learn from what the last action has led to.

        Args:
            next_state: a key of the table.
            reward: what was paid.
            done: nothing heeds it: episodes are cut off, they do not end.
        """
        values, best = self._values(self.state), max(self._values(next_state))
        values[self.action] += self.alpha * (reward + self.gamma * best - values[self.action])
        self.state = next_state
        self.acc_reward += reward

    def _values(self, state: Hashable) -> list[float]:
        return self.q_table.setdefault(state, [0.0] * int(self.action_space.n))
