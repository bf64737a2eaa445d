"""The benchmark's rows: each is a TOML file, which anybody can copy, change, and run.

    name = "PPO-BEV"
    summary = "PPO from above."

    [training]                  # of a row that learns: fields of `Training`
    algorithm = "ppo"
    observation = "bev"

    [scenarios.cologne1]        # what is different there
    steps = 400_000

A row that does not learn has `controller = "max-pressure"` and may have `[settings]` of the environment. One
with `logic = "fixed"`, `"actuated"` or `"delay_based"` is the best timing plan that a search finds.
"""

import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import lru_cache
from pathlib import Path
from types import MappingProxyType
from typing import Any

from dojo_env.controllers import CONTROLLERS
from dojo_env.errors import ConfigError
from dojo_env.learning.settings import RunFileError, Training
from dojo_env.timing_plans import LOGICS
from dojo_maps.demand.patterns import split_pattern
from dojo_maps.safe_toml import read_toml
from dojo_maps.wording import did_you_mean

FOLDER = Path(__file__).parent / "row_files"
SUFFIX = ".toml"
CONSTRAINTS: dict[str, dict[str, Any]] = {
    "paper": {"yellow_time": 2, "all_red": 0, "always_transition": True},
    "intergreen": {"yellow_time": "speed", "all_red": 2},
}
"""What holds for all rows of a table but the network's own program: the published figures' changes of 2 s, or
those of a street, with a yellow after each approach's speed limit and a red for all."""
ONE_SIGNAL, SEVERAL_SIGNALS = ("two-way", "cologne1"), ("cologne3", "grid4x4")
"""The benchmark's scenarios."""
SCENARIOS = (*ONE_SIGNAL, *SEVERAL_SIGNALS)
_MOST_BYTES = 1 << 20
_NAME = re.compile(r"[\w*. -]{1,60}")
_KEYS = {"name", "summary", "controller", "logic", "settings", "training", "scenarios"}
_Settings = Mapping[str, Any]


@dataclass(frozen=True, slots=True, kw_only=True)
class Row:
    """A row of the table.

    Attributes:
        name: in the tables.
        summary: what it is, in a sentence.
        controller: who acts, in a row that does not learn.
        logic: of the timing plan, in a row that is searched.
        settings: of the environment for a controller, of the training for a learner.
        scenarios: what is different on single scenarios; their hyperparameters add to the row's.
    """

    name: str
    summary: str = ""
    controller: str | None = None
    logic: str | None = None
    settings: _Settings = field(default_factory=lambda: MappingProxyType({}))
    scenarios: Mapping[str, _Settings] = field(default_factory=lambda: MappingProxyType({}))

    @property
    def learns(self) -> bool:
        """Whether it has a policy."""
        return self.controller is None and self.logic is None

    def find_settings(self, scenario: str) -> dict[str, Any]:
        """Tell its settings on a scenario.

        Args:
            scenario: name or path. One with a pattern of demand, as `cologne1-surges`, has what its map
                has, where the row tells nothing of the whole name.

        Returns:
            The row's settings, with those of the scenario in their places; hyperparameters are joined one by
            one.
        """
        settings, own = dict(self.settings), dict(self._find_own(scenario))
        if "hyperparameters" in own:
            own["hyperparameters"] = {**settings.get("hyperparameters", {}), **own["hyperparameters"]}
        return {**settings, **own}

    def _find_own(self, scenario: str) -> _Settings:
        """Tell what is different on a scenario; one with a pattern has what its map has."""
        return self.scenarios.get(scenario) or self.scenarios.get(split_pattern(scenario)[0], {})

    def find_training(self, scenario: str) -> Training:
        """Tell how its policy is trained on a scenario.

        Args:
            scenario: name or path.

        Returns:
            The settings of the training run.

        Raises:
            ConfigError: a setting is unknown, or cannot be.
        """
        try:
            return Training(scenario=scenario, **self.find_settings(scenario))
        except TypeError as error:
            raise ConfigError(f"row {self.name}: {str(error).partition('() ')[2] or error}") from error


