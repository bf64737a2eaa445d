"""What happens between updates: figures of each round of episodes, the best policy, checkpoints."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from stable_baselines3.common.callbacks import BaseCallback
from stable_baselines3.common.vec_env import VecEnv
from torch.optim.swa_utils import AveragedModel

from dojo_env.learning.checkpoints import save_checkpoint, save_policy
from dojo_env.learning.evaluation import evaluate
from dojo_env.learning.pace import Pace
from dojo_env.learning.settings import CHECKPOINT, CURVE, POLICY, Training
from dojo_env.metrics import SIX
from dojo_maps.progress import say
from dojo_maps.whole_file import write_table

CHOSEN_BY = "travel_time_all"
"""The figure that chooses the best policy: unfinished trips and those that wait outside count, too."""
COLUMNS = ("steps", "part", "reward", *SIX, CHOSEN_BY)


class Curve:
    """A run's figures so far: each round of episodes, each validation, and the best of them."""

    def __init__(self, training: Training, folder: Path, tell: Callable[[str], None]) -> None:
        """Take whose figures they are, where to write them, and what takes lines of progress."""
        self._folder = folder
        self.rows: list[dict[str, Any]] = []
        self.best = float(np.inf)
        self.pace = Pace(training.whole_steps, tell)

    def resume(self, known: dict[str, Any]) -> None:
        """Take what a checkpoint knew.

        Args:
            known: as `known` told it.
        """
        self.rows, self.best = known["rows"], known["best"]

    @property
    def known(self) -> dict[str, Any]:
        """What a checkpoint must know."""
        return {"rows": self.rows, "best": self.best}

    def add(self, steps: int, part: str, figures: list[dict[str, Any]]) -> dict[str, Any]:
        """Add the means of some episodes' figures.

        Args:
            steps: the run's so far.
            part: `training` or `validation`.
            figures: an item per episode, each with all figures of `COLUMNS`.

        Returns:
            The curve's new row, by the names of `COLUMNS`.
        """
        means = {name: float(np.mean([f[name] for f in figures])) for name in COLUMNS[2:]}
        self.rows.append({"steps": steps, "part": part, **means})
        return self.rows[-1]

    def validate(self, steps: int, policy: Any, environments: VecEnv) -> None:
        """Measure a policy, keep it if it is the best so far, and write the curve.

        Args:
            steps: the run's so far.
            policy: what acts, and what is kept.
            environments: of the validation; an episode is run in each.

        Raises:
            SimulationError: an environment's process has ended.
            WriteError: the folder cannot be written.
        """
        row = self.add(steps, "validation", evaluate(policy, environments)[0])
        if row[CHOSEN_BY] < self.best:
            self.best = row[CHOSEN_BY]
            save_policy(policy, self._folder / POLICY)
        self._write()
        words = (
            f": travel time {row['travel_time']:.2f} s, waiting {row['accumulated_waiting']:.0f} s, "
            f"all trips {row[CHOSEN_BY]:.2f} s (best {self.best:.2f})"
        )
        self.pace.say(steps, words)

    def _write(self) -> None:
        told = ([row[name] for name in COLUMNS] for row in self.rows)
        rows = ([round(each, 4) if isinstance(each, float) else each for each in row] for row in told)
        write_table(self._folder / CURVE, COLUMNS, rows)


class Progress(BaseCallback):
    """Evaluates and saves after every few rounds of episodes; a round is an episode in each environment."""

    def __init__(
        self,
        training: Training,
        folder: Path,
        validation: VecEnv,
        *,
        agents: int = 1,
        average: AveragedModel | None = None,
        tell: Callable[[str], None] = say,
    ) -> None:
        """Take a run's parts.

        Args:
            training: its settings.
            folder: where to write.
            validation: environments that the policy is evaluated in.
            agents: how many signals share the policy.
            average: of the weights, where that is what is kept.
            tell: takes lines of progress.
        """
        super().__init__()
        self._folder, self._validation = folder, validation
        self._average = average
        self._curve = Curve(training, folder, tell)
        self._apart = training.every * training.round_steps
        self._agents = agents
        self._done_at = -1

    def resume(self, known: dict[str, Any], done: int) -> None:
        """Take what was known when so many steps were done.

        Args:
            known: what the checkpoint gave back.
            done: steps of all environments together; there, nothing is validated or saved again.
        """
        self._curve.resume(known)
        if self._average is not None:
            self._average.load_state_dict(known["average"])
        self._done_at = done

    @property
    def _steps(self) -> int:
        """Decisions of all environments; a model counts each agent's."""
        return self.num_timesteps // self._agents

    def _on_step(self) -> bool:
        self._curve.pace.note(self._steps)
        if np.all(self.locals["dones"]):
            figures = [info["figures"] for info in self.locals["infos"] if "figures" in info]
            self._record(self._curve.add(self._steps, "training", figures))
        return True

    def _on_rollout_start(self) -> None:
        self._between()
        if self._average is not None:
            self._average.update_parameters(self.model.policy)

    def _on_training_end(self) -> None:
        self._between(last=True)

    def _between(self, *, last: bool = False) -> None:
        steps = self._steps
        due = steps % self._apart == 0 and steps > 0
        if steps == self._done_at or not (due or last):
            return
        self._done_at = steps
        average = self._average
        self._curve.validate(
            steps, self.model.policy if average is None else average.module, self._validation
        )
        self._record(self._curve.rows[-1])
        averaged = {} if average is None else {"average": average.state_dict()}
        save_checkpoint(self.model, self._folder / CHECKPOINT, {**self._curve.known, **averaged})

    def _record(self, row: dict[str, Any]) -> None:
        for name in COLUMNS[2:]:
            self.logger.record(f"{row['part']}/{name}", row[name])
        self.logger.dump(row["steps"])
