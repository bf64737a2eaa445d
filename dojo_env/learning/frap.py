"""FRAP: phases compete in pairs for the green, by the demand of the movements that they serve.

One network judges every movement and every pair of phases. So it does not matter how many there are, how they
are numbered, or from where a junction is looked at. Trained by DQN with one policy for all signals it is
MPLight.

Source: Zheng et al., Learning phase competition for traffic signal control (FRAP), CIKM 2019; Chen et al.,
Toward a thousand lights (MPLight), AAAI 2020.
"""

from typing import Any

import torch
from gymnasium import spaces
from stable_baselines3.common.policies import MultiInputActorCriticPolicy
from stable_baselines3.common.torch_layers import BaseFeaturesExtractor
from stable_baselines3.dqn.policies import MultiInputPolicy, QNetwork
from torch import nn

_DEMAND, _PAIR = 16, 20
"""Features of a movement's demand, and of a pair of phases."""
_NEVER = -1e6
"""The score of a phase that a signal does not have."""


class PhasePairs(BaseFeaturesExtractor):
    """Scores of the phases, and the worth of the junction's state, as one row of (phases + 1,) values."""

    def __init__(self, observation_space: spaces.Dict) -> None:
        """Build the network for `network_observations.Movements`."""
        (self._phases, _), (_, features) = (
            observation_space[name].shape or () for name in ("serves", "movements")
        )
        super().__init__(observation_space, self._phases + 1)
        self._movement = nn.Sequential(nn.Linear(features, _DEMAND), nn.ReLU())
        self._demand = nn.Sequential(nn.Linear(2 * (_DEMAND + 1), _PAIR), nn.ReLU())
        self._relation = nn.Sequential(nn.Linear(1, _PAIR), nn.ReLU())
        self._compete = nn.Sequential(nn.Linear(_PAIR, _PAIR), nn.ReLU(), nn.Linear(_PAIR, 1))
        self._value = nn.Sequential(nn.Linear(_DEMAND + 1, _PAIR), nn.ReLU(), nn.Linear(_PAIR, 1))

    def forward(self, observations: Any) -> torch.Tensor:
        """Judge n junctions at once.

        Args:
            observations: n of `network_observations.Movements`, by name: `movements` (n, m, features),
                `serves` (n, phases, m), `mask` (n, phases) and `may_change` (n, 1).

        Returns:
            (n, phases + 1): the phases' scores, -1e6 where there is no phase, and the worth of the state.
        """
        serves, mask = observations["serves"], observations["mask"]
        demand = serves @ self._movement(observations["movements"])
        may_change = observations["may_change"][:, None].expand(-1, self._phases, -1)
        demand = torch.cat([demand, may_change], dim=2)
        own = demand[:, :, None].expand(-1, -1, self._phases, -1)
        pair = self._demand(torch.cat([own, own.transpose(1, 2)], dim=3))
        shared = (serves @ serves.transpose(1, 2) > 0).to(serves.dtype)
        won = self._compete(pair * self._relation(shared[..., None]))[..., 0]
        others = mask[:, None] * (1 - torch.eye(self._phases, device=mask.device))
        scores = (won * others).sum(2).masked_fill(mask == 0, _NEVER)
        worth = self._value((demand * mask[..., None]).sum(1))
        return torch.cat([scores, worth], dim=1)


class _Columns(nn.Module):
    """Takes some of a row's values as they are."""

    def __init__(self, start: int, end: int | None) -> None:
        super().__init__()
        self._start, self._end = start, end

    def forward(self, values: torch.Tensor) -> torch.Tensor:
        return values[:, self._start : self._end]


class _Rows(nn.Module):
    """Hands actor and critic the whole row."""

    latent_dim_pi = latent_dim_vf = 1

    def forward(self, values: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor]:
        return values, values

    def forward_actor(self, values: torch.Tensor) -> torch.Tensor:
        return values

    def forward_critic(self, values: torch.Tensor) -> torch.Tensor:
        return values


class FrapActorCritic(MultiInputActorCriticPolicy):
    """For PPO and A2C: scores are the logarithms of chances."""

    def _build(self, lr_schedule: Any) -> None:
        super()._build(lr_schedule)
        self.action_net = _Columns(0, int(self.action_space.n))  # type: ignore[attr-defined]  # discrete
        self.value_net = _Columns(-1, None)  # type: ignore[assignment]  # as a layer
        make: Any = self.optimizer_class
        self.optimizer = make(self.parameters(), lr=lr_schedule(1), **self.optimizer_kwargs)

    def _build_mlp_extractor(self) -> None:
        self.mlp_extractor = _Rows()  # type: ignore[assignment]  # with the same methods


class FrapDQN(MultiInputPolicy):
    """For DQN: scores are what the phases are worth."""

    def make_q_net(self) -> QNetwork:
        """Let the scores themselves be the values."""
        net = super().make_q_net()
        net.q_net = _Columns(0, int(self.action_space.n))  # type: ignore[attr-defined, assignment]
        return net
