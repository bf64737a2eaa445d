"""The network of lanes in torch: what `sensors.lane_network` runs."""

import numpy as np
import torch
from numpy.typing import NDArray
from torch import nn

from dojo_env.sensors.lane_network import CHANNELS, LAYERS

_RARELY, _EPSILON = -3.0, 1e-5
"""The logits with which it begins; and what keeps torch's normalising from dividing by 0."""


class LaneNet(nn.Module):
    """Tells from strips what is in each cell."""

    def __init__(self) -> None:
        """Begin with little anywhere, as it is on most streets."""
        super().__init__()
        channels, layers = CHANNELS, list[nn.Module]()
        for window, stride, padding, out in LAYERS.values():
            layers += [nn.Conv2d(channels, out, window, stride, padding), nn.BatchNorm2d(out), nn.ReLU()]
            channels = out
        self.layers = nn.Sequential(*layers[:-2])
        nn.init.constant_(layers[-3].get_parameter("bias"), _RARELY)

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
        """Give the weights as `lane_network` takes them: what normalises is part of the convolutions."""
        found, layers = {}, list(self.layers)
        for number, name in enumerate(LAYERS):
            weight, bias = (layers[3 * number].get_parameter(part).detach() for part in ("weight", "bias"))
            if 3 * number + 1 < len(layers):
                norm = layers[3 * number + 1]
                mean, spread = norm.get_buffer("running_mean"), norm.get_buffer("running_var")
                scale = norm.get_parameter("weight").detach() / (spread + _EPSILON).sqrt()
                weight = weight * scale[:, None, None, None]
                bias = (bias - mean) * scale + norm.get_parameter("bias").detach()
            found[f"{name}_weight"] = weight.flatten(1).numpy().astype(np.float32)
            found[f"{name}_bias"] = bias.numpy().astype(np.float32)
        return found
