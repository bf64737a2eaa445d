"""The command `dojo-env`. Results go to standard output, everything else to standard error."""

import argparse
import sys
from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from dojo_env.errors import ConfigError
from dojo_maps.command import Parser, add_command, run_command
from dojo_maps.progress import Progress
from dojo_maps.whole_file import write_json

_MISSED = 0.02
"""The share of vehicles from which on it matters that they have not arrived."""


def main(arguments: Sequence[str] | None = None) -> int:
    """Run a command and return its exit status; see `dojo_maps.command`.

    Args:
        arguments: None for the process's own.
    """
    return run_command("dojo-env", _parser, arguments)


def _parser() -> argparse.ArgumentParser:
    parser = Parser(
        prog="dojo-env", description="Traffic signal control on converted maps, with SUMO's traffic."
    )
    commands = parser.add_subparsers(required=True, metavar="COMMAND")

    run = add_command(commands, "run", _run, "run a controller and print its figures")
    run.add_argument("--scenario", required=True, help="a packaged scenario such as cologne1, or a .sumocfg")
    run.add_argument("--controller", required=True, metavar="NAME", help="such as max-pressure or fixed-time")
    run.add_argument(
        "--seeds", type=int, default=1, metavar="N", help="how many episodes, each with the next seed"
    )
    run.add_argument(
        "--seconds", type=int, metavar="S", help="simulated (default: to the scenario's end, or 3600)"
    )
    run.add_argument(
        "--min-green", type=int, default=10, metavar="S", help="seconds of green before a change"
    )
    run.add_argument("--yellow", type=_yellow, default=2, metavar="S", help='seconds, or "speed"')
    run.add_argument("--all-red", type=int, default=0, metavar="S", help="seconds between yellow and green")
    run.add_argument("--signals", nargs="+", metavar="ID", help="the signals to control (default: all)")
    run.add_argument("--json", type=Path, metavar="FILE", help="also write every episode's figures")
    run.add_argument("--csv", metavar="STEM", help="also write a CSV and a JSON file per episode")
    run.add_argument("--record", metavar="STEM", help="also record each episode's snapshots")
    run.add_argument("--video", type=Path, metavar="FILE", help="also show every second in an .mp4 or .webm")
    run.add_argument(
        "--sumo-outputs",
        type=Path,
        metavar="FOLDER",
        help="where the scenario's own outputs go (default: none)",
    )

    watch = add_command(commands, "watch", _watch, "show an episode live in the browser")
    watch.add_argument(
        "--scenario", default="cologne1", metavar="NAME", help="a packaged scenario, or a .sumocfg"
    )
    watch.add_argument(
        "--controller", default="max-pressure", metavar="NAME", help="who controls the signals"
    )
    watch.add_argument("--seed", type=int, default=0, metavar="N", help="of SUMO's random numbers")
    watch.add_argument(
        "--seconds", type=int, metavar="S", help="simulated (default: to the scenario's end, or 3600)"
    )
    watch.add_argument("--signals", nargs="+", metavar="ID", help="the signals to control (default: all)")
    _add_view_options(watch)

    replay = add_command(commands, "replay", _replay, "look at a recorded episode again, without SUMO")
    replay.add_argument("recording", type=Path, metavar="RECORDING", help="a file that run --record wrote")
    replay.add_argument(
        "--map", metavar="BUNDLE", help="the map that it was made on, where that is not a packaged scenario's"
    )
    replay.add_argument("--signals", nargs="+", metavar="ID", help="the signals to look at (default: all)")
    replay.add_argument("--cameras", type=Path, metavar="FILE", help="look through these, for one signal")
    replay.add_argument("--video", type=Path, metavar="FILE", help="write an .mp4 or .webm")
    replay.add_argument("--export", choices=["metadrive"], help="write in another program's format")
    replay.add_argument(
        "-o", "--output", type=Path, metavar="DIR", help="where to export to (default: NAME.metadrive)"
    )
    _add_view_options(replay)

    prove = add_command(commands, "prove", _prove, "prove that no actions make a map's signals unsafe")
    prove.add_argument("scenario", help="a packaged scenario, a .sumocfg, a bundle or a network")
    prove.add_argument("--signals", nargs="+", metavar="ID", help="the signals to look at (default: all)")
    prove.add_argument("--yellow", type=_yellow, default=2, metavar="S", help='seconds, or "speed"')
    prove.add_argument("--all-red", type=int, default=0, metavar="S", help="seconds between yellow and green")
    prove.add_argument(
        "--min-green", type=int, default=10, metavar="S", help="seconds of green before a change"
    )
    prove.add_argument("--max-green", type=int, metavar="S", help="seconds of green before the next phase")
    prove.add_argument(
        "--walking-speed", type=float, default=1.2, metavar="M/S", help="of the slowest walker"
    )
    prove.add_argument(
        "--phases", choices=["program", "computed"], default="program", help="which to choose from"
    )

    listed = add_command(commands, "scenarios", _list_scenarios, "list the packaged scenarios, or signals")
    listed.add_argument(
        "scenarios", nargs="*", metavar="SCENARIO", help="show the signals of these, phase by phase"
    )
    return parser


