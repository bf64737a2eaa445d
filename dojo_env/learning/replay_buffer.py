"""What DQN remembers of pictures, several to an observation."""

from typing import Any

import numpy as np
from stable_baselines3.common.buffers import DictReplayBuffer
from stable_baselines3.common.type_aliases import DictReplayBufferSamples
from stable_baselines3.common.vec_env import VecNormalize


class NStepDictReplayBuffer(DictReplayBuffer):
    """Stable-Baselines3's `NStepReplayBuffer` for dicts of observations, for which it has none."""

    def __init__(self, *arguments: Any, n_steps: int, gamma: float, **keywords: Any) -> None:
        """Make room; `n_steps` rewards are counted, each worth `gamma` of the one before."""
        super().__init__(*arguments, **keywords)
        self._discounts = gamma ** np.arange(n_steps + 1, dtype=np.float32)

    def _get_samples(  # type: ignore[override]  # as its parent
        self, batch_inds: np.ndarray, env: VecNormalize | None = None
    ) -> DictReplayBufferSamples:
        """Give transitions over `n_steps`, or fewer, up to an episode's end or the newest one."""
        places = np.random.randint(0, self.n_envs, size=len(batch_inds))  # noqa: NPY002 - as its parent draws
        count = len(self._discounts) - 1
        steps = (batch_inds[:, None] + np.arange(count)) % self.buffer_size
        newest = (self.pos - 1) % self.buffer_size
        ends = (self.dones[steps, places[:, None]] > 0) | (steps == newest)
        last = np.where(ends.any(axis=1), ends.argmax(axis=1), count - 1)
        weights = self._discounts[:count] * (np.arange(count) <= last[:, None])
        rewards = self._normalize_reward(self.rewards[steps, places[:, None]], env) * weights
        final = steps[np.arange(len(last)), last]
        before: Any = {name: seen[batch_inds, places] for name, seen in self.observations.items()}
        after: Any = {name: seen[final, places] for name, seen in self.next_observations.items()}
        before, after = self._normalize_obs(before, env), self._normalize_obs(after, env)
        over = self.dones[final, places] * (1 - self.timeouts[final, places])
        return DictReplayBufferSamples(
            observations={name: self.to_torch(seen) for name, seen in before.items()},
            actions=self.to_torch(self.actions[batch_inds, places]),
            next_observations={name: self.to_torch(seen) for name, seen in after.items()},
            dones=self.to_torch(over[:, None]),
            rewards=self.to_torch(rewards.sum(axis=1, keepdims=True)),
            discounts=self.to_torch(self._discounts[last + 1][:, None]),
        )
