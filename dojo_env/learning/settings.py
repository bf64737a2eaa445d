"""Everything that a training run depends on, kept beside its policy as JSON."""

import dataclasses
import hashlib
import json
import math
import platform
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

from dojo_env.errors import ConfigError
from dojo_maps.errors import SourceError
from dojo_maps.input_files import is_there
from dojo_maps.safe_json import read_json
from dojo_maps.short_repr import short_repr
from dojo_maps.whole_file import write_json

ALGORITHMS: dict[str, dict[str, Any]] = {
    "ppo": {"n_steps": 90, "batch_size": 180, "n_epochs": 3, "learning_rate": 5e-4, "gamma": 0.97,
            "gae_lambda": 0.9, "ent_coef": 0.005, "clip_range": 0.2},
    "a2c": {"n_steps": 12, "learning_rate": 7e-4, "gamma": 0.97, "gae_lambda": 0.9, "ent_coef": 0.005},
    "dqn": {"buffer_size": 50_000, "learning_starts": 5_760, "batch_size": 64, "learning_rate": 5e-4,
            "gamma": 0.97, "train_freq": 4, "gradient_steps": 1, "target_update_interval": 500,
            "exploration_fraction": 0.3, "exploration_final_eps": 0.02, "n_steps": 1},
}  # fmt: skip
"""The algorithms and what their settings are unless said otherwise; the names are Stable-Baselines3's.

The learning rate is that of the beginning; it falls to 0 at the end, so that the last policies differ little.
"""
OBSERVATIONS = ("features", "bev", "multi_view", "detector", "movements", "neighbours")
IMAGES = ("bev", "multi_view")
AGENTS = ("single", "shared", "independent")
NETWORKS = {"usual": None, "frap": "movements", "colight": "neighbours", "mappo": "neighbours"}
"""The networks that learn, and what those with a structure of their own observe."""
PACKAGES = ("traffic-dojo", "libsumo", "numpy", "gymnasium", "torch", "stable-baselines3")
CONDITIONS: dict[str, dict[str, tuple[float, float]]] = {
    "day": {},
    "random": {
        "hour": (0, 24),
        "rain": (0, 1),
        "noise": (0, 6),
        "shake_m": (0, 0.5),
        "shake_deg": (0, 2),
    },
}
"""Ranges from which each training episode draws its light, weather and lenses."""
SETTINGS, CURVE, CHECKPOINT, POLICY = "training.json", "curve.csv", "checkpoint.pt", "policy.pt"
"""The files of a run's folder."""
REWARD = {"queue": 0.01, "diff-waiting-time": 0.05}
"""The queue keeps everyone's trip short, the difference of waiting forgets nobody in a side street."""
_SEEDS = 2**32
"""As many as numpy's and Stable-Baselines3's generators take."""


