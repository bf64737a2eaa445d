"""Stable-Baselines3's environments behind one encoder: a step's pictures of all of them in one batch."""

from collections.abc import Mapping
from typing import Any

import numpy as np
from stable_baselines3.common.vec_env import VecEnv, VecEnvWrapper

from dojo_env.encoders.base import Encoder, Features, encode_observations, encoded_space


class EncodedVecEnv(VecEnvWrapper):
    """Shows features, (environments, views * size) float32, in place of `bev` or `multi_view`.

    The encoder runs in this process: its weights are loaded once, however many environments there are.
    """

    def __init__(self, venv: VecEnv, encoder: Encoder) -> None:
        """Put the encoder between environments and learner.

        Raises:
            ConfigError: the environments' observations are no pictures.
        """
        super().__init__(venv, observation_space=encoded_space(venv.observation_space, encoder))
        self._encoder = encoder

    def reset(self) -> Features:
        """Begin episodes."""
        return encode_observations(self._encoder, _append(self.venv.reset(), []))

    def step_wait(self) -> tuple[Features, Any, Any, list[dict[str, Any]]]:
        """Encode what all environments show, and the last observations of the episodes that ended."""
        observations, rewards, dones, infos = self.venv.step_wait()
        ended = [info for info in infos if "terminal_observation" in info]
        batch = _append(observations, [info["terminal_observation"] for info in ended])
        features = encode_observations(self._encoder, batch)
        for info, last in zip(ended, features[self.num_envs :], strict=True):
            info["terminal_observation"] = last
        return features[: self.num_envs], rewards, dones, infos


def _append(observations: Any, more: list[Any]) -> Any:
    if not more:
        return observations
    if isinstance(observations, Mapping):
        return {
            name: np.concatenate([images, np.stack([each[name] for each in more])])
            for name, images in observations.items()
        }
    return np.concatenate([observations, np.stack(more)])
