"""The command `dojo-env run`: a controller plays episodes, and its figures are printed."""

import argparse
import sys
from collections import Counter
from pathlib import Path
from typing import TYPE_CHECKING, Any

from dojo_env.commands.options import (
    add_routes_option,
    add_sensing_options,
    find_controller,
    read_sensing,
    read_yellow,
)
from dojo_env.errors import ConfigError
from dojo_maps.command import Commands, add_command
from dojo_maps.progress import Progress
from dojo_maps.whole_file import write_json
from dojo_maps.wording import counted

if TYPE_CHECKING:
    from dojo_env.runs import Episodes

_MISSED = 0.02
"""The share of vehicles from which on it matters that they have not arrived."""


def add_run(commands: Commands) -> None:
    """Add the command to the parser.

    Args:
        commands: what `add_subparsers` made; the command is added to it.
    """
    run = add_command(
        commands,
        "run",
        _run,
        "run a controller and print its figures",
        example="dojo-env run --scenario cologne1 --controller max-pressure --seeds 5 --json out.json",
    )
    run.add_argument("--scenario", required=True, help="a packaged scenario such as cologne1, or a .sumocfg")
    add_routes_option(run)
    run.add_argument(
        "--controller",
        default="fixed-time",
        metavar="NAME",
        help="such as max-pressure, or a policy.pt (default: fixed-time, the network's own programs)",
    )
    run.add_argument(
        "--seeds", type=int, default=1, metavar="N", help="how many episodes, each with the next seed"
    )
    run.add_argument(
        "--seconds", type=int, metavar="S", help="simulated (default: to the scenario's end, or 3600)"
    )
    run.add_argument(
        "--min-green", type=int, default=10, metavar="S", help="seconds of green before a change"
    )
    run.add_argument("--yellow", type=read_yellow, default=2, metavar="S", help='seconds, or "speed"')
    run.add_argument("--all-red", type=int, default=0, metavar="S", help="seconds between yellow and green")
    run.add_argument("--signals", nargs="+", metavar="ID", help="the signals to control (default: all)")
    run.add_argument(
        "--detector",
        metavar="FILE",
        help="act on what this detector (.onnx, or .json) finds in pictures of the approaches",
    )
    add_sensing_options(run)
    run.add_argument("--json", type=Path, metavar="FILE", help="also write every episode's figures")
    run.add_argument("--csv", metavar="STEM", help="also write a CSV and a JSON file per episode")
    run.add_argument(
        "--plot", type=Path, metavar="FILE", help="also draw figures over time: a .png, .svg or .pdf"
    )
    run.add_argument("--record", metavar="STEM", help="also record each episode, in STEM_ep1.npz and so on")
    run.add_argument("--video", type=Path, metavar="FILE", help="also show every second in an .mp4 or .webm")
    run.add_argument(
        "--sumo-outputs",
        type=Path,
        metavar="FOLDER",
        help="where the scenario's own outputs go (default: none)",
    )


def _run(options: argparse.Namespace) -> int:
    from dojo_env.runs import run_controller, summarize

    _check(options)

    def tell(figures: dict[str, Any]) -> None:
        if not figures["departed"] + figures["backlogged"]:
            print(
                f"dojo-env: {options.scenario}: seed {figures['seed']}: no vehicle in the whole episode; "
                "let it begin when the demand does (<begin> of a .sumocfg), or give it --seconds or --routes",
                file=sys.stderr,
            )
        if sys.stderr.isatty() and not options.quiet:
            print(f"seed {figures['seed']}: travel time {figures['travel_time']:.2f} s", file=sys.stderr)

    figures = run_controller(
        find_controller(options.controller, options.scenario),
        options.seeds,
        on_episode=tell,
        on_stage=Progress(quiet=options.quiet),
        scenario=options.scenario,
        routes=options.routes,
        num_seconds=options.seconds,
        min_green=options.min_green,
        yellow_time=options.yellow,
        all_red=options.all_red,
        ts_ids=options.signals,
        out_csv_name=options.csv,
        record_name=options.record,
        video=options.video,
        sumo_outputs=options.sumo_outputs,
        **read_sensing(options),
        **_read_detector(options.detector),
    )
    violations = _print_figures(figures)
    if options.json:
        about = {"scenario": options.scenario, "controller": options.controller}
        write_json(options.json, {**about, "summary": summarize(figures), "episodes": figures})
    if options.plot:
        figures.plot().save(options.plot)
    missing = max(episode["missing"] for episode in figures)
    if missing > _MISSED:
        print(
            f"dojo-env: warning: {options.scenario}: up to {missing:.1%} of the vehicles had not arrived at "
            "the end, and travel_time leaves them out; compare travel_time_all",
            file=sys.stderr,
        )
    _tell_locks(figures, options.scenario)
    if violations:
        found = ", ".join(f"{count} {rule}" for rule, count in violations.most_common())
        print(f"dojo-env: warning: {options.scenario}: signals were unsafe: {found}", file=sys.stderr)
    return 0


def _check(options: argparse.Namespace) -> None:
    """Refuse before the episodes what would fail after them."""
    from dojo_env.charts import check_name, styled

    if options.seeds < 1:
        raise ConfigError(f"--seeds {options.seeds}: expected a number above 0")
    if options.json and not options.json.absolute().parent.is_dir():
        raise ConfigError(f"--json {options.json}: no such folder; make it first")
    if options.plot:
        check_name(options.plot)
        styled()  # Matplotlib may be missing.


def _print_figures(figures: "Episodes") -> Counter[str]:
    """Print the table; returns how often signals were unsafe, by rule."""
    from dojo_env.runs import JAMMED, summarize

    print(f"{'figure':24}{'mean':>12} {'± deviation':12}{'median':>12}")
    for name, value in summarize(figures).items():
        print(f"{name:24}{value['mean']:12.2f} ± {value['std']:<10.2f}{value['median']:12.2f}")
    jammed = sum(episode["late"] > JAMMED for episode in figures)
    print(f"{'episodes that jammed':24}{jammed:12d}")
    violations = sum((Counter(episode["violations"]) for episode in figures), Counter[str]())
    print(f"{'safety violations':24}{violations.total():12d}")
    return violations


def _tell_locks(figures: "Episodes", scenario: str) -> None:
    """Say where vehicles block one another inside a junction, and what helps."""
    locked = [episode["locks"] for episode in figures if episode["locks"]]
    if locked:
        junctions = ", ".join(sorted(set().union(*locked)))
        print(
            f"dojo-env: warning: {scenario}: at the end of {counted(len(locked), 'episode')} vehicles had "
            f"stood inside a junction for more than three minutes ({junctions}): they block one another, or "
            "the road ahead is full; with --yellow speed --all-red 2 a junction empties between phases",
            file=sys.stderr,
        )


def _read_detector(file: str | None) -> dict[str, Any]:
    """Turn `--detector` into settings of an environment."""
    if file is None:
        return {}
    from dojo_env.sensors.video_detector import PICTURE, VideoDetector

    return {"observation": VideoDetector(model=file), "width": PICTURE[0], "height": PICTURE[1]}