class RunFileError(SourceError, ConfigError):
    """A file of a training run is missing, damaged, or not what it should be."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Training:
    """One training run.

    Attributes:
        scenario: name or path.
        algorithm: `ppo`, `a2c` or `dqn`.
        observation: what the policy sees.
        encoder: a frozen encoder of images, or `none`.
        seed: of everything random.
        steps: decisions of all environments together.
        seconds: of an episode.
        processes: environments, each in a process of its own.
        delta_time: seconds from decision to decision.
        yellow_time: seconds of yellow before a red.
        min_green: seconds of green alone before a change is granted.
        reward: names of rewards and their weights.
        height: pixels, where the policy sees images.
        width: pixels.
        shared_views: one set of weights for all of `multi_view`'s images.
        blind: it sees nothing of the traffic, only the signal's own phase and for how long that has been
            green; in the same shape, but that all views are one.
        background_subtraction: images show how far each pixel is from its own mean in the episode.
        averaged_weights: the policy that is validated and kept has the average of the weights so far, in
            which later ones count more.
        every: rounds of episodes between validations, from which the best policy is kept, and checkpoints.
        conditions: `day`, or `random` light, weather and lenses per episode.
        agents: `single` for one signal; with several, all may use one `shared` policy, or each learns an
            `independent` one.
        network: `usual` layers over what is observed, or those of `frap`, `colight` or `mappo`.
        hyperparameters: of the algorithm; what is not given is as in `ALGORITHMS`, or somewhat less where
            the decisions of an episode are no multiple of that.
    """

    scenario: str = "cologne1"
    algorithm: str = "ppo"
    observation: str = "features"
    encoder: str = "none"
    seed: int = 0
    steps: int = 200_000
    seconds: int = 3600
    processes: int = 8
    delta_time: int = 5
    yellow_time: int = 2
    min_green: int = 10
    reward: Mapping[str, float] = field(default_factory=lambda: dict(REWARD))
    height: int = 84
    width: int = 84
    shared_views: bool = False
    blind: bool = False
    background_subtraction: bool = False
    averaged_weights: bool = False
    every: int = 3
    conditions: str = "day"
    agents: str = "single"
    network: str = "usual"
    hyperparameters: Mapping[str, Any] = field(default_factory=dict)

    __repr__ = short_repr

    def __post_init__(self) -> None:
        """Refuse what cannot be.

        Raises:
            ConfigError: a value is of another type than its default, unknown, or out of its range.
        """
        _check_types(self)
        known = {
            "algorithm": tuple(ALGORITHMS),
            "observation": OBSERVATIONS,
            "conditions": tuple(CONDITIONS),
            "agents": AGENTS,
            "network": tuple(NETWORKS),
        }
        for name, values in known.items():
            if getattr(self, name) not in values:
                raise ConfigError(f"{name}={getattr(self, name)!r}: expected one of {', '.join(values)}")
        for name in ("steps", "processes", "seconds", "delta_time", "yellow_time", "min_green", "every"):
            if getattr(self, name) < 1:
                raise ConfigError(f"{name}={getattr(self, name)}: expected at least 1")
        if not 0 <= self.seed < _SEEDS:
            raise ConfigError(f"seed={self.seed}: expected 0 to {_SEEDS - 1}")
        _check_together(self)
        if self.seconds % self.delta_time:
            raise ConfigError(f"seconds={self.seconds}: expected a multiple of delta_time={self.delta_time}")
        own = _complete(self.algorithm, self.hyperparameters, self.decisions, self.processes)
        object.__setattr__(self, "hyperparameters", own)
        rollout = _rollout(self.algorithm)
        if self.decisions % own[rollout]:
            raise ConfigError(
                f"{rollout}={own[rollout]}: expected a divisor of {self.decisions}, the decisions of an "
                f"episode of {self.seconds} s"
            )

    @property
    def decisions(self) -> int:
        """Decisions in an episode."""
        return self.seconds // self.delta_time

    @property
    def round_steps(self) -> int:
        """Steps of an episode in each environment."""
        return self.decisions * self.processes

    @property
    def whole_steps(self) -> int:
        """Steps of whole rounds: a run ends where episodes end."""
        return -(-self.steps // self.round_steps) * self.round_steps

    @property
    def sees(self) -> bool:
        """Whether the policy learns from images, not from features or an encoder's."""
        return self.encoder == "none" and self.observation in IMAGES

    @property
    def _shown(self) -> str:
        """What the environment shows."""
        if not self.blind:
            return self.observation
        return "blind_picture" if self.observation in IMAGES else "blind"

    @property
    def environment(self) -> dict[str, Any]:
        """Keywords of the environment that it learns in."""
        keywords: dict[str, Any] = {
            "scenario": self.scenario,
            "observation": self._shown,
            "delta_time": self.delta_time,
            "yellow_time": self.yellow_time,
            "min_green": self.min_green,
            "num_seconds": self.seconds,
            "max_red": None,  # The paper sets no limit.
            "always_transition": True,  # As the table's other rows.
        }
        if self.observation in IMAGES:
            keywords |= {"height": self.height, "width": self.width, "show_links": True}
        if CONDITIONS[self.conditions]:
            keywords["conditions"] = CONDITIONS[self.conditions]
        return {**keywords, "reward_fn": dict(self.reward)}


def _check_types(training: Training) -> None:
    """Refuse a value of another type than the setting's default."""
    for setting in dataclasses.fields(training):
        value = getattr(training, setting.name)
        kind = Mapping if setting.default is dataclasses.MISSING else type(setting.default)
        if not isinstance(value, kind) or (isinstance(value, bool) and kind is not bool):
            raise ConfigError(f"{setting.name}={value!r}: expected {kind.__name__}")


def _check_together(training: Training) -> None:
    """Refuse settings that do not go together."""
    for name, unused in (("encoder", "none"), ("background_subtraction", False)):
        value = getattr(training, name)
        if value != unused and training.observation not in IMAGES:
            raise ConfigError(f"{name}={value!r} needs images; observe {' or '.join(IMAGES)}")
    if training.blind and (training.encoder != "none" or training.observation not in ("features", *IMAGES)):
        raise ConfigError("blind=True: observe features, bev or multi_view, without an encoder")
    if training.agents != "single" and training.observation == "multi_view":
        raise ConfigError("several signals have different numbers of views; observe features or bev")
    observed = NETWORKS[training.network] or training.observation
    if training.observation != observed:
        raise ConfigError(f"network={training.network!r} sees observation={observed!r} alone; give it")
    if training.network == "mappo" and training.algorithm == "dqn":
        raise ConfigError("network='mappo' is a critic's; learn by algorithm='ppo' or 'a2c'")


