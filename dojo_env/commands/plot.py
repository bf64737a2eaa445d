"""The command `dojo-env plot`: figures over time of episodes, recordings and trainings, drawn into a file."""

import argparse
from pathlib import Path

from dojo_env.errors import ConfigError
from dojo_maps.command import Commands, add_command


def add_plot(commands: Commands) -> None:
    """Add the command to the parser.

    Args:
        commands: what `add_subparsers` made; the command is added to it.
    """
    plot = add_command(
        commands,
        "plot",
        _plot,
        "draw figures over time, of episodes, recordings or trainings beside each other",
        example="dojo-env plot actuated_conn0_ep1.csv sotl_conn0_ep1.csv --figures queue co2 -o queues.png",
    )
    plot.add_argument(
        "sources",
        nargs="+",
        metavar="FILE",
        help="a .csv that run --csv wrote, an .npz that run --record wrote, or the folder of a training",
    )
    plot.add_argument(
        "-o", "--output", type=Path, required=True, metavar="FILE", help="a .png, .svg or .pdf to write"
    )
    plot.add_argument(
        "--figures", nargs="+", default=[], metavar="NAME",
        help="such as queue or co2 (default: those that tell most)",
    )  # fmt: skip
    plot.add_argument(
        "--smooth", type=float, default=60.0, metavar="S", help="seconds that values are averaged over"
    )
    plot.add_argument(
        "--lights", action="store_true", help="of one recording: what the signals showed, link by link"
    )


def _plot(options: argparse.Namespace) -> int:
    from dojo_env.charts import check_name
    from dojo_env.plotting import plot
    from dojo_env.recording import read_recording

    check_name(options.output)
    if options.lights:
        if len(options.sources) > 1 or options.figures:
            raise ConfigError("--lights draws one recording, and no figures")
        drawn = read_recording(options.sources[0]).plot_signals()
    else:
        drawn = plot(options.sources, *options.figures, smooth=options.smooth)
    print(drawn.save(options.output))
    return 0
