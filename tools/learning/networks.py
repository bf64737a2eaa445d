"""Networks that see: small enough that a plain CPU learns from images about as fast as it simulates."""

from typing import Any

import torch
from gymnasium import spaces
from stable_baselines3.common.torch_layers import BaseFeaturesExtractor
from torch import nn

WIDTH = 128
"""Features that a view gives."""
_SLOWEST = 1e-3
"""The least share that a batch has in the running means."""
_LEAST_DEVIATION = 1e-3


def build_view(shape: tuple[int, int, int]) -> nn.Sequential:
    """Build the network of one view of a camera that does not move: where something is seen matters.

    Cars are a few pixels, lighter or darker than the road, so the first layer looks at 4 x 4 pixels and
    keeps both signs; the second sums patches of 8 x 8 pixels; nothing is pooled, so places stay apart.
    """
    stem = nn.Sequential(
        nn.Conv2d(shape[0], 16, 4, 4), nn.ReLU(), nn.Conv2d(16, 32, 2, 2), nn.ReLU(), nn.Flatten()
    )
    with torch.no_grad():
        size = stem(torch.zeros(1, *shape)).shape[1]
    return nn.Sequential(*stem, nn.Linear(size, WIDTH), nn.ReLU())


class ViewNet(BaseFeaturesExtractor):
    """Sees one image, or several and concatenates what it sees in each."""

    def __init__(self, observation_space: spaces.Space[Any], *, shared: bool = False) -> None:
        """Build a network per view, or one for all."""
        views = (
            observation_space.spaces
            if isinstance(observation_space, spaces.Dict)
            else {"": observation_space}
        )
        super().__init__(observation_space, WIDTH * len(views))
        self._names = sorted(views)
        shapes = [views[name].shape for name in self._names]
        built = [build_view(shape) for shape in (shapes[:1] if shared else shapes)]
        self._views = nn.ModuleList(built * len(shapes) if shared else built)

    def forward(self, seen: Any) -> torch.Tensor:
        """Turn images (n, 3, h, w), 0 to 1, into (n, features)."""
        images = [seen[name] for name in self._names] if isinstance(seen, dict) else [seen]
        return torch.cat([view(image - 0.5) for view, image in zip(self._views, images, strict=True)], dim=1)


class EncodedNet(BaseFeaturesExtractor):
    """Takes what a frozen encoder saw, each feature by how far it is from its mean.

    Most of every feature is the road, which never changes; what is left tells the cars. Mean and deviation
    run along while the policy learns, and are kept with its weights; Stable-Baselines3's DQN copies to its
    target network what is named `running_`.
    """

    running_mean: torch.Tensor
    running_square: torch.Tensor
    running_count: torch.Tensor

    def __init__(self, observation_space: spaces.Box) -> None:
        """Begin with nothing known."""
        size = int(observation_space.shape[0])
        super().__init__(observation_space, size)
        self.register_buffer("running_mean", torch.zeros(size))
        self.register_buffer("running_square", torch.ones(size))
        self.register_buffer("running_count", torch.zeros(()))

    def forward(self, seen: torch.Tensor) -> torch.Tensor:
        """Standardize (n, features)."""
        if self.training:
            self.running_count += len(seen)
            share = (len(seen) / self.running_count).clamp(min=_SLOWEST)
            self.running_mean += share * (seen.mean(0) - self.running_mean)
            self.running_square += share * (seen.square().mean(0) - self.running_square)
        deviation = (self.running_square - self.running_mean.square()).clamp(min=0).sqrt()
        return ((seen - self.running_mean) / (deviation + _LEAST_DEVIATION)).clamp(-5.0, 5.0)
