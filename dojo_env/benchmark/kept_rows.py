"""What the rows of a results folder hold, read back for pictures and reports; torch is not needed."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from dojo_env.benchmark.row_runs import FIGURES, SERIES
from dojo_env.learning.result_files import Numbers, read_columns, read_result
from dojo_env.learning.settings import CURVE
from dojo_env.series import CURVES


@dataclass(frozen=True, slots=True)
class KeptRow:
    """A row that was run: all of its `figures.json`, and where its other files are."""

    folder: Path
    result: Mapping[str, Any]

    @property
    def name(self) -> str:
        """Its name in the tables."""
        return self.result["row"]

    @property
    def figures(self) -> Mapping[str, Mapping[str, float]]:
        """Mean and standard deviation of each figure."""
        return self.result["figures"]

    @property
    def learned(self) -> bool:
        """Whether a policy was trained for it."""
        return "training" in self.result

    def read_series(self) -> tuple[Numbers, dict[str, Numbers]]:
        """Read the first seed's hour: minutes since its begin, and the means of what was measured."""
        series = read_columns(self.folder / SERIES, ("second", *CURVES))
        seconds = series["second"]
        interval = seconds[1] - seconds[0] if len(seconds) > 1 else 0.0
        return (seconds - seconds[:1] + interval) / 60, {name: series[name] for name in CURVES}

    def read_curve(self, part: str = "validation") -> dict[str, Numbers]:
        """Read one part of its training's curve, without the reward.

        Args:
            part: `validation` or `training`.

        Returns:
            By name, the steps and each figure, one value a line of the curve; empty where there is no curve.

        Raises:
            RunFileError: the curve is damaged.
        """
        if not (self.folder / CURVE).is_file():
            return {}
        columns = read_columns(self.folder / CURVE, (), part=part)
        return {name: values for name, values in columns.items() if name != "reward"}


def read_kept(results: Path) -> dict[str, dict[str, KeptRow]]:
    """Read every row that is there.

    Args:
        results: holds a folder per scenario, and in it one per row.

    Returns:
        The rows by scenario and name, in the tables' order: those that learned come last.

    Raises:
        RunFileError: a row's figures are damaged.
    """
    found: dict[str, dict[str, KeptRow]] = {}
    for path in sorted(results.glob(f"*/*/{FIGURES}")):
        row = KeptRow(path.parent, read_result(path, "row", "figures", "seeds"))
        found.setdefault(path.parent.parent.name, {})[row.name] = row
    return {
        scenario: {name: rows[name] for name in sorted(rows, key=lambda name: (rows[name].learned, name))}
        for scenario, rows in found.items()
    }
