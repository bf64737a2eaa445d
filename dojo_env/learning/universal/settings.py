"""Everything that a universal policy's training depends on, kept beside the policy as JSON."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from dojo_env.config import SignalConfig
from dojo_env.errors import ConfigError
from dojo_env.learning.settings import RunFileError
from dojo_env.managers.map import MapManager
from dojo_env.notes import say_once
from dojo_env.scenario import find_scenario, open_map
from dojo_maps.safe_json import read_json
from dojo_maps.wording import counted

SETTINGS, CHECKPOINT, CURVE, POLICY = "training.json", "checkpoint.pt", "curve.csv", "policy.npz"
"""The files of a run's folder."""
KIND = "universal"


@dataclass(frozen=True, slots=True, kw_only=True)
class UniversalTraining:
    """All that a run depends on.

    Attributes:
        scenarios: names or paths; the policy learns at all of their signals.
        start: the policy to go on from, a file, a run's folder or `learned`; None begins with queue pressure.
        temperature: what the scores of `start` are divided by: a trained policy is so sure that it tries
            nothing else, and learns nothing.
        seed: of everything random.
        rounds: of episodes, each with an update.
        episodes: of a round.
        shortest: simulated seconds of an episode, the least.
        longest: the most.
        least_demand: of the scenario's own, as a share.
        most_demand: likewise.
        learning_rate: at the beginning; it falls to 0.
        entropy: the worth of trying things, at the beginning; it falls to 0, too.
        clip_range: how far an update may move the odds of a choice, as a share.
        epochs: how often an update looks at each decision.
        batch_size: decisions of a step.
        every: rounds between validations.
        validation_seconds: of each of its episodes, one a scenario.
    """

    scenarios: tuple[str, ...]
    start: str | None = None
    temperature: float = 4.0
    seed: int = 0
    rounds: int = 60
    episodes: int = 32
    shortest: int = 600
    longest: int = 1800
    least_demand: float = 0.6
    most_demand: float = 1.5
    learning_rate: float = 1e-3
    entropy: float = 0.01
    clip_range: float = 0.2
    epochs: int = 10
    batch_size: int = 256
    every: int = 10
    validation_seconds: int = 1200

    def __post_init__(self) -> None:
        """Refuse what cannot be.

        Raises:
            ConfigError: a value is out of its range.
        """
        object.__setattr__(self, "scenarios", tuple(self.scenarios))
        if not self.scenarios:
            raise ConfigError("no scenarios to learn from; name at least one")
        for name in ("rounds", "episodes", "epochs", "batch_size", "every"):
            if getattr(self, name) < 1:
                raise ConfigError(f"{name}={getattr(self, name)}: expected at least 1")
        if not 120 <= self.shortest <= self.longest:
            raise ConfigError(f"shortest={self.shortest}, longest={self.longest}: expected 120 s or more")
        if not 0 < self.least_demand <= self.most_demand:
            raise ConfigError(
                f"least_demand={self.least_demand}, most_demand={self.most_demand}: expected shares"
            )
        if not self.temperature > 0:
            raise ConfigError(f"temperature={self.temperature}: expected a number above 0")
        if not 0 < self.clip_range < 1:
            raise ConfigError(f"clip_range={self.clip_range}: expected a share between 0 and 1")
        if not 0 <= self.seed < 1_000:
            raise ConfigError(f"seed={self.seed}: expected 0 to 999")


def list_junctions(scenarios: Sequence[str]) -> list[tuple[str, tuple[str, ...]]]:
    """List each scenario's signals at which there is something to decide, and say what is odd about others.

    Args:
        scenarios: names or paths.

    Returns:
        Each scenario as it was named, and the ids of its signals with at least two phases.

    Raises:
        ConfigError: there is no such scenario, or it has no such signal.
    """
    found = []
    for name in scenarios:
        managed = MapManager(open_map(find_scenario(name)), SignalConfig())
        for words in managed.list_warnings():
            say_once(words)
        plans = managed.plans
        signals = tuple(signal for signal, plan in plans.items() if len(plan.phases) > 1)
        if not signals:
            raise ConfigError(f"scenario {name}: no signal has two phases to choose from; leave it out")
        found.append((name, signals))
    return found


def count_junctions(junctions: Sequence[tuple[str, Sequence[str]]]) -> str:
    """Say how many junctions of how many scenarios `list_junctions` has found.

    Args:
        junctions: scenarios, and the ids of each one's signals.

    Returns:
        Words such as `5 junctions of 2 scenarios`.
    """
    count = counted(sum(len(signals) for _, signals in junctions), "junction")
    return f"{count} of {counted(len(junctions), 'scenario')}"


def read_settings(path: Path) -> UniversalTraining:
    """Read a run's settings.

    Args:
        path: of `training.json` in the run's folder.

    Returns:
        The settings.

    Raises:
        RunFileError: the file is missing or damaged, or is none of this kind.
    """
    value = read_json(path, error=RunFileError)
    if not isinstance(value, dict) or value.get("kind") != KIND:
        raise RunFileError(path, "not the settings of a universal policy's training")
    try:
        return UniversalTraining(**value["training"])
    except (ConfigError, TypeError, KeyError) as error:
        raise RunFileError(path, f"not the settings of a universal policy's training ({error})") from error
