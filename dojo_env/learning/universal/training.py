"""Training of the universal policy: rounds of episodes and updates, validation, and files to go on from.

Every round's episodes are drawn from the seed and the round's number, and come back in their order: so the
result is the same however many processes, or machines of a cluster, simulate them.
"""

import dataclasses
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from multiprocessing import get_context
from pathlib import Path
from typing import Any, Protocol

import numpy as np
import torch
from numpy.typing import NDArray

from dojo_env.config import SignalConfig
from dojo_env.controllers import make_controller
from dojo_env.controllers.phase_competition import PhaseCompetition
from dojo_env.errors import ConfigError
from dojo_env.learning.pace import Pace
from dojo_env.learning.process_setup import prepare_process
from dojo_env.learning.settings import RunFileError, list_versions
from dojo_env.learning.tensor_files import load_tensors, save_tensors
from dojo_env.learning.universal.cases import Case, draw_case
from dojo_env.learning.universal.network import PhaseNet
from dojo_env.learning.universal.ppo import UsualCosts, build_batch, update
from dojo_env.learning.universal.rollouts import run_case
from dojo_env.managers.map import MapManager
from dojo_env.runs import run_controller
from dojo_env.scenario import find_scenario, open_map
from dojo_maps.progress import say
from dojo_maps.safe_json import read_json
from dojo_maps.whole_file import replaced, write_json, write_table

SETTINGS, CHECKPOINT, CURVE, POLICY = "training.json", "checkpoint.pt", "curve.csv", "policy.npz"
RIVAL = "queue-pressure"
"""What learns nothing, and is to be beaten."""
_VALIDATION_SEED, _FIRST_SEED, _SEEDS_PER_RUN = 500, 1_000, 1_000_000
_COLUMNS = ("round", "travel_time_all", "accumulated_waiting", "score")
_KIND = "universal"


@dataclass(frozen=True, slots=True, kw_only=True)
class UniversalTraining:
    """All that a run depends on.

    Attributes:
        scenarios: names or paths; the policy learns at all of their signals.
        seed: of everything random.
        rounds: of episodes, each with an update.
        episodes: of a round.
        shortest: simulated seconds of an episode, the least.
        longest: the most.
        least_demand: of the scenario's own, as a share.
        most_demand: likewise.
        learning_rate: at the beginning; it falls to 0.
        entropy: the worth of trying things.
        epochs: how often an update looks at each decision.
        batch_size: decisions of a step.
        every: rounds between validations.
        validation_seconds: of each of its episodes, one a scenario.
    """

    scenarios: tuple[str, ...]
    seed: int = 0
    rounds: int = 100
    episodes: int = 16
    shortest: int = 600
    longest: int = 1800
    least_demand: float = 0.6
    most_demand: float = 1.15
    learning_rate: float = 1e-3
    entropy: float = 0.01
    epochs: int = 4
    batch_size: int = 512
    every: int = 10
    validation_seconds: int = 1800

    def __post_init__(self) -> None:
        """Refuse what cannot be.

        Raises:
            ConfigError: a value is out of its range.
        """
        object.__setattr__(self, "scenarios", tuple(self.scenarios))
        if not self.scenarios:
            raise ConfigError("no scenarios to learn from; name at least one")
        for name in ("rounds", "episodes", "epochs", "batch_size", "every"):
            if getattr(self, name) < 1:
                raise ConfigError(f"{name}={getattr(self, name)}: expected at least 1")
        if not 120 <= self.shortest <= self.longest:
            raise ConfigError(f"shortest={self.shortest}, longest={self.longest}: expected 120 s or more")


class Mapper(Protocol):
    """Runs a function on many values, in their order, wherever there is room."""

    def __call__(self, function: Callable[[Any], Any], values: Sequence[Any]) -> list[Any]:
        """Run."""
        ...


