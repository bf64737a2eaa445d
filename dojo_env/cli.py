"""The command `dojo-env`. Results go to standard output, everything else to standard error."""

import argparse
import sys
from collections.abc import Sequence

from dojo_env.commands.benchmark import add_benchmark
from dojo_env.commands.calibrate import add_calibrate
from dojo_env.commands.cameras import add_cameras
from dojo_env.commands.dataset import add_dataset
from dojo_env.commands.evaluate import add_evaluate
from dojo_env.commands.plan import add_plan
from dojo_env.commands.plot import add_plot
from dojo_env.commands.prove import add_prove
from dojo_env.commands.replay import add_replay
from dojo_env.commands.run import add_run
from dojo_env.commands.scenarios import add_scenarios
from dojo_env.commands.train import add_train
from dojo_env.commands.watch import add_watch
from dojo_env.commands.watch_video import add_watch_video
from dojo_maps.command import Parser, run_command

COMMANDS = (
    add_run,
    add_watch,
    add_replay,
    add_plot,
    add_scenarios,
    add_cameras,
    add_prove,
    add_plan,
    add_dataset,
    add_calibrate,
    add_watch_video,
    add_train,
    add_evaluate,
    add_benchmark,
)


def main(arguments: Sequence[str] | None = None) -> int:
    """Run a command and return its exit status; see `dojo_maps.command`.

    Args:
        arguments: None for the process's own.

    Returns:
        The exit status.
    """
    return run_command("dojo-env", build_parser, arguments)


def build_parser() -> argparse.ArgumentParser:
    """Declare the commands and what each takes.

    Returns:
        The parser, which sets `run` to a command's function.
    """
    parser = Parser(
        prog="dojo-env", description="Traffic signal control on converted maps, with SUMO's traffic."
    )
    commands = parser.add_subparsers(required=True, metavar="COMMAND")
    for add in COMMANDS:
        add(commands)
    return parser


if __name__ == "__main__":
    sys.exit(main())
