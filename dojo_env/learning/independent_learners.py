"""Independent learners: a model per signal, all of them learning side by side on the same steps.

Stable-Baselines3's loops stay as they are. Each model's runs in a thread of its own and only one thread runs
at a time: it goes on until its model has acted, then it is the next one's turn, and the last to act takes the
step of all. So the order of everything random is fixed, and the same seed gives the same result.
"""

import threading
from collections.abc import Callable, Iterable
from dataclasses import replace
from operator import itemgetter
from typing import Any, cast

import numpy as np
import torch
from gymnasium import spaces
from numpy.typing import NDArray
from stable_baselines3.common.base_class import BaseAlgorithm
from stable_baselines3.common.callbacks import BaseCallback
from stable_baselines3.common.logger import Logger
from stable_baselines3.common.policies import BasePolicy
from stable_baselines3.common.vec_env import VecEnv, VecEnvWrapper

from dojo_env.learning.joint_signals import AgentsVecEnv, change_each
from dojo_env.learning.settings import Training

_SEEDS_APART = 1_000


class StoppedError(Exception):
    """Another thread failed, or the user interrupted."""


class Turns:
    """Whose turn it is, among so many threads."""

    def __init__(self, count: int) -> None:
        """Begin with the first."""
        self._count, self._turn, self._stopped = count, 0, False
        self._changed = threading.Condition()

    def wait(self, who: int) -> None:
        """Wait for one's turn.

        Args:
            who: the number of the thread that waits, from 0.

        Raises:
            StoppedError: it will not come.
        """
        with self._changed:
            self._changed.wait_for(lambda: self._turn == who or self._stopped)
            if self._stopped:
                raise StoppedError

    def hand_on(self, who: int) -> None:
        """Let the next one run.

        Args:
            who: the number of the thread whose turn it was; after the last, the first is next.
        """
        with self._changed:
            self._turn = (who + 1) % self._count
            self._changed.notify_all()

    def stop(self) -> None:
        """Let everybody who waits end."""
        with self._changed:
            self._stopped = True
            self._changed.notify_all()


class Seat(VecEnvWrapper):
    """One signal's environments, as its own model knows them: it acts, and waits until all have."""

    def __init__(self, table: "Independent", who: int) -> None:
        """Sit down at a table."""
        environments = table.environments
        self._agents = environments.agents
        super().__init__(environments, action_space=spaces.Discrete(environments.phases[who]))
        self.num_envs = environments.num_envs // environments.agents
        self._table, self._who = table, who

    def seed(self, seed: int | None = None) -> list[int | None]:
        """Episodes have seeds already.

        Args:
            seed: has no effect.

        Returns:
            The same value for each environment.
        """
        return [seed] * self.num_envs

    def reset(self) -> Any:
        """Begin an episode everywhere, when the first one asks."""
        if self._who == 0:
            self._table.seen = self.venv.reset()
        return self._own(self._table.seen)

    def step_async(self, actions: NDArray[Any]) -> None:
        """Note what this signal does.

        Args:
            actions: (environments,) a phase in each.
        """
        self._table.actions[:, self._who] = actions

    def step_wait(self) -> Any:
        """Let the others act, and take one's part of what came of it."""
        table = self._table
        if self._who == self._agents - 1:
            table.step()
        table.yield_turn(self._who)
        seen, rewards, ended, infos = table.outcome
        infos = [dict(info) for info in infos[self._who :: self._agents]]
        return self._own(seen), self._own(rewards), self._own(ended), infos

    def _own(self, values: Any) -> Any:
        return change_each(lambda part: part[self._who :: self._agents].copy(), values)


class _Meeting(BaseCallback):
    """Before each rollout all models wait for each other: only then has everybody learned from the last."""

    def __init__(self, table: "Independent", who: int, everybody: Callable[[], None]) -> None:
        super().__init__()
        self._table, self._who, self._everybody = table, who, everybody

    def _on_step(self) -> bool:
        return True

    def _on_rollout_start(self) -> None:
        if self._who == len(self._table.models) - 1:
            self._everybody()
        self._table.yield_turn(self._who)


