"""The network of lanes in torch: what `sensors.lane_network` runs."""

import numpy as np
import torch
from numpy.typing import NDArray
from torch import nn

from dojo_env.sensors.lane_network import CHANNELS, LAYERS


class LaneNet(nn.Module):
    """Tells from strips what is in each cell."""

    def __init__(self) -> None:
        """Begin with nothing known."""
        super().__init__()
        channels = CHANNELS
        layers = list[nn.Module]()
        for window, stride, padding, out in LAYERS.values():
            layers += [nn.Conv2d(channels, out, window, stride, padding), nn.ReLU()]
            channels = out
        self.layers = nn.Sequential(*layers[:-1])

    def forward(self, values: torch.Tensor) -> torch.Tensor:
        """Look at strips.

        Args:
            values: (n, rows, columns, channels) colours from -1 to 1, and geometry.

        Returns:
            (n, cells, 4) logits.
        """
        told: torch.Tensor = self.layers(values.permute(0, 3, 1, 2))[..., 0]
        return told.permute(0, 2, 1)

    def export(self) -> dict[str, NDArray[np.float32]]:
        """Give the weights as `lane_network` takes them."""
        found = {}
        layers = (layer for layer in self.layers if isinstance(layer, nn.Conv2d))
        for name, layer in zip(LAYERS, layers, strict=True):
            found[f"{name}_weight"] = layer.weight.detach().flatten(1).numpy().astype(np.float32)
            found[f"{name}_bias"] = layer.get_parameter("bias").detach().numpy().astype(np.float32)
        return found
