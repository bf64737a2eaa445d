"""Policies and checkpoints as files of tensors and plain values, without pickled code."""

import copy
import math
from pathlib import Path
from typing import Any

import numpy as np
import torch
from stable_baselines3.common.base_class import BaseAlgorithm
from stable_baselines3.common.buffers import ReplayBuffer
from stable_baselines3.common.policies import BasePolicy

from dojo_env.learning.independent_learners import Independent, Policies
from dojo_env.learning.settings import RunFileError
from dojo_env.learning.tensor_files import load_tensors, save_tensors

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


def save_policy(policy: BasePolicy | Policies, path: Path) -> None:
    """Write the weights alone.

    Args:
        policy: of one signal or several.
        path: of the file, which is replaced whole.

    Raises:
        UsageError: the path is a folder, or lies in none.
        WriteError: the disk is full, or the folder cannot be written.
    """
    save_tensors(policy.state_dict(), path)


def load_policy(policy: BasePolicy | Policies, path: Path) -> None:
    """Take weights from a file.

    Args:
        policy: built with the settings that the weights were trained with; it is changed in place.
        path: of the file that `save_policy` wrote.

    Raises:
        RunFileError: the file is missing or damaged, or holds no weights, or those of another policy.
    """
    try:
        policy.load_state_dict(load_tensors(path))
    except (RuntimeError, TypeError, AttributeError) as error:
        problem = " ".join(str(error).split())[:300]
        raise RunFileError(
            path, f"weights of another policy; give the folder they were trained in ({problem})"
        ) from error


def save_checkpoint(model: BaseAlgorithm | Independent, path: Path, known: dict[str, Any]) -> None:
    """Write all that the next update depends on, between two episodes; and what the caller knows.

    Args:
        model: the algorithm, or one per signal.
        path: of the file, which is replaced whole.
        known: tensors and plain values, at least those of `Curve.known`, which `read_checkpoint` asks for.

    Raises:
        UsageError: the path is a folder, or lies in none.
        WriteError: the disk is full, or the folder cannot be written.
    """
    first, *others = model.models if isinstance(model, Independent) else [model]
    save_tensors(
        {**_read_state(first), "others": [_read_state(other) for other in others], "known": known}, path
    )


def _read_state(model: BaseAlgorithm) -> dict[str, Any]:
    return {
        "parameters": model.get_parameters(),
        "counters": {name: getattr(model, name) for name in _COUNTERS if hasattr(model, name)},
        "torch": torch.get_rng_state(),
        "numpy": _plain(np.random.get_state(legacy=True)),  # noqa: NPY002 - Stable-Baselines3 draws from it
        "actions": model.action_space.np_random.bit_generator.state,
        "buffer": _read_buffer(model),
    }


def read_checkpoint(path: Path) -> dict[str, Any]:
    """Read a checkpoint.

    Args:
        path: of the file that `save_checkpoint` wrote.

    Returns:
        What `restore_checkpoint` takes; what the caller knew is under `known`.

    Raises:
        RunFileError: the file is missing or damaged, or is no checkpoint.
    """
    state = load_tensors(path)
    if not isinstance(state, dict) or not state.keys() >= _STATE or not are_known(state.get("known")):
        raise RunFileError(path, "not a checkpoint; start anew in another folder")
    return state


def are_known(known: Any) -> bool:
    """Tell whether a checkpoint knows what a run's curve needs: its rows so far, and the best of them.

    Args:
        known: whatever a file holds in its place.

    Returns:
        True where `rows` are dicts with whole `steps`, and `best`, if it is there, is a float.
    """
    rows = known.get("rows") if isinstance(known, dict) else None
    return (
        isinstance(rows, list)
        and all(isinstance(row, dict) and isinstance(row.get("steps"), int) for row in rows)
        and isinstance(known.get("best", math.inf), float)
    )


def restore_checkpoint(
    model: BaseAlgorithm | Independent, state: dict[str, Any], path: Path
) -> dict[str, Any]:
    """Put a model, and the random numbers of torch and numpy, where they were.

    Args:
        model: built with the same settings; it is changed in place.
        state: what `read_checkpoint` gave.
        path: of the file, for errors.

    Returns:
        What the caller knew.

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


def _plain(state: Any) -> list[Any]:
    return [part.tolist() if isinstance(part, np.ndarray) else part for part in state]