def _add_view_options(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--conditions", metavar="NAME", help="day, dusk, night, rain, fog, or such as hour=20,rain=0.4"
    )
    parser.add_argument("--port", type=int, default=0, metavar="N", help="of the page (default: any)")
    parser.add_argument("--no-browser", action="store_true", help="only say where the page is")


def _sensing(options: argparse.Namespace) -> dict[str, Any]:
    from dojo_env.conditions import read_conditions

    return {"conditions": read_conditions(options.conditions)} if options.conditions else {}


def _yellow(text: str) -> float | str:
    try:
        return text if text == "speed" else float(text)
    except ValueError:
        raise argparse.ArgumentTypeError(f'{text!r} is neither a number of seconds nor "speed"') from None


def _run(options: argparse.Namespace) -> int:
    from dojo_env.runs import JAMMED, run_controller, summarize

    if options.seeds < 1:
        raise ConfigError("--seeds: expected a number above 0")
    if options.json and not options.json.absolute().parent.is_dir():
        raise ConfigError(f"--json {options.json}: no such folder; make it first")

    def tell(figures: dict[str, Any]) -> None:
        if not figures["departed"] + figures["backlogged"]:
            print(
                f"dojo-env: {options.scenario}: seed {figures['seed']}: no vehicle in the whole episode; "
                "let it begin when the demand does (<begin> of a .sumocfg), or give it --seconds",
                file=sys.stderr,
            )
        if sys.stderr.isatty() and not options.quiet:
            print(f"seed {figures['seed']}: travel time {figures['travel_time']:.2f} s", file=sys.stderr)

    figures = run_controller(
        options.controller,
        options.seeds,
        on_episode=tell,
        on_stage=Progress(quiet=options.quiet),
        scenario=options.scenario,
        num_seconds=options.seconds,
        min_green=options.min_green,
        yellow_time=options.yellow,
        all_red=options.all_red,
        ts_ids=options.signals,
        out_csv_name=options.csv,
        record_name=options.record,
        video=options.video,
        sumo_outputs=options.sumo_outputs,
    )
    summary = summarize(figures)
    print(f"{'figure':24}{'mean':>12} {'± deviation':12}{'median':>12}")
    for name, value in summary.items():
        print(f"{name:24}{value['mean']:12.2f} ± {value['std']:<10.2f}{value['median']:12.2f}")
    jammed = sum(episode["late"] > JAMMED for episode in figures)
    print(f"{'episodes that jammed':24}{jammed:12d}")
    violations = sum((Counter(episode["violations"]) for episode in figures), Counter[str]())
    print(f"{'safety violations':24}{violations.total():12d}")
    if options.json:
        content = {
            "scenario": options.scenario,
            "controller": options.controller,
            "summary": summary,
            "episodes": figures,
        }
        write_json(options.json, content)
    missing = max(episode["missing"] for episode in figures)
    if missing > _MISSED:
        print(
            f"dojo-env: warning: {options.scenario}: up to {missing:.1%} of the vehicles had not arrived at "
            "the end, and travel_time leaves them out; compare travel_time_all",
            file=sys.stderr,
        )
    if violations:
        found = ", ".join(f"{count} {rule}" for rule, count in violations.most_common())
        print(f"dojo-env: warning: {options.scenario}: signals were unsafe: {found}", file=sys.stderr)
    return 0


def _watch(options: argparse.Namespace) -> int:
    from dojo_env.watch import watch

    if not 0 <= options.port < 1 << 16:
        raise ConfigError("--port: expected a number from 0 to 65535")
    watch(
        options.controller,
        seed=options.seed,
        port=options.port,
        browser=not options.no_browser,
        scenario=options.scenario,
        num_seconds=options.seconds,
        ts_ids=options.signals,
        **_sensing(options),
    )
    return 0


