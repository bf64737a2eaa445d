"""Updates from pictures take long: a second core works on them, or environments go on beside them."""

from collections.abc import Callable
from functools import partial
from typing import Any

from stable_baselines3 import DQN, PPO
from stable_baselines3.common.vec_env import VecEnv, VecEnvWrapper

from dojo_env.learning.process_setup import threads


class TwoThreadPPO(PPO):
    """Updates on two threads: environments wait for an update, and it takes a quarter less time."""

    def train(self) -> None:
        """Update the policy."""
        with threads(2):
            super().train()


class Meanwhile(VecEnvWrapper):
    """Environments beside which something is done while they step."""

    work: Callable[[], None] | None = None
    """What is done during the next step."""

    def reset(self) -> Any:
        """Begin the next episode everywhere."""
        return self.venv.reset()

    def step_wait(self) -> Any:
        """Do the work, and collect what came of the actions."""
        work, self.work = self.work, None
        if work is not None:
            work()
        return self.venv.step_wait()


class BesideDQN(DQN):
    """Updates while the environments step: actions come from the policy as it was one update before."""

    def __init__(self, policy: str, environments: VecEnv, **settings: Any) -> None:
        """Take `DQN`'s arguments."""
        self._beside = Meanwhile(environments)
        super().__init__(policy, self._beside, **settings)

    def train(self, gradient_steps: int, batch_size: int = 100) -> None:
        """Update during the next step; at once where episodes end, since a checkpoint may come before.

        Args:
            gradient_steps: how often the weights are changed.
            batch_size: transitions of each such step.
        """
        update = partial(self._update, gradient_steps, batch_size)
        memory = self.replay_buffer
        if memory is not None and memory.dones[memory.pos - 1].all():
            update()
        else:
            self._beside.work = update

    def _update(self, gradient_steps: int, batch_size: int) -> None:
        super().train(gradient_steps, batch_size)
        self.policy.set_training_mode(False)
