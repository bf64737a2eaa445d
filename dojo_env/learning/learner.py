"""One training run, from its settings to the best policy in its folder; goes on where it was interrupted."""

from collections.abc import Callable
from contextlib import ExitStack, closing
from dataclasses import asdict
from pathlib import Path

from dojo_env.errors import ConfigError
from dojo_env.learning.algorithms import average_weights, build_model
from dojo_env.learning.checkpoints import read_checkpoint, restore_checkpoint
from dojo_env.learning.environments import VALIDATION_SEEDS, open_environments, open_evaluation
from dojo_env.learning.figure_logs import open_logger
from dojo_env.learning.process_setup import prepare_process
from dojo_env.learning.progress import Progress
from dojo_env.learning.result_files import read_columns
from dojo_env.learning.settings import (
    CHECKPOINT,
    CURVE,
    POLICY,
    SETTINGS,
    Training,
    check_folder,
    read_training,
    write_training,
)
from dojo_maps.progress import say
from dojo_maps.wording import counted


def prepare_folder(training: Training, folder: Path) -> None:
    """Make the folder of a new run; `check_folder` has seen that it is free.

    Args:
        training: the run's settings, which are written into it.
        folder: to make, with those around it where there are none.

    Raises:
        WriteError: the settings cannot be written.
    """
    folder.mkdir(parents=True, exist_ok=True)
    write_training(training, folder / SETTINGS)


def _is_trained(training: Training, folder: Path) -> bool:
    """Tell whether a run has come to its end: its policy is there, and its curve goes to the last step."""
    if not (folder / SETTINGS).is_file():
        return False
    if read_training(folder / SETTINGS) != training:
        raise ConfigError(f"{folder}: trained with other settings; delete it, or name another --results")
    if not (folder / POLICY).is_file() or not (folder / CURVE).is_file():
        return False
    return bool((read_columns(folder / CURVE, ("steps",))["steps"] >= training.whole_steps).any())


def finish_training(training: Training, folder: Path) -> None:
    """Train unless the run has come to its end in its folder; what was interrupted goes on.

    Args:
        training: the run's settings.
        folder: of the run; it may be missing.

    Raises:
        ConfigError: the folder holds another run, or a file of it is damaged.
        SimulationError: SUMO refuses the scenario, or stopped.
    """
    if not _is_trained(training, folder):
        train(training, folder, resume=(folder / CHECKPOINT).is_file())


def train(
    training: Training,
    folder: Path,
    *,
    resume: bool = False,
    tensorboard: bool = False,
    wandb: str | None = None,
    tell: Callable[[str], None] = say,
) -> None:
    """Train, and keep the best policy, the curve and a checkpoint in the folder.

    Args:
        training: all that it depends on.
        folder: where all of it goes.
        resume: go on from the folder's checkpoint.
        tensorboard: write its event files, too.
        wandb: a project of Weights & Biases that figures are logged to.
        tell: takes lines of how far it is; on standard error, unless said otherwise.

    Raises:
        ConfigError: the folder holds another run, or the checkpoint is another's.
        SimulationError: SUMO stopped.
    """
    check_folder(training, folder, read_training, resume=resume)
    prepare_process()
    known = read_checkpoint(folder / CHECKPOINT) if resume else None
    rows = known["known"]["rows"] if known else []
    done = rows[-1]["steps"] if rows else 0
    with ExitStack() as stack:
        started = counted(training.processes, "environment")
        tell(f"starting {started} and {len(VALIDATION_SEEDS)} for validation")
        environments = stack.enter_context(closing(open_environments(training, done=done)))
        validation = stack.enter_context(closing(open_evaluation(training, VALIDATION_SEEDS)))
        model = build_model(training, environments)
        logger = open_logger(folder, asdict(training), tensorboard=tensorboard, wandb=wandb)
        stack.callback(logger.close)
        model.set_logger(logger)
        if not resume:
            prepare_folder(training, folder)  # Not before: all that may be wrong has been opened.
        agents = environments.num_envs // training.processes if training.agents == "shared" else 1
        average = average_weights(model.policy) if training.averaged_weights else None
        progress = Progress(training, folder, validation, agents=agents, average=average, tell=tell)
        if known is not None:
            progress.resume(restore_checkpoint(model, known, folder / CHECKPOINT), done)
            known = None  # The next checkpoint replaces the file, whose place is free once nobody reads it.
        model.learn(
            (training.whole_steps - done) * agents, progress, log_interval=None,
            reset_num_timesteps=not resume,
        )  # fmt: skip
