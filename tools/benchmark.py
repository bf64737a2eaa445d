"""Run rows of the benchmark's table on scenarios, five seeded hours each, and write what came out.

Each row's figures are kept in a JSON file of its own; a row that is there already, made with the same
settings, is not run again. The tables hold every row that is there, beside published figures where a file
of them is given.
"""

import argparse
import json
import multiprocessing
import platform
import shlex
import sys
from concurrent.futures import ProcessPoolExecutor, as_completed
from importlib.metadata import version
from pathlib import Path
from typing import Any

from result_table import write_tables

from dojo_env.errors import ConfigError
from dojo_env.metrics import SIX
from dojo_env.runs import run_controller, summarize
from dojo_env.scenario import find_scenario, open_map
from dojo_maps.errors import DojoError

CONTROLLERS: dict[str, tuple[str, dict[str, Any]]] = {
    "FixedTime": ("fixed-time", {}),
    "Cycle": ("cycle", {}),
    "Webster": ("webster", {}),
    "Actuated": ("actuated", {}),
    "DelayBased": ("delay-based", {}),
    "SOTL": ("sotl", {"min_green": 8}),
    "MaxPressure": ("max-pressure", {}),
    "Random": ("random", {}),
}
"""Controller and settings of each row that does not learn.

`min_green` is green alone: 8 where the paper's figures come from changing 10 s after the last change, its 2 s
of yellow included.
"""
OWN_SETTINGS: dict[tuple[str, str], dict[str, Any]] = {("cologne1", "MaxPressure"): {"min_green": 8}}
PACKAGES = ("traffic-dojo", "libsumo", "sumo-rl", "numpy")
KEPT = (*SIX, "mean_trip_duration", "mean_trip_duration_all", "arrived", "departed", "violations", "seed")


def describe(row: str, scenario: str, seeds: int, seconds: int) -> dict[str, Any]:
    """Tell everything that a row's figures depend on."""
    controller, settings = CONTROLLERS[row]
    return {
        "row": row,
        "scenario": scenario,
        "controller": controller,
        "settings": {"num_seconds": seconds, **settings, **OWN_SETTINGS.get((scenario, row), {})},
        "seeds": seeds,
    }


def run_row(task: dict[str, Any], path: Path) -> None:
    """Run a row's episodes and write its file, whole."""
    episodes = run_controller(
        task["controller"], range(task["seeds"]), scenario=task["scenario"], **task["settings"]
    )
    result = {
        **task,
        "command": shlex.join(["python", "tools/benchmark.py", "--controllers", task["row"],
                               "--scenarios", task["scenario"], "--seeds", str(task["seeds"])]),
        "versions": {"python": platform.python_version(), **{name: version(name) for name in PACKAGES}},
        "figures": {name: value for name, value in summarize(episodes).items() if name in KEPT},
        "episodes": [{name: episode[name] for name in KEPT} for episode in episodes],
    }  # fmt: skip
    path.parent.mkdir(parents=True, exist_ok=True)
    fresh = path.with_suffix(".part")
    fresh.write_text(json.dumps(result, indent=1) + "\n", encoding="utf-8")
    fresh.replace(path)


def find_open_rows(tasks: list[dict[str, Any]], folder: Path) -> dict[Path, dict[str, Any]]:
    """List the rows that have not been run yet, by the files they will be in."""
    found = {}
    for task in tasks:
        path = folder / task["scenario"] / f"{task['row']}.json"
        known = json.loads(path.read_text(encoding="utf-8")) if path.is_file() else {}
        if any(known.get(name) != value for name, value in task.items()):
            found[path] = task
    return found


def run_rows(rows: dict[Path, dict[str, Any]], jobs: int) -> None:
    """Run rows in processes of their own: libsumo holds one simulation per process."""
    with ProcessPoolExecutor(jobs, mp_context=multiprocessing.get_context("spawn")) as pool:
        running = {pool.submit(run_row, task, path): task for path, task in rows.items()}
        for done in as_completed(running):
            done.result()
            task = running[done]
            print(f"{task['scenario']}: {task['row']}", file=sys.stderr)


def main() -> int:
    """Run what is asked for and write the tables."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument(
        "--controllers", nargs="*", choices=list(CONTROLLERS), metavar="ROW",
        help=f"rows that do not learn: {', '.join(CONTROLLERS)} (all, if none is named)",
    )  # fmt: skip
    parser.add_argument("--scenarios", nargs="+", default=["two-way", "cologne1"], metavar="NAME")
    parser.add_argument("--seeds", type=int, default=5, help="episodes a row, seeds 0 to N-1")
    parser.add_argument("--seconds", type=int, default=3600, help="simulated seconds an episode")
    parser.add_argument("--jobs", type=int, default=2, help="processes at once")
    parser.add_argument("--results", type=Path, default=Path(__file__).parent / "results", metavar="FOLDER")
    parser.add_argument("--paper", type=Path, metavar="FILE", help="JSON of published figures")
    options = parser.parse_args()
    rows = list(CONTROLLERS) if options.controllers == [] else options.controllers or []
    try:
        published = (
            json.loads(options.paper.read_text(encoding="utf-8"))["scenarios"] if options.paper else {}
        )
        for scenario in options.scenarios:
            open_map(find_scenario(scenario))
        if options.seeds < 1:
            raise ConfigError(f"--seeds {options.seeds}: expected a number above 0")
        tasks = [
            describe(row, name, options.seeds, options.seconds) for name in options.scenarios for row in rows
        ]
        run_rows(find_open_rows(tasks, options.results), options.jobs)
    except (DojoError, OSError, ValueError, KeyError) as error:
        print(f"benchmark: {error}", file=sys.stderr)
        return 3
    print(write_tables(options.results, list(CONTROLLERS), published))
    return 0


if __name__ == "__main__":
    sys.exit(main())
