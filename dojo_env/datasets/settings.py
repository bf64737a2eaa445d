"""What a data set is made from: settings that refuse contradictions, and the episodes that follow."""

from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass, field, fields
from itertools import accumulate
from math import ceil
from typing import Any, TypeVar

import numpy as np

from dojo_env.camera import LARGEST_SIDE
from dojo_env.controllers import CONTROLLERS
from dojo_env.datasets.formats import FORMATS
from dojo_env.datasets.weather import read_ranges
from dojo_env.errors import ConfigError
from dojo_env.imaging import read_imaging
from dojo_maps.short_repr import short_repr
from dojo_maps.wording import counted

Thing = TypeVar("Thing")

SPLITS = ("train", "val", "test")
EPISODE, SCENARIO, CAMERA = "episode", "scenario", "camera"
_DIVIDED = (EPISODE, SCENARIO, CAMERA)
"""What may be divided among the splits."""
_MOST_PICTURES = 100_000_000
_LARGEST_EPISODE, _FEWEST_EPISODES = 1000, 10
"""Pictures that an episode gives at most, unless asked for; and how many episodes there are at least."""
_INTERVAL, _FRAME_INTERVAL = 10.0, 0.1
"""Seconds between two instants; and of sequences, between two frames."""
_NEGATIVES = 0.05


