"""CoLight: a signal attends to what the signals near it observe; one policy for all.

Source: Wei et al., CoLight: learning network-level cooperation for traffic signal control, CIKM 2019.
"""

from typing import Any

import torch
from gymnasium import spaces
from stable_baselines3.common.torch_layers import BaseFeaturesExtractor
from torch import nn

_WIDTH, _HEADS = 64, 4


class NeighbourAttention(BaseFeaturesExtractor):
    """What a signal observes, beside what it attends to in its neighbourhood."""

    def __init__(self, observation_space: spaces.Dict) -> None:
        """Build the network for `network_observations.Neighbours`."""
        super().__init__(observation_space, 2 * _WIDTH)
        (seen,) = observation_space["own"].shape or ()
        self._embed = nn.Sequential(nn.Linear(seen, _WIDTH), nn.ReLU(), nn.Linear(_WIDTH, _WIDTH), nn.ReLU())
        self._attend = nn.MultiheadAttention(_WIDTH, _HEADS, batch_first=True)

    def forward(self, observations: Any) -> torch.Tensor:
        """Describe each signal's own observation and what it attends to near it.

        Args:
            observations: n of `network_observations.Neighbours`, by name: `own` (n, w), `everyone`
                (n, signals, w) and `near` (n, signals).

        Returns:
            (n, features), one half from `own`, the other from those that are near.
        """
        own, everyone = self._embed(observations["own"]), self._embed(observations["everyone"])
        far = observations["near"] == 0
        attended, _ = self._attend(own[:, None], everyone, everyone, key_padding_mask=far, need_weights=False)
        return torch.cat([own, attended[:, 0].relu()], dim=1)
