"""The command `dojo-env`. Results go to standard output, everything else to standard error."""

import argparse
import json
import re
import signal
import sys
from collections.abc import Sequence
from pathlib import Path
from types import FrameType
from typing import Any

from dojo_maps.errors import DojoError


def main(arguments: Sequence[str] | None = None) -> int:
    """Run a command and return its exit status.

    0 done, 2 wrong usage, 3 bad input, 4 failure or a tool missing, 130 interrupted.
    """
    options = _parser().parse_args(arguments)
    signal.signal(signal.SIGTERM, _stop)
    try:
        status: int = options.run(options)
    except DojoError as error:
        print(f"dojo-env: {' '.join(str(error).split())}", file=sys.stderr)
        return error.exit_status
    except KeyboardInterrupt:
        print("dojo-env: interrupted", file=sys.stderr)
        return 130
    except OSError as error:
        print(f"dojo-env: {error}", file=sys.stderr)
        return 4
    return status


def _stop(_signal: int, _frame: FrameType | None) -> None:
    raise KeyboardInterrupt


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="dojo-env", description="Traffic signal control on converted maps, with SUMO's traffic."
    )
    commands = parser.add_subparsers(required=True, metavar="COMMAND")

    run = commands.add_parser("run", help="run a controller and print its figures")
    run.add_argument("--scenario", required=True, help="a packaged scenario such as cologne1, or a .sumocfg")
    run.add_argument("--controller", required=True, metavar="NAME", help="such as max-pressure or fixed-time")
    run.add_argument("--seeds", type=int, default=1, metavar="N", help="how many episodes, seeds 0 to N-1")
    run.add_argument("--seconds", type=int, default=3600, metavar="S", help="simulated seconds an episode")
    run.add_argument(
        "--min-green", type=int, default=10, metavar="S", help="seconds of green before a change"
    )
    run.add_argument("--yellow", type=_yellow, default=2, metavar="S", help='seconds, or "speed"')
    run.add_argument("--all-red", type=int, default=0, metavar="S", help="seconds between yellow and green")
    run.add_argument("--signals", nargs="+", metavar="ID", help="the signals to control (default: all)")
    run.add_argument("--json", type=Path, metavar="FILE", help="also write every episode's figures")
    run.add_argument("--csv", metavar="STEM", help="also write a CSV and a JSON file per episode")
    run.add_argument("--record", metavar="STEM", help="also record each episode's snapshots")
    run.set_defaults(run=_run)

    scenarios = commands.add_parser("scenarios", help="list the packaged scenarios")
    scenarios.set_defaults(run=_list_scenarios)
    return parser


def _yellow(text: str) -> float | str:
    return text if text == "speed" else float(text)


def _run(options: argparse.Namespace) -> int:
    from dojo_env.runs import run_controller, summarize

    if options.seeds < 1:
        print("dojo-env: --seeds: expected a number above 0", file=sys.stderr)
        return 2

    def tell(figures: dict[str, Any]) -> None:
        if sys.stderr.isatty():
            print(f"seed {figures['seed']}: travel time {figures['travel_time']:.2f} s", file=sys.stderr)

    figures = run_controller(
        options.controller,
        range(options.seeds),
        on_episode=tell,
        scenario=options.scenario,
        num_seconds=options.seconds,
        min_green=options.min_green,
        yellow_time=options.yellow,
        all_red=options.all_red,
        ts_ids=options.signals,
        out_csv_name=options.csv,
        record_name=options.record,
    )
    summary = summarize(figures)
    for name, value in summary.items():
        print(f"{name:24}{value['mean']:12.2f} ± {value['std']:.2f}")
    violations = sum(sum(episode["violations"].values()) for episode in figures)
    print(f"{'safety violations':24}{violations:12d}")
    if options.json:
        content = {
            "scenario": options.scenario,
            "controller": options.controller,
            "summary": summary,
            "episodes": figures,
        }
        options.json.write_text(json.dumps(content, indent=1) + "\n", encoding="utf-8")
    return 0


def _list_scenarios(_options: argparse.Namespace) -> int:
    from dojo_env.scenario import PACKAGED, packaged_scenario

    print(f"{'name':14}{'signals':>8}{'demand':>8}{'begin':>8}  licence")
    for name in PACKAGED:
        found = packaged_scenario(name)
        signals = len(set(re.findall(r'<tlLogic [^>]*?id="([^"]*)"', found.map.read_text(encoding="utf-8"))))
        demand = sum(_count_departures(path, found.end or 0) for path in found.routes)
        print(f"{name:14}{signals:8d}{demand:8d}{found.begin:8.0f}  {found.licence}")
    return 0


def _count_departures(routes: Path, end: float) -> int:
    """Count the vehicles that a route file lets depart until the scenario's end."""
    text = routes.read_text(encoding="utf-8")
    departs = re.findall(r'<(?:trip|vehicle)\b[^>]*?depart="([\d.]+)"', text)
    flows = re.findall(r'<flow\b[^>]*?begin="([\d.]+)" end="([\d.]+)" vehsPerHour="([\d.]+)"', text)
    hourly = sum(float(rate) * (float(stop) - float(start)) / 3600 for start, stop, rate in flows)
    return sum(float(depart) < end for depart in departs) + round(hourly)


if __name__ == "__main__":
    sys.exit(main())
