"""Run controllers on RESCO's eight scenarios under its settings, and put them beside its published delays.

A delay is time loss plus depart delay, of all vehicles, those that have not arrived too: RESCO's own figure.
Rows of the benchmark that learn are trained anew under these settings, once on each scenario; a training that
is in its folder already is measured, one that was interrupted goes on.

    python tools/compare_resco.py
    python tools/compare_resco.py --controllers --learners MPLight --scenarios cologne3 --runs runs/resco

Source: Ault, Sharon, Reinforcement learning benchmarks for traffic signal control, NeurIPS 2021; its settings
from `config/map_config.py`, its figures from `utils/avg_timeLoss.py` of github.com/Pi-Star-Lab/RESCO.
"""

import argparse
import sys
from collections.abc import Iterable, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from functools import partial
from itertools import product
from multiprocessing import get_context
from pathlib import Path
from statistics import fmean, median, pstdev

from dojo_env.benchmark.row_runs import find_folder
from dojo_env.benchmark.rows import find_row
from dojo_env.learning.learner import finish_training
from dojo_env.learning.policy_controller import PolicyController
from dojo_env.runs import run_controller
from dojo_env.scenario import find_scenario, open_map
from dojo_maps.command import Parser, run_command
from dojo_maps.input_files import read_table
from dojo_maps.interruption import begin
from dojo_maps.whole_file import write_table, write_text

FOLDER = Path(__file__).parent / "results" / "resco"
OURS = FOLDER / "ours.csv"
COLUMNS = ("controller", "scenario", "delay", "spread", "median", "seeds")
PUBLISHED = ("method", "scenario", "delay", "best_episode")
SCENARIOS = ("grid4x4", "arterial4x4", "cologne1", "cologne3", "cologne8", "ingolstadt1", "ingolstadt7",
             "ingolstadt21")  # fmt: skip
CONTROLLERS = (
    "fixed-time", "actuated", "max-pressure-paper", "max-pressure", "queue-pressure", "rolling-horizon",
    "learned",
)  # fmt: skip
LEARNERS = ("MPLight", "CoLight", "MAPPO", "PPO-F shared")
"""Rows of the benchmark that the page has; a signal alone learns by the same network and algorithm."""
EPISODES = {"grid4x4": 60, "arterial4x4": 30, "ingolstadt21": 30}
"""Hours of traffic of a training; 100 where no other number is given, as RESCO's program has by default."""
_USUAL = {"delta_time": 10, "yellow_time": 3, "min_green": 7}
"""A decision every 10 s, of which a change takes 3: what is left is green."""
_ARTERIAL = {"delta_time": 5, "yellow_time": 2, "min_green": 3}
_TEXT = """# RESCO's scenarios

Mean delay in seconds: time loss plus depart delay, of all vehicles, those that have not arrived too. One \
hour of each scenario, ± the standard deviation over {seeds} seeds; in brackets their median. Where the two \
are far apart, vehicles locked each other inside a junction in some hours, and nobody moved there again: \
without red for all after a change, and without teleporting, SUMO lets that happen under any controller.

The settings are RESCO's: a decision every 10 s and 3 s of yellow (arterial4x4: 5 s and 2 s), no all-red, no \
minimum green but what a decision leaves, no longest red, no teleporting. Three things differ. Its figures \
were made with SUMO 1.9. On grid4x4 and arterial4x4 it draws another demand for each episode, where these \
are runs of the one demand that the package `sumo-rl` holds. Its signals see 200 m, these 150 m. *Fixed \
time* beside fixed-time tells how far that goes: both are the networks' own programs.

Published figures of rules are means of all episodes; of learners, the mean of the last ten episodes of \
training, and in brackets the best episode, which is what its paper shows. `learned` met these scenarios \
in its training, with other seeds. What learns and is not in italics ({learners}) was trained for this page, \
once on each scenario and under the settings above: for 100 hours of its traffic, on grid4x4 60, on \
arterial4x4 and ingolstadt21 30. The policy that did best on yet other seeds is measured. `PPO-F shared` is \
IPPO with one policy for all signals. It, CoLight and MAPPO share one network that scores phases by their \
number, and a number means another phase at each junction of Ingolstadt; MPLight scores them by the \
movements that they serve. Source: Ault and Sharon, NeurIPS 2021; `avg_timeLoss.py` of Pi-Star-Lab/RESCO.

`{command}` makes this page again.

{table}
"""


def run_all(
    tasks: Sequence[tuple[str, str]], seeds: int, processes: int, *, policies: Path | None = None
) -> dict[tuple[str, str], list[float]]:
    """Measure delays, seconds, one a seed.

    Args:
        tasks: controllers, or rows that learn, each with a scenario.
        seeds: of the episodes, from 0.
        processes: at once.
        policies: holds the trainings, if the tasks are of rows that learn.

    Returns:
        The delays of each task.
    """
    whole = list(product(tasks, range(seeds)))
    found: dict[tuple[str, str], list[float]] = {}
    with ProcessPoolExecutor(processes, mp_context=get_context("spawn")) as pool:
        measured = pool.map(partial(_measure, policies=policies), whole)
        for ((name, scenario), seed), delay in zip(whole, measured, strict=True):
            found.setdefault((name, scenario), []).append(delay)
            print(f"{scenario}: {name}, seed {seed}: {delay:.1f} s", file=sys.stderr, flush=True)
    return found


