"""Run rows of the benchmark's table on scenarios, five seeded hours each, and write what came out.

Each row has a folder: its figures, the first hour's curves, and, where it learns, the run that trained its
policy. A row that is there already, made with the same settings, is not run again; a training that was
interrupted goes on. The tables hold every row that is there, beside published figures where a file of them
is given.
"""

import argparse
import multiprocessing
import os
import signal
import sys
from concurrent.futures import ProcessPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
from multiprocessing.connection import wait
from pathlib import Path
from threading import Thread
from typing import Any

from dojo_env.clusters import LOCAL
from dojo_env.errors import ConfigError, SimulationError
from dojo_env.scenario import find_scenario, open_map
from dojo_maps.command import Parser, run_command
from dojo_maps.interruption import begin
from learning import cluster_rows
from learning.outcomes import read_published
from learning.rows import CONSTRAINTS, GROUPS, ROWS, learns
from learning.run_row import describe, is_done, run_row
from learning.scenarios import check_scenario
from learning.settings import Training
from result_table import write_tables


def run_rows(tasks: list[dict[str, Any]], results: Path, jobs: int) -> None:
    """Run rows in processes of their own: libsumo holds one simulation per process."""
    spawn = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(jobs, mp_context=spawn, initializer=_prepare_to_end) as pool:
        running = {pool.submit(_run, task, results): task for task in tasks}
        try:
            for done in as_completed(running):
                done.result()
                task = running[done]
                print(f"{task['scenario']}: {task['row']}", file=sys.stderr)
        except BrokenProcessPool:
            raise SimulationError(
                "a row's process was killed, perhaps for want of memory; the same command goes on from the "
                "last checkpoints, and fewer --jobs need less"
            ) from None
        except KeyboardInterrupt:
            for worker in multiprocessing.active_children():
                worker.terminate()
            raise


def _run(task: dict[str, Any], results: Path) -> None:
    try:
        run_row(task, results)
    except KeyboardInterrupt:
        os._exit(130)  # Back in the pool, it would begin with the next row.


def _prepare_to_end() -> None:
    """Let a row end in order when the benchmark says so, or is there no more."""
    parent = multiprocessing.parent_process()

    def watch() -> None:
        wait([parent.sentinel])
        os.kill(os.getpid(), signal.SIGTERM)

    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.signal(signal.SIGTERM, signal.default_int_handler)
    Thread(target=watch, daemon=True).start()


def build_parser() -> Parser:
    """Declare what the command takes."""
    parser = Parser(description=__doc__)
    parser.add_argument(
        "--rows", nargs="*", action="extend", default=[], choices=(*ROWS, *GROUPS), metavar="ROW",
        help=f"{', '.join(ROWS)}; or {', '.join(GROUPS)}; without any, only the tables are written",
    )  # fmt: skip
    parser.add_argument("--controllers", action="append_const", const="controllers", dest="rows",
                        help="short for --rows controllers")  # fmt: skip
    parser.add_argument("--scenarios", nargs="+", default=["two-way", "cologne1"], metavar="NAME")
    parser.add_argument("--constraints", choices=CONSTRAINTS, default="paper", help="of signal changes: 2 s "
                        "as published, or an intergreen by speed with all-red, for rows that do not learn; "
                        "kept in a folder of that name (default: paper)")  # fmt: skip
    parser.add_argument("--seeds", type=int, default=5, help="episodes a row, seeds 0 to N-1")
    parser.add_argument("--seconds", type=int, default=3600, help="simulated seconds an episode")
    parser.add_argument("--jobs", type=int, default=2, help="rows at once")
    parser.add_argument("--ray", nargs="?", const=LOCAL, metavar="ADDRESS", help="run rows on a Ray "
                        "cluster: HOST:PORT of its head; without it, one of this machine")  # fmt: skip
    parser.add_argument("--results", type=Path, default=Path(__file__).parent / "results", metavar="FOLDER")
    parser.add_argument("--paper", type=Path, metavar="FILE", help="JSON of published figures")
    parser.set_defaults(run=run)
    return parser


def run(options: argparse.Namespace) -> int:
    """Run what is asked for and write the tables."""
    rows = dict.fromkeys(name for row in options.rows for name in GROUPS.get(row, (row,)))
    published = read_published(options.paper)
    for scenario in options.scenarios:
        open_map(find_scenario(scenario))
    if options.seeds < 1:
        raise ConfigError(f"--seeds {options.seeds}: expected a number above 0")
    learned = ", ".join(filter(learns, rows))
    if learned and options.constraints != "paper":
        raise ConfigError(
            f"--constraints {options.constraints}: {learned} learn under the paper's; leave out"
        )
    results = options.results / ("" if options.constraints == "paper" else options.constraints)
    tasks = [
        describe(row, name, options.seeds, options.seconds, options.constraints)
        for name in options.scenarios
        for row in rows
    ]
    left = [task for task in tasks if not is_done(task, results)]
    for task in left:
        if "training" in task:
            check_scenario(Training(**task["training"]))
    if left and options.ray:
        cluster_rows.run_rows(left, results, options.ray, options.jobs)
    else:
        run_rows(left, results, options.jobs)
    print(write_tables(results, ROWS, published if options.constraints == "paper" else {}))
    return 0


def main() -> int:
    """Benchmark; see `dojo_maps.command`."""
    return run_command("benchmark", build_parser, None)


if __name__ == "__main__":
    begin("benchmark: interrupted; the same command goes on from the last checkpoints")
    main()
