"""The environments a policy learns in: each episode has a seed of its own, and tells its figures."""

from collections.abc import Mapping, Sequence
from functools import partial
from typing import Any

import gymnasium
from gymnasium import spaces
from stable_baselines3.common.vec_env import VecEnv, VecTransposeImage

from dojo_env.background_subtraction import BackgroundSubtraction
from dojo_env.env import TrafficSignalEnv
from dojo_env.learning.episode_processes import Processes
from dojo_env.learning.joint_signals import AgentsVecEnv, JointEnv
from dojo_env.learning.seeded_episodes import SeededEpisodes
from dojo_env.learning.settings import Training
from dojo_env.parallel import TrafficSignalsEnv

FIRST_TRAINING_SEED = 1_000
"""The seeds below are for evaluation: the benchmark's, and from 500 those that choose the best policy."""
VALIDATION_SEEDS = (500, 501, 502, 503)
_SEEDS_PER_RUN = 1_000_000


def open_environments(training: Training, *, done: int = 0) -> VecEnv:
    """Open a run's environments as they are after so many steps.

    Args:
        training: the run's settings.
        done: steps of all environments together; the episodes' seeds go on from there.

    Returns:
        An environment per process, or, with several signals, one for each of its signals.

    Raises:
        ConfigError: the encoder is unknown, a package of it is missing, or its file is none.
        SimulationError: an environment's process ends at its start.
    """
    start = _first_seed(training, done)
    makers = [
        partial(_make, training, start + index, training.processes) for index in range(training.processes)
    ]
    return _start(makers, training)


def open_evaluation(training: Training, seeds: Sequence[int], **changes: Any) -> VecEnv:
    """Open an environment per seed; every episode of each has the same seed.

    Args:
        training: the run's settings.
        seeds: one for each environment.
        changes: settings of the environment that take the place of the training's.

    Returns:
        An environment per seed, or, with several signals, one for each of its signals.

    Raises:
        ConfigError: the encoder is unknown, a package of it is missing, or its file is none.
        SimulationError: an environment's process ends at its start.
    """
    makers = [partial(_make, training, seed, 0, **changes) for seed in seeds]
    return _start(makers, training)


def open_environment(settings: Any) -> gymnasium.Env[Any, Any]:
    """Open one environment of a run in a process of RLlib's, which asks for images as (3, h, w).

    Args:
        settings: `training`; `done`, the run's steps so far; and RLlib's `worker_index`, from 1.

    Returns:
        The environment, whose episodes have the seeds that are this worker's; with an encoder, it shows
        features.

    Raises:
        ConfigError: a setting of the environment cannot work, or the encoder cannot be loaded.
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
        self.observation_space = turn_images(env.observation_space)

    def observation(self, observation: Any) -> Any:
        """Turn an image, or each of several.

        Args:
            observation: (h, w, 3), or a mapping of such by the view's name.

        Returns:
            (3, h, w), or a dict of such; they share memory with what came.
        """
        if isinstance(observation, Mapping):
            return {name: image.transpose(2, 0, 1) for name, image in observation.items()}
        return observation.transpose(2, 0, 1)


def turn_images(observed: Any) -> spaces.Space[Any]:
    """Describe images, or a dict of them, as (3, h, w).

    Args:
        observed: the space of images (h, w, 3), or a dict of such.

    Returns:
        The same space with its axes turned.
    """
    if not isinstance(observed, spaces.Dict):
        turned: spaces.Space[Any] = VecTransposeImage.transpose_space(observed)
        return turned
    return spaces.Dict({name: turn_images(each) for name, each in observed.spaces.items()})


def _first_seed(training: Training, done: int) -> int:
    return FIRST_TRAINING_SEED + training.seed * _SEEDS_PER_RUN + done // training.decisions


def _start(makers: list[Any], training: Training) -> VecEnv:
    """Start an environment per maker, in processes that share what is loaded once."""
    encoder = None
    if training.encoder != "none":  # First, since it may not be there.
        from dojo_env.encoders import load_encoder
        from dojo_env.encoders.vectorised import EncodedVecEnv

        encoder = load_encoder(training.encoder)
    environments: VecEnv = Processes(makers)
    if training.agents != "single":
        environments = AgentsVecEnv(environments)
    return environments if encoder is None else EncodedVecEnv(environments, encoder)


def _make(training: Training, first: int, stride: int, **changes: Any) -> SeededEpisodes:
    keywords = {**training.environment, **changes}
    single = training.agents == "single"
    env: gymnasium.Env[Any, Any] = (
        TrafficSignalEnv(**keywords) if single else JointEnv(TrafficSignalsEnv(**keywords))
    )
    if training.background_subtraction:
        env = BackgroundSubtraction(env)
    return SeededEpisodes(env, first, stride)