@dataclass(frozen=True, slots=True, kw_only=True)
class DatasetSettings:
    """All that decides the bytes of a data set.

    Attributes:
        scenarios: names or paths; each gives as many pictures as the others.
        pictures: of all together.
        format: of `formats.FORMATS`.
        cameras: see `cameras.choose_cameras`.
        conditions: one is drawn for each episode; see `weather.read_ranges`.
        imaging: how cameras work; one is drawn for each episode; see `imaging.read_imaging`.
        controllers: one is drawn for each episode, so that queues differ.
        size: width and height, pixels.
        split: shares of train, val and test. Whole episodes are divided, so no sequence is in two of them.
        split_by: `episode`; or `scenario`, so that no two splits share one: in the order in which they are
            given, the first for train; or `camera`, so that no two splits share one: drawn by the seed.
        interval: seconds from one instant to the next; None takes 10 s, and 0.1 s of sequences.
        per_episode: pictures of an episode; None takes a tenth of all, at most 1,000.
        seconds: simulated of each episode; None takes the scenario's.
        seed: of everything random.
        least_pixels: visible pixels below which a road user is not asked for.
        least_visible: visible share below which it is not.
        negatives: share of pictures with empty roads; None takes 0.05, and none of sequences.
        depth: write depths, too.
        picture: `jpg` or `png`; None takes the format's own.
        quality: of JPEG, 1 to 100.
        smooth: anti-alias what moves.
        parked: cars stand parked where the map has them; pictures of empty roads have none.
    """

    scenarios: tuple[str, ...]
    pictures: int
    format: str = "coco"
    cameras: tuple[str, ...] = ("approach",)
    conditions: tuple[str, ...] = ("random",)
    imaging: tuple[str, ...] = ("ideal",)
    controllers: tuple[str, ...] = ("fixed-time", "actuated", "max-pressure", "cycle", "random")
    size: tuple[int, int] = (640, 448)
    split: tuple[float, ...] = (0.8, 0.1, 0.1)
    split_by: str = EPISODE
    interval: float | None = None
    per_episode: int | None = None
    seconds: float | None = None
    seed: int = 0
    least_pixels: int = 40
    least_visible: float = 0.1
    negatives: float | None = None
    depth: bool = False
    picture: str | None = None
    quality: int = 92
    smooth: bool = True
    parked: bool = True

    __repr__ = short_repr

    def __post_init__(self) -> None:
        """Refuse what cannot be, and settle what depends on the format.

        Raises:
            ConfigError: a value cannot work.
        """
        for name in ("scenarios", "cameras", "conditions", "imaging", "controllers", "size", "split"):
            value = getattr(self, name)
            object.__setattr__(self, name, (value,) if isinstance(value, str) else tuple(value))
        _refuse_unless(self.format in FORMATS, "format", self.format, f"one of {', '.join(FORMATS)}")
        made = FORMATS[self.format]
        defaults = {
            "interval": _FRAME_INTERVAL if made.is_sequential else _INTERVAL,
            "per_episode": min(_LARGEST_EPISODE, ceil(self.pictures / _FEWEST_EPISODES)),
            "negatives": 0.0 if made.is_sequential else _NEGATIVES,
            "picture": made.picture,
        }
        for name, value in defaults.items():
            if getattr(self, name) is None:
                object.__setattr__(self, name, value)
        self._check()
        for text in self.conditions:
            read_ranges(text)
        for text in self.imaging:
            read_imaging(text)

    def _check(self) -> None:
        width, height = self.size if len(self.size) == 2 else (0, 0)
        sides = f"WIDTHxHEIGHT, 16 to {LARGEST_SIDE} pixels"
        known = f"of {', '.join(CONTROLLERS)}"
        for name, is_possible, wanted in (
            ("scenarios", bool(self.scenarios), "at least one"),
            ("pictures", 1 <= self.pictures <= _MOST_PICTURES, f"1 to {_MOST_PICTURES:,}"),
            ("cameras", bool(self.cameras), "at least one"),
            ("conditions", bool(self.conditions), "at least one"),
            ("imaging", bool(self.imaging), "at least one"),
            ("controllers", bool(self.controllers) and set(self.controllers) <= set(CONTROLLERS), known),
            ("size", all(16 <= side <= LARGEST_SIDE for side in (width, height)), sides),
            ("split", _are_shares(self.split), "up to three shares that add up to 1, such as 0.8,0.1,0.1"),
            ("split_by", self.split_by in _DIVIDED, f"one of {', '.join(_DIVIDED)}"),
            ("interval", 0.01 <= (self.interval or 0) <= 3600, "0.01 to 3600 seconds"),
            ("per_episode", (self.per_episode or 0) >= 1, "at least 1"),
            ("seed", 0 <= self.seed < 2**63, "0 or more"),
            ("least_pixels", self.least_pixels >= 1, "at least 1"),
            ("least_visible", 0 <= self.least_visible <= 1, "0 to 1"),
            ("negatives", 0 <= (self.negatives or 0) < 1, "0 to 1, without 1"),
            ("picture", self.picture in ("jpg", "png"), "jpg or png"),
            ("quality", 1 <= self.quality <= 100, "1 to 100"),
        ):
            _refuse_unless(is_possible, name, getattr(self, name), wanted)
        if FORMATS[self.format].is_sequential and self.negatives:
            raise ConfigError(f"negatives={self.negatives}: a sequence of {self.format} is whole; give 0")

    @property
    def splits(self) -> tuple[str, ...]:
        """Names of the splits that get something."""
        return tuple(name for name, share in zip(SPLITS, self.split, strict=False) if share > 0)

    def describe(self) -> dict[str, Any]:
        """Give everything as JSON takes it.

        Returns:
            The fields by name.
        """
        return {name: list(v) if isinstance(v, tuple) else v for name, v in asdict(self).items()}

    def command(self) -> str:
        """Write the command that makes such a data set.

        Returns:
            The command in a line.
        """
        words = ["dojo-env dataset", *self.scenarios, f"-n {self.pictures}"]
        usual = DatasetSettings(scenarios=self.scenarios, pictures=self.pictures, format=self.format)
        for each in fields(self):
            value = getattr(self, each.name)
            if value == (each.default if each.name == "format" else getattr(usual, each.name)):
                continue
            if isinstance(value, bool):
                words.append(f"--{'' if value else 'no-'}{each.name}")
            else:
                words.append(f"--{each.name.replace('_', '-')} {_write(each.name, value)}")
        return " ".join(words)


@dataclass(frozen=True, slots=True, kw_only=True)
class Job:
    """One episode, and the pictures that it gives.

    Attributes:
        number: of the episode, from 0.
        scenario: its name or path.
        seed: of everything random in it.
        split: that all its pictures belong to.
        first: number of its first picture, from 1.
        pictures: how many.
    """

    number: int
    scenario: str
    seed: int
    split: str
    first: int
    pictures: int

    @property
    def name(self) -> str:
        """Name of its part."""
        return f"{self.number:06d}"


