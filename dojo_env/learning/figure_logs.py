"""Where a training's figures go beside its curve: event files of TensorBoard, a run of Weights & Biases."""

from collections.abc import Mapping
from numbers import Real
from pathlib import Path
from typing import Any

from stable_baselines3.common.logger import KVWriter, Logger, TensorBoardOutputFormat

from dojo_env.errors import ConfigError


def open_logger(
    folder: Path, settings: Mapping[str, Any], *, tensorboard: bool = False, wandb: str | None = None
) -> Logger:
    """Open what figures are logged to.

    Args:
        folder: of the run; event files and the offline runs of Weights & Biases are written into it.
        settings: of the training, for people to compare runs by.
        tensorboard: write event files.
        wandb: the project of Weights & Biases; None for none.

    Returns:
        The logger, which is to be closed; without either of them it writes nothing.

    Raises:
        ConfigError: Weights & Biases cannot be reached.
    """
    folder.mkdir(parents=True, exist_ok=True)
    writers: list[KVWriter] = [TensorBoardOutputFormat(str(folder))] if tensorboard else []
    if wandb is not None:
        writers.append(WeightsAndBiases(folder, wandb, settings))
    return Logger(str(folder), writers)


class WeightsAndBiases(KVWriter):
    """Logs to a run of Weights & Biases; nothing but the settings and the figures is told."""

    def __init__(self, folder: Path, project: str, settings: Mapping[str, Any]) -> None:
        """Begin a run, named after the folder.

        Raises:
            ConfigError: its server cannot be reached.
        """
        import wandb

        quiet = wandb.Settings(
            console="off", disable_git=True, save_code=False, silent=True, x_disable_stats=True
        )
        try:
            self._run: Any = wandb.init(
                project=project, name=folder.name, dir=folder, config=dict(settings), settings=quiet
            )
        except wandb.Error as error:
            raise ConfigError(f"--wandb {project}: {error}; log in, or set WANDB_MODE=offline") from error

    def write(
        self, key_values: dict[str, Any], key_excluded: dict[str, tuple[str, ...]], step: int = 0
    ) -> None:
        """Log the numbers among the figures.

        Args:
            key_values: figures by name; what is no number is left out.
            key_excluded: has no effect here.
            step: how far the run is, which is where the figures are drawn.
        """
        del key_excluded  # It names writers that others leave figures out for.
        numbers = {name: value for name, value in key_values.items() if isinstance(value, Real)}
        self._run.log(numbers, step=step)

    def close(self) -> None:
        """End the run."""
        self._run.finish()
