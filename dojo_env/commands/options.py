"""Options that several commands share."""

import argparse
from typing import Any


def add_view_options(parser: argparse.ArgumentParser) -> None:
    """Add what decides how pictures are shown."""
    parser.add_argument(
        "--conditions", metavar="NAME", help="day, dusk, night, rain, fog, or such as hour=20,rain=0.4"
    )
    parser.add_argument("--port", type=int, default=0, metavar="N", help="of the page (default: any)")
    parser.add_argument("--no-browser", action="store_true", help="only say where the page is")


def read_sensing(options: argparse.Namespace) -> dict[str, Any]:
    """Turn `--conditions` into settings of an environment."""
    from dojo_env.conditions import read_conditions

    return {"conditions": read_conditions(options.conditions)} if options.conditions else {}


def read_yellow(text: str) -> float | str:
    """Read seconds, or "speed"."""
    try:
        return text if text == "speed" else float(text)
    except ValueError:
        raise argparse.ArgumentTypeError(f'{text!r} is neither a number of seconds nor "speed"') from None