@dataclass(frozen=True, slots=True, kw_only=True)
class Plan:
    """A data set's settings and all of its episodes.

    Attributes:
        settings: from which the rest follows.
        jobs: the episodes.
    """

    settings: DatasetSettings
    jobs: tuple[Job, ...] = field(init=False)

    def __post_init__(self) -> None:
        """Divide the pictures into episodes, and these into splits.

        Raises:
            ConfigError: there are too few episodes for the splits.
        """
        object.__setattr__(self, "jobs", tuple(_plan_jobs(self.settings)))
        found = {job.split for job in self.jobs}
        missing = [name for name in self.settings.splits if name not in found]
        if missing:
            raise ConfigError(
                f"split {_write('split', self.settings.split)}: of {counted(len(self.jobs), 'episode')} none "
                f"is left to {missing[0]}; give fewer pictures per episode, more in all, or another split"
            )


def _plan_jobs(settings: DatasetSettings) -> list[Job]:
    """Divide; each episode goes to the split that lacks most, so that shares hold all along."""
    jobs: list[Job] = []
    taken = dict.fromkeys(SPLITS, 0)
    shares = dict(zip(SPLITS, settings.split, strict=False))
    first = 1
    for scenario, held, wanted in _divide_scenarios(settings):
        for _, count in _divide(range(ceil(wanted / (settings.per_episode or 1))), wanted):
            number, total = len(jobs), first - 1 + count
            split = held or max(shares, key=lambda name: shares[name] * total - taken[name])
            seed = int(np.random.SeedSequence([settings.seed, number]).generate_state(1, np.uint64)[0] >> 1)
            jobs.append(
                Job(number=number, scenario=scenario, seed=seed, split=split, first=first, pictures=count)
            )
            taken[split] += count
            first += count
    return jobs


def _divide_scenarios(settings: DatasetSettings) -> Iterator[tuple[str, str, int]]:
    """Tell how many pictures each scenario gives, and the split that it is held for; "" for any."""
    if settings.split_by != SCENARIO:
        yield from (
            (scenario, "", count) for scenario, count in _divide(settings.scenarios, settings.pictures)
        )
        return
    begun = 0.0
    for split, scenarios in divide_among(
        settings, tuple(dict.fromkeys(settings.scenarios)), "scenario"
    ).items():
        share = settings.split[SPLITS.index(split)]
        least, most = (round(settings.pictures * bound) for bound in (begun, begun + share))
        begun += share
        yield from ((scenario, split, count) for scenario, count in _divide(scenarios, most - least))


def divide_among(settings: DatasetSettings, things: Sequence[Thing], what: str) -> dict[str, Sequence[Thing]]:
    """Divide things among the splits in their order, as near to the shares as each gets one.

    Args:
        settings: name the splits.
        things: to divide.
        what: one of them is called, for the message.

    Returns:
        The things of each split, at least one.

    Raises:
        ConfigError: there are fewer things than splits.
    """
    names = settings.splits
    if len(things) < len(names):
        raise ConfigError(
            f"split by {settings.split_by}: of {counted(len(things), what)} none is left to "
            f"{names[len(things)]}; give more {what}s, or another split"
        )
    counts = dict.fromkeys(names, 1)
    shares = {name: settings.split[SPLITS.index(name)] for name in names}
    for _ in range(len(things) - len(names)):
        counts[max(names, key=lambda name: shares[name] * len(things) - counts[name])] += 1
    ends = list(accumulate(counts.values()))
    return {name: things[end - counts[name] : end] for name, end in zip(names, ends, strict=True)}


def _divide(parts: Sequence[Any], total: int) -> list[tuple[Any, int]]:
    """Divide a number among parts as evenly as can be; who gets nothing is left out."""
    base, more = divmod(total, max(len(parts), 1))
    return [(part, base + (k < more)) for k, part in enumerate(parts) if base + (k < more)]


def _are_shares(split: tuple[float, ...]) -> bool:
    return 1 <= len(split) <= len(SPLITS) and min(split) >= 0 and abs(sum(split) - 1) < 1e-6


def _refuse_unless(is_possible: object, name: str, value: object, wanted: str) -> None:
    if not is_possible:
        raise ConfigError(f"{name}={value!r}: expected {wanted}")


def _write(name: str, value: Any) -> str:
    if isinstance(value, tuple):
        return {"size": "x", "split": ","}.get(name, " ").join(f"{each}" for each in value)
    return f"{value}"
