"""Pictures as what changes in them: light, weather and where the camera hangs drop out, vehicles stay."""

from collections.abc import Mapping
from typing import Any

import gymnasium
import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from dojo_env.errors import ConfigError

_MEMORY = 120
"""Observations after which the oldest fade from the mean: ten minutes of decisions."""
_GREY, _CONTRAST = 128, 32
_LEAST = 4.0
"""Added to the deviation, in grey values, so that noise on an empty road does not grow."""


class BackgroundSubtraction(gymnasium.ObservationWrapper[Any, Any, Any]):
    """Shows how far each pixel is from its own running mean in this episode, in the picture's deviations.

    The background is 128; 32 grey values are one deviation of the whole picture so far. What was half as
    bright, or half as plain, looks the same. Pictures keep their names, shapes (h, w, 3) and type uint8.
    """

    def __init__(self, env: gymnasium.Env[Any, Any]) -> None:
        """Put the subtraction between environment and agent.

        Args:
            env: whose observations are pictures (h, w, 3) uint8, or a dict of these.

        Raises:
            ConfigError: the environment's observations are no pictures.
        """
        super().__init__(env)
        space = env.observation_space
        self._parts = dict(space.spaces) if isinstance(space, spaces.Dict) else {"": space}
        for part in self._parts.values():
            if part.dtype != np.uint8 or len(part.shape or ()) < 3:
                raise ConfigError(f"no pictures, of which a background could be known: {part}")
        self._known: dict[str, Background] = {}

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> Any:
        """Begin an episode, of whose background nothing is known.

        Args:
            seed: of the episode.
            options: as the environment takes them.

        Returns:
            The observation, the background subtracted, and figures by name.
        """
        self._known = {name: Background(part.shape or ()) for name, part in self._parts.items()}
        return super().reset(seed=seed, options=options)

    def observation(self, observation: Any) -> Any:
        """Subtract from a picture, or from each of several.

        Args:
            observation: the environment's.

        Returns:
            The same shapes, uint8, 128 where nothing has changed.
        """
        if isinstance(observation, Mapping):
            return {name: self._known[name].subtract(picture) for name, picture in observation.items()}
        return self._known[""].subtract(observation)


class Background:
    """The mean of a camera's pictures, and how far they are from it."""

    def __init__(self, shape: tuple[int, ...]) -> None:
        """Begin with nothing known of pictures (..., h, w, 3), each of which is told by itself."""
        self._count = 0
        self._mean = np.zeros(shape, np.float32)
        self._variance = np.zeros((*shape[:-3], 1, 1, 1), np.float32)

    def subtract(self, picture: NDArray[np.uint8]) -> NDArray[np.uint8]:
        """Take a picture into the mean, and show how far it is from it.

        Args:
            picture: (..., h, w, 3) uint8.

        Returns:
            The same shape, uint8, 128 where nothing has changed.
        """
        self._count = min(self._count + 1, _MEMORY)
        away = picture - self._mean
        self._mean += away / self._count
        away *= 1 - 1 / self._count
        self._variance += (np.square(away).mean((-3, -2, -1), keepdims=True) - self._variance) / self._count
        shown = away * (_CONTRAST / (np.sqrt(self._variance) + _LEAST)) + _GREY
        return shown.clip(0, 255).astype(np.uint8)
