"""Encoders of open_clip, with weights by tag or from a local file."""

from pathlib import Path

import numpy as np
import open_clip
import torch

from dojo_env.encoders.base import BATCH, Features, Images, Scaling
from dojo_env.errors import ConfigError


class ClipEncoder:
    """The picture side of a CLIP model, on the accelerator where there is one."""

    def __init__(self, name: str) -> None:
        """Load `open_clip:MODEL:WEIGHTS`.

        Raises:
            ConfigError: there is no such model or tag, or the weights cannot be had.
        """
        self.name = name
        _, model, weights = _split(name)
        local = Path(weights).is_file()
        tags = open_clip.list_pretrained_tags_by_model(model)
        if not local and weights not in tags:
            raise ConfigError(
                f"encoder {name!r}: {weights!r} is no file, and open_clip has no such weights of {model}; "
                f"known are {', '.join(tags) or 'none'}"
            )
        try:
            built = open_clip.create_model(model, pretrained=weights, require_pretrained=True)
        except Exception as error:  # whatever a download or a foreign file may raise
            raise ConfigError(
                f"encoder {name!r}: the weights cannot be loaded ({error}); fetch a file of them "
                f"where there is a network, and name it: open_clip:{model}:/path/to/weights"
            ) from error
        self._visual = built.visual.eval()
        self._device = torch.device("cuda" if torch.cuda.is_available() else "cpu")
        self._visual.to(self._device)
        size = built.visual.image_size
        height, width = size if isinstance(size, tuple) else (size, size)
        self._scaling = Scaling(
            height=height, width=width, mean=built.visual.image_mean, deviation=built.visual.image_std
        )
        self.size = int(self.encode(np.zeros((1, height, width, 3), np.uint8)).shape[1])

    def encode(self, images: Images) -> Features:
        """Encode (n, h, w, 3) to (n, size)."""
        if not len(images):
            return np.empty((0, self.size), np.float32)
        batch = BATCH if self._device.type == "cuda" else 1
        parts = []
        with torch.inference_mode():
            for start in range(0, len(images), batch):
                scaled = torch.from_numpy(self._scaling.apply(images[start : start + batch]))
                parts.append(self._visual(scaled.to(self._device)).float().cpu().numpy())
        return np.concatenate(parts)


def _split(name: str) -> tuple[str, str, str]:
    kind, *rest = name.split(":", 2)
    known = open_clip.list_models()
    if len(rest) != 2 or not all(rest):
        raise ConfigError(f"encoder {name!r}: expected open_clip:MODEL:WEIGHTS, the weights a tag or a file")
    if rest[0] not in known:
        raise ConfigError(f"encoder {name!r}: open_clip has no model {rest[0]!r}; it has {', '.join(known)}")
    return kind, rest[0], rest[1]
