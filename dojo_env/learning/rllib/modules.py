"""Stable-Baselines3's policies as RLlib's modules: both learners train and write the same networks."""

from typing import Any

import torch
from ray.rllib.algorithms.dqn.dqn_learner import QF_PREDS
from ray.rllib.algorithms.dqn.torch.default_dqn_torch_rl_module import DefaultDQNTorchRLModule
from ray.rllib.core.columns import Columns
from ray.rllib.core.learner.utils import make_target_network
from ray.rllib.core.rl_module.apis.value_function_api import ValueFunctionAPI
from ray.rllib.core.rl_module.torch import TorchRLModule
from ray.rllib.utils.schedules.scheduler import Scheduler
from stable_baselines3.common.policies import BasePolicy

from dojo_env.learning.algorithms import build_policy
from dojo_env.learning.settings import Training


class PPOModule(TorchRLModule, ValueFunctionAPI):
    """PPO's policy and values."""

    def setup(self) -> None:
        """Build the network."""
        training = Training(**self.model_config["training"])
        self.net: Any = build_policy(training, self.observation_space, self.action_space)

    @property
    def policy(self) -> BasePolicy:
        """What is evaluated and kept."""
        return self.net

    def _forward(self, batch: dict[str, Any], **_keywords: Any) -> dict[str, Any]:
        latent, _ = self.net.mlp_extractor(self.net.extract_features(batch[Columns.OBS]))
        return {Columns.ACTION_DIST_INPUTS: self.net.action_net(latent)}

    def compute_values(self, batch: dict[str, Any], embeddings: Any = None) -> torch.Tensor:  # noqa: ARG002
        """Tell what states are worth.

        Args:
            batch: n observations, under `Columns.OBS`.
            embeddings: have no effect: the network reads the observations again.

        Returns:
            (n,) values.
        """
        return self.net.predict_values(batch[Columns.OBS]).squeeze(-1)


class DQNModule(DefaultDQNTorchRLModule):
    """DQN's values of actions; exploration and what the loss needs are RLlib's."""

    def __init__(self, *arguments: Any, **keywords: Any) -> None:
        """Leave out RLlib's catalogue of networks, which knows no sets of views."""
        TorchRLModule.__init__(self, *arguments, **keywords)

    def setup(self) -> None:
        """Build the network."""
        training = Training(**self.model_config["training"])
        policy = build_policy(training, self.observation_space, self.action_space)
        self.net: Any = policy.q_net
        object.__setattr__(self, "policy", policy)  # Its own target is no parameter to optimise.
        self.uses_double_q, self.uses_dueling, self.num_atoms = False, False, 1
        self.epsilon_schedule = Scheduler(self.model_config["epsilon"], framework=self.framework)

    def get_initial_state(self) -> dict[str, Any]:
        """Tell that nothing is remembered from decision to decision."""
        return {}

    def make_target_networks(self) -> None:
        """Copy the network, once the optimizer has its parameters."""
        self._target = make_target_network(self.net)

    def get_non_inference_attributes(self) -> list[str]:
        """Tell what environment runners do without."""
        return ["_target"]

    def get_target_network_pairs(self) -> list[tuple[Any, Any]]:
        """Tell what is copied where now and then."""
        return [(self.net, self._target)]

    def compute_q_values(self, batch: dict[str, Any]) -> dict[str, Any]:
        """Tell what actions are worth.

        Args:
            batch: n observations, under `Columns.OBS`.

        Returns:
            (n, actions) values, under `QF_PREDS`.
        """
        return {QF_PREDS: self.net(batch[Columns.OBS])}

    def forward_target(self, batch: dict[str, Any]) -> dict[str, Any]:
        """Tell what actions are worth by the network as it was some time ago.

        Args:
            batch: n observations, under `Columns.OBS`.

        Returns:
            (n, actions) values, under `QF_PREDS`.
        """
        return {QF_PREDS: self._target(batch[Columns.OBS])}


MODULES = {"ppo": PPOModule, "dqn": DQNModule}
