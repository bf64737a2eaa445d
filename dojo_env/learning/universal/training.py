"""Training of the universal policy: rounds of episodes and updates, validation, and files to go on from.

Every round's episodes are drawn from the seed and the round's number, and come back in their order: so the
result is the same however many processes, or machines of a cluster, simulate them.
"""

from collections.abc import Callable, Mapping, Sequence
from contextlib import closing
from dataclasses import asdict
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray

from dojo_env.config import build_config
from dojo_env.controllers import Controller, make_controller
from dojo_env.controllers.phase_competition import PACKAGED, PhaseCompetition, read_weights
from dojo_env.errors import SimulationError
from dojo_env.forks import call_in_fork
from dojo_env.learning.episode_pools import Mapper
from dojo_env.learning.figure_logs import open_logger
from dojo_env.learning.pace import Pace
from dojo_env.learning.process_setup import prepare_process
from dojo_env.learning.settings import RunFileError, check_folder, write_settings
from dojo_env.learning.tensor_files import load_tensors, save_tensors
from dojo_env.learning.universal.cases import Case, draw_case
from dojo_env.learning.universal.network import PhaseNet
from dojo_env.learning.universal.ppo import UsualCosts, build_batch, update
from dojo_env.learning.universal.rollouts import Trajectory, run_case
from dojo_env.learning.universal.settings import (
    CHECKPOINT,
    CURVE,
    KIND,
    POLICY,
    SETTINGS,
    UniversalTraining,
    count_junctions,
    list_junctions,
    read_settings,
)
from dojo_env.local_world import LocalWorld
from dojo_env.notes import notes_unsaid
from dojo_maps.progress import say
from dojo_maps.whole_file import replaced, write_table

RIVAL = "queue-pressure"
"""What learns nothing, and is to be beaten."""
_VALIDATION_SEED, _FIRST_SEED, _SEEDS_PER_RUN = 500, 1_000, 1_000_000
_VALUES_FIRST = 2
"""Rounds in which a policy that goes on from another learns only what states are worth: weights lack it."""
_FIGURES = ("travel_time_all", "accumulated_waiting")
_COLUMNS = ("round", *_FIGURES, "score")
_WAITING_COUNTS = 0.2
"""How much a share of waiting counts beside one of travel time, where the best policy is chosen."""

Weights = Mapping[str, NDArray[np.float32]]


def train(
    training: UniversalTraining,
    folder: Path,
    run_all: Mapper,
    *,
    resume: bool = False,
    tensorboard: bool = False,
    wandb: str | None = None,
    tell: Callable[[str], None] = say,
) -> None:
    """Train, and keep the best weights, the curve and a checkpoint in the folder.

    Args:
        training: all that it depends on.
        folder: where all of it goes.
        run_all: simulates.
        resume: go on from the folder's checkpoint.
        tensorboard: write its event files, too.
        wandb: a project of Weights & Biases that figures are logged to.
        tell: takes lines of how far it is.

    Raises:
        ConfigError: the folder holds another run, or a scenario cannot be learned from.
        SimulationError: SUMO stopped in a validation, or in all episodes of a round.
    """
    check_folder(training, folder, read_settings, resume=resume)
    prepare_process()
    junctions = list_junctions(training.scenarios)
    tell(count_junctions(junctions))
    learner = _Learner(training, junctions, run_all, tell)
    if resume:
        learner.restore(folder / CHECKPOINT)
    else:
        learner.measure_rival()
    pace = Pace(training.rounds, tell, unit="rounds")
    with closing(open_logger(folder, asdict(training), tensorboard=tensorboard, wandb=wandb)) as logger:
        if not resume:
            write_settings(KIND, asdict(training), folder / SETTINGS)
        for number in range(learner.done, training.rounds):
            learner.learn(number)
            pace.note(number + 1)
            if (number + 1) % training.every == 0 or number + 1 == training.rounds:
                row = learner.keep(number + 1, folder)
                beside = ", ".join(f"{name} {row[name] - 1:+.1%}" for name in _FIGURES)
                pace.say(number + 1, f": beside {RIVAL}, {beside}")
                for name in _FIGURES:
                    logger.record(f"validation/{name}", row[name])
                logger.dump(number + 1)


