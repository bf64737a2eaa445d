"""The command `dojo-env evaluate`: trained policies, as they were trained or under other conditions."""

import argparse
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from dojo_env.errors import ConfigError
from dojo_maps.command import Commands, add_command
from dojo_maps.progress import say, say_nothing
from dojo_maps.whole_file import write_json

_COLUMNS = (
    ("travel_time", 2, 18),
    ("travel_time_all", 2, 18),
    ("accumulated_waiting", 0, 18),
    ("queue", 2, 16),
)
"""Figures that are shown, their digits behind the point, and how wide their columns are."""


def add_evaluate(commands: Commands) -> None:
    """Add the command to the parser."""
    evaluate = add_command(
        commands,
        "evaluate",
        _evaluate,
        "measure trained policies",
        example="dojo-env evaluate runs/bev --under night rain --seeds 5",
    )
    evaluate.add_argument(
        "policies", nargs="+", type=Path, metavar="POLICY", help="folders of dojo-env train"
    )
    evaluate.add_argument(
        "--under",
        nargs="+",
        default=[],
        metavar="NAME",
        help="other light, cameras or detectors, such as night or noisy-detector; all of them with `all`",
    )
    evaluate.add_argument(
        "--seeds", type=int, default=5, metavar="N", help="episodes of each, seeds 0 to N-1 (default: 5)"
    )
    evaluate.add_argument(
        "--seconds", type=int, metavar="S", help="simulated, an episode (default: as in its training)"
    )
    evaluate.add_argument("--json", type=Path, metavar="FILE", help="also write every episode's figures")


def _evaluate(options: argparse.Namespace) -> int:
    from dojo_env.learning.other_conditions import choose_conditions
    from dojo_env.learning.settings import POLICY, SETTINGS, read_training
    from dojo_env.runs import summarize

    if options.seeds < 1:
        raise ConfigError(f"--seeds {options.seeds}: expected a number above 0")
    if options.json and not options.json.absolute().parent.is_dir():
        raise ConfigError(f"--json {options.json}: no such folder; make it first")
    tell = say_nothing if options.quiet else say
    folders = [path.parent if path.name == POLICY else path for path in options.policies]
    wanted = []
    for folder in folders:
        training = read_training(folder / SETTINGS)
        wanted.append((folder, training, choose_conditions(training, options.under)))
    from dojo_env.learning.evaluation import run_policy  # Bad arguments are told before torch is loaded.

    found: list[dict[str, Any]] = []
    for folder, training, under in wanted:
        for name, changes in under.items():
            seconds = options.seconds or training.seconds
            tell(f"{folder}: {name}: {options.seeds} episodes of {seconds} s")
            episodes, _ = run_policy(training, folder, range(options.seeds), num_seconds=seconds, **changes)
            found.append(
                {
                    "policy": str(folder),
                    "scenario": training.scenario,
                    "under": name,
                    "summary": summarize(episodes),
                    "episodes": episodes,
                }
            )
    _print(found)
    if options.json:
        write_json(options.json, {"evaluations": found})
    return 0


def _print(found: list[dict[str, Any]]) -> None:
    """Print a line for each policy and condition: means, and their deviations over the seeds."""
    widths = [max(len(each[name]) for each in found) for name in ("policy", "under")]
    print(f"{'policy':{widths[0]}}  {'under':{widths[1]}}{'travel time (s)':>18}{'all trips (s)':>18}"
          f"{'waiting (s)':>18}{'queue (veh)':>16}")  # fmt: skip
    for each in found:
        cells = "".join(
            f"{_cell(each['summary'][name], digits):>{width}}" for name, digits, width in _COLUMNS
        )
        print(f"{each['policy']:{widths[0]}}  {each['under']:{widths[1]}}{cells}")


def _cell(figure: Mapping[str, float], digits: int) -> str:
    return f"{figure['mean']:.{digits}f} ± {figure['std']:.{digits}f}"
