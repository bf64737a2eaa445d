"""The command `dojo-env replay`: a recorded episode again, without SUMO."""

import argparse
from pathlib import Path

from dojo_env.commands.options import add_view_options, read_sensing
from dojo_env.errors import ConfigError
from dojo_maps.command import Commands, add_command
from dojo_maps.progress import Progress
from dojo_maps.wording import counted


def add_replay(commands: Commands) -> None:
    """Add the command to the parser.

    Args:
        commands: what `add_subparsers` made; the command is added to it.
    """
    replay = add_command(
        commands,
        "replay",
        _replay,
        "look at a recorded episode again, without SUMO",
        example="dojo-env replay out_ep1.npz --conditions night --video night.webm",
    )
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
    add_view_options(replay)


def _replay(options: argparse.Namespace) -> int:
    from dojo_env.recording import read_recording
    from dojo_env.watch import Rerun

    if options.cameras and options.preset:
        raise ConfigError("--cameras and --preset: the file says how its cameras hang; leave one out")
    rerun = Rerun.of(
        read_recording(options.recording),
        map=options.map,
        signals=options.signals,
        cameras=options.cameras,
        **read_sensing(options),
    )
    if options.export:
        target = options.output or options.recording.with_suffix(".metadrive")
        print(f"{target}: {counted(rerun.export(target), 'scenario')}")
    if options.video:
        rerun.film(options.video, on_stage=Progress(quiet=options.quiet))
        print(options.video)
    if not options.export and not options.video:
        rerun.watch(port=options.port, browser=not options.no_browser)
    return 0
