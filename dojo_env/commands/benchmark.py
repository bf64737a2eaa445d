"""The command `dojo-env benchmark`: rows of controllers and learners on scenarios, kept, and their tables."""

import argparse
from pathlib import Path
from typing import Any

from dojo_env.commands.options import add_ray_option
from dojo_env.errors import ConfigError
from dojo_maps import interruption
from dojo_maps.command import Commands, add_command

_RESUME = "dojo-env: benchmark: interrupted; the same command goes on from the last checkpoints"


def add_benchmark(commands: Commands) -> None:
    """Add the command to the parser.

    Args:
        commands: what `add_subparsers` made; the command is added to it.
    """
    benchmark = add_command(
        commands,
        "benchmark",
        _benchmark,
        "run rows of the benchmark's table, and write what came out",
        example="dojo-env benchmark --rows MaxPressure PPO-F --scenarios two-way",
    )
    benchmark.add_argument(
        "--rows",
        nargs="*",
        action="extend",
        default=[],
        metavar="ROW",
        help="names, .toml files, or all, controllers, searched, learned, varied, several (default: none)",
    )
    benchmark.add_argument("--list", action="store_true", help="list the rows and end")
    benchmark.add_argument("--scenarios", nargs="+", default=["two-way", "cologne1"], metavar="NAME")
    benchmark.add_argument(
        "--constraints",
        default="paper",
        metavar="NAME",
        help="of controllers: paper (default; 2 s of yellow), or intergreen (by speed, with all-red)",
    )
    benchmark.add_argument("--seeds", type=int, default=5, metavar="N", help="episodes a row (default: 5)")
    benchmark.add_argument(
        "--trainings", type=int, default=1, metavar="N", help="of each row that learns (default: 1)"
    )
    benchmark.add_argument(
        "--seconds", type=int, default=3600, metavar="S", help="simulated, an episode (default: 3600)"
    )
    benchmark.add_argument("--jobs", type=int, default=2, metavar="N", help="rows at once (default: 2)")
    benchmark.add_argument("--results", type=Path, default=Path("results"), metavar="FOLDER")
    benchmark.add_argument("--paper", type=Path, metavar="FILE", help="JSON of published figures")
    benchmark.add_argument("--pictures", action="store_true", help="also draw them, into FOLDER/pictures")
    add_ray_option(benchmark, "run rows on a Ray cluster")


def _benchmark(options: argparse.Namespace) -> int:
    from dojo_env.benchmark import cluster, local
    from dojo_env.benchmark.row_runs import is_done
    from dojo_env.benchmark.rows import read_packaged_rows
    from dojo_env.benchmark.tables import write_tables
    from dojo_env.learning.result_files import read_published
    from dojo_env.learning.scenario_check import check_scenario
    from dojo_env.learning.settings import Training

    if options.list:
        for name, row in read_packaged_rows().items():
            print(f"{name:24}{row.summary}")
        return 0
    published = read_published(options.paper)
    is_paper = options.constraints == "paper"
    results = options.results / ("" if is_paper else options.constraints)
    left = [task for task in _describe(options) if not is_done(task, results)]
    for task in left:
        if "training" in task:
            check_scenario(Training(**task["training"]))
    interruption.explain(_RESUME)
    if left and options.ray:
        cluster.run_rows(left, results, options.ray, options.jobs)
    elif left:
        local.run_rows(left, results, options.jobs)
    print(write_tables(results, published if is_paper else {}))
    if options.pictures:
        from dojo_env.benchmark.pictures import draw_all

        for path in draw_all(results, published):
            print(path)
    return 0


def _describe(options: argparse.Namespace) -> list[dict[str, Any]]:
    """Describe every row on every scenario.

    Raises:
        ConfigError: an argument cannot work.
    """
    from dojo_env.benchmark.row_runs import describe
    from dojo_env.benchmark.rows import CONSTRAINTS, find_row, list_groups
    from dojo_env.scenario import find_scenario, open_map

    for name in ("seeds", "trainings", "seconds", "jobs"):
        if getattr(options, name) < 1:
            raise ConfigError(f"--{name} {getattr(options, name)}: expected a number above 0")
    if options.constraints not in CONSTRAINTS:
        raise ConfigError(f"--constraints {options.constraints}: expected one of {', '.join(CONSTRAINTS)}")
    groups = list_groups()
    names = dict.fromkeys(name for row in options.rows for name in groups.get(row, (row,)))
    rows = [find_row(name) for name in names]
    learned = ", ".join(row.name for row in rows if row.learns)
    if learned and options.constraints != "paper":
        raise ConfigError(
            f"--constraints {options.constraints}: {learned} learn under the paper's; leave out"
        )
    for scenario in options.scenarios:
        open_map(find_scenario(scenario))
    settings = {name: getattr(options, name) for name in ("seeds", "seconds", "constraints", "trainings")}
    return [describe(row, scenario, **settings) for scenario in options.scenarios for row in rows]
