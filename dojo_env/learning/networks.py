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
_THINNED = 8
"""Of so many seen, one counts for the running means: it is enough, and the others cost nothing."""
_FARTHEST = 5.0


def build_view(shape: tuple[int, int, int]) -> nn.Sequential:
    """Build the network of one view of a camera that does not move: where something is seen matters.

    Cars are a few pixels, lighter or darker than the road: the first layer keeps both signs. A car on the
    edge of two patches is whole in the second layer; nothing is pooled, so places stay apart.

    Args:
        shape: (channels, h, w) of an image.

    Returns:
        A network from (n, channels, h, w) to (n, `WIDTH`), with fresh weights.
    """
    stem = nn.Sequential(
        nn.Conv2d(shape[0], 8, 4, 4),
        nn.ReLU(),
        nn.Conv2d(8, 24, 3, 2, 1),
        nn.ReLU(),
        nn.Flatten(),
    )
    with torch.no_grad():
        seen = stem(torch.zeros(1, *shape)).shape[1]
    return nn.Sequential(*stem, nn.Linear(seen, WIDTH), nn.ReLU())


class Standard(nn.Module):
    """Tells each value by how far it is from its own mean, in its own deviations.

    Most of what a camera that does not move shows never changes; what is left tells cars and lights. Mean
    and deviation run along while a policy learns, and are kept with its weights. Stable-Baselines3's DQN
    copies to its target network what is named `running_`.
    """

    running_count: torch.Tensor
    running_mean: torch.Tensor
    running_square: torch.Tensor
    running_scale: torch.Tensor

    def __init__(self, shape: tuple[int, ...], least: float) -> None:
        """Begin with nothing known; `least` is added to deviations, so that noise does not grow."""
        super().__init__()
        self._least = least
        self.register_buffer("running_count", torch.zeros(()))
        self.register_buffer("running_mean", torch.zeros(shape))
        self.register_buffer("running_square", torch.zeros(shape))
        self.register_buffer("running_scale", torch.full(shape, 1 / least))

    def forward(self, seen: torch.Tensor) -> torch.Tensor:
        """Standardize in place: new memory would cost more than the sums.

        While the network trains, mean and deviation take part of the values into account first.

        Args:
            seen: (n, ...) floats, which are changed.

        Returns:
            The same tensor, in deviations from the mean, none beyond 5.
        """
        if self.training:
            self._note(seen[::_THINNED])
        return seen.sub_(self.running_mean).mul_(self.running_scale).clamp_(-_FARTHEST, _FARTHEST)

    @torch.no_grad()
    def _note(self, seen: torch.Tensor) -> None:
        """Let the mean and the deviation run on."""
        self.running_count += len(seen)
        share = (len(seen) / self.running_count).clamp(min=_SLOWEST)
        self.running_mean.lerp_(seen.mean(0), share)
        self.running_square.lerp_(seen.square().mean(0), share)
        variance = (self.running_square - self.running_mean.square()).clamp_(min=0)
        self.running_scale.copy_(1 / (variance.sqrt() + self._least))


class ViewNet(BaseFeaturesExtractor):
    """Sees one image, or several and concatenates what it sees in each."""

    def __init__(self, observation_space: spaces.Space[Any], *, shared: bool) -> None:
        """Build a network per view, or one for all."""
        views = (
            observation_space.spaces
            if isinstance(observation_space, spaces.Dict)
            else {"": observation_space}
        )
        super().__init__(observation_space, WIDTH * len(views))
        self._names = sorted(views)
        shapes: list[Any] = [views[name].shape for name in self._names]
        built = [build_view(shape) for shape in (shapes[:1] if shared else shapes)]
        self._standards = nn.ModuleList(Standard(shape, 12.0) for shape in shapes)
        self._views = nn.ModuleList(built * len(shapes) if shared else built)

    def forward(self, seen: Any) -> torch.Tensor:
        """See each view, and put together what was seen.

        Args:
            seen: images (n, 3, h, w), floats from 0 to 255, or a dict of such by the view's name; they are
                not to be used afterwards.

        Returns:
            (n, `WIDTH` * views), the views in order of their names.
        """
        images = [seen[name] for name in self._names] if isinstance(seen, dict) else [seen]
        parts = zip(self._views, self._standards, images, strict=True)
        # What was (n, h, w, 3) still lies so in memory, where everything after takes three times as long.
        return torch.cat([view(standard(image.contiguous())) for view, standard, image in parts], dim=1)


class EncodedNet(BaseFeaturesExtractor):
    """Takes what a frozen encoder saw, standardized."""

    def __init__(self, observation_space: spaces.Box) -> None:
        """Begin with nothing known."""
        size = int(observation_space.shape[0])
        super().__init__(observation_space, size)
        self._standard = Standard((size,), 1e-3)

    def forward(self, seen: torch.Tensor) -> torch.Tensor:
        """Standardize features.

        Args:
            seen: (n, features), which stay as they are.

        Returns:
            (n, features), in deviations from the mean, none beyond 5.
        """
        return self._standard(seen.clone())
