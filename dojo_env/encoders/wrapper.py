"""One environment's pictures as an encoder's features."""

from collections.abc import Mapping
from typing import Any

import gymnasium
import numpy as np

from dojo_env.encoders.base import Encoder, Features, encode_observations, encoded_space


class EncodedObservation(gymnasium.ObservationWrapper[Any, Any, Any]):
    """Shows features, (views * size) float32, in place of `bev` or `multi_view`.

    Raises:
        ConfigError: the environment's observations are no pictures.
    """

    def __init__(self, env: gymnasium.Env[Any, Any], encoder: Encoder) -> None:
        """Put the encoder between environment and agent."""
        super().__init__(env)
        self.observation_space = encoded_space(env.observation_space, encoder)
        self._encoder = encoder

    def observation(self, observation: Any) -> Features:
        """Encode one observation.

        Args:
            observation: a picture (h, w, 3), or a mapping of such by the view's name.

        Returns:
            (views * size,), the views in order of their names.
        """
        if isinstance(observation, Mapping):
            batch: Any = {name: np.asarray(image)[None] for name, image in observation.items()}
        else:
            batch = np.asarray(observation)[None]
        return encode_observations(self._encoder, batch)[0]
