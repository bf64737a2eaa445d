"""What a policy is worth: whole episodes without exploration, measured as everything else is."""

from collections.abc import Sequence
from contextlib import closing
from pathlib import Path
from typing import Any

import numpy as np
from stable_baselines3.common.vec_env import VecEnv, VecTransposeImage

from dojo_env.learning.algorithms import build_policies
from dojo_env.learning.checkpoints import load_policy
from dojo_env.learning.environments import open_evaluation
from dojo_env.learning.process_setup import prepare_process
from dojo_env.learning.settings import POLICY, Training


def evaluate(policy: Any, environments: VecEnv) -> tuple[list[dict[str, Any]], list[dict[str, Any]]]:
    """Run one episode in each environment, side by side.

    Episodes have one length, so they end together.

    Args:
        policy: what has Stable-Baselines3's `predict`; it does not explore.
        environments: as `open_evaluation` opens them.

    Returns:
        The figures of each, in the environments' order, and every `info` of the first.

    Raises:
        SimulationError: an environment's process has ended.
    """
    seen, first = environments.reset(), []
    while True:
        actions, _ = policy.predict(seen, deterministic=True)
        seen, _, ended, infos = environments.step(actions)
        first.append(infos[0])
        if np.all(ended):
            return [info["figures"] for info in infos if "figures" in info], first


def run_policy(
    training: Training, folder: Path, seeds: Sequence[int], **changes: Any
) -> tuple[list[dict[str, Any]], list[dict[str, Any]]]:
    """Evaluate a trained policy, an episode per seed.

    Args:
        training: the settings that it was trained with.
        folder: of its run, where its weights are.
        seeds: of the episodes.
        changes: settings of the environment that take the place of the training's.

    Returns:
        What `evaluate` does.

    Raises:
        RunFileError: the folder holds no weights, or those of another policy.
        ConfigError: the encoder cannot be loaded.
        SimulationError: an environment's process has ended.
    """
    prepare_process()
    environments = open_evaluation(training, seeds, **changes)
    with closing(VecTransposeImage(environments) if training.sees else environments) as environments:
        acting: Any = environments.action_space
        phases = getattr(environments, "phases", None) or (int(acting.n),)
        policy = build_policies(training, environments.observation_space, phases)
        load_policy(policy, folder / POLICY)
        return evaluate(policy, environments)
