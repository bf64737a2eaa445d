"""Train a policy: settings in, the best policy with its curve and exact settings out.

The folder holds `training.json` (all settings and versions), `policy.pt` (the weights of the policy that did
best on validation seeds), `curve.csv`, and `checkpoint.pt`, from which `--resume` goes on to the same result.
"""

import argparse
import json
import sys
from pathlib import Path
from typing import Any

from dojo_env.errors import ConfigError
from dojo_env.rewards import REWARDS
from dojo_maps.errors import DojoError
from learning.scenarios import check_scenario
from learning.settings import AGENTS, ALGORITHMS, CONDITIONS, OBSERVATIONS, REWARD, Training


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
    """Add what a run is described by; every learner takes the same."""
    parser.add_argument("--scenario", default="cologne1")
    parser.add_argument("--algorithm", default="ppo", choices=list(ALGORITHMS))
    parser.add_argument("--observation", default="features", choices=OBSERVATIONS)
    parser.add_argument("--encoder", default="none", help="a frozen encoder of images; see dojo_env's README")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--steps", type=int, default=200_000, help="decisions of all environments together")
    parser.add_argument("--seconds", type=int, default=3600, help="of an episode")
    parser.add_argument("--processes", type=int, default=4, help="environments, each in its own process")
    parser.add_argument("--min-green", type=int, default=10, help="seconds of green before a change")
    parser.add_argument(
        "--reward", nargs="+", default=[f"{name}={weight}" for name, weight in REWARD.items()],
        metavar="NAME=WEIGHT", help=", ".join(REWARDS),
    )  # fmt: skip
    parser.add_argument("--size", type=read_size, default=(84, 84), metavar="HEIGHTxWIDTH", help="of images")
    parser.add_argument("--shared-views", action="store_true", help="one set of weights for all views")
    parser.add_argument("--conditions", default="day", choices=list(CONDITIONS), help="light and weather")
    parser.add_argument("--agents", default="single", choices=AGENTS, help="how several signals learn")
    parser.add_argument(
        "--set", nargs="+", default=[], metavar="NAME=VALUE", help="the algorithm's own settings"
    )


def read_arguments(options: argparse.Namespace) -> Training:
    """Turn arguments into settings.

    Raises:
        ConfigError: a value cannot work.
    """
    height, width = options.size
    reward = read_pairs(options.reward)
    if unknown := set(reward) - set(REWARDS):
        raise ConfigError(f"--reward {', '.join(unknown)}: expected {', '.join(REWARDS)}")
    names = (
        "scenario",
        "algorithm",
        "observation",
        "encoder",
        "seed",
        "steps",
        "seconds",
        "processes",
        "min_green",
        "shared_views",
        "conditions",
        "agents",
    )
    return Training(
        **{name: getattr(options, name) for name in names},
        reward=reward, height=height, width=width, hyperparameters=read_pairs(options.set),
    )  # fmt: skip


def main() -> int:
    """Train."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    add_arguments(parser)
    parser.add_argument("--out", type=Path, required=True, metavar="FOLDER")
    parser.add_argument("--resume", action="store_true", help="go on from the folder's checkpoint")
    parser.add_argument("--every", type=int, default=5, help="rounds of episodes between evaluations")
    parser.add_argument("--tensorboard", action="store_true", help="write its event files, too")
    options = parser.parse_args()
    try:
        training = read_arguments(options)
        check_scenario(training)
        from learning.learner import train  # Bad settings are told before torch is loaded.

        train(
            training, options.out, resume=options.resume, every=options.every, tensorboard=options.tensorboard
        )
    except (DojoError, OSError) as error:
        print(f"train: {error}", file=sys.stderr)
        return 3
    except KeyboardInterrupt:
        print(
            f"train: interrupted; --resume goes on from the last checkpoint in {options.out}", file=sys.stderr
        )
        return 130
    return 0


if __name__ == "__main__":
    sys.exit(main())
