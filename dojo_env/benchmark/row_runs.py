"""Run one row of the benchmark: train its policy where it learns, evaluate it, keep all that came out."""

import shlex
from collections.abc import Mapping, Sequence
from dataclasses import asdict, replace
from pathlib import Path
from statistics import fmean
from typing import Any

import numpy as np

from dojo_env.benchmark.rows import CONSTRAINTS, Row
from dojo_env.controllers import Controller, make_controller
from dojo_env.controllers.timed import Timed
from dojo_env.errors import ConfigError
from dojo_env.learning.result_files import read_result
from dojo_env.learning.settings import RunFileError, Training, list_versions
from dojo_env.metrics import SIX
from dojo_env.plan_search import VALIDATION_SEEDS, Memory, search_plan
from dojo_env.runs import run_controller, summarize
from dojo_env.series import CURVES
from dojo_env.timing_plans import write_plan
from dojo_maps.input_files import sha256_of
from dojo_maps.whole_file import write_json, write_table

FIGURES, SERIES, PLAN, SEARCH = "figures.json", "series.csv", "plan.json", "search.json"
KEPT = (*SIX, "mean_trip_duration", "travel_time_all", "arrived", "departed", "late", "violations", "seed")


def find_folder(row: str, scenario: str, results: Path) -> Path:
    """Tell where a row's files are; a star or a space is no name for a folder.

    Args:
        row: its name.
        scenario: name or path; the folder is called as the file is, without its suffix.
        results: holds a folder per scenario.

    Returns:
        The row's folder, which may not be there yet.
    """
    return results / Path(scenario).stem / row.replace("*", "-encoder").replace(" ", "-")


def find_training_folder(folder: Path, number: int) -> Path:
    """Tell where the files of a row's training are: the first one's beside the figures.

    Args:
        folder: the row's.
        number: of the training, from 0.

    Returns:
        The training's folder, which may not be there yet.
    """
    return folder / f"training{number}" if number else folder


def describe(
    row: Row, scenario: str, *, seeds: int, seconds: int, constraints: str = "paper", trainings: int = 1
) -> dict[str, Any]:
    """Tell everything that a row's figures depend on, as values that JSON knows.

    Args:
        row: the row.
        scenario: name or path.
        seeds: episodes, of each policy.
        seconds: simulated seconds of an episode.
        constraints: a name of `CONSTRAINTS`; learners have the paper's.
        trainings: of a row that learns, each with a seed of its own.

    Returns:
        What `run_row` and `is_done` take as a task.

    Raises:
        ConfigError: the row's settings cannot be.
    """
    task: dict[str, Any] = {"row": row.name, "scenario": scenario, "seeds": seeds, "seconds": seconds}
    if row.learns:
        return {**task, "trainings": trainings, "training": asdict(row.find_training(scenario))}
    settings = {**CONSTRAINTS[constraints], **row.find_settings(scenario)}
    acting = {"controller": row.controller} if row.logic is None else {"logic": row.logic}
    learned = {}
    if row.controller:
        controller = make_controller(row.controller)
        settings, learned = {**controller.preferred, **settings}, tell_weights(controller)
    return {**task, **acting, "constraints": constraints, "settings": settings, **learned}


def tell_weights(controller: Controller) -> dict[str, list[str]]:
    """Tell what a controller has learned, so that figures made with other weights are known as old.

    Args:
        controller: a rule has no weights.

    Returns:
        `weights`: 64 hexadecimal digits of each file; nothing of a rule.
    """
    weights = [sha256_of(path, error=RunFileError) for path in controller.weights]
    return {"weights": weights} if weights else {}


def is_done(task: Mapping[str, Any], results: Path) -> bool:
    """Tell whether a row's figures are there, made with the same settings.

    Args:
        task: what `describe` tells.
        results: holds a folder per scenario, and in it one per row.

    Returns:
        False where there are none, or others.

    Raises:
        RunFileError: the figures are damaged, or another version made them, whose settings are unknown here.
    """
    path = find_folder(task["row"], task["scenario"], results) / FIGURES
    known = read_result(path) if path.is_file() else {}
    if "training" in known:  # What came later was so before.
        try:
            known = {"trainings": 1, **known, "training": asdict(Training(**known["training"]))}
        except (ConfigError, TypeError) as error:
            raise RunFileError(path, f"made by another version ({error}); delete its folder") from error
    return all(known.get(name) == value for name, value in task.items())


