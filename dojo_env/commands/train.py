"""The command `dojo-env train`: a policy is trained, and its best weights, curve and settings are kept."""

import argparse
import dataclasses
import importlib.util
import json
import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from dojo_env.commands.options import add_ray_option
from dojo_env.errors import ConfigError
from dojo_maps import interruption
from dojo_maps.command import Commands, add_command
from dojo_maps.progress import say, say_nothing

_RESUME = "dojo-env: train: interrupted; the same command with --resume goes on from its last checkpoint"


def add_train(commands: Commands) -> None:
    """Add the command to the parser.

    Args:
        commands: what `add_subparsers` made; the command is added to it.
    """
    from dojo_env.learning.settings import AGENTS, ALGORITHMS, CONDITIONS, NETWORKS, OBSERVATIONS

    train = add_command(
        commands,
        "train",
        _train,
        "train a policy to set the signals",
        example="dojo-env train --scenario cologne1 --algorithm ppo --observation bev --out runs/bev",
    )
    train.add_argument(
        "--scenario", metavar="NAME", help="a packaged scenario, or a file (default: cologne1)"
    )
    train.add_argument(
        "--row", metavar="ROW", help="begin with the settings of a row of the benchmark, or of a .toml file"
    )
    train.add_argument(
        "--junctions",
        nargs="*",
        metavar="NAME",
        help="one policy for any junction, from those of scenarios or files (default: all packaged)",
    )
    train.add_argument(
        "--vision",
        action="store_true",
        help="the network that sees lanes in pictures, for any junction, from those of --junctions",
    )
    train.add_argument(
        "--from",
        dest="start",
        metavar="POLICY",
        help="with --junctions: begin with a policy, learned or a run's",
    )
    train.add_argument("--algorithm", choices=list(ALGORITHMS), help="(default: ppo)")
    train.add_argument("--observation", choices=OBSERVATIONS, help="(default: features)")
    train.add_argument("--encoder", metavar="NAME", help="a frozen encoder of images, as efficientnet-lite0")
    train.add_argument("--seed", type=int, metavar="N", help="of everything random (default: 0)")
    train.add_argument(
        "--steps", type=int, metavar="N", help="decisions, of all environments together (default: 200000)"
    )
    train.add_argument("--seconds", type=int, metavar="S", help="simulated, an episode (default: 3600)")
    train.add_argument(
        "--processes", type=int, metavar="N", help="environments, each in its own process (default: 8)"
    )
    train.add_argument("--delta-time", type=int, metavar="S", help="seconds between decisions (default: 5)")
    train.add_argument("--yellow-time", type=int, metavar="S", help="seconds of yellow (default: 2)")
    train.add_argument("--min-green", type=int, metavar="S", help="seconds before a change (default: 10)")
    train.add_argument(
        "--every", type=int, metavar="N", help="episodes between validations and checkpoints (default: 3)"
    )
    train.add_argument("--reward", nargs="+", metavar="NAME=WEIGHT", help="summed up, as queue=0.01")
    train.add_argument("--size", type=_read_size, metavar="HxW", help="pixels of images (default: 84x84)")
    train.add_argument(
        "--shared-views", action="store_true", default=None, help="one set of weights for all views"
    )
    train.add_argument(
        "--blind", action="store_true", default=None, help="see only the own phase: what sight is worth"
    )
    train.add_argument(
        "--background-subtraction",
        action="store_true",
        default=None,
        help="show images as what changes in an episode",
    )
    train.add_argument(
        "--averaged-weights", action="store_true", default=None, help="keep the average of the run's weights"
    )
    train.add_argument("--conditions", choices=list(CONDITIONS), help="light and weather (default: day)")
    train.add_argument("--agents", choices=AGENTS, help="how several signals learn (default: single)")
    train.add_argument("--network", choices=list(NETWORKS), help="the policy's structure (default: usual)")
    train.add_argument(
        "--set", nargs="+", dest="hyperparameters", metavar="NAME=VALUE", help="the algorithm's own settings"
    )
    train.add_argument("--out", type=Path, metavar="FOLDER", help="(default: in runs, by what is learned)")
    train.add_argument("--resume", action="store_true", help="go on from the folder's checkpoint")
    train.add_argument("--tensorboard", action="store_true", help="write its event files, too")
    train.add_argument("--wandb", metavar="PROJECT", help="log figures to a project of Weights & Biases, too")
    add_ray_option(train, "simulate on the nodes of a Ray cluster, and learn here")


def _train(options: argparse.Namespace) -> int:
    if options.vision:
        return _train_vision(options)
    return _train_universal(options) if options.junctions is not None else _train_row(options)


