"""The command `dojo-env dataset`: labelled pictures of simulated traffic."""

import argparse
from pathlib import Path
from typing import Any

from dojo_env.commands.options import add_ray_option
from dojo_maps.command import Commands, add_command
from dojo_maps.progress import Progress
from dojo_maps.wording import counted


def add_dataset(commands: Commands) -> None:
    """Add the command to the parser.

    Args:
        commands: what `add_subparsers` made; the command is added to it.
    """
    make = add_command(
        commands,
        "dataset",
        _dataset,
        "write a data set of labelled pictures",
        example="dojo-env dataset cologne1 cologne3 -n 10000 --format coco -o cologne.coco",
    )
    make.add_argument(
        "scenarios", nargs="+", metavar="SCENARIO", help="packaged scenarios, or .sumocfg files"
    )
    make.add_argument("-n", type=int, required=True, dest="pictures", metavar="N", help="pictures in all")
    make.add_argument(
        "-o", "--output", type=Path, metavar="DIR", help="new, or to go on in (default: dataset.FORMAT)"
    )
    make.add_argument("--format", metavar="NAME", help="coco (default), yolo, kitti, mot or cvat")
    make.add_argument(
        "--cameras",
        nargs="+",
        metavar="WHICH",
        help="approach (default), bev, all, a preset such as usual, or files",
    )
    make.add_argument(
        "--conditions",
        nargs="+",
        metavar="WHICH",
        help="random (default), day, dusk, night, rain, fog, or such as hour=6..22,rain=0.4; one an episode",
    )
    make.add_argument(
        "--imaging",
        nargs="+",
        metavar="WHICH",
        help="how cameras work: ideal (default), traffic_camera, webcam and so on; one an episode",
    )
    make.add_argument(
        "--controllers", nargs="+", metavar="NAME", help="who sets the signals; each episode takes one"
    )
    make.add_argument("--size", type=_read_size, metavar="WxH", help="of pictures (default: 640x448)")
    make.add_argument(
        "--split", type=_read_split, metavar="SHARES", help="train, val, test (default: 0.8,0.1,0.1)"
    )
    make.add_argument(
        "--split-by",
        metavar="WHAT",
        help="episode (default), scenario or camera: no two splits have the same",
    )
    make.add_argument("--interval", type=float, metavar="S", help="between instants (default: 10, mot: 0.1)")
    make.add_argument(
        "--per-episode", type=int, metavar="N", help="pictures (default: a tenth of all, up to 1000)"
    )
    make.add_argument("--seconds", type=float, metavar="S", help="simulated of each episode")
    make.add_argument("--seed", type=int, metavar="N", help="of everything random (default: 0)")
    make.add_argument("--least-pixels", type=int, metavar="N", help="visible, to be asked for (default: 40)")
    make.add_argument(
        "--least-visible", type=float, metavar="SHARE", help="visible, to be asked for (default: 0.1)"
    )
    make.add_argument(
        "--negatives", type=float, metavar="SHARE", help="pictures of empty roads (default: 0.05; mot: 0)"
    )
    make.add_argument("--depth", action="store_true", help="write depths, too: 16 bits, 256 steps a metre")
    make.add_argument("--picture", metavar="KIND", help="jpg or png (default: jpg; kitti: png)")
    make.add_argument("--quality", type=int, metavar="N", help="of JPEG (default: 92)")
    make.add_argument("--no-smooth", action="store_true", help="no anti-aliasing of what moves: faster")
    make.add_argument("--no-parked", action="store_true", help="no parked cars")
    make.add_argument("--jobs", type=int, metavar="N", help="processes (default: one per core)")
    add_ray_option(make, "make it on a Ray cluster")


def _dataset(options: argparse.Namespace) -> int:
    from dojo_env.datasets import write_dataset

    names = (
        *("scenarios", "pictures", "format", "cameras", "conditions", "controllers", "size", "split"),
        *("interval", "per_episode", "seconds", "seed", "least_pixels", "least_visible", "negatives"),
        *("picture", "quality", "imaging", "split_by"),
    )
    given: dict[str, Any] = {name: getattr(options, name) for name in names}
    settings = {name: value for name, value in given.items() if value is not None}
    folder = options.output or Path(f"dataset.{options.format or 'coco'}")
    made = write_dataset(
        folder,
        jobs=options.jobs,
        ray=options.ray,
        on_stage=Progress(quiet=options.quiet),
        depth=options.depth,
        smooth=not options.no_smooth,
        parked=not options.no_parked,
        **settings,
    )
    totals = made["counts"]["totals"]
    users = counted(totals.get("objects", 0), "road user")
    print(f"{folder}: {counted(totals['pictures'], 'picture')}, {users}")
    return 0


def _read_size(text: str) -> tuple[int, ...]:
    return _read_numbers(text, "x", int, "WIDTHxHEIGHT, such as 640x448")


def _read_split(text: str) -> tuple[float, ...]:
    return _read_numbers(text, ",", float, "shares, such as 0.8,0.1,0.1")


def _read_numbers(text: str, sign: str, kind: Any, wanted: str) -> tuple[Any, ...]:
    try:
        return tuple(kind(part) for part in text.split(sign))
    except ValueError:
        raise argparse.ArgumentTypeError(f"{text!r}: expected {wanted}") from None
