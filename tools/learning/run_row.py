"""Run one row of the benchmark: train its policy where it learns, evaluate it, keep all that came out."""

import shlex
from collections.abc import Mapping
from dataclasses import asdict
from pathlib import Path
from typing import Any

from dojo_env.metrics import SIX
from dojo_env.runs import run_controller, summarize
from dojo_maps.whole_file import write_json, write_table

from .outcomes import read_result
from .rows import CONSTRAINTS, CONTROLLERS, find_settings, find_training, learns
from .settings import Training, list_versions

FIGURES, SERIES = "figures.json", "series.csv"
KEPT = (*SIX, "mean_trip_duration", "travel_time_all", "arrived", "departed", "violations", "seed")
CURVES = {
    "co2": "agents_total_co2", "delay": "agents_total_delay",
    "accumulated_waiting": "agents_total_accumulated_waiting_time", "queue": "agents_total_stopped",
}  # fmt: skip
"""What is kept of every decision of the first seed's hour, and its name in `info`."""


def find_folder(row: str, scenario: str, results: Path) -> Path:
    """Tell where a row's files are; a star is no name for a folder."""
    return results / scenario / row.replace("*", "-encoder")


def describe(row: str, scenario: str, seeds: int, seconds: int, constraints: str = "paper") -> dict[str, Any]:
    """Tell everything that a row's figures depend on."""
    task: dict[str, Any] = {"row": row, "scenario": scenario, "seeds": seeds, "seconds": seconds}
    if learns(row):
        return {**task, "training": asdict(find_training(row, scenario))}
    settings = {**CONSTRAINTS[constraints], **find_settings(row, scenario)}
    return {**task, "controller": CONTROLLERS[row][0], "constraints": constraints, "settings": settings}


def is_done(task: Mapping[str, Any], results: Path) -> bool:
    """Tell whether a row's figures are there, made with the same settings."""
    path = find_folder(task["row"], task["scenario"], results) / FIGURES
    known = read_result(path) if path.is_file() else {}
    if "training" in known:  # A setting that came later had its default before.
        known = {**known, "training": asdict(Training(**known["training"]))}
    return all(known.get(name) == value for name, value in task.items())


def run_row(task: Mapping[str, Any], results: Path) -> None:
    """Run a row's episodes and write its files, figures last."""
    folder = find_folder(task["row"], task["scenario"], results)
    folder.mkdir(parents=True, exist_ok=True)
    episodes, infos = _run_policy(task, folder) if "training" in task else _run_controller(task)
    words = ["python", "tools/benchmark.py", "--rows", task["row"], "--scenarios", task["scenario"],
             "--seeds", str(task["seeds"]), "--seconds", str(task["seconds"])]  # fmt: skip
    if task.get("constraints", "paper") == "paper":
        _write_series(folder / SERIES, infos)
    else:
        words += ["--constraints", task["constraints"]]
    result = {
        **task,
        "command": shlex.join(words),
        "versions": list_versions(),
        "figures": {name: value for name, value in summarize(episodes).items() if name in KEPT},
        "episodes": [{name: episode[name] for name in KEPT} for episode in episodes],
    }
    write_json(folder / FIGURES, result)


def _write_series(path: Path, infos: list[dict[str, Any]]) -> None:
    """Write the curves of an hour; those that pictures show are the paper's."""
    series = ([int(info["step"]), *(round(info[name], 3) for name in CURVES.values())] for info in infos)
    write_table(path, ["second", *CURVES], series)


Outcome = tuple[list[dict[str, Any]], list[dict[str, Any]]]
"""The figures of each episode, and what `info` told at every decision of the first."""


def _run_controller(task: Mapping[str, Any]) -> Outcome:
    infos: list[dict[str, Any]] = []
    figures = run_controller(
        task["controller"], range(task["seeds"]), scenario=task["scenario"], num_seconds=task["seconds"],
        on_step=infos.append, **task["settings"],
    )  # fmt: skip
    return figures, infos[: len(infos) // task["seeds"]]


def _run_policy(task: Mapping[str, Any], folder: Path) -> Outcome:
    from .evaluation import run_policy  # torch takes long to load
    from .learner import is_trained, train

    training = Training(**task["training"])
    if not is_trained(training, folder):
        train(training, folder, resume=(folder / "checkpoint.pt").is_file())
    return run_policy(training, folder, range(task["seeds"]), num_seconds=task["seconds"])
