"""Train a policy on many machines with Ray RLlib: train.py's settings in, the same files out.

Environment runners simulate on the nodes of a cluster, one environment and process each; this process learns.
A runner whose node is lost is started again where there is room, and the others go on meanwhile.
"""

import argparse
from pathlib import Path

from dojo_env.clusters import LOCAL, open_cluster, set_environment
from dojo_env.errors import ConfigError
from dojo_maps.command import Parser, run_command
from dojo_maps.interruption import begin
from learning.scenarios import check_scenario
from learning.settings import Training
from train import add_arguments, choose_folder, read_arguments

ALGORITHMS = ("ppo", "dqn")


def read_training(options: argparse.Namespace) -> Training:
    """Turn arguments into settings.

    Raises:
        ConfigError: a value cannot work, or RLlib has no such algorithm.
    """
    training = read_arguments(options)
    if training.algorithm not in ALGORITHMS:
        raise ConfigError(
            f"RLlib has no {training.algorithm}; expected {' or '.join(ALGORITHMS)}, or use tools/train.py"
        )
    if training.agents != "single":
        raise ConfigError(f"agents={training.agents!r}: RLlib trains one signal here; use tools/train.py")
    if training.averaged_weights:
        raise ConfigError("RLlib averages no weights here; use tools/train.py")
    check_scenario(training)
    return training


def build_parser() -> Parser:
    """Declare what the command takes."""
    parser = Parser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    add_arguments(parser)
    parser.add_argument(
        "--runners", dest="processes", type=int, default=argparse.SUPPRESS, help="the same as --processes"
    )
    parser.add_argument("--address", default=LOCAL, metavar="HOST:PORT",
                        help="of a cluster's head; without it, this machine alone")  # fmt: skip
    parser.set_defaults(run=run)
    return parser


def run(options: argparse.Namespace) -> int:
    """Train as the arguments say."""
    training = read_training(options)
    folder = choose_folder(options, training)
    from learning.learner import check_folder  # Bad settings are told before torch is loaded.

    check_folder(training, folder, resume=options.resume)
    set_environment(options.address)
    from learning.rllib_learner import train  # It takes long, and no cluster should wait for it.

    with open_cluster(options.address, training.processes, [Path(__file__).parent / "learning"]):
        train(training, folder, resume=options.resume)
    print(folder)
    return 0


def main() -> int:
    """Train; see `dojo_maps.command`."""
    return run_command("train_rllib", build_parser, None)


if __name__ == "__main__":
    begin("train_rllib: interrupted; the same command with --resume goes on from its last checkpoint")
    main()