def _train_row(options: argparse.Namespace) -> int:
    """Train a policy for one scenario."""
    from dojo_env.learning.scenario_check import check_scenario
    from dojo_env.learning.settings import check_folder
    from dojo_env.learning.settings import read_training as read_training_file

    if options.start is not None:
        raise ConfigError(
            "--from is for a policy of any junction; name some with --junctions, or leave it out"
        )
    training, logs = read_training(options), _choose_logs(options)
    folder = choose_folder(options.out, training)
    tell = say_nothing if options.quiet else say
    if options.ray:
        _check_for_ray(training, logs=options.tensorboard or options.wandb is not None)
    tell(f"{folder}: {training.algorithm} learns {training.scenario} from {training.observation}")
    check_scenario(training)
    check_folder(training, folder, read_training_file, resume=options.resume)
    from dojo_env.learning.learner import train  # Bad settings are told before torch is loaded.

    interruption.explain(_RESUME)
    if options.ray:
        from dojo_env.clusters import open_cluster, set_environment

        set_environment(options.ray)
        from dojo_env.learning.rllib import learner  # It takes long, and no cluster should wait for it.

        with open_cluster(options.ray, training.processes):
            learner.train(training, folder, resume=options.resume, tell=tell)
    else:
        train(training, folder, resume=options.resume, **logs, tell=tell)
    print(folder)
    return 0


def _choose_logs(options: argparse.Namespace) -> dict[str, Any]:
    """Tell where figures are logged.

    Raises:
        ConfigError: Weights & Biases is not installed.
    """
    if options.wandb is not None and importlib.util.find_spec("wandb") is None:
        raise ConfigError('--wandb needs its package: pip install "traffic-dojo[wandb]"')
    return {"tensorboard": options.tensorboard, "wandb": options.wandb}


def _train_universal(options: argparse.Namespace) -> int:
    """Train a policy for any junction."""
    from dojo_env.learning.settings import check_folder
    from dojo_env.learning.universal.settings import UniversalTraining, read_settings
    from dojo_env.scenario import PACKAGED

    given = {"longest": options.seconds, "every": options.every, "start": options.start}
    training = read_any_junction(options, tuple(PACKAGED), UniversalTraining, given)
    logs = _choose_logs(options)
    folder = options.out or Path("runs", f"universal-seed{training.seed}")
    tell = say_nothing if options.quiet else say
    check_folder(training, folder, read_settings, resume=options.resume)
    tell(f"{folder}: one policy for any junction, from {', '.join(training.scenarios)}")
    from dojo_env.learning.episode_pools import open_nodes, open_processes
    from dojo_env.learning.universal.training import train

    interruption.explain(_RESUME)
    count = options.processes or os.cpu_count() or 1
    with open_nodes(options.ray, count) if options.ray else open_processes(count) as run_all:
        train(training, folder, run_all, resume=options.resume, **logs, tell=tell)
    print(folder)
    return 0


def _train_vision(options: argparse.Namespace) -> int:
    """Train the network that sees lanes."""
    from dojo_env.learning.vision.settings import SETTINGS, VisionTraining
    from dojo_env.scenario import PACKAGED

    unused = ("resume", "ray", "every", "tensorboard", "wandb", "start")
    if wrong := [name for name in unused if getattr(options, name)]:
        name = "from" if wrong[0] == "start" else wrong[0]
        raise ConfigError(f"--vision takes minutes, on this machine: leave --{name} out")
    training = read_any_junction(options, tuple(PACKAGED), VisionTraining, {"seconds": options.seconds})
    folder = options.out or Path("runs", f"vision-seed{training.seed}")
    if (folder / SETTINGS).exists():
        raise ConfigError(f"{folder} holds a run already; name another folder with --out")
    tell = say_nothing if options.quiet else say
    tell(f"{folder}: a network that sees lanes, from {', '.join(training.scenarios)}")
    from dojo_env.learning.episode_pools import open_processes
    from dojo_env.learning.vision.training import train

    with open_processes(options.processes or os.cpu_count() or 1) as run_all:
        train(training, folder, run_all, tell=tell)
    print(folder)
    return 0


