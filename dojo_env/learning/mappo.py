"""MAPPO: signals act on what they observe themselves; while they learn, one critic knows what all observe.

Source: Yu et al., The surprising effectiveness of PPO in cooperative multi-agent games, NeurIPS 2022.
"""

from typing import Any

import torch
from gymnasium import spaces
from stable_baselines3.common.policies import MultiInputActorCriticPolicy
from stable_baselines3.common.torch_layers import BaseFeaturesExtractor, MlpExtractor
from torch import nn


class OwnAndEveryone(BaseFeaturesExtractor):
    """Puts `network_observations.Neighbours` into a row: the signal's own first, then everyone's."""

    def __init__(self, observation_space: spaces.Dict) -> None:
        """Measure the row."""
        (own,), (count, width) = (observation_space[name].shape or () for name in ("own", "everyone"))
        super().__init__(observation_space, own + count * width)

    def forward(self, observations: Any) -> torch.Tensor:
        """Put observations into rows.

        Args:
            observations: n of `network_observations.Neighbours`, by name: `own` (n, w) and `everyone`
                (n, signals, w).

        Returns:
            (n, w + signals * w), the signal's own first.
        """
        return torch.cat([observations["own"], observations["everyone"].flatten(1)], dim=1)


class _OwnForTheActor(MlpExtractor):
    """Two networks: the actor's sees the row's first values alone."""

    def __init__(self, own: int, whole: int, layers: list[int]) -> None:
        super().__init__(whole, net_arch={"pi": [], "vf": layers}, activation_fn=nn.Tanh)
        actor = MlpExtractor(own, net_arch={"pi": layers, "vf": []}, activation_fn=nn.Tanh)
        self._own, self.policy_net, self.latent_dim_pi = own, actor.policy_net, actor.latent_dim_pi

    def forward_actor(self, features: torch.Tensor) -> torch.Tensor:
        return self.policy_net(features[:, : self._own])


class CentralCritic(MultiInputActorCriticPolicy):
    """For PPO and A2C."""

    def _build_mlp_extractor(self) -> None:
        known: Any = self.observation_space
        layers: Any = self.net_arch
        self.mlp_extractor = _OwnForTheActor(known["own"].shape[0], self.features_dim, layers)
