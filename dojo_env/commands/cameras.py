"""The command `dojo-env cameras`: where a scenario's cameras hang, and what they see of its lanes."""

import argparse
from dataclasses import asdict
from pathlib import Path
from typing import Any

from dojo_env.camera_presets import CAMERA_PRESETS, PAPER
from dojo_env.errors import ConfigError
from dojo_maps.command import Commands, add_command


def add_cameras(commands: Commands) -> None:
    """Add the command to the parser.

    Args:
        commands: what `add_subparsers` made; the command is added to it.
    """
    cameras = add_command(
        commands,
        "cameras",
        _cameras,
        "list cameras, and what they see of the lanes",
        example="dojo-env cameras cologne1 --preset usual",
    )
    cameras.add_argument("scenario", help="a packaged scenario, a .sumocfg, a bundle or a network")
    cameras.add_argument("--signals", nargs="+", metavar="ID", help="the signals to look at (default: all)")
    which = cameras.add_mutually_exclusive_group()
    which.add_argument(
        "--preset", choices=list(CAMERA_PRESETS), default=PAPER, help=f"how cameras hang (default: {PAPER})"
    )
    which.add_argument("--cameras", type=Path, metavar="FILE", help="these cameras instead, for one signal")
    cameras.add_argument("--width", type=int, default=356, metavar="N", help="pixels (default: 356)")
    cameras.add_argument("--height", type=int, default=256, metavar="N", help="pixels (default: 256)")
    cameras.add_argument("--json", type=Path, metavar="FILE", help="write all figures")
    cameras.add_argument(
        "-o",
        "--output",
        type=Path,
        metavar="FILE",
        help="write the cameras of one signal (for --cameras)",
    )


def _cameras(options: argparse.Namespace) -> int:
    from dojo_env.camera import read_cameras, write_cameras
    from dojo_env.config import SensingConfig, SignalConfig
    from dojo_env.managers.map import MapManager
    from dojo_env.scenario import find_map, open_map
    from dojo_env.sensors.eyes import Eyes
    from dojo_maps.whole_file import write_json

    found = find_map(options.scenario)
    bundle = open_map(found)
    chosen = tuple(options.signals) if options.signals else None
    signals = tuple(MapManager(bundle, SignalConfig(ts_ids=chosen), additional=found.additional).plans)
    file = options.output or options.cameras
    if file and len(signals) > 1:
        raise ConfigError(
            f"{file}: cameras are for one signal; name it by --signals, of {', '.join(signals)}"
        )
    hung: Any = dict.fromkeys(signals, read_cameras(options.cameras)) if options.cameras else options.preset
    eyes = Eyes(bundle, SensingConfig(cameras=hung, width=options.width, height=options.height))
    listed = [_list_cameras(eyes, signal) for signal in signals]
    if options.json:
        values = {"format": "dojo-camera-views", "version": 1, "scenario": found.name, "signals": listed}
        write_json(options.json, values)
    if options.output:
        write_cameras(eyes.cameras(signals[0]), options.output)
    return 0


def _list_cameras(eyes: Any, signal: str) -> dict[str, Any]:
    """Print a signal's cameras with the lanes that they watch, and give the same as values."""
    from dojo_env.sensors.coverage import DISTANCES, list_watched, measure_views
    from dojo_env.sensors.placement import find_approaches, find_signal

    road_map = eyes.scene.road_map
    approaches = find_approaches(road_map, find_signal(road_map, signal))
    print(f"signal {signal}")
    listed = []
    for camera in eyes.cameras(signal):
        views = measure_views(eyes.scene, camera, list_watched(camera, approaches))
        place = ", ".join(f"{each:.1f}" for each in camera.position)
        print(
            f"  {camera.name}: at {place} m, heading {camera.heading_deg:g}, pitch {camera.pitch_deg:g}, "
            f"{camera.field_of_view_deg:g} degrees wide, {camera.width} x {camera.height} pixels"
        )
        where = "".join(f"{f'at {distance:g} m':>9}" for distance in DISTANCES)
        print(f"    {'lane':24}{'length':>8}{'seen':>7}{where}   pixels per metre, before the stop line")
        for view in views:
            sizes = "".join(f"{'-' if each is None else f'{each:.1f}':>9}" for each in view.pixels_per_metre)
            print(f"    {view.lane:24}{view.length:6.0f} m{view.seen:7.0%}{sizes}")
        lanes = [{**asdict(view), "distances": DISTANCES} for view in views]
        listed.append({**asdict(camera), "lanes": lanes})
    return {"signal": signal, "cameras": listed}