def _rollout(algorithm: str) -> str:
    """Name the setting that tells how many decisions of each environment an update waits for."""
    return "train_freq" if algorithm == "dqn" else "n_steps"


def _complete(algorithm: str, given: Mapping[str, Any], decisions: int, processes: int) -> dict[str, Any]:
    """Add an algorithm's usual settings to those that are given, made to fit the length of an episode.

    Raises:
        ConfigError: it has no such setting, or the value cannot take the usual one's place: counts are whole
            numbers, and none is negative.
    """
    usual = ALGORITHMS[algorithm]
    if unknown := set(given) - set(usual):
        names = ", ".join(sorted(unknown))
        raise ConfigError(f"{algorithm} has no setting {names} here; known are {', '.join(usual)}")
    for name, value in given.items():
        is_count = isinstance(usual[name], int)
        kinds = int if is_count else (int, float)
        if not isinstance(value, kinds) or isinstance(value, bool) or not 0 <= value < math.inf:
            raise ConfigError(f"{name}={value!r}: expected a number such as {usual[name]}")
        if value == 0 and is_count and name != "learning_starts":
            raise ConfigError(f"{name}={value}: expected at least 1")
    own = {**usual, **given}
    rollout = _rollout(algorithm)
    if rollout not in given:
        own[rollout] = _largest_divisor(decisions, own[rollout])
    if algorithm == "ppo" and "batch_size" not in given:
        own["batch_size"] = _largest_divisor(own[rollout] * processes, own["batch_size"])
    return own


def _largest_divisor(number: int, most: int) -> int:
    return next(k for k in range(min(number, most), 0, -1) if number % k == 0)


def read_training(path: Path) -> Training:
    """Read a run's settings.

    Args:
        path: of `training.json` in the run's folder.

    Returns:
        The settings.

    Raises:
        RunFileError: there is none, it is not one of ours, or not as it was written.
    """
    if not is_there(path):
        raise RunFileError(path.parent, "no training; dojo-env train --out FOLDER makes one")
    value = read_json(path, error=RunFileError)
    # Settings that were kept before there were checksums have none.
    if not isinstance(value, dict) or value.keys() - {"sha256"} != {"training", "versions"}:
        raise RunFileError(path, "not the settings of a training run")
    if value.pop("sha256", _sha256(value)) != _sha256(value):
        raise RunFileError(path, "is damaged, or was edited: its sha256 is another; train anew")
    try:
        return Training(**value["training"])
    except (ConfigError, TypeError) as error:
        raise RunFileError(path, f"not the settings of a training run ({error})") from error


def check_folder(training: Any, folder: Path, read: Callable[[Path], Any], *, resume: bool) -> None:
    """See that a folder is free for a run, or this run's.

    Args:
        training: the run's settings.
        folder: of the run.
        read: reads such settings from their file.
        resume: whether the run goes on.

    Raises:
        ConfigError: the folder holds a run already, or none, or another one's.
    """
    path = folder / SETTINGS
    if resume:
        if read(path) != training:
            raise ConfigError(f"{path}: another run's settings; give the same ones, or another --out")
        if not (folder / CHECKPOINT).is_file():
            raise ConfigError(f"{folder}: no checkpoint yet; start again without --resume in another folder")
    elif path.exists():
        raise ConfigError(f"{folder} holds a run already; --resume goes on with it, or name another --out")


def write_training(training: Training, path: Path) -> None:
    """Write a run's settings, the versions of what it ran on, and their checksum.

    Args:
        training: the settings.
        path: of the file, which is replaced whole.

    Raises:
        UsageError: the path is a folder, or lies in none.
        WriteError: the folder cannot be written.
    """
    known = {"training": dataclasses.asdict(training), "versions": list_versions()}
    write_json(path, {**known, "sha256": _sha256(known)})


def _sha256(known: Mapping[str, Any]) -> str:
    """Hash what is kept, all but the checksum itself."""
    told = {name: value for name, value in known.items() if name != "sha256"}
    return hashlib.sha256(json.dumps(told, sort_keys=True).encode()).hexdigest()


def write_settings(kind: str, settings: Mapping[str, Any], path: Path) -> None:
    """Write the settings of a training of another kind, and the versions of what it ran on.

    Args:
        kind: what is trained; readers know the file by it.
        settings: by name, as JSON has them.
        path: of the file, which is replaced whole.

    Raises:
        UsageError: the path is a folder, or lies in none.
        WriteError: the folder cannot be written.
    """
    write_json(path, {"kind": kind, "training": settings, "versions": list_versions()})


def list_versions() -> dict[str, str]:
    """List what a run's figures may depend on."""
    found = {"python": platform.python_version()}
    for name in PACKAGES:
        try:
            found[name] = version(name)
        except PackageNotFoundError:
            found[name] = "not installed"
    return found