def _replay(options: argparse.Namespace) -> int:
    from dojo_env.watch import Rerun

    rerun = Rerun.open(
        options.recording,
        map=options.map,
        signals=options.signals,
        cameras=options.cameras,
        **_sensing(options),
    )
    if options.export:
        target = options.output or options.recording.with_suffix(".metadrive")
        print(f"{target}: {rerun.export(target)} scenarios")
    if options.video:
        rerun.film(options.video, on_stage=Progress(quiet=options.quiet))
        print(options.video)
    if not options.export and not options.video:
        rerun.watch(port=options.port, browser=not options.no_browser)
    return 0


def _prove(options: argparse.Namespace) -> int:
    """Visit every state of every signal in every action mode; returns 1 where a rule is broken."""
    from dojo_env.config import ACTION_MODES, SignalConfig
    from dojo_env.managers.map import MapManager
    from dojo_env.scenario import find_map, open_map
    from dojo_env.signals.proof import prove

    found = find_map(options.scenario)
    configs = [
        SignalConfig(
            ts_ids=options.signals,
            action_mode=mode,
            yellow_time=options.yellow,
            all_red=options.all_red,
            min_green=options.min_green,
            max_green=options.max_green,
            walking_speed=options.walking_speed,
            phases=options.phases,
        )
        for mode in ACTION_MODES
    ]
    plans = MapManager(open_map(found), configs[0], additional=found.additional).plans
    states = proved = 0
    print("result    phases    states  longest change  signal")
    for signal, plan in plans.items():
        proofs = [prove(plan, config) for config in configs]
        visited = sum(proof.states for proof in proofs)
        broken = [(proof.mode, example) for proof in proofs for example in proof.counterexamples]
        states, proved = states + visited, proved + (not broken)
        result = "VIOLATED" if broken else "proved"
        longest = max(proof.longest_change for proof in proofs)
        print(f"{result:8}{len(plan.phases):8}{visited:10}{longest:14g} s  {signal}", flush=True)
        for mode, example in broken:
            print(f"  {mode}: {example}")
    print(f"{found.name}: {proved} of {len(plans)} signals proved in every action mode, {states} states")
    return int(proved < len(plans))


def _show_signals(name: str) -> None:
    """Print each signal of a scenario with its phases, and what of it cannot be controlled."""
    from dojo_env.config import SignalConfig
    from dojo_env.managers.map import MapManager
    from dojo_env.scenario import find_map, open_map
    from dojo_env.signals.diagram import draw_phases, list_oddities
    from dojo_maps.index import MapIndex

    found = find_map(name)
    manager = MapManager(open_map(found), SignalConfig(fixed_ts=True), additional=found.additional)
    index = MapIndex(manager.bundle.road_map)
    print(f"{found.name}: {len(manager.plans)} signals to control")
    for signal, plan in manager.plans.items():
        links = len({link for link, _, _ in plan.links} | {link for link, _ in plan.walks})
        print(f"\nsignal {signal}: {len(plan.phases)} phases, {links} links, {len(plan.lanes)} lanes")
        for line in draw_phases(plan, index):
            print(line)
        for words in list_oddities(plan):
            print(f"  note: {words}")
    for signal in manager.left_out:
        print(f"\nsignal {signal}: left out, for it controls no vehicles or guards a railway")


def _list_scenarios(options: argparse.Namespace) -> int:
    from dojo_env.scenario import PACKAGED, packaged_scenario

    for name in options.scenarios:
        _show_signals(name)
    if options.scenarios:
        return 0
    print(f"{'name':14}{'signals':>8}{'demand':>8}{'begin':>8}  licence")
    for name in PACKAGED:
        found = packaged_scenario(name)
        elements = _list_elements(found.map)
        signals = len({attributes["id"] for kind, attributes in elements if kind == "tlLogic"})
        demand = sum(_count_departures(path, found.end or 0) for path in found.routes)
        print(f"{name:14}{signals:8d}{demand:8d}{found.begin:8.0f}  {found.licence}")
    return 0


def _list_elements(path: Path) -> list[tuple[str, dict[str, str]]]:
    from dojo_env.elements import read_elements

    found: list[tuple[str, dict[str, str]]] = []
    read_elements(path, lambda kind, attributes: found.append((kind, attributes)))
    return found


def _count_departures(routes: Path, end: float) -> int:
    """Count the vehicles that a route file lets depart until the scenario's end."""
    count = 0.0
    for kind, a in _list_elements(routes):
        if kind in ("trip", "vehicle"):
            count += float(a["depart"]) < end
        elif kind == "flow":
            count += float(a["vehsPerHour"]) * (float(a["end"]) - float(a["begin"])) / 3600
    return round(count)


if __name__ == "__main__":
    sys.exit(main())
