"""What the rows of a results folder hold, read back for pictures and reports; torch is not needed."""

import contextlib
import csv
import json
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dojo_maps.errors import DojoError, SourceError

from .rows import ROWS
from .run_row import CURVES, FIGURES, SERIES
from .settings import CURVE

Numbers = NDArray[np.float64]
Published = Mapping[str, Mapping[str, Mapping[str, float]]]
"""Mean and standard deviation by row and figure."""


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
        """Read the first seed's hour: minutes since its begin, and what was measured at each decision."""
        with (self.folder / SERIES).open(encoding="utf-8") as file:
            lines = list(csv.DictReader(file))
        seconds = np.array([float(line["second"]) for line in lines])
        interval = seconds[1] - seconds[0] if len(seconds) > 1 else 0.0
        series = {name: np.array([float(line[name]) for line in lines]) for name in CURVES}
        return (seconds - seconds[0] + interval) / 60, series

    def read_curve(self, part: str = "validation") -> dict[str, Numbers]:
        """Read its training: steps and figures of one part; empty where there is none."""
        if not (self.folder / CURVE).is_file():
            return {}
        with (self.folder / CURVE).open(encoding="utf-8") as file:
            lines = [line for line in csv.DictReader(file) if line["part"] == part]
        names = [name for name in (lines[0] if lines else ()) if name not in ("part", "reward")]
        return {name: np.array([float(line[name]) for line in lines]) for name in names}


@contextlib.contextmanager
def files_read(path: Path) -> Iterator[None]:
    """Read files of results in here.

    Raises:
        SourceError: one does not hold what it should.
    """
    try:
        yield
    except DojoError:
        raise
    except (ValueError, KeyError, TypeError) as error:
        raise SourceError(path, f"does not hold results ({type(error).__name__}: {error})") from error


def read_published(path: Path | None) -> Mapping[str, Published]:
    """Read a file of published figures, by scenario; nothing without one.

    Raises:
        SourceError: the file is missing, or holds something else.
    """
    if path is None:
        return {}
    if not path.is_file():
        raise SourceError(path, "no such file")
    with files_read(path):
        return json.loads(path.read_text(encoding="utf-8"))["scenarios"]


def read_kept(results: Path) -> dict[str, dict[str, KeptRow]]:
    """Read every row that is there, by scenario and name, in the tables' order."""
    found: dict[str, dict[str, KeptRow]] = {}
    for path in sorted(results.glob(f"*/*/{FIGURES}")):
        row = KeptRow(path.parent, json.loads(path.read_text(encoding="utf-8")))
        found.setdefault(path.parent.parent.name, {})[row.name] = row
    order = {name: place for place, name in enumerate(ROWS)}
    return {
        scenario: {name: rows[name] for name in sorted(rows, key=lambda name: (order.get(name, 99), name))}
        for scenario, rows in found.items()
    }