def list_junctions(scenarios: Sequence[str]) -> list[tuple[str, tuple[str, ...]]]:
    """List each scenario's signals at which there is something to decide.

    Raises:
        ConfigError: a scenario has none.
    """
    found = []
    for name in scenarios:
        plans = MapManager(open_map(find_scenario(name)), SignalConfig()).plans
        signals = tuple(signal for signal, plan in plans.items() if len(plan.phases) > 1)
        if not signals:
            raise ConfigError(f"scenario {name}: no signal has two phases to choose from; leave it out")
        found.append((name, signals))
    return found


@contextmanager
def open_processes(count: int) -> Iterator[Mapper]:
    """Open processes of this machine to simulate in."""
    with ProcessPoolExecutor(count, mp_context=get_context("spawn")) as pool:
        yield lambda function, values: list(pool.map(function, values))


def train(
    training: UniversalTraining,
    folder: Path,
    run_all: Mapper,
    *,
    resume: bool = False,
    tell: Callable[[str], None] = say,
) -> None:
    """Train, and keep the best weights, the curve and a checkpoint in the folder.

    Args:
        training: all that it depends on.
        folder: where all of it goes.
        run_all: simulates.
        resume: go on from the folder's checkpoint.
        tell: takes lines of how far it is.

    Raises:
        ConfigError: the folder holds another run, or a scenario cannot be learned from.
        SimulationError: SUMO stopped.
    """
    check_folder(training, folder, resume=resume)
    prepare_process()
    torch.manual_seed(training.seed)
    network = PhaseNet()
    optimizer = torch.optim.Adam(network.parameters(), eps=1e-5)
    usual, rows, rival = UsualCosts(), list[dict[str, float]](), dict[str, Any]()
    if resume:
        known = load_tensors(folder / CHECKPOINT)
        network.load_state_dict(known["network"])
        optimizer.load_state_dict(known["optimizer"])
        usual, rows, rival = UsualCosts(known["usual"]), known["rows"], known["rival"]
    junctions = list_junctions(training.scenarios)
    tell(f"{sum(len(signals) for _, signals in junctions)} junctions of {len(junctions)} scenarios")
    if not resume:
        folder.mkdir(parents=True, exist_ok=True)
        write_json(
            folder / SETTINGS,
            {"kind": _KIND, "training": dataclasses.asdict(training), "versions": list_versions()},
        )
    validation = _list_validation(training, junctions)
    if not rival:
        found = run_all(partial(_measure, RIVAL), validation)
        rival = {case.scenario: each for case, each in zip(validation, found, strict=True)}
    pace = Pace(training.rounds, tell, unit="rounds")
    for number in range(int(rows[-1]["round"]) if rows else 0, training.rounds):
        _learn(training, number, network, optimizer, usual, run_all, junctions)
        pace.note(number + 1)
        if (number + 1) % training.every == 0 or number + 1 == training.rounds:
            weights = network.export()
            found = run_all(partial(_measure, weights), validation)
            row = _compare(number + 1, validation, found, rival)
            if not rows or row["score"] < min(each["score"] for each in rows):
                write_weights(weights, folder / POLICY)
            rows.append(row)
            write_table(
                folder / CURVE, _COLUMNS, ([round(each[name], 4) for name in _COLUMNS] for each in rows)
            )
            save_tensors(
                {
                    "network": network.state_dict(),
                    "optimizer": optimizer.state_dict(),
                    "usual": usual.known,
                    "rows": rows,
                    "rival": rival,
                },
                folder / CHECKPOINT,
            )
            pace.say(
                number + 1,
                f": beside {RIVAL}, travel time {row['travel_time_all'] - 1:+.1%}, "
                f"waiting {row['accumulated_waiting'] - 1:+.1%}",
            )