def read_any_junction(
    options: argparse.Namespace, packaged: Sequence[str], kind: Any, given: Mapping[str, Any]
) -> Any:
    """Turn arguments into settings of a training for any junction.

    Args:
        options: the command's.
        packaged: the scenarios that are meant where none is named.
        kind: the class of the settings.
        given: what other arguments set; None where they are left out.

    Returns:
        The settings, of the class `kind`.

    Raises:
        ConfigError: a value cannot work, or is of a policy for one scenario.
    """
    others = ("scenario", "row", "algorithm", "observation", "encoder", "steps", "reward", "size", "agents",
              "conditions", "blind", "shared_views", "background_subtraction", "averaged_weights",
              "delta_time", "yellow_time", "min_green", "network")  # fmt: skip
    if wrong := [name for name in others if getattr(options, name) is not None]:
        raise ConfigError(
            f"--{wrong[0].replace('_', '-')} is for one scenario; leave it out, or --junctions and --vision"
        )
    settings = read_pairs(options.hyperparameters or [])
    known = {field.name for field in dataclasses.fields(kind)} - {"scenarios", "seed"}
    if unknown := settings.keys() - known:
        raise ConfigError(f"--set {', '.join(sorted(unknown))}: known are {', '.join(sorted(known))}")
    settings |= {name: value for name, value in {**given, "seed": options.seed}.items() if value is not None}
    return kind(scenarios=tuple(options.junctions or packaged), **settings)


def read_training(options: argparse.Namespace) -> Any:
    """Turn arguments into settings; what is not given is as in the row, or as usual.

    Args:
        options: the command's; those that are missing or None are not given.

    Returns:
        The settings, a `Training`.

    Raises:
        ConfigError: a value cannot work.
    """
    from dojo_env.benchmark.rows import find_row
    from dojo_env.learning.settings import Training

    known = {field.name: getattr(options, field.name, None) for field in dataclasses.fields(Training)}
    given = {name: value for name, value in known.items() if value is not None}
    for name in {"reward", "hyperparameters"} & set(given):
        given[name] = read_pairs(given[name])
    if options.size:
        given["height"], given["width"] = options.size
    if options.row is None:
        return Training(**given)
    row = find_row(options.row)
    if not row.learns:
        raise ConfigError(f"--row {options.row}: it does not learn; choose another")
    usual = row.find_training(given.get("scenario", Training().scenario))
    if "hyperparameters" in given and given.get("algorithm", usual.algorithm) == usual.algorithm:
        given["hyperparameters"] = {**usual.hyperparameters, **given["hyperparameters"]}
    elif given.get("algorithm", usual.algorithm) != usual.algorithm:
        given.setdefault("hyperparameters", {})
    return dataclasses.replace(usual, **given)


def choose_folder(out: Path | None, training: Any) -> Path:
    """Take the folder that was given, or name one by what is learned.

    Args:
        out: the folder that was given; None where there is none.
        training: the settings, a `Training`.

    Returns:
        `out`; or one in `runs`, named by scenario, algorithm, observation and what else tells policies apart.
        It is not made.
    """
    known = (training.scenario, training.algorithm, training.observation, training.encoder,
             training.agents, training.conditions)  # fmt: skip
    parts = [Path(part).stem for part in known if part not in ("none", "single", "day")]
    parts += ["blind"] if training.blind else []
    return out or Path("runs", "-".join([*parts, f"seed{training.seed}"]))


def _check_for_ray(training: Any, *, logs: bool) -> None:
    """Refuse what RLlib does not do here.

    Raises:
        ConfigError: the settings ask for it.
    """
    if training.algorithm not in ("ppo", "dqn"):
        raise ConfigError(
            f"--ray: RLlib has no {training.algorithm}; expected ppo or dqn, or leave --ray out"
        )
    if training.agents != "single":
        raise ConfigError(f"--ray: agents={training.agents!r}: RLlib trains one signal here; leave --ray out")
    if training.averaged_weights or logs:
        raise ConfigError(
            "--ray: no averaged weights, no TensorBoard, no Weights & Biases there; leave it out"
        )


def _read_size(text: str) -> tuple[int, int]:
    """Read `HEIGHTxWIDTH`."""
    try:
        height, width = (int(part) for part in text.lower().split("x"))
    except ValueError:
        raise argparse.ArgumentTypeError(f"{text!r}: expected HEIGHTxWIDTH, such as 84x84") from None
    return height, width


def read_pairs(pairs: list[str]) -> dict[str, Any]:
    """Read `name=value`, values as JSON.

    Args:
        pairs: as they were given, such as `queue=0.5`.

    Returns:
        Values by name; of a name that is given twice, the last one.

    Raises:
        ConfigError: a value is missing, or is not JSON.
    """
    found = {}
    for pair in pairs:
        name, _, value = pair.partition("=")
        try:
            found[name] = json.loads(value)
        except ValueError as error:
            raise ConfigError(f"{pair}: expected name=number") from error
    return found
