"""Stable-Baselines3's algorithms over our networks, from a run's settings."""

import math
import os
from collections.abc import Mapping, Sequence
from functools import partial
from typing import Any

from gymnasium import spaces
from stable_baselines3 import A2C, DQN, PPO
from stable_baselines3.common.base_class import BaseAlgorithm
from stable_baselines3.common.logger import Logger
from stable_baselines3.common.policies import BasePolicy
from stable_baselines3.common.torch_layers import BaseFeaturesExtractor
from torch.optim.swa_utils import AveragedModel

from dojo_env.errors import ConfigError
from dojo_env.learning.colight import NeighbourAttention
from dojo_env.learning.frap import FrapActorCritic, FrapDQN, PhasePairs
from dojo_env.learning.independent_learners import Independent, Policies
from dojo_env.learning.mappo import CentralCritic, OwnAndEveryone
from dojo_env.learning.networks import EncodedNet, ViewNet
from dojo_env.learning.replay_buffer import NStepDictReplayBuffer
from dojo_env.learning.settings import Training
from dojo_env.learning.updates import BesideDQN, TwoThreadPPO

CLASSES: dict[str, type[BaseAlgorithm]] = {"ppo": PPO, "a2c": A2C, "dqn": DQN}
_SEEING = {"ppo": TwoThreadPPO, "dqn": BesideDQN}
"""What stands in for them where updates take long."""
_EXTRACTORS: dict[str, type[BaseFeaturesExtractor]] = {
    "images": ViewNet,
    "encoder": EncodedNet,
    "frap": PhasePairs,
    "colight": NeighbourAttention,
    "mappo": OwnAndEveryone,
}
"""What reads observations that need more than layers."""
_POLICIES: dict[tuple[str, str], type[BasePolicy]] = {
    ("frap", "ppo"): FrapActorCritic,
    ("frap", "a2c"): FrapActorCritic,
    ("frap", "dqn"): FrapDQN,
    ("mappo", "ppo"): CentralCritic,
    ("mappo", "a2c"): CentralCritic,
}
"""Policies with heads of their own, by network and algorithm."""


def build_model(training: Training, environments: Any) -> Any:
    """Build the algorithm with fresh weights.

    Args:
        training: the run's settings.
        environments: what it learns in; an `AgentsVecEnv` where signals are several.

    Returns:
        A model of Stable-Baselines3's, or an `Independent` of as many as there are signals.

    Raises:
        ConfigError: DQN's replay buffer needs more memory than this machine has.
    """
    if training.agents == "independent":
        return Independent(training, environments, build_model)
    policy, settings = describe_policy(training, environments.observation_space)
    known = dict(training.hyperparameters)
    rate = known.pop("learning_rate")
    if training.algorithm == "dqn":
        _check_memory(known["buffer_size"], environments.observation_space)
        if isinstance(environments.observation_space, spaces.Dict) and known["n_steps"] > 1:
            known["replay_buffer_class"] = NStepDictReplayBuffer
            known["replay_buffer_kwargs"] = {"n_steps": known.pop("n_steps"), "gamma": known["gamma"]}
    classes: Mapping[str, Any] = {**CLASSES, **_SEEING} if training.sees else CLASSES
    model = classes[training.algorithm](
        policy,
        environments,
        seed=training.seed,
        device="auto" if training.sees else "cpu",
        policy_kwargs=settings,
        learning_rate=partial(_fall, rate),
        **known,
    )
    model.set_logger(Logger(None, []))  # The default one makes a folder among the system's temporary files.
    return model


def _check_memory(steps: int, observed: spaces.Space[Any]) -> None:
    """See that a replay buffer fits: memory fills while a run learns, and the system would end it then."""
    parts: Any = observed.spaces.values() if isinstance(observed, spaces.Dict) else [observed]
    needed = 2 * steps * sum(math.prod(part.shape) * part.dtype.itemsize for part in parts) / 2**30
    there = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES") / 2**30
    if needed > there:
        raise ConfigError(
            f"buffer_size={steps}: so many observations need {needed:,.0f} GiB, and this machine has "
            f"{there:,.0f}; keep fewer, or smaller images"
        )


def _fall(rate: float, left: float) -> float:
    """Give the learning rate when a share of the run is left."""
    return rate * left


def build_policy(training: Training, observed: spaces.Space[Any], actions: spaces.Space[Any]) -> BasePolicy:
    """Build the policy that `build_model` would train, without its algorithm, for another learner.

    Args:
        training: the run's settings.
        observed: what one signal observes; images are (3, h, w).
        actions: the phases to choose from.

    Returns:
        A policy with fresh weights.
    """
    policy, settings = describe_policy(training, observed)
    return policy(observed, actions, lambda _: 0.0, **settings)


def build_policies(
    training: Training, observed: spaces.Space[Any], phases: Sequence[int]
) -> BasePolicy | Policies:
    """Build what acts for one signal or several; weights are to be loaded.

    Args:
        training: the run's settings.
        observed: what one signal observes; images are (3, h, w).
        phases: how many each signal has.

    Returns:
        One policy for all, with as many actions as the most phases; or, of independent learners, one for each
        signal in the order of `phases`.
    """
    if training.agents != "independent":
        return build_policy(training, observed, spaces.Discrete(max(phases)))
    return Policies(build_policy(training, observed, spaces.Discrete(count)) for count in phases)


def average_weights(policy: BasePolicy | Policies) -> AveragedModel:
    """Copy a policy whose weights will be the average of all that `update_parameters` is given.

    The n-th counts as n ** 4 does (polynomial-decay averaging, Shamir and Zhang 2013): the average is mostly
    that of the last fifth.

    Args:
        policy: is copied; its present weights do not count.

    Returns:
        The copy, in `module`, with what updates it.
    """
    return AveragedModel(policy, avg_fn=lambda mean, last, count: mean.lerp(last, 5 / (count + 5)))


def describe_policy(
    training: Training, observed: spaces.Space[Any]
) -> tuple[type[BasePolicy], dict[str, Any]]:
    """Tell the policy's class, and its settings.

    Args:
        training: the run's settings.
        observed: what one signal observes; it only matters whether that is a dict.

    Returns:
        The class, and keywords for it beside spaces and learning rate: Stable-Baselines3's `policy_kwargs`.
    """
    settings: dict[str, Any] = {"net_arch": [128] if training.sees else [128, 128]}
    if training.sees:
        settings["normalize_images"] = False  # The network does, pixel by pixel.
        settings["features_extractor_kwargs"] = {"shared": training.shared_views}
        if training.algorithm == "dqn":
            settings["optimizer_kwargs"] = {"fused": True}  # A tenth of an update's time.
    extractor = _EXTRACTORS.get(_name_network(training))
    if extractor is not None:
        settings["features_extractor_class"] = extractor
    several = isinstance(observed, spaces.Dict)
    alias = "MultiInputPolicy" if several else "CnnPolicy" if training.sees else "MlpPolicy"
    usual = CLASSES[training.algorithm].policy_aliases[alias]
    return _POLICIES.get((training.network, training.algorithm), usual), settings


def _name_network(training: Training) -> str:
    """Tell what reads the observations."""
    if training.network != "usual":
        return training.network
    return "images" if training.sees else "encoder" if training.encoder != "none" else "usual"
