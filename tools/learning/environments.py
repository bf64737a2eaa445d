"""The environments a policy learns in: each episode has a seed of its own, and tells its figures."""

import contextlib
import multiprocessing
import os
import signal
from collections.abc import Mapping, Sequence
from functools import partial
from typing import Any

import gymnasium
import numpy as np
from gymnasium import spaces
from stable_baselines3.common.vec_env import SubprocVecEnv, VecEnv, VecTransposeImage

from dojo_env.env import TrafficSignalEnv
from dojo_env.parallel import TrafficSignalsEnv

from .agents import AgentsVecEnv, JointEnv
from .settings import Training

FIRST_TRAINING_SEED = 1_000
"""The seeds below are for evaluation: the benchmark's, and from 500 those that choose the best policy."""
VALIDATION_SEEDS = (500, 501, 502, 503)
_SEEDS_PER_RUN = 1_000_000
LOADED_ONCE = ["stable_baselines3", "libsumo", "dojo_env.parallel", "dojo_env.sensor_observations"]
"""What takes seconds to import; processes are forks of one that has. It finds installed packages only."""
_PIECE = 1 << 16
"""Bytes that are read at once of an answer that nobody waits for."""


class SeededEpisodes(gymnasium.Wrapper[Any, Any, Any, Any]):
    """Begins each episode with the seed that follows, and adds its figures to the last step's info.

    So a run that was interrupted between two episodes goes on with the same traffic.
    """

    def __init__(self, env: gymnasium.Env[Any, Any], first: int, stride: int) -> None:
        """Count from the first seed in strides."""
        super().__init__(env)
        self._next, self._stride, self._earned = first, stride, 0.0

    def reset(self, **_keywords: Any) -> tuple[Any, dict[str, Any]]:
        """Begin the next episode."""
        seed, self._next, self._earned = self._next, self._next + self._stride, 0.0
        return self.env.reset(seed=seed)

    def step(self, action: Any) -> tuple[Any, Any, bool, bool, dict[str, Any]]:
        """Act; at the end of an episode, its figures come with it."""
        seen, reward, terminated, truncated, info = self.env.step(action)
        self._earned += float(np.mean(reward))
        if truncated:
            info["figures"] = {**self.env.unwrapped.metrics(), "reward": self._earned}
        return seen, reward, terminated, truncated, info


class Processes(SubprocVecEnv):
    """Environments in processes that end whatever they were doing.

    Where a step was interrupted, Stable-Baselines3 waits for an answer of each; of one that has answered
    already it waits forever.
    """

    def close(self) -> None:
        """Let each finish what it does, and end."""
        if self.closed:
            return
        for remote in self.remotes:
            with contextlib.suppress(BrokenPipeError):
                remote.send(("close", None))
        for remote, process in zip(self.remotes, self.processes, strict=True):
            # As bytes: an answer may have been read in part.
            with contextlib.suppress(ConnectionResetError):
                while os.read(remote.fileno(), _PIECE):
                    pass
            process.join()
            remote.close()
        self.closed = True


def open_environments(training: Training, *, done: int = 0) -> VecEnv:
    """Open a run's environments as they are after so many steps."""
    start = _first_seed(training, done)
    makers = [
        partial(_make, training, start + index, training.processes) for index in range(training.processes)
    ]
    return _start(makers, training)


def open_evaluation(training: Training, seeds: Sequence[int], **changes: Any) -> VecEnv:
    """Open an environment per seed; every episode of each has the same seed."""
    makers = [partial(_make, training, seed, 0, **changes) for seed in seeds]
    return _start(makers, training)


def open_environment(settings: Mapping[str, Any]) -> gymnasium.Env[Any, Any]:
    """Open one environment of a run in a process of RLlib's, which asks for images as (3, h, w).

    Args:
        settings: `training`; `done`, the run's steps so far; and RLlib's `worker_index`, from 1.
    """
    training: Training = settings["training"]
    start = _first_seed(training, settings["done"])
    env: gymnasium.Env[Any, Any] = _make(training, start + settings.worker_index - 1, training.processes)
    if training.encoder != "none":
        from dojo_env.encoders import load_encoder
        from dojo_env.encoders.wrapper import EncodedObservation

        return EncodedObservation(env, load_encoder(training.encoder))
    return ChannelsFirst(env) if training.sees else env


class ChannelsFirst(gymnasium.ObservationWrapper[Any, Any, Any]):
    """Shows images as torch wants them: (h, w, 3) becomes (3, h, w)."""

    def __init__(self, env: gymnasium.Env[Any, Any]) -> None:
        """Describe the images."""
        super().__init__(env)
        space = env.observation_space
        if isinstance(space, spaces.Dict):
            turned = {name: VecTransposeImage.transpose_space(each) for name, each in space.spaces.items()}
            self.observation_space = spaces.Dict(turned)
        else:
            self.observation_space = VecTransposeImage.transpose_space(space)

    def observation(self, observation: Any) -> Any:
        """Turn an image, or each of several."""
        if isinstance(observation, Mapping):
            return {name: image.transpose(2, 0, 1) for name, image in observation.items()}
        return observation.transpose(2, 0, 1)


def _first_seed(training: Training, done: int) -> int:
    return FIRST_TRAINING_SEED + training.seed * _SEEDS_PER_RUN + done // training.decisions


def _start(makers: list[Any], training: Training) -> VecEnv:
    """Start an environment per maker, in processes that share what is loaded once."""
    encoder = None
    if training.encoder != "none":  # First, since it may not be there.
        from dojo_env.encoders import load_encoder
        from dojo_env.encoders.vectorised import EncodedVecEnv

        encoder = load_encoder(training.encoder)
    multiprocessing.set_forkserver_preload(LOADED_ONCE)
    environments: VecEnv = Processes(makers, start_method="forkserver")
    if training.agents != "single":
        environments = AgentsVecEnv(environments)
    return environments if encoder is None else EncodedVecEnv(environments, encoder)


def _make(training: Training, first: int, stride: int, **changes: Any) -> SeededEpisodes:
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is for the learner, which closes us.
    keywords = {**training.environment, **changes}
    single = training.agents == "single"
    env = TrafficSignalEnv(**keywords) if single else JointEnv(TrafficSignalsEnv(**keywords))
    return SeededEpisodes(env, first, stride)
