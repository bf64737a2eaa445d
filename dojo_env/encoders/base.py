"""What an encoder is, the memory around it, and how an observation of several pictures becomes one batch."""

import hashlib
import importlib
from collections import OrderedDict
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Protocol

import cv2
import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from dojo_env.errors import ConfigError

Images = NDArray[np.uint8]
Features = NDArray[np.float32]
BATCH = 32
"""Pictures that go through a network at once on an accelerator. On a processor each goes alone: in a batch,
its last digits would depend on how many there are."""
_MEMORY = 64 << 20
"""Bytes of features that are remembered."""


class Encoder(Protocol):
    """Turns pictures into numbers; the same picture into the same, whatever else is in the batch.

    Attributes:
        name: as `load_encoder` takes it.
        size: features per picture.
    """

    name: str
    size: int

    def encode(self, images: Images) -> Features:
        """Encode a batch.

        Args:
            images: (n, h, w, 3), red first.

        Returns:
            (n, size).
        """
        ...


@dataclass(frozen=True, slots=True, kw_only=True)
class Scaling:
    """How pixels become a network's input: squashed to its size, then (value / 255 - mean) / deviation."""

    height: int
    width: int
    mean: tuple[float, float, float] = (0.485, 0.456, 0.406)
    deviation: tuple[float, float, float] = (0.229, 0.224, 0.225)

    def apply(self, images: Images) -> Features:
        """Prepare a batch for the network.

        Args:
            images: (n, h, w, 3), red first, n >= 1.

        Returns:
            (n, 3, height, width), a new array.
        """
        size = (self.width, self.height)
        # Squashed rather than cropped: the far ends of the queues are at the picture's sides.
        resized = [
            image if image.shape[:2] == size[::-1] else cv2.resize(image, size, interpolation=cv2.INTER_AREA)
            for image in images
        ]
        slope = np.float32(1) / (np.float32(255) * np.array(self.deviation, np.float32))
        offset = np.array(self.mean, np.float32) / np.array(self.deviation, np.float32)
        planes = np.ascontiguousarray(np.stack(resized).transpose(0, 3, 1, 2))  # While a value is one byte.
        return planes * slope[:, None, None] - offset[:, None, None]


class RememberingEncoder:
    """Encodes each picture once, as long as there is room to remember it.

    `encoded` counts the pictures that the network has seen.
    """

    def __init__(self, encoder: Encoder) -> None:
        """Put a memory around an encoder."""
        self.name, self.size, self.encoded = encoder.name, encoder.size, 0
        self._encoder = encoder
        self._most = max(1, _MEMORY // (4 * encoder.size))
        self._known: OrderedDict[bytes, Features] = OrderedDict()

    def encode(self, images: Images) -> Features:
        """Encode the pictures that are new in one batch, and remember the others."""
        keys = [_digest(image) for image in images]
        found = {key: self._known[key] for key in keys if key in self._known}
        new = {key: row for row, key in enumerate(keys) if key not in found}
        if new:
            encoded = self._encoder.encode(images[list(new.values())])
            found.update(zip(new, encoded, strict=True))
            self.encoded += len(new)
        for key in keys:
            self._known[key] = found[key]
            self._known.move_to_end(key)
        while len(self._known) > self._most:
            self._known.popitem(last=False)
        return np.array([found[key] for key in keys], dtype=np.float32).reshape(len(keys), self.size)


def _digest(image: Images) -> bytes:
    shape = np.array(image.shape, dtype=np.int64).tobytes()
    return hashlib.blake2b(np.ascontiguousarray(image).data, key=shape, digest_size=16).digest()


def encoded_space(space: spaces.Space[Any], encoder: Encoder) -> spaces.Box:
    """Give the space of encoded observations: the views' features one after another, in order of their names.

    Args:
        space: what is observed: a picture (h, w, 3) of bytes, or a dict of such, one per view.
        encoder: of single pictures.

    Returns:
        (views * size,) numbers without bounds.

    Raises:
        ConfigError: observations are neither a picture nor a dict of pictures of one size.
    """
    parts = list(space.spaces.values()) if isinstance(space, spaces.Dict) else [space]
    (shape, dtype), *others = {(part.shape or (), part.dtype) for part in parts}
    if others or dtype != np.uint8 or len(shape) != 3 or shape[2] != 3:
        raise ConfigError(
            f"encoder {encoder.name!r} needs observations that are colour pictures of one size, "
            f'as "bev" and "multi_view" are; got {space}'
        )
    return spaces.Box(-np.inf, np.inf, (len(parts) * encoder.size,), np.float32)


def encode_observations(encoder: Encoder, observations: Images | Mapping[str, Images]) -> Features:
    """Encode the observations of n environments in one batch.

    Args:
        encoder: of single pictures.
        observations: (n, h, w, 3), or one such array per view.

    Returns:
        (n, views * size), the views in order of their names.
    """
    if not isinstance(observations, Mapping):
        return encoder.encode(observations)
    views = np.stack([observations[name] for name in sorted(observations)], axis=1)
    count = views.shape[0]
    return encoder.encode(views.reshape(-1, *views.shape[2:])).reshape(count, -1)


def import_needed(module: str, encoder: str, install: str) -> Any:
    """Import a package that only some encoders need.

    Args:
        module: its name, as `import` takes it.
        encoder: who needs it; the error names it.
        install: how to get it; the error ends with it.

    Returns:
        The module.

    Raises:
        ConfigError: it is not there, or cannot be loaded.
    """
    try:
        return importlib.import_module(module)
    except (ImportError, RuntimeError, OSError) as error:
        raise ConfigError(f"encoder {encoder!r} needs {module} ({error}); {install}") from error
