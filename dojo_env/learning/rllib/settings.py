"""A training's settings in RLlib's words."""

import dataclasses
from typing import Any

from ray.rllib.algorithms.algorithm_config import AlgorithmConfig
from ray.rllib.algorithms.dqn import DQNConfig
from ray.rllib.algorithms.ppo import PPOConfig
from ray.rllib.core.rl_module.rl_module import RLModuleSpec

from dojo_env.learning.rllib.modules import MODULES
from dojo_env.learning.settings import Training

ENVIRONMENT = "dojo"
FIGURES = "figures"
_PACKET = 4
"""Decisions of a DQN runner between two updates of its weights: each answer over the network takes time."""


def build_config(training: Training, *, done: int) -> AlgorithmConfig:
    """Describe a run that goes on after so many steps.

    Args:
        training: the run's settings, of PPO or DQN.
        done: steps of all environments together; learning rate, exploration and seeds go on from there.

    Returns:
        What builds RLlib's algorithm; `ENVIRONMENT` is to be registered before.
    """
    config, exploration = (_describe_ppo if training.algorithm == "ppo" else _describe_dqn)(training, done)
    return (
        config.environment(ENVIRONMENT, env_config={"training": training, "done": done},
                           disable_env_checking=True)
        .env_runners(num_env_runners=training.processes, num_envs_per_env_runner=1, sample_timeout_s=600,
                     explore=True)
        .learners(num_learners=0)
        # A lost runner is started again wherever there is room; until then the others go on.
        .fault_tolerance(restart_failed_env_runners=True, max_num_env_runner_restarts=1_000_000,
                         delay_between_env_runner_restarts_s=0, env_runner_health_probe_timeout_s=1)
        .rl_module(rl_module_spec=RLModuleSpec(
            MODULES[training.algorithm],
            model_config={"training": dataclasses.asdict(training), **exploration},
        ))
        .callbacks(on_episode_end=_keep_figures)
        .reporting(min_time_s_per_iteration=0)
        .debugging(seed=training.seed, log_level="CRITICAL")
    )  # fmt: skip


def _describe_ppo(training: Training, done: int) -> tuple[AlgorithmConfig, dict[str, Any]]:
    known = training.hyperparameters
    config = PPOConfig().training(
        lr=_fall(known["learning_rate"], 0, training.whole_steps, done),
        gamma=known["gamma"],
        lambda_=known["gae_lambda"],
        train_batch_size=known["n_steps"] * training.processes,
        minibatch_size=known["batch_size"],
        num_epochs=known["n_epochs"],
        entropy_coeff=known["ent_coef"],
        clip_param=known["clip_range"],
        # What Stable-Baselines3 does, and what our settings were found with.
        use_kl_loss=False, vf_loss_coeff=0.5, vf_clip_param=float("inf"), grad_clip=0.5,
        grad_clip_by="global_norm",
    )  # fmt: skip
    return config.env_runners(rollout_fragment_length=known["n_steps"]), {}


def _describe_dqn(training: Training, done: int) -> tuple[AlgorithmConfig, dict[str, Any]]:
    known = training.hyperparameters
    epsilon = _fall(
        1, known["exploration_final_eps"], training.whole_steps * known["exploration_fraction"], done
    )
    # RLlib's intensity counts a runner that does not exist.
    intensity = known["gradient_steps"] * known["batch_size"] / known["train_freq"] / (training.processes + 1)
    config = DQNConfig().training(
        lr=_fall(known["learning_rate"], 0, training.whole_steps, done),
        gamma=known["gamma"],
        train_batch_size=known["batch_size"],
        replay_buffer_config={"type": "EpisodeReplayBuffer", "capacity": known["buffer_size"]},
        num_steps_sampled_before_learning_starts=known["learning_starts"],
        target_network_update_freq=known["target_update_interval"],
        training_intensity=intensity,
        epsilon=epsilon,
        n_step=known["n_steps"],
        double_q=False, dueling=False, num_atoms=1, td_error_loss_fn="huber", grad_clip=10.0,
        grad_clip_by="global_norm",
    )  # fmt: skip
    config.env_runners(rollout_fragment_length=_PACKET * known["train_freq"])
    config.reporting(min_sample_timesteps_per_iteration=training.round_steps)
    return config, {"epsilon": epsilon}


def _fall(first: float, last: float, until: float, done: int) -> list[list[float]]:
    """Give RLlib's schedule of a value that falls, as a run sees it that goes on after some steps.

    Args:
        first: the value at the run's beginning.
        last: the value from `until` on.
        until: steps.
        done: steps, too.
    """
    now = last + (first - last) * max(1 - done / until, 0.0)
    return [[0, now], [max(round(until) - done, 1), last]]


def _keep_figures(*, episode: Any, metrics_logger: Any, **_keywords: Any) -> None:
    """Send an episode's figures to the driver."""
    metrics_logger.log_value(FIGURES, episode.get_infos(-1)[FIGURES], reduce="item_series")
