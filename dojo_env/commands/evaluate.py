"""The command `dojo-env evaluate`: trained policies, as they were trained or under other conditions."""

import argparse
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

from dojo_env.commands.options import find_controller
from dojo_env.errors import ConfigError
from dojo_maps.command import Commands, add_command
from dojo_maps.progress import say, say_nothing
from dojo_maps.whole_file import write_json
from dojo_maps.wording import counted

_COLUMNS = (
    ("travel_time", 2, 18),
    ("travel_time_all", 2, 18),
    ("accumulated_waiting", 0, 18),
    ("queue", 2, 16),
)
"""Figures that are shown, their digits behind the point, and how wide their columns are."""


def add_evaluate(commands: Commands) -> None:
    """Add the command to the parser.

    Args:
        commands: what `add_subparsers` made; the command is added to it.
    """
    evaluate = add_command(
        commands,
        "evaluate",
        _evaluate,
        "measure policies and controllers",
        example="dojo-env evaluate runs/bev --under night rain --seeds 5",
    )
    evaluate.add_argument(
        "policies",
        nargs="+",
        metavar="POLICY",
        help="folders of dojo-env train, or controllers such as learned-vision or max-pressure",
    )
    evaluate.add_argument(
        "--scenario",
        nargs="+",
        metavar="NAME",
        help="where controllers, and policies for any junction, are measured (default: cologne1)",
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
    from dojo_env.runs import summarize

    if options.seeds < 1:
        raise ConfigError(f"--seeds {options.seeds}: expected a number above 0")
    if options.json and not options.json.absolute().parent.is_dir():
        raise ConfigError(f"--json {options.json}: no such folder; make it first")
    tell = say_nothing if options.quiet else say
    found: list[dict[str, Any]] = []
    for run in [run for policy in options.policies for run in _list_runs(policy, options)]:
        tell(f"{run.policy}: {run.scenario}: {run.under}: {counted(options.seeds, 'episode')}")
        episodes = run.measure()
        found.append(
            {
                "policy": run.policy,
                "scenario": run.scenario,
                "under": run.under,
                "summary": summarize(episodes),
                "episodes": episodes,
            }
        )
    _print(found)
    if options.json:
        write_json(options.json, {"evaluations": found})
    return 0


@dataclass(frozen=True, slots=True, kw_only=True)
class _Run:
    """Episodes of one policy under one condition, not yet measured."""

    policy: str
    scenario: str
    under: str
    measure: Callable[[], list[dict[str, Any]]]


def _list_runs(policy: str, options: argparse.Namespace) -> list[_Run]:
    """List what is to be measured of a policy; bad arguments are told before torch is loaded.

    Raises:
        ConfigError: a condition is unknown, or there is no such policy.
        RunFileError: a folder holds none.
    """
    from dojo_env.learning.other_conditions import choose_conditions, choose_for_controller
    from dojo_env.learning.settings import POLICY, SETTINGS, read_training
    from dojo_env.runs import run_controller

    seeds, path = range(options.seeds), Path(policy)
    folder = path.parent if path.name == POLICY else path
    if folder.is_dir() and not any((folder / name).is_file() for name in ("policy.npz", "lanes.npz")):
        if options.scenario:
            raise ConfigError(f"--scenario: {policy} was trained for one; leave it out")
        training = read_training(folder / SETTINGS)
        return [
            _Run(
                policy=str(folder),
                scenario=training.scenario,
                under=name,
                measure=partial(
                    _run_policy, training, folder, seeds, options.seconds or training.seconds, changes
                ),
            )
            for name, changes in choose_conditions(training, options.under).items()
        ]
    found = list[_Run]()
    for scenario in options.scenario or ("cologne1",):
        controller = find_controller(policy, scenario)
        for name, changes in choose_for_controller(controller, options.under).items():
            settings = {"scenario": scenario, "num_seconds": options.seconds, **changes}
            measure = partial(run_controller, controller, seeds, **settings)
            found.append(_Run(policy=policy, scenario=Path(scenario).stem, under=name, measure=measure))
    return found


def _run_policy(
    training: Any, folder: Path, seeds: Sequence[int], seconds: int, changes: Mapping[str, Any]
) -> list[dict[str, Any]]:
    from dojo_env.learning.evaluation import run_policy

    return run_policy(training, folder, seeds, num_seconds=seconds, **changes)[0]


def _print(found: list[dict[str, Any]]) -> None:
    """Print a line for each policy and condition: means, and their deviations over the seeds."""
    names = ("policy", "scenario", "under")
    widths = [max(len(each[name]) for each in (*found, {name: name})) for name in names]
    heads = "  ".join(f"{name:{width}}" for name, width in zip(names, widths, strict=True))
    print(f"{heads}{'travel time (s)':>18}{'all trips (s)':>18}{'waiting (s)':>18}{'queue (veh)':>16}")
    for each in found:
        cells = "".join(
            f"{_cell(each['summary'][name], digits):>{width}}" for name, digits, width in _COLUMNS
        )
        words = "  ".join(f"{each[name]:{width}}" for name, width in zip(names, widths, strict=True))
        print(f"{words}{cells}")


def _cell(figure: Mapping[str, float], digits: int) -> str:
    return f"{figure['mean']:.{digits}f} ± {figure['std']:.{digits}f}"