def _learn(
    training: UniversalTraining,
    number: int,
    network: PhaseNet,
    optimizer: torch.optim.Optimizer,
    usual: UsualCosts,
    run_all: Mapper,
    junctions: Sequence[tuple[str, Sequence[str]]],
) -> None:
    """Simulate a round, and update."""
    draw = np.random.default_rng([training.seed, number])
    first = _FIRST_SEED + training.seed * _SEEDS_PER_RUN + number * training.episodes
    cases = [
        draw_case(
            junctions,
            draw,
            seed=first + place,
            seconds=(training.shortest, training.longest),
            scales=(training.least_demand, training.most_demand),
        )
        for place in range(training.episodes)
    ]
    weights = network.export()
    # The longest first, so that none is waited for alone.
    order = sorted(range(len(cases)), key=lambda place: -cases[place].seconds * len(cases[place].signals))
    found = run_all(partial(_simulate, weights), [cases[place] for place in order])
    tracks = [
        track for _, each in sorted(zip(order, found, strict=True), key=lambda one: one[0]) for track in each
    ]
    if not tracks:
        return
    left = 1 - number / training.rounds
    for group in optimizer.param_groups:
        group["lr"] = training.learning_rate * left
    update(
        network,
        optimizer,
        build_batch(network, tracks, usual),
        epochs=training.epochs,
        size=training.batch_size,
        entropy=training.entropy * left,
        generator=torch.Generator().manual_seed(first),
    )


def _simulate(weights: Mapping[str, NDArray[np.float32]], case: Case) -> Any:
    return run_case(case, weights)


def _list_validation(
    training: UniversalTraining, junctions: Sequence[tuple[str, Sequence[str]]]
) -> list[Case]:
    """List an episode per scenario, with all signals and other seeds than in training."""
    return [
        Case(
            scenario=name, signals=tuple(signals), seed=_VALIDATION_SEED, seconds=training.validation_seconds
        )
        for name, signals in junctions
    ]


def _measure(actor: str | Mapping[str, NDArray[np.float32]], case: Case) -> dict[str, float]:
    """Measure a controller, or a policy's weights, in an episode."""
    controller = make_controller(actor) if isinstance(actor, str) else PhaseCompetition(actor)
    (figures,) = run_controller(controller, [case.seed], **case.environment)
    return {name: float(figures[name]) for name in ("travel_time_all", "accumulated_waiting")}


def _compare(
    number: int,
    cases: Sequence[Case],
    found: Sequence[Mapping[str, float]],
    rival: Mapping[str, Mapping[str, float]],
) -> dict[str, float]:
    """Compare with the rule that learns nothing: the geometric means of the ratios."""
    means = {
        name: float(
            np.exp(np.mean([np.log((each[name] + 1) / (rival[case.scenario][name] + 1))
                            for case, each in zip(cases, found, strict=True)]))
        )
        for name in ("travel_time_all", "accumulated_waiting")
    }  # fmt: skip
    return {
        "round": number,
        **means,
        "score": means["travel_time_all"] ** 2 * means["accumulated_waiting"] ** 0.25,
    }


def write_weights(weights: Mapping[str, NDArray[np.float32]], path: Path) -> None:
    """Write a policy's weights, as `controllers.phase_competition` reads them."""
    with replaced(path) as fresh, fresh.open("wb") as file:
        np.savez(file, allow_pickle=False, **weights)


def check_folder(training: UniversalTraining, folder: Path, *, resume: bool) -> None:
    """See that a folder is free for a run, or this run's.

    Raises:
        ConfigError: it holds a run already, or none, or another one's.
    """
    path = folder / SETTINGS
    if not resume:
        if path.exists():
            raise ConfigError(
                f"{folder} holds a run already; --resume goes on with it, or name another --out"
            )
        return
    if read_settings(path) != training:
        raise ConfigError(f"{path}: another run's settings; give the same ones, or another --out")
    if not (folder / CHECKPOINT).is_file():
        raise ConfigError(f"{folder}: no checkpoint yet; start again without --resume in another folder")


def read_settings(path: Path) -> UniversalTraining:
    """Read a run's settings.

    Raises:
        RunFileError: it is none of this kind.
    """
    value = read_json(path, error=RunFileError)
    if not isinstance(value, dict) or value.get("kind") != _KIND:
        raise RunFileError(path, "not the settings of a universal policy's training")
    try:
        return UniversalTraining(**value["training"])
    except (ConfigError, TypeError, KeyError) as error:
        raise RunFileError(path, f"not the settings of a universal policy's training ({error})") from error