def run_row(task: Mapping[str, Any], results: Path) -> None:
    """Run a row's episodes and write its files, figures last.

    Args:
        task: what `describe` tells.
        results: holds a folder per scenario, and in it one per row.

    Raises:
        ConfigError: the row's folder holds another training.
        SimulationError: SUMO refuses the scenario, or stopped.
    """
    folder = find_folder(task["row"], task["scenario"], results)
    folder.mkdir(parents=True, exist_ok=True)
    if "training" in task:
        episodes, infos = _run_policies(task, folder)
    else:
        episodes, infos = _run_controller(task, _find_plan(task, folder) if "logic" in task else None)
    if task.get("constraints", "paper") == "paper":
        _write_series(folder / SERIES, infos)
    result = {
        **task,
        "command": _tell_command(task),
        "versions": list_versions(),
        "figures": {name: value for name, value in summarize(episodes).items() if name in KEPT},
        **({"between_trainings": _compare_trainings(episodes)} if task.get("trainings", 1) > 1 else {}),
        "episodes": [
            {name: episode[name] for name in (*KEPT, "training") if name in episode} for episode in episodes
        ],
    }
    write_json(folder / FIGURES, result)


def _tell_command(task: Mapping[str, Any]) -> str:
    words = ["dojo-env", "benchmark", "--rows", task["row"], "--scenarios", task["scenario"],
             "--seeds", str(task["seeds"]), "--seconds", str(task["seconds"])]  # fmt: skip
    for name, usual in (("constraints", "paper"), ("trainings", 1)):
        if task.get(name, usual) != usual:
            words += [f"--{name}", str(task[name])]
    return shlex.join(words)


def _write_series(path: Path, infos: Sequence[Mapping[str, Any]]) -> None:
    """Write the curves of an hour, the mean of each minute; those that pictures show are the paper's."""
    pace = infos[1]["step"] - infos[0]["step"] if len(infos) > 1 else 60
    minute = max(1, int(60 // pace))
    minutes = [infos[start : start + minute] for start in range(0, len(infos), minute)]
    series = (
        [int(part[-1]["step"]), *(round(fmean(info[name] for info in part), 3) for name in CURVES.values())]
        for part in minutes
    )
    write_table(path, ["second", *CURVES], series)


def _compare_trainings(episodes: Sequence[Mapping[str, Any]]) -> dict[str, float]:
    """Give the deviation of the trainings' means, by figure."""
    numbers = sorted({episode["training"] for episode in episodes})
    parts = [[episode for episode in episodes if episode["training"] == number] for number in numbers]
    return {
        name: float(np.std([np.mean([episode[name] for episode in part]) for part in parts], ddof=1))
        for name in (*SIX, "travel_time_all")
    }


Outcome = tuple[list[dict[str, Any]], list[dict[str, Any]]]
"""The figures of each episode, and what `info` told at every decision of the first."""


def _find_plan(task: Mapping[str, Any], folder: Path) -> Timed:
    """Search the row's timing plan, where that is not done."""
    path, about = folder / PLAN, {name: task[name] for name in ("scenario", "seconds", "settings")}
    if not path.is_file() or read_result(path, "searched")["searched"] != about:
        memory = Memory(folder / SEARCH)
        keywords = {"scenario": task["scenario"], "num_seconds": task["seconds"], **task["settings"]}
        search = search_plan(keywords, logic=task["logic"], memory=memory)
        scores = dict(zip(map(str, VALIDATION_SEEDS), search.scores, strict=True))
        write_plan(search.found, path, searched=about, episodes=search.spent, validation=scores)
        memory.forget()
    return Timed(path)


def _run_controller(task: Mapping[str, Any], plan: Timed | None) -> Outcome:
    infos: list[dict[str, Any]] = []
    figures = run_controller(
        plan or task["controller"], range(task["seeds"]), scenario=task["scenario"],
        num_seconds=task["seconds"], on_step=infos.append, **task["settings"],
    )  # fmt: skip
    return figures, infos[: len(infos) // task["seeds"]]


def _run_policies(task: Mapping[str, Any], folder: Path) -> Outcome:
    """Train, where that is not done, and evaluate each policy on the same seeds."""
    from dojo_env.learning.evaluation import run_policy  # torch takes long to load
    from dojo_env.learning.learner import finish_training

    usual = Training(**task["training"])
    episodes: list[dict[str, Any]] = []
    first: list[dict[str, Any]] = []
    for number in range(task.get("trainings", 1)):
        training, own = replace(usual, seed=usual.seed + number), find_training_folder(folder, number)
        finish_training(training, own)
        figures, infos = run_policy(training, own, range(task["seeds"]), num_seconds=task["seconds"])
        episodes += [{**each, "training": number} for each in figures]
        first = first or infos
    return episodes, first
