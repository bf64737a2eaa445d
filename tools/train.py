"""Train a policy: settings in, the best policy with its curve and exact settings out.

The folder holds `training.json` (all settings and versions), `policy.pt` (the weights of the policy that did
best on validation seeds), `curve.csv`, and `checkpoint.pt`, from which `--resume` goes on to the same result.
"""

import argparse
import dataclasses
import json
from pathlib import Path
from typing import Any

from dojo_env.errors import ConfigError
from dojo_env.rewards import REWARDS
from dojo_maps.command import Parser, run_command
from dojo_maps.interruption import begin
from learning.scenarios import check_scenario
from learning.settings import AGENTS, ALGORITHMS, CONDITIONS, OBSERVATIONS, PATCHES, Training


def read_size(text: str) -> tuple[int, int]:
    """Read `HEIGHTxWIDTH`."""
    height, width = (int(part) for part in text.lower().split("x"))
    return height, width


def read_pairs(pairs: list[str]) -> dict[str, Any]:
    """Read `name=value`, values as JSON."""
    found = {}
    for pair in pairs:
        name, _, value = pair.partition("=")
        try:
            found[name] = json.loads(value)
        except ValueError as error:
            raise ConfigError(f"{pair}: expected name=number") from error
    return found


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add what a run is described by; every learner takes the same, and what is not given is as usual."""
    parser.add_argument("--scenario")
    parser.add_argument("--algorithm", choices=list(ALGORITHMS))
    parser.add_argument("--observation", choices=OBSERVATIONS)
    parser.add_argument("--encoder", help="a frozen encoder of images; see dojo_env's README")
    parser.add_argument("--seed", type=int)
    parser.add_argument("--steps", type=int, help="decisions of all environments together")
    parser.add_argument("--seconds", type=int, help="of an episode")
    parser.add_argument("--processes", type=int, help="environments, each in its own process")
    parser.add_argument("--min-green", type=int, help="seconds of green before a change")
    parser.add_argument("--every", type=int, help="rounds of episodes between validations and checkpoints")
    parser.add_argument("--reward", nargs="+", metavar="NAME=WEIGHT", help=", ".join(REWARDS))
    parser.add_argument("--size", type=read_size, metavar="HEIGHTxWIDTH", help="of images")
    parser.add_argument("--shared-views", action="store_true", help="one set of weights for all views")
    parser.add_argument("--patches", choices=PATCHES, help="of an image, with which its network begins")
    parser.add_argument(
        "--background-subtraction", action="store_true", help="show images as what changes in an episode"
    )
    parser.add_argument(
        "--averaged-weights", action="store_true", help="keep the policy whose weights are the run's average"
    )
    parser.add_argument("--conditions", choices=list(CONDITIONS), help="light and weather")
    parser.add_argument("--agents", choices=AGENTS, help="how several signals learn")
    parser.add_argument(
        "--set", nargs="+", dest="hyperparameters", metavar="NAME=VALUE", help="the algorithm's own settings"
    )
    parser.add_argument("--out", type=Path, metavar="FOLDER", help="default: one in runs, by what is learned")
    parser.add_argument("--resume", action="store_true", help="go on from the folder's checkpoint")


def read_arguments(options: argparse.Namespace) -> Training:
    """Turn arguments into settings.

    Raises:
        ConfigError: a value cannot work.
    """
    known = {field.name: getattr(options, field.name, None) for field in dataclasses.fields(Training)}
    given = {name: value for name, value in known.items() if value is not None}
    for name in {"reward", "hyperparameters"} & set(given):
        given[name] = read_pairs(given[name])
    if options.size:
        given["height"], given["width"] = options.size
    return Training(**given)


def choose_folder(options: argparse.Namespace, training: Training) -> Path:
    """Take the folder that was given, or name one by what is learned."""
    known = (training.scenario, training.algorithm, training.observation, training.encoder,
             training.agents, training.conditions)  # fmt: skip
    parts = [Path(part).stem for part in known if part not in ("none", "single", "day")]
    return options.out or Path("runs", "-".join([*parts, f"seed{training.seed}"]))


def build_parser() -> Parser:
    """Declare what the command takes."""
    parser = Parser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    add_arguments(parser)
    parser.add_argument("--tensorboard", action="store_true", help="write its event files, too")
    parser.set_defaults(run=run)
    return parser


def run(options: argparse.Namespace) -> int:
    """Train as the arguments say."""
    training = read_arguments(options)
    folder = choose_folder(options, training)
    check_scenario(training)
    from learning.learner import train  # Bad settings are told before torch is loaded.

    train(training, folder, resume=options.resume, tensorboard=options.tensorboard)
    print(folder)
    return 0


def main() -> int:
    """Train; see `dojo_maps.command`."""
    return run_command("train", build_parser, None)


if __name__ == "__main__":
    begin("train: interrupted; the same command with --resume goes on from its last checkpoint")
    main()
