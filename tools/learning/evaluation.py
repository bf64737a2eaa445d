"""What a policy is worth: whole episodes without exploration, measured as everything else is."""

from collections.abc import Sequence
from contextlib import closing
from pathlib import Path
from typing import Any

import numpy as np
from stable_baselines3.common.policies import BasePolicy
from stable_baselines3.common.vec_env import VecEnv, VecTransposeImage

from .environments import open_evaluation
from .independent import Policies
from .machine import prepare_process
from .models import build_policies, load_policy
from .settings import POLICY, Training


def evaluate(
    policy: BasePolicy | Policies, environments: VecEnv
) -> tuple[list[dict[str, Any]], list[dict[str, Any]]]:
    """Run one episode in each environment, side by side.

    Episodes have one length, so they end together.

    Returns:
        The figures of each, in the environments' order, and every `info` of the first.
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
    """Evaluate a trained policy, an episode per seed; `changes` are settings of the environment.

    Returns:
        What `evaluate` does.
    """
    prepare_process()
    environments = open_evaluation(training, seeds, **changes)
    with closing(VecTransposeImage(environments) if training.sees else environments) as environments:
        policy = build_policies(training, environments)
        load_policy(policy, folder / POLICY)
        return evaluate(policy, environments)