def _measure(task: tuple[tuple[str, str], int], *, policies: Path | None) -> float:
    (name, scenario), seed = task
    acting = name if policies is None else PolicyController(find_folder(name, scenario, policies))
    (figures,) = run_controller(acting, [seed], scenario=scenario, max_red=None, **_settings(scenario))
    return float(figures["time_loss"] + figures["depart_delay"])


def _settings(scenario: str) -> Mapping[str, int]:
    return _ARTERIAL if scenario == "arterial4x4" else _USUAL


def train_row(name: str, scenario: str, folder: Path) -> None:
    """Train a row of the benchmark under RESCO's settings, or go on with what was interrupted.

    Args:
        name: of a row that learns.
        scenario: one of `SCENARIOS`.
        folder: for the training; one that holds it whole is left as it is.

    Raises:
        ConfigError: there is no such row, or the folder holds another training.
    """
    settings, episodes = _settings(scenario), EPISODES.get(scenario, 100)
    signals = open_map(find_scenario(scenario)).road_map.signals
    training = replace(
        find_row(name).find_training(scenario),
        agents="shared" if len(signals) > 1 else "single",
        steps=episodes * 3600 // settings["delta_time"],
        processes=2,
        every=10,
        hyperparameters={},
        **settings,
    )
    print(f"{scenario}: {name} learns for {episodes} hours of traffic", file=sys.stderr, flush=True)
    finish_training(training, folder)


def format_page(ours: Iterable[Mapping[str, str]], published: Iterable[Mapping[str, str]]) -> str:
    """Write both as one table, a column a scenario."""
    rows: dict[str, dict[str, str]] = {}
    for each in published:
        best = f" ({float(each['best_episode']):.1f})" if each["best_episode"] else ""
        rows.setdefault(f"*{each['method']}*", {})[each["scenario"]] = f"{float(each['delay']):.1f}{best}"
    seeds = 0
    for each in ours:
        seeds = max(seeds, int(each["seeds"]))
        cell = f"{float(each['delay']):.1f} ± {float(each['spread']):.1f} ({float(each['median']):.1f})"
        rows.setdefault(each["controller"], {})[each["scenario"]] = cell
    lines = [f"| delay (s); *published* | {' | '.join(SCENARIOS)} |", "|---" * (len(SCENARIOS) + 1) + "|"]
    for name, cells in rows.items():
        lines.append(f"| {name} | {' | '.join(cells.get(scenario, '') for scenario in SCENARIOS)} |")
    command = f"python tools/compare_resco.py --seeds {seeds}"
    learners = ", ".join(LEARNERS)
    return _TEXT.format(seeds=seeds, command=command, learners=learners, table="\n".join(lines))


def build_parser() -> Parser:
    """Declare what the command takes."""
    parser = Parser(description=__doc__)
    parser.add_argument("--controllers", nargs="*", default=list(CONTROLLERS), metavar="NAME")
    parser.add_argument("--learners", nargs="*", default=list(LEARNERS), metavar="ROW")
    parser.add_argument("--scenarios", nargs="+", default=list(SCENARIOS), choices=SCENARIOS, metavar="NAME")
    parser.add_argument("--runs", type=Path, default=Path("runs", "resco"), help="folder of the trainings")
    parser.add_argument("--seeds", type=int, default=5, help="episodes each, seeds 0 to N-1; 0 for none")
    parser.add_argument("--processes", type=int, default=2)
    parser.set_defaults(run=run)
    return parser


def run(options: argparse.Namespace) -> int:
    """Measure what is asked for, keep it beside what is known of other controllers, and write the page."""
    kept = read_table(OURS, COLUMNS) if OURS.is_file() else []
    known = {(each["controller"], each["scenario"]): each for each in kept}
    learned = list(product(options.learners, options.scenarios))
    for name, scenario in learned if options.seeds else ():
        train_row(name, scenario, find_folder(name, scenario, options.runs))
    acting = list(product(options.controllers, options.scenarios))
    found = run_all(acting, options.seeds, options.processes)
    found |= run_all(learned, options.seeds, options.processes, policies=options.runs)
    for (name, scenario), delays in found.items():
        measures = (f"{measure(delays):.2f}" for measure in (fmean, pstdev, median))
        figures = (name, scenario, *measures, str(len(delays)))
        known[name, scenario] = dict(zip(COLUMNS, figures, strict=True))
    write_table(OURS, COLUMNS, (each.values() for each in known.values()))
    write_text(
        FOLDER / "README.md", format_page(known.values(), read_table(FOLDER / "published.csv", PUBLISHED))
    )
    return 0


def main() -> int:
    """Compare; see `dojo_maps.command`."""
    return run_command("compare_resco", build_parser, None)


if __name__ == "__main__":
    begin("compare_resco: interrupted")
    main()