def read_row(path: Path) -> Row:
    """Read a row's file.

    Args:
        path: of the TOML file.

    Returns:
        The row. Names and kinds are checked here, values of settings only where they are used.

    Raises:
        RunFileError: it cannot be read, or is no row.
    """
    known = read_toml(path, most=_MOST_BYTES, error=RunFileError)
    if unknown := known.keys() - _KEYS:
        told, expected = (", ".join(sorted(each)) for each in (unknown, _KEYS))
        raise RunFileError(path, f"{told}: unknown; known are {expected}")
    name, controller = known.get("name"), known.get("controller")
    if not isinstance(name, str) or not _NAME.fullmatch(name):
        raise RunFileError(path, f"name = {name!r}: expected letters, digits, spaces and any of _ * . -")
    summary = known.get("summary", "")
    if not isinstance(summary, str):
        raise RunFileError(path, f"summary = {summary!r}: expected text")
    if controller is not None and controller not in CONTROLLERS:
        raise RunFileError(path, f"controller = {controller!r}: expected one of {', '.join(CONTROLLERS)}")
    logic = known.get("logic")
    if logic is not None and (logic not in LOGICS or controller is not None):
        raise RunFileError(path, f"logic = {logic!r}: expected one of {', '.join(LOGICS)}, and no controller")
    learns = controller is None and logic is None
    part, other = ("training", "settings") if learns else ("settings", "training")
    if other in known:
        raise RunFileError(
            path, f"[{other}]: a row has a controller or a logic with [settings], or [training]"
        )
    settings, scenarios = known.get(part, {}), known.get("scenarios", {})
    tables = [settings, scenarios, *(scenarios.values() if isinstance(scenarios, dict) else ())]
    if not all(isinstance(table, dict) for table in tables):
        raise RunFileError(path, f"{part} and each of scenarios: expected tables")
    return Row(
        name=name,
        summary=summary,
        controller=controller,
        logic=logic,
        settings=settings,
        scenarios=scenarios,
    )


@lru_cache(maxsize=1)
def read_packaged_rows() -> Mapping[str, Row]:
    """Read the rows of this package, by name: who does not learn first."""
    rows = [read_row(path) for path in FOLDER.glob(f"*{SUFFIX}")]
    return {row.name: row for row in sorted(rows, key=lambda row: (row.learns, row.name))}


def list_groups() -> dict[str, tuple[str, ...]]:
    """List the groups of packaged rows that have a name of their own."""
    rows = read_packaged_rows().values()
    learners = [row for row in rows if row.learns]
    several = [row for row in learners if row.settings.get("agents", "single") != "single"]
    varied = [row for row in learners if row.settings.get("conditions", "day") != "day"]
    controllers = tuple(row.name for row in rows if row.controller is not None)
    searched = tuple(row.name for row in rows if row.logic is not None)
    learned = tuple(row.name for row in learners if row not in several and row not in varied)
    return {
        "all": (*controllers, *searched, *learned),
        "controllers": controllers,
        "searched": searched,
        "learned": learned,
        "varied": tuple(row.name for row in varied),
        "several": tuple(row.name for row in several),
    }


def list_rows(scenario: str) -> tuple[str, ...]:
    """List the packaged rows that belong on a scenario: for one signal, or for several.

    Args:
        scenario: its name.

    Returns:
        The rows' names; none where it is not one of `SCENARIOS`.
    """
    groups = list_groups()
    if scenario in ONE_SIGNAL:
        return (*groups["all"], *groups["varied"])
    return (
        (*groups["controllers"], *groups["searched"], *groups["several"])
        if scenario in SEVERAL_SIGNALS
        else ()
    )


def find_row(name: str) -> Row:
    """Find a packaged row by its name, or read one from a file.

    Args:
        name: of the row, or the path of a `.toml` file.

    Returns:
        The row.

    Raises:
        ConfigError: there is none of that name.
        RunFileError: the file is no row.
    """
    if name.endswith(SUFFIX):
        return read_row(Path(name))
    rows = read_packaged_rows()
    if name not in rows:
        meant = did_you_mean(name, rows)
        raise ConfigError(f"row {name!r}: expected one of {', '.join(rows)}, or a .toml file{meant}")
    return rows[name]