class Policies(torch.nn.ModuleList):
    """A policy per signal, each of which acts for its own."""

    def predict(self, seen: Any, *, deterministic: bool) -> tuple[NDArray[Any], None]:
        """Act for every signal: all of the first environment, then all of the second.

        Args:
            seen: (environments * signals, ...) in this order, or a dict of such.
            deterministic: take the best action rather than draw one.

        Returns:
            (environments * signals,) phases in the same order; and None, since nothing is remembered.
        """
        parts = [change_each(itemgetter(slice(who, None, len(self))), seen) for who in range(len(self))]
        acted = [
            policy.predict(part, deterministic=deterministic)[0]
            for policy, part in zip(cast(Iterable[BasePolicy], self), parts, strict=True)
        ]
        return np.stack(acted, axis=1).ravel(), None


class Independent:
    """A model per signal, with as much of a single model's interface as training and evaluation use."""

    def __init__(
        self,
        training: Training,
        environments: AgentsVecEnv,
        build: Callable[[Training, VecEnv], BaseAlgorithm],
    ) -> None:
        """Build a model per signal, each with weights of its own."""
        self.environments = environments
        processes, agents = environments.num_envs // environments.agents, environments.agents
        self.actions = np.zeros((processes, agents), np.int64)
        self.seen: Any = None
        self.outcome: Any = None
        self.num_timesteps = 0
        self.logger = Logger(None, [])
        self.models = [
            build(
                replace(training, agents="single", seed=training.seed + who * _SEEDS_APART), Seat(self, who)
            )
            for who in range(agents)
        ]
        self.policy = Policies(model.policy for model in self.models)
        self._turns = Turns(agents)
        self._callback: BaseCallback | None = None

    def set_logger(self, logger: Logger) -> None:
        """Log the figures of all there; the models' own losses nowhere.

        Args:
            logger: what the run's callback logs to.
        """
        self.logger = logger
        for model in self.models:
            model.set_logger(Logger(None, []))

    def step(self) -> None:
        """Take the step of all, and tell the callback as a single model would."""
        self.outcome = self.environments.step(self.actions.ravel())
        self.num_timesteps += len(self.actions)
        if self._callback is not None:
            _, rewards, ended, infos = self.outcome
            self._callback.update_locals({"rewards": rewards, "dones": ended, "infos": infos})
            self._callback.on_step()

    def yield_turn(self, who: int) -> None:
        """Let all others run until it is one's turn again.

        Args:
            who: the number of the model whose thread calls.

        Raises:
            StoppedError: another thread failed, or the user interrupted.
        """
        self._turns.hand_on(who)
        self._turns.wait(who)

    def learn(
        self, steps: int, callback: BaseCallback, *, log_interval: Any, reset_num_timesteps: bool
    ) -> None:
        """Let all models learn for so many steps of their environments.

        Args:
            steps: decisions of all environments together; those of an environment's signals count once.
            callback: is told of the run as a single model tells it.
            log_interval: as the models' own `learn` has it.
            reset_num_timesteps: count from 0; False goes on from what the models have counted.

        Raises:
            Exception: whatever a model or the callback raised in a thread, once all threads have ended.
        """
        self._callback = callback
        callback.init_callback(cast(BaseAlgorithm, self))
        self._turns = Turns(len(self.models))
        self.num_timesteps = 0 if reset_num_timesteps else self.models[0].num_timesteps
        failed: list[BaseException] = []

        def run(who: int) -> None:
            torch.set_num_threads(1)  # Each thread has its own setting.
            try:
                self._turns.wait(who)
                self.models[who].learn(
                    steps, _Meeting(self, who, callback.on_rollout_start), log_interval=log_interval,
                    reset_num_timesteps=reset_num_timesteps,
                )  # fmt: skip
                self._turns.hand_on(who)
            except StoppedError:
                pass
            except BaseException as error:  # noqa: BLE001 - told by the thread that started this one
                failed.append(error)
                self._turns.stop()

        threads = [threading.Thread(target=run, args=(who,)) for who in range(len(self.models))]
        for thread in threads:
            thread.start()
        try:
            for thread in threads:
                thread.join()
        finally:
            self._turns.stop()
            for thread in threads:
                thread.join()
        if failed:
            raise failed[0]
        callback.on_training_end()
