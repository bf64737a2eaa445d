"""Stable-Baselines3's algorithms over our networks; policies and checkpoints without pickled code."""

import copy
import math
import os
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import torch
from gymnasium import spaces
from stable_baselines3 import A2C, DQN, PPO
from stable_baselines3.common.base_class import BaseAlgorithm
from stable_baselines3.common.buffers import ReplayBuffer
from stable_baselines3.common.policies import BasePolicy
from stable_baselines3.common.vec_env import VecEnv
from torch.optim.swa_utils import AveragedModel

from dojo_env.errors import ConfigError

from .buffers import NStepDictReplayBuffer
from .independent import Independent, Policies
from .networks import EncodedNet, ViewNet
from .settings import RunFileError, Training
from .tensor_files import load, save
from .updates import BesideDQN, TwoThreadPPO

CLASSES: dict[str, type[BaseAlgorithm]] = {"ppo": PPO, "a2c": A2C, "dqn": DQN}
_SEEING = {"ppo": TwoThreadPPO, "dqn": BesideDQN}
"""What stands in for them where updates take long."""
_COUNTERS = (
    "num_timesteps",
    "_n_updates",
    "_n_calls",
    "_episode_num",
    "_current_progress_remaining",
    "exploration_rate",
)
_STATE = {"parameters", "counters", "torch", "numpy", "actions", "buffer"}
"""What a checkpoint tells of an algorithm."""
_BUFFERED = ("observations", "next_observations", "actions", "rewards", "dones", "timeouts")


def build_model(training: Training, environments: VecEnv) -> BaseAlgorithm | Independent:
    """Build the algorithm with fresh weights; for independent signals, as many as there are."""
    if training.agents == "independent":
        return Independent(training, environments, build_model)
    name, settings = describe_policy(training, environments.observation_space)
    known = dict(training.hyperparameters)
    rate = known.pop("learning_rate")
    if training.algorithm == "dqn":
        _check_memory(known["buffer_size"], environments.observation_space)
        if isinstance(environments.observation_space, spaces.Dict) and known["n_steps"] > 1:
            known["replay_buffer_class"] = NStepDictReplayBuffer
            known["replay_buffer_kwargs"] = {"n_steps": known.pop("n_steps"), "gamma": known["gamma"]}
    classes = {**CLASSES, **_SEEING} if training.parallel_updates else CLASSES
    return classes[training.algorithm](
        name,
        environments,
        seed=training.seed,
        device="auto" if training.sees else "cpu",
        policy_kwargs=settings,
        learning_rate=partial(_fall, rate),
        **known,
    )


def _check_memory(steps: int, observed: spaces.Space[Any]) -> None:
    """See that a replay buffer fits: memory fills while a run learns, and the system would end it then."""
    parts = observed.spaces.values() if isinstance(observed, spaces.Dict) else [observed]
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
    """Build the same policy without its algorithm, for another learner; images are (3, h, w) here."""
    name, settings = describe_policy(training, observed)
    return CLASSES[training.algorithm].policy_aliases[name](observed, actions, lambda _: 0.0, **settings)


def build_policies(training: Training, environments: VecEnv) -> BasePolicy | Policies:
    """Build what acts in such environments, whose images are (3, h, w); weights are to be loaded."""
    observed = environments.observation_space
    if training.agents != "independent":
        return build_policy(training, observed, environments.action_space)
    alone = (spaces.Discrete(count) for count in environments.phases)
    return Policies(build_policy(training, observed, actions) for actions in alone)


def average_weights(policy: BasePolicy | Policies) -> AveragedModel:
    """Copy a policy whose weights will be the average of all that `update_parameters` is given.

    The n-th counts as n ** 4 does (polynomial-decay averaging, Shamir and Zhang 2013): the average is mostly
    that of the last fifth.
    """
    return AveragedModel(policy, avg_fn=lambda mean, last, count: mean.lerp(last, 5 / (count + 5)))


def describe_policy(training: Training, observed: spaces.Space[Any]) -> tuple[str, dict[str, Any]]:
    """Tell the policy's name in Stable-Baselines3, and its settings."""
    settings: dict[str, Any] = {"net_arch": [128] if training.sees else [128, 128]}
    if training.sees:
        settings["normalize_images"] = False  # The network does, pixel by pixel.
        settings["features_extractor_class"] = ViewNet
        settings["features_extractor_kwargs"] = {
            "shared": training.shared_views,
            "patches": training.patches,
        }
        if training.algorithm == "dqn" and training.parallel_updates:
            settings["optimizer_kwargs"] = {"fused": True}  # A tenth of an update's time.
    elif training.encoder != "none":
        settings["features_extractor_class"] = EncodedNet
    several = isinstance(observed, spaces.Dict)
    return "MultiInputPolicy" if several else "CnnPolicy" if training.sees else "MlpPolicy", settings


