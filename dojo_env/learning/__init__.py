"""Learning: settings of a training run, its environments and networks, checkpoints, evaluation.

Stable-Baselines3 on one machine, Ray RLlib on many: both train the same networks and write the same files.
"""

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from types import ModuleType
from typing import TYPE_CHECKING

from dojo_env.errors import ConfigError
from dojo_maps.errors import explain_missing
from dojo_maps.progress import say

if TYPE_CHECKING:
    from dojo_env.learning.policy_controller import PolicyController
    from dojo_env.learning.settings import Training


def train(
    training: "Training",
    folder: str | Path,
    *,
    resume: bool = False,
    tensorboard: bool = False,
    wandb: str | None = None,
    tell: Callable[[str], None] = say,
) -> "PolicyController":
    """Train a policy with Stable-Baselines3; the folder keeps the best one, the curve and a checkpoint.

    Args:
        training: all that the result depends on.
        folder: where all of it goes.
        resume: go on from the folder's checkpoint, to the same result.
        tensorboard: write its event files, too.
        wandb: a project of Weights & Biases that figures are logged to, too.
        tell: takes lines of how far it is; on standard error, unless said otherwise.

    Returns:
        The best policy, as a controller.

    Raises:
        ToolMissingError: the extra `learn` is not installed.
        ConfigError: the folder holds another run, or the checkpoint is another's.
        SimulationError: SUMO stopped.
    """
    from dojo_env.learning.policy_controller import PolicyController
    from dojo_env.learning.settings import Training

    if not isinstance(training, Training):
        raise ConfigError(f"training={training!r}: expected dojo_env.Training(...)")
    try:
        from dojo_env.learning import learner
    except ModuleNotFoundError as error:
        raise explain_missing(error) or error from error
    with _script_unread():
        learner.train(training, Path(folder), resume=resume, tensorboard=tensorboard, wandb=wandb, tell=tell)
    return PolicyController(Path(folder))


@contextmanager
def _script_unread() -> Iterator[None]:
    """Keep the processes of a training from reading the script that began it, of which they need nothing.

    So a script needs no guard against being read twice.
    """
    script = sys.modules["__main__"]
    sys.modules["__main__"] = ModuleType("__main__")
    try:
        yield
    finally:
        sys.modules["__main__"] = script
