"""The command `dojo-env watch`: an episode live in the browser."""

import argparse

from dojo_env.commands.options import (
    add_routes_option,
    add_view_options,
    find_controller,
    read_sensing,
)
from dojo_env.errors import ConfigError
from dojo_maps.command import Commands, add_command


def add_watch(commands: Commands) -> None:
    """Add the command to the parser.

    Args:
        commands: what `add_subparsers` made; the command is added to it.
    """
    watch = add_command(
        commands,
        "watch",
        _watch,
        "show an episode live in the browser",
        example="dojo-env watch --scenario cologne1 --controller max-pressure --conditions dusk",
    )
    watch.add_argument(
        "--scenario", default="cologne1", metavar="NAME", help="a packaged scenario, or a .sumocfg"
    )
    add_routes_option(watch)
    watch.add_argument(
        "--controller",
        default="max-pressure",
        metavar="NAME",
        help="who controls the signals, or a policy.pt",
    )
    watch.add_argument("--seed", type=int, default=0, metavar="N", help="of SUMO's random numbers")
    watch.add_argument(
        "--seconds", type=int, metavar="S", help="simulated (default: to the scenario's end, or 3600)"
    )
    watch.add_argument("--signals", nargs="+", metavar="ID", help="the signals to control (default: all)")
    add_view_options(watch)


def _watch(options: argparse.Namespace) -> int:
    from dojo_env.watch import watch

    if not 0 <= options.port < 1 << 16:
        raise ConfigError("--port: expected a number from 0 to 65535")
    watch(
        find_controller(options.controller, options.scenario),
        seed=options.seed,
        port=options.port,
        browser=not options.no_browser,
        scenario=options.scenario,
        routes=options.routes,
        num_seconds=options.seconds,
        ts_ids=options.signals,
        **read_sensing(options),
    )
    return 0