def save_policy(policy: BasePolicy | Policies, path: Path) -> None:
    """Write the weights alone."""
    save(policy.state_dict(), path)


def load_policy(policy: BasePolicy | Policies, path: Path) -> None:
    """Take weights from a file.

    Raises:
        RunFileError: they are no weights, or those of another policy.
    """
    try:
        policy.load_state_dict(load(path))
    except (RuntimeError, TypeError, AttributeError) as error:
        problem = " ".join(str(error).split())[:300]
        raise RunFileError(
            path, f"weights of another policy; give the folder they were trained in ({problem})"
        ) from error


def save_checkpoint(model: BaseAlgorithm | Independent, path: Path, known: dict[str, Any]) -> None:
    """Write all that the next update depends on, between two episodes; and what the caller knows."""
    first, *others = model.models if isinstance(model, Independent) else [model]
    save({**_read_state(first), "others": [_read_state(other) for other in others], "known": known}, path)


def _read_state(model: BaseAlgorithm) -> dict[str, Any]:
    return {
        "parameters": model.get_parameters(),
        "counters": {name: getattr(model, name) for name in _COUNTERS if hasattr(model, name)},
        "torch": torch.get_rng_state(),
        "numpy": _plain(np.random.get_state()),  # noqa: NPY002 - Stable-Baselines3 draws from it
        "actions": model.action_space.np_random.bit_generator.state,
        "buffer": _read_buffer(model),
    }


def read_checkpoint(path: Path) -> dict[str, Any]:
    """Read a checkpoint.

    Raises:
        RunFileError: it is none.
    """
    state = load(path)
    if not isinstance(state, dict) or not state.keys() >= _STATE or not are_known(state.get("known")):
        raise RunFileError(path, "not a checkpoint; start anew in another folder")
    return state


def are_known(known: Any) -> bool:
    """Tell whether a checkpoint knows what a run's curve needs: its rows so far, and the best of them."""
    rows = known.get("rows") if isinstance(known, dict) else None
    return (
        isinstance(rows, list)
        and all(isinstance(row, dict) and isinstance(row.get("steps"), int) for row in rows)
        and isinstance(known.get("best", math.inf), float)
    )


def restore_checkpoint(
    model: BaseAlgorithm | Independent, state: dict[str, Any], path: Path
) -> dict[str, Any]:
    """Put a model where it was; returns what the caller knew.

    Raises:
        RunFileError: the checkpoint is another run's.
    """
    try:
        models = model.models if isinstance(model, Independent) else [model]
        for each, own in zip(models, [state, *state.get("others", [])], strict=True):
            _put_state(each, own)
    except (LookupError, TypeError, ValueError, AttributeError, RuntimeError) as error:
        raise RunFileError(
            path, f"another run's checkpoint ({error}); start anew in another folder"
        ) from error
    return state["known"]


def _put_state(model: BaseAlgorithm, state: dict[str, Any]) -> None:
    model.set_parameters(copy.deepcopy(state["parameters"]))  # Optimizers keep what they are given.
    for name in _COUNTERS:
        if name in state["counters"]:
            setattr(model, name, state["counters"][name])
    torch.set_rng_state(state["torch"])
    np.random.set_state(tuple(state["numpy"]))  # noqa: NPY002
    model.action_space.np_random.bit_generator.state = state["actions"]
    _fill_buffer(model, state["buffer"])


def _read_buffer(model: BaseAlgorithm) -> dict[str, Any]:
    buffer = getattr(model, "replay_buffer", None)
    if not isinstance(buffer, ReplayBuffer):
        return {}
    filled = buffer.buffer_size if buffer.full else buffer.pos
    arrays = {name: _map(lambda a: torch.from_numpy(a[:filled]), getattr(buffer, name)) for name in _BUFFERED}
    return {"pos": buffer.pos, "full": buffer.full, **arrays}


def _fill_buffer(model: BaseAlgorithm, state: dict[str, Any]) -> None:
    buffer = getattr(model, "replay_buffer", None)
    if not isinstance(buffer, ReplayBuffer):
        return
    for name in _BUFFERED:
        kept, array = state[name], getattr(buffer, name)
        for to, values in (
            [(array[key], kept[key]) for key in array] if isinstance(array, dict) else [(array, kept)]
        ):
            to[: len(values)] = values.numpy()
    buffer.pos, buffer.full = state["pos"], state["full"]


def _map(function: Any, value: Any) -> Any:
    return (
        {key: function(each) for key, each in value.items()} if isinstance(value, dict) else function(value)
    )


def _plain(state: tuple[Any, ...]) -> list[Any]:
    return [part.tolist() if isinstance(part, np.ndarray) else part for part in state]