class _Learner:
    """The network, what improves it, and how it did so far."""

    def __init__(
        self,
        training: UniversalTraining,
        junctions: Sequence[tuple[str, Sequence[str]]],
        run_all: Mapper,
        tell: Callable[[str], None],
    ) -> None:
        self._training, self._junctions, self._run_all, self._tell = training, junctions, run_all, tell
        torch.manual_seed(training.seed)
        if training.start is None:
            self.network = PhaseNet()
        else:
            start = read_start(training.start)
            self.network = PhaseNet.of_weights(start, temperature=training.temperature)
        self._optimizer = torch.optim.Adam(self.network.parameters(), eps=1e-5)
        self._usual = UsualCosts()
        self.rows: list[dict[str, float]] = []
        self._rival: dict[str, dict[str, float]] = {}
        self._validation = [
            Case(
                scenario=name,
                signals=tuple(signals),
                seed=_VALIDATION_SEED,
                seconds=training.validation_seconds,
            )
            for name, signals in junctions
        ]

    @property
    def done(self) -> int:
        """Rounds so far."""
        return int(self.rows[-1]["round"]) if self.rows else 0

    def save(self, path: Path) -> None:
        save_tensors(
            {
                "network": self.network.state_dict(),
                "optimizer": self._optimizer.state_dict(),
                "usual": self._usual.known,
                "rows": self.rows,
                "rival": self._rival,
            },
            path,
        )

    def restore(self, path: Path) -> None:
        known = load_tensors(path)
        try:
            self.network.load_state_dict(known["network"])
            self._optimizer.load_state_dict(known["optimizer"])
            self._usual, self.rows, self._rival = UsualCosts(known["usual"]), known["rows"], known["rival"]
        except (LookupError, TypeError, ValueError, AttributeError, RuntimeError) as error:
            raise RunFileError(path, f"another run's checkpoint ({error}); start anew elsewhere") from error

    def measure_rival(self) -> None:
        """Measure what learns nothing; a scenario that cannot run is told of before anything is learned."""
        found = self._run_all(partial(_measure, RIVAL), self._validation)
        self._rival = {case.scenario: each for case, each in zip(self._validation, found, strict=True)}

    def keep(self, number: int, folder: Path) -> dict[str, float]:
        """Validate, and write the curve, a checkpoint, and the weights if they are the best so far."""
        row = self.validate(number)
        if row["score"] <= min(each["score"] for each in self.rows):
            write_weights(self.network.export(), folder / POLICY)
        rounded = ([round(each[name], 4) for name in _COLUMNS] for each in self.rows)
        write_table(folder / CURVE, _COLUMNS, rounded)
        self.save(folder / CHECKPOINT)
        return row

    def validate(self, number: int) -> dict[str, float]:
        """Compare with the rival, by the geometric means of the ratios; each episode has seeds of its own."""
        found = self._run_all(partial(_measure, self.network.export()), self._validation)
        row: dict[str, float] = {"round": number}
        for name in _FIGURES:
            ratios = [
                (each[name] + 1) / (self._rival[case.scenario][name] + 1)
                for case, each in zip(self._validation, found, strict=True)
            ]
            row[name] = float(np.exp(np.mean(np.log(ratios))))
        row["score"] = row["travel_time_all"] * row["accumulated_waiting"] ** _WAITING_COUNTS
        self.rows.append(row)
        return row

    def learn(self, number: int) -> None:
        """Simulate a round, and update."""
        training = self._training
        first = _FIRST_SEED + training.seed * _SEEDS_PER_RUN + number * training.episodes
        left = 1 - number / training.rounds
        for group in self._optimizer.param_groups:
            group["lr"] = training.learning_rate * left
        update(
            self.network,
            self._optimizer,
            build_batch(self.network, self._simulate(number, first), self._usual),
            epochs=training.epochs,
            size=training.batch_size,
            entropy=training.entropy * left,
            clip=None if training.start is not None and number < _VALUES_FIRST else training.clip_range,
            generator=torch.Generator().manual_seed(first),
        )

    def _simulate(self, number: int, first: int) -> list[Trajectory]:
        training, draw = self._training, np.random.default_rng([self._training.seed, number])
        cases = [
            draw_case(
                self._junctions,
                draw,
                seed=first + place,
                seconds=(training.shortest, training.longest),
                scales=(training.least_demand, training.most_demand),
            )
            for place in range(training.episodes)
        ]
        # The longest come first, so that none is waited for alone.
        order = sorted(range(len(cases)), key=lambda place: -cases[place].seconds * len(cases[place].signals))
        found = self._run_all(partial(_try, self.network.export()), [cases[place] for place in order])
        outcomes, tracks = dict(zip(order, found, strict=True)), list[Trajectory]()
        for place, case in enumerate(cases):
            if isinstance(outcomes[place], SimulationError):
                self._tell(f"{case.scenario}, seed {case.seed}: left out, for {outcomes[place]}")
            else:
                tracks += outcomes[place]
        if not tracks:
            raise SimulationError("no episode of a whole round came to its end; leave such scenarios out")
        return tracks


def _try(weights: Weights, case: Case) -> list[Trajectory] | SimulationError:
    """Run an episode; where SUMO stops at one, the others go on."""
    try:
        return run_case(case, weights)
    except SimulationError as error:
        return error


def _measure(actor: str | Weights, case: Case) -> dict[str, float]:
    """Measure a controller, or a policy's weights, in an episode."""
    controller = make_controller(actor) if isinstance(actor, str) else PhaseCompetition(actor)
    try:
        figures: dict[str, Any] = call_in_fork(_run_episode, controller, case)
    except SimulationError as error:
        raise SimulationError(f"{case.scenario}, seed {case.seed}: {error}") from error
    return {name: float(figures[name]) for name in _FIGURES}


def _run_episode(controller: Controller, case: Case) -> dict[str, Any]:
    config = build_config(**controller.complete(case.environment))
    with notes_unsaid(), closing(LocalWorld(config)) as world:
        _, figures = world.run(controller, case.seed)
    return figures


def read_start(name: str) -> Weights:
    """Read the policy that a training goes on from.

    Args:
        name: `learned`, a file, or a run's folder.

    Returns:
        The weights of its scores.

    Raises:
        PolicyError: the file holds none.
    """
    path = PACKAGED / "learned.npz" if name == "learned" else Path(name)
    return read_weights(path / POLICY if path.is_dir() else path)


def write_weights(weights: Weights, path: Path) -> None:
    """Write a policy's weights, as `controllers.phase_competition` reads them.

    Args:
        weights: arrays by the names in `phase_competition.WEIGHTS`.
        path: of the file, which is replaced whole; it ends in `.npz`.

    Raises:
        UsageError: the path is a folder, or lies in none.
        WriteError: the folder cannot be written.
    """
    with replaced(path) as fresh:
        np.savez(fresh, allow_pickle=False, **dict(weights))
