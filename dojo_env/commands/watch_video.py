"""The command `dojo-env watch-video`: what a film tells of its lanes, and what a controller would do."""

import argparse
import json
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from itertools import takewhile
from math import isnan
from pathlib import Path
from typing import TYPE_CHECKING

from dojo_env.errors import ConfigError
from dojo_maps.command import Commands, add_command
from dojo_maps.whole_file import replaced
from dojo_maps.wording import counted

if TYPE_CHECKING:
    from dojo_env.films.places import Backdrop, Place
    from dojo_env.films.watching import Look
    from dojo_maps.bundle import Bundle

Put = Callable[["Look"], None]
"""Takes a look."""
_USUAL_RATE = 25.0


def add_watch_video(commands: Commands) -> None:
    """Add the command to the parser.

    Args:
        commands: what `add_subparsers` made; the command is added to it.
    """
    watch = add_command(
        commands,
        "watch-video",
        _watch_video,
        "count the lanes of a film, and tell what a controller would do",
        example="dojo-env watch-video film.mp4 --regions lanes.json --detector detector.onnx",
    )
    watch.add_argument(
        "film",
        metavar="FILM",
        help="a film, a folder of JPEGs or PNGs, or a stream's rtsp:// or http:// address",
    )
    watch.add_argument(
        "--detector", required=True, type=Path, metavar="FILE", help="an .onnx network, or a .json about one"
    )
    watch.add_argument("--camera", type=Path, metavar="FILE", help="as calibrate wrote it")
    watch.add_argument("--name", metavar="NAME", help="which camera of that file (default: its only one)")
    watch.add_argument("--map", metavar="MAP", help="a bundle, a network or a packaged scenario")
    watch.add_argument(
        "--regions", type=Path, metavar="FILE", help="polygons in the picture by lane, instead of a camera"
    )
    watch.add_argument("--policy", metavar="NAME", help="such as max-pressure; needs a map")
    watch.add_argument("--signals", nargs="+", metavar="ID", help="those to advise on (default: all in view)")
    watch.add_argument("--every", type=float, default=1.0, metavar="S", help="seconds from look to look")
    watch.add_argument(
        "--rate", type=float, metavar="FPS", help="pictures a second (default: the film's, or 1)"
    )
    watch.add_argument("--seconds", type=float, metavar="S", help="of the film (default: all)")
    watch.add_argument("--json", type=Path, metavar="FILE", help="write the lines there, and print a table")
    watch.add_argument("--output", type=Path, metavar="FILE", help="also write an annotated .mp4 or .webm")


def _watch_video(options: argparse.Namespace) -> int:
    _check(options)
    from dojo_env.detectors import load_detector
    from dojo_env.films.advice import Advisor
    from dojo_env.films.source import read_frames
    from dojo_env.films.watching import watch_film
    from dojo_env.scenario import find_map, open_map

    bundle = open_map(find_map(options.map)) if options.map else None
    place = _open_place(options, bundle)
    advisor = None
    if options.policy and bundle:
        advisor = Advisor(bundle, options.policy, place.lanes, options.signals)
    frames = read_frames(options.film, every=options.every, rate=options.rate)
    if options.seconds is not None:
        frames = takewhile(lambda frame: frame.time <= options.seconds, frames)
    looks = watch_film(frames, load_detector(options.detector), place, advisor)
    begun, count = time.monotonic(), 0
    with ExitStack() as stack:
        outputs = list(_open_outputs(options, place, stack))
        for look in looks:
            count += 1
            for put in outputs:
                put(look)
    if not options.quiet:
        seconds = max(time.monotonic() - begun, 1e-3)
        print(
            f"dojo-env: {counted(count, 'frame')} in {seconds:.1f} s, {count / seconds:.1f} a second",
            file=sys.stderr,
        )
    return 0


def _check(options: argparse.Namespace) -> None:
    """Refuse what cannot work before anything is read."""
    if (options.camera is None) == (options.regions is None):
        raise ConfigError("expected either --camera FILE with --map, or --regions FILE")
    if options.map is None and (options.camera or options.policy):
        raise ConfigError("--map: give the bundle, network or scenario that the film shows")
    for name, least in (("every", 0.0), ("rate", 0.001), ("seconds", 0.0)):
        value = getattr(options, name)
        if value is not None and not least <= value <= 1e9:
            raise ConfigError(f"--{name} {value:g}: expected {least:g} or more")


def _open_place(options: argparse.Namespace, bundle: "Bundle | None") -> "Place":
    from dojo_env.camera import read_cameras
    from dojo_env.films.places import MapPlace, RegionPlace
    from dojo_env.films.regions import read_regions

    if bundle is None or options.camera is None:
        return RegionPlace(*read_regions(options.regions))
    cameras = {camera.name: camera for camera in read_cameras(options.camera)}
    name = options.name or next(iter(cameras))
    if name not in cameras or (options.name is None and len(cameras) > 1):
        raise ConfigError(f"--name: expected one of {', '.join(cameras)}")
    return MapPlace(bundle, cameras[name], options.signals)


def _open_outputs(options: argparse.Namespace, place: "Place", stack: ExitStack) -> Iterator[Put]:
    """Open what each look is told to."""
    if options.json is None:
        yield lambda look: print(json.dumps(look.to_json()), flush=True)
    else:
        fresh = stack.enter_context(replaced(options.json))
        file = stack.enter_context(fresh.open("w", encoding="utf-8"))
        yield lambda look: print(json.dumps(look.to_json()), file=file, flush=True)
        for number, lane in enumerate(place.lanes, 1):
            print(f"lane {number}: {lane}")
        print("vehicles / standing, and the mean speed in m/s, by lane")
        print(f"{'time':>8}" + "".join(f"{number:^12}" for number in range(1, len(place.lanes) + 1)))
        yield _print_row
    if options.output is not None:
        yield _Filming(options, place, stack)


def _print_row(look: "Look") -> None:
    cells = []
    for _, vehicles, halting, speed in look.measured.rows():
        cell = f"{vehicles}/{halting}" + ("" if isnan(speed) else f" {speed:.1f}")
        cells.append(f"{cell if vehicles else '-':^12}")
    advice = "; ".join(f"{each.signal}: {each.describe()}" for each in look.advice)
    print(f"{look.frame.time:8.1f}" + "".join(cells) + advice, flush=True)


class _Filming:
    """Writes the annotated film, at the film's own pace."""

    def __init__(self, options: argparse.Namespace, place: "Place", stack: ExitStack) -> None:
        from dojo_env.watching.video import open_video

        rate = 1.0 / options.every if options.every else options.rate or _USUAL_RATE
        self._video = stack.enter_context(open_video(options.output, frame_rate=min(max(rate, 1.0), 60.0)))
        self._place = place
        self._backdrop: Backdrop | None = None

    def __call__(self, look: "Look") -> None:
        from dojo_env.films.drawing import draw_look

        if self._backdrop is None:
            height, width = look.frame.picture.shape[:2]
            self._backdrop = self._place.draw(width, height)
        self._video.add(draw_look(look, self._backdrop))
