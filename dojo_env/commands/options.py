"""Options that several commands share."""

import argparse
from typing import Any

from dojo_env.camera_presets import CAMERA_PRESETS, PAPER


def add_sensing_options(parser: argparse.ArgumentParser) -> None:
    """Add what decides how cameras see."""
    parser.add_argument(
        "--conditions", metavar="NAME", help="day, dusk, night, rain, fog, or such as hour=20,rain=0.4"
    )
    parser.add_argument(
        "--imaging", metavar="NAME", help="ideal, traffic_camera, webcam, or such as shutter_s=0.02"
    )
    parser.add_argument(
        "--models",
        metavar="FILE",
        help="a TOML file that names a 3D model (glTF, OBJ) for some vehicle types",
    )
    parser.add_argument("--preset", choices=list(CAMERA_PRESETS), help=f"how cameras hang (default: {PAPER})")


def add_view_options(parser: argparse.ArgumentParser) -> None:
    """Add what decides how pictures are shown."""
    add_sensing_options(parser)
    parser.add_argument("--port", type=int, default=0, metavar="N", help="of the page (default: any)")
    parser.add_argument("--no-browser", action="store_true", help="only say where the page is")


def read_sensing(options: argparse.Namespace) -> dict[str, Any]:
    """Turn `--conditions`, `--imaging`, `--models` and `--preset` into settings of an environment."""
    from dojo_env.conditions import read_conditions
    from dojo_env.imaging import read_imaging

    wanted = {
        "conditions": options.conditions and read_conditions(options.conditions),
        "imaging": options.imaging and read_imaging(options.imaging),
        "models": options.models,
        "cameras": options.preset,
    }
    return {name: value for name, value in wanted.items() if value}


def read_yellow(text: str) -> float | str:
    """Read seconds, or "speed"."""
    try:
        return text if text == "speed" else float(text)
    except ValueError:
        raise argparse.ArgumentTypeError(f'{text!r} is neither a number of seconds nor "speed"') from None
