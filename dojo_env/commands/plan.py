"""The command `dojo-env plan`: the best timing plan that sees nothing, or the best times of SUMO's logics."""

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from dojo_env.commands.options import add_routes_option, read_yellow
from dojo_maps import interruption
from dojo_maps.command import Commands, add_command
from dojo_maps.progress import Progress

if TYPE_CHECKING:
    from dojo_env.plan_search import Search

_RESUME = "dojo-env: plan: interrupted; the same command goes on from the episodes that were judged"


def add_plan(commands: Commands) -> None:
    """Add the command to the parser.

    Args:
        commands: what `add_subparsers` made; the command is added to it.
    """
    plan = add_command(
        commands,
        "plan",
        _plan,
        "search the best signal timing plan of a scenario",
        example="dojo-env plan cologne1-surges -o plan.json",
    )
    plan.add_argument("scenario", help="a packaged scenario such as cologne1, a bundle, or a .sumocfg")
    add_routes_option(plan)
    plan.add_argument(
        "--logic",
        default="fixed",
        metavar="NAME",
        help="fixed (default), or SUMO's actuated or delay_based, whose times are searched",
    )
    plan.add_argument("--budget", type=int, default=70, metavar="N", help="episodes (default: 70)")
    plan.add_argument("--seed", type=int, default=0, metavar="N", help="of the search (default: 0)")
    plan.add_argument("--seconds", type=int, metavar="S", help="simulated, an episode")
    plan.add_argument("--min-green", type=int, default=10, metavar="S", help="seconds (default: 10)")
    plan.add_argument("--yellow", type=read_yellow, default=2, metavar="S", help='seconds, or "speed"')
    plan.add_argument("--all-red", type=int, default=0, metavar="S", help="seconds between yellow and green")
    plan.add_argument("-o", "--output", type=Path, default=Path("plan.json"), metavar="FILE")


def _plan(options: argparse.Namespace) -> int:
    from dojo_env.plan_search import VALIDATION_SEEDS, Memory, search_plan
    from dojo_env.timing_plans import write_plan

    keywords = {
        "scenario": options.scenario,
        "routes": options.routes,
        "num_seconds": options.seconds,
        "min_green": options.min_green,
        "yellow_time": options.yellow,
        "all_red": options.all_red,
    }
    interruption.explain(_RESUME)
    progress = Progress(quiet=options.quiet)

    def tell(search: "Search") -> None:
        progress(f"{search.spent} of {search.budget} episodes, {search.mean:.1f} s a trip")

    memory = Memory(options.output.with_suffix(".search.json"))
    search = search_plan(
        keywords, logic=options.logic, budget=options.budget, seed=options.seed, memory=memory, on_score=tell
    )
    scores = dict(zip(map(str, VALIDATION_SEEDS), search.scores, strict=True))
    write_plan(search.found, options.output, scenario=options.scenario, validation=scores)
    memory.forget()
    print(f"{options.output}: {search.mean:.1f} s a trip (travel_time_all, {len(VALIDATION_SEEDS)} episodes)")
    for signal, timing in search.found.signals.items():
        stages = ", ".join(f"phase {phase} for {seconds} s" for phase, seconds in timing.stages)
        print(f"{signal}: {stages}" + (f", {timing.offset} s on" if timing.offset else ""))
    return 0
