"""Everything that a training of the network of lanes depends on, kept beside it as JSON."""

from dataclasses import dataclass

from dojo_env.errors import ConfigError

SETTINGS, CURVE, NETWORK = "training.json", "curve.csv", "lanes.npz"
"""The files of a run's folder."""
KIND = "vision"


@dataclass(frozen=True, slots=True, kw_only=True)
class VisionTraining:
    """All that a run depends on.

    Attributes:
        scenarios: names or paths; pictures are taken at all of their signals.
        seed: of everything random.
        episodes: to take pictures of.
        seconds: simulated, of each.
        looks: of each, at up to three signals at once.
        epochs: how often each example is looked at.
        batch_size: strips of a step.
        learning_rate: the greatest; it rises at the beginning, and falls to 0.
    """

    scenarios: tuple[str, ...]
    seed: int = 0
    episodes: int = 64
    seconds: int = 400
    looks: int = 40
    epochs: int = 16
    batch_size: int = 64
    learning_rate: float = 4e-3

    def __post_init__(self) -> None:
        """Refuse what cannot be.

        Raises:
            ConfigError: a value is out of its range.
        """
        object.__setattr__(self, "scenarios", tuple(self.scenarios))
        if not self.scenarios:
            raise ConfigError("no scenarios to learn from; name at least one")
        for name, least in (("looks", 1), ("epochs", 1), ("batch_size", 1), ("episodes", 2)):
            if getattr(self, name) < least:
                raise ConfigError(f"{name}={getattr(self, name)}: expected at least {least}")
        if self.seconds < self.looks + 120:
            raise ConfigError(f"seconds={self.seconds}: expected 120 more than looks={self.looks}")
        if not 0 <= self.seed < 1_000:
            raise ConfigError(f"seed={self.seed}: expected 0 to 999")
