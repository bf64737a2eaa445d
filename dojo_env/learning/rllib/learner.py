"""One training run on a Ray cluster: runners on its nodes simulate, this process learns."""

import logging
from collections.abc import Callable, Iterator
from contextlib import closing, contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from ray.rllib.algorithms.algorithm import Algorithm
from ray.rllib.core import DEFAULT_MODULE_ID
from ray.rllib.core.learner.learner import Learner
from ray.rllib.utils.metrics import ENV_RUNNER_RESULTS, NUM_ENV_STEPS_SAMPLED_LIFETIME
from ray.tune.registry import register_env
from ray.tune.trainable import trainable

from dojo_env.learning.checkpoints import are_known
from dojo_env.learning.environments import VALIDATION_SEEDS, open_environment, open_evaluation
from dojo_env.learning.learner import prepare_folder
from dojo_env.learning.process_setup import prepare_process
from dojo_env.learning.progress import Curve
from dojo_env.learning.rllib.settings import ENVIRONMENT, FIGURES, build_config
from dojo_env.learning.settings import CHECKPOINT, RunFileError, Training, check_folder, read_training
from dojo_env.learning.tensor_files import load_tensors, save_tensors
from dojo_maps.progress import say


def train(
    training: Training, folder: Path, *, resume: bool = False, tell: Callable[[str], None] = say
) -> None:
    """Train on the cluster that is connected, and keep the same files as without one.

    Args:
        training: all that the run is described by; `processes` are runners on the cluster's nodes.
        folder: where all of it goes.
        resume: go on from the folder's checkpoint.
        tell: takes lines of how far it is.

    Raises:
        ConfigError: the folder holds another run, or the checkpoint is another's.
        SimulationError: SUMO stopped in a validation.
    """
    check_folder(training, folder, read_training, resume=resume)
    known: dict[str, Any] = read_checkpoint(folder / CHECKPOINT) if resume else {"steps": 0}
    prepare_process()
    begun = known["steps"]
    with (
        closing(open_evaluation(training, VALIDATION_SEEDS)) as validation,
        _open_algorithm(training, begun) as algorithm,
    ):
        if not resume:
            prepare_folder(training, folder)  # Not before: all that may be wrong has been opened.
        curve, learner = Curve(training, folder, tell), algorithm.learner_group._learner
        if resume:
            curve.resume(known["known"])
            restore(algorithm, known, folder / CHECKPOINT)
        apart = training.every * training.round_steps
        steps, due, runners = begun, begun + apart, training.processes
        while steps < training.whole_steps:
            found = algorithm.train().get(ENV_RUNNER_RESULTS, {})
            runners = _tell_runners(algorithm, runners, tell)
            steps = begun + int(found.get(NUM_ENV_STEPS_SAMPLED_LIFETIME, steps - begun))
            curve.pace.note(steps)
            if figures := found.get(FIGURES):
                # RLlib hands over a series of one without its list.
                curve.add(steps, "training", figures if isinstance(figures, list) else [figures])
            if steps >= min(due, training.whole_steps):
                due += apart
                curve.validate(steps, learner.module[DEFAULT_MODULE_ID].policy, validation)
                save_checkpoint(learner, folder / CHECKPOINT, {"steps": steps, "known": curve.known})


@contextmanager
def _open_algorithm(training: Training, done: int) -> Iterator[Algorithm]:
    logging.getLogger("ray.rllib").setLevel(logging.CRITICAL)  # We tell ourselves when runners are lost.
    register_env(ENVIRONMENT, open_environment)
    with TemporaryDirectory() as folder:
        trainable.DEFAULT_STORAGE_PATH = folder  # Else each run leaves a folder in the user's home.
        algorithm = build_config(training, done=done).build_algo()
        try:
            yield algorithm
        finally:
            algorithm.stop()


def _tell_runners(algorithm: Algorithm, before: int, tell: Callable[[str], None]) -> int:
    now = algorithm.env_runner_group.num_healthy_remote_workers()
    if now != before:
        tell(f"{now} of {algorithm.config.num_env_runners} runners are there")
    return now


def save_checkpoint(learner: Learner, path: Path, known: dict[str, Any]) -> None:
    """Write what the next update depends on, replay and the runners' random states aside.

    Args:
        learner: RLlib's, with the network and what optimises it.
        path: of the file, which is replaced whole.
        known: the run's `steps`, and under `known` what its `Curve` knows.

    Raises:
        UsageError: the path is a folder, or lies in none.
        WriteError: the disk is full, or the folder cannot be written.
    """
    optimizers = [optimizer.state_dict() for _, optimizer in learner.get_optimizers_for_module()]
    save_tensors(
        {"module": learner.module[DEFAULT_MODULE_ID].state_dict(), "optimizers": optimizers, **known}, path
    )


def read_checkpoint(path: Path) -> dict[str, Any]:
    """Read a checkpoint of a cluster's run.

    Args:
        path: of the file that `save_checkpoint` wrote.

    Returns:
        The network's state under `module`, that of the `optimizers`, and what `save_checkpoint` was told.

    Raises:
        RunFileError: the file is missing or damaged, or is no such checkpoint.
    """
    state = load_tensors(path)
    if not isinstance(state, dict) or not {"module", "optimizers", "steps"} <= state.keys():
        raise RunFileError(path, "not from a cluster; go on without --ray, or name another --out")
    if not isinstance(state["steps"], int) or not are_known(state.get("known")):
        raise RunFileError(path, "not a checkpoint; name another --out")
    return state


def restore(algorithm: Algorithm, state: dict[str, Any], path: Path) -> None:
    """Put learner and runners where they were.

    Args:
        algorithm: built with the same settings; it is changed in place.
        state: what `read_checkpoint` gave.
        path: of the file, for errors.

    Raises:
        RunFileError: the checkpoint is another run's.
    """
    learner = algorithm.learner_group._learner
    try:
        learner.module[DEFAULT_MODULE_ID].load_state_dict(state["module"])
        for (_, optimizer), known in zip(
            learner.get_optimizers_for_module(), state["optimizers"], strict=True
        ):
            optimizer.load_state_dict(known)
    except (RuntimeError, ValueError, TypeError, AttributeError, KeyError) as error:
        raise RunFileError(path, f"another run's checkpoint ({error}); name another --out") from error
    algorithm.env_runner_group.sync_weights(
        from_worker_or_learner_group=algorithm.learner_group, inference_only=True
    )
