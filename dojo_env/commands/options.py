"""Options that several commands share."""

import argparse
from pathlib import Path
from typing import TYPE_CHECKING, Any

from dojo_env.camera_presets import CAMERA_PRESETS, LONG_VIEW, PAPER
from dojo_env.clusters import LOCAL
from dojo_maps.progress import say

if TYPE_CHECKING:
    from dojo_env.controllers import Controller


def add_routes_option(parser: argparse.ArgumentParser) -> None:
    """Add what other traffic drives on a scenario's network.

    Args:
        parser: of a command; it gets `--routes`.
    """
    parser.add_argument(
        "--routes", metavar="FILE[,FILE]", help="route files to drive in place of the scenario's own"
    )


def add_sensing_options(parser: argparse.ArgumentParser) -> None:
    """Add what decides how cameras see.

    Args:
        parser: of a command; it gets `--conditions`, `--imaging`, `--models` and `--preset`.
    """
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
    parser.add_argument(
        "--preset",
        choices=list(CAMERA_PRESETS),
        help=f"how cameras hang (default: {PAPER}; {LONG_VIEW} where learned-vision acts)",
    )


def add_view_options(parser: argparse.ArgumentParser) -> None:
    """Add what decides how pictures are shown.

    Args:
        parser: of a command; it gets what `add_sensing_options` adds, `--port` and `--no-browser`.
    """
    add_sensing_options(parser)
    parser.add_argument("--port", type=int, default=0, metavar="N", help="of the page (default: any)")
    parser.add_argument("--no-browser", action="store_true", help="only say where the page is")


def read_sensing(options: argparse.Namespace) -> dict[str, Any]:
    """Turn `--conditions`, `--imaging`, `--models` and `--preset` into settings of an environment.

    Args:
        options: of a command that `add_sensing_options` was called for.

    Returns:
        Keywords of an environment: of `conditions`, `imaging`, `models` and `cameras` those that were given.

    Raises:
        ConfigError: there are no conditions or camera bodies of that name, or a value is out of range.
    """
    from dojo_env.conditions import read_conditions
    from dojo_env.imaging import read_imaging

    wanted = {
        "conditions": options.conditions and read_conditions(options.conditions),
        "imaging": options.imaging and read_imaging(options.imaging),
        "models": options.models,
        "cameras": options.preset,
    }
    return {name: value for name, value in wanted.items() if value}


def find_controller(name: str, scenario: str) -> "Controller":
    """Find who controls the signals: a controller by its name, or a policy that `dojo-env train` kept.

    Args:
        name: of the controller; a timing plan's `.json`; or a run's folder, or the policy in it.
        scenario: that it will control; it is said where a policy was trained on another.

    Returns:
        The controller, for any number of episodes.

    Raises:
        ConfigError: there is none of that name.
        PlanError: the `.json` holds no timing plan.
        PolicyError: the `.npz` holds no weights.
        RunFileError: the folder or file is no training run's.
    """
    from dojo_env.controllers import CONTROLLERS, make_controller, make_seeing
    from dojo_env.controllers.phase_competition import PhaseCompetition

    path = Path(name)
    if path.is_dir() and (path / "policy.npz").is_file():
        path /= "policy.npz"
    if path.suffix == ".json":
        from dojo_env.controllers.timed import Timed

        return Timed(path)
    if path.is_dir() and (path / "lanes.npz").is_file():
        return make_seeing(path / "lanes.npz")
    if path.suffix == ".npz":
        return PhaseCompetition(path)
    if name in CONTROLLERS or not (path.suffix == ".pt" or path.is_dir()):
        return make_controller(name)
    from dojo_env.learning.policy_controller import PolicyController

    policy = PolicyController(path)
    if Path(policy.trained_on).stem != Path(scenario).stem:
        say(f"dojo-env: warning: {name}: trained on {policy.trained_on}, and this is {scenario}")
    return policy


def read_yellow(text: str) -> float | str:
    """Read seconds, or "speed".

    Args:
        text: what stands after `--yellow`.

    Returns:
        The seconds, or the word as it is.

    Raises:
        ArgumentTypeError: it is neither.
    """
    try:
        return text if text == "speed" else float(text)
    except ValueError:
        raise argparse.ArgumentTypeError(f'{text!r} is neither a number of seconds nor "speed"') from None


def add_ray_option(parser: argparse.ArgumentParser, purpose: str) -> None:
    """Add `--ray`, with or without an address; see `dojo_env.clusters.open_cluster`.

    Args:
        parser: of a command; its `ray` is None without the option, and `local` without an address.
        purpose: what the cluster is for, with which the option's help begins.
    """
    parser.add_argument(
        "--ray",
        nargs="?",
        const=LOCAL,
        metavar="HOST:PORT",
        help=f"{purpose}: HOST:PORT of its head; without it, one of this machine",
    )
