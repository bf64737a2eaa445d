"""Episodes one after another, each with a seed of its own."""

from typing import Any

import gymnasium
import numpy as np


class SeededEpisodes(gymnasium.Wrapper[Any, Any, Any, Any]):
    """Begins each episode with the seed that follows, and adds its figures to the last step's info.

    So a run that was interrupted between two episodes goes on with the same traffic.

    Attributes:
        episode: how many have begun, which is the next one's number.
    """

    def __init__(self, env: gymnasium.Env[Any, Any], first: int, stride: int) -> None:
        """Count from the first seed in strides."""
        super().__init__(env)
        self._first, self._stride, self._earned = first, stride, 0.0
        self._inner: Any = env.unwrapped
        self.episode = 0

    def reset(self, **_keywords: Any) -> tuple[Any, dict[str, Any]]:
        """Begin the next episode."""
        seed, self._earned = self._first + self.episode * self._stride, 0.0
        self.episode += 1
        return self.env.reset(seed=seed)

    def prepare(self) -> None:
        """Do now what the next episodes would each do in a fork; see `LocalWorld.prepare`."""
        self._inner.world.prepare()

    def step(self, action: Any) -> tuple[Any, Any, bool, bool, dict[str, Any]]:
        """Act; at the end of an episode, its figures come with it.

        Args:
            action: as the environment takes it.

        Returns:
            What the environment's own `step` gives. At an episode's end, its metrics are in `info`, under
            `figures`, with the sum of its rewards, the mean of the signals, as `reward`.
        """
        seen, reward, terminated, truncated, info = self.env.step(action)
        self._earned += float(np.mean(np.asarray(reward)))
        if truncated:
            info["figures"] = {**self._inner.metrics(), "reward": self._earned}
        return seen, reward, terminated, truncated, info
