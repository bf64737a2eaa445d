"""Run controllers on RESCO's eight scenarios under its settings, and put them beside its published delays.

A delay is time loss plus depart delay, of all vehicles, those that have not arrived too: RESCO's own figure.

Source: Ault, Sharon, Reinforcement learning benchmarks for traffic signal control, NeurIPS 2021; its settings
from `config/map_config.py`, its figures from `utils/avg_timeLoss.py` of github.com/Pi-Star-Lab/RESCO.
"""

import argparse
import sys
from collections.abc import Iterable, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from itertools import product
from multiprocessing import get_context
from pathlib import Path
from statistics import fmean, median, pstdev
from typing import Any

from dojo_env.runs import run_controller
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
in its training, with other seeds. Source: Ault and Sharon, \
NeurIPS 2021; `avg_timeLoss.py` of Pi-Star-Lab/RESCO.

`{command}` makes this page again.

{table}
"""


def run_all(controllers: Sequence[str], seeds: int, processes: int) -> dict[tuple[str, str], list[float]]:
    """Measure each controller's delays on each scenario: seconds, one a seed."""
    tasks = list(product(controllers, SCENARIOS, range(seeds)))
    found: dict[tuple[str, str], list[float]] = {}
    with ProcessPoolExecutor(processes, mp_context=get_context("spawn")) as pool:
        for (name, scenario, seed), delay in zip(tasks, pool.map(_measure, tasks), strict=True):
            found.setdefault((name, scenario), []).append(delay)
            print(f"{scenario}: {name}, seed {seed}: {delay:.1f} s", file=sys.stderr, flush=True)
    return found


def _measure(task: tuple[str, str, int]) -> float:
    name, scenario, seed = task
    settings: Mapping[str, Any] = _ARTERIAL if scenario == "arterial4x4" else _USUAL
    (figures,) = run_controller(name, [seed], scenario=scenario, max_red=None, **settings)
    return float(figures["time_loss"] + figures["depart_delay"])


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
    return _TEXT.format(seeds=seeds, command=command, table="\n".join(lines))


def build_parser() -> Parser:
    """Declare what the command takes."""
    parser = Parser(description=__doc__)
    parser.add_argument("--controllers", nargs="+", default=list(CONTROLLERS), metavar="NAME")
    parser.add_argument("--seeds", type=int, default=5, help="episodes each, seeds 0 to N-1; 0 for none")
    parser.add_argument("--processes", type=int, default=2)
    parser.set_defaults(run=run)
    return parser


def run(options: argparse.Namespace) -> int:
    """Measure what is asked for, keep it beside what is known of other controllers, and write the page."""
    kept = read_table(OURS, COLUMNS) if OURS.is_file() else []
    known = {(each["controller"], each["scenario"]): each for each in kept}
    for (name, scenario), delays in run_all(options.controllers, options.seeds, options.processes).items():
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
