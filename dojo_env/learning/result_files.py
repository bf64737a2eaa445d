"""What runs left in files, read back with care: tables of numbers, results, and published figures."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dojo_env.learning.settings import RunFileError
from dojo_maps.input_files import read_table
from dojo_maps.safe_json import read_json

Numbers = NDArray[np.float64]
Published = Mapping[str, Mapping[str, Mapping[str, float]]]
"""Mean and standard deviation by row and figure."""


def read_columns(path: Path, needed: tuple[str, ...], *, part: str | None = None) -> dict[str, Numbers]:
    """Read a table's columns of numbers, by their names.

    Args:
        path: the file of comma-separated values.
        needed: columns that it must have.
        part: only the rows whose column `part` says so.

    Returns:
        (rows,) values of each column but `part`; where there are no rows, of those that are needed alone.

    Raises:
        RunFileError: the file is missing or damaged, or a value is no number.
    """
    rows = read_table(path, needed if part is None else (*needed, "part"), error=RunFileError)
    rows = [row for row in rows if part is None or row["part"] == part]
    names = [name for name in (rows[0] if rows else needed) if name != "part"]
    try:
        return {name: np.array([float(row[name]) for row in rows]) for name in names}
    except (TypeError, ValueError) as error:
        raise RunFileError(path, f"holds what is no number ({error})") from error


def read_result(path: Path, *needed: str) -> dict[str, Any]:
    """Read an object of JSON that has some names.

    Args:
        path: of the file.
        needed: names that the object must have.

    Returns:
        The whole object.

    Raises:
        RunFileError: the file is missing, damaged, or lacks one of `needed`; or its figures are none.
    """
    value = read_json(path, error=RunFileError)
    missing = [name for name in needed if not isinstance(value, dict) or name not in value]
    if missing or not isinstance(value, dict):
        raise RunFileError(path, f"no result of ours: it has no {', '.join(missing) or 'names'}")
    if "figures" in value and not _are_figures(value["figures"]):
        raise RunFileError(path, "its figures are no means and standard deviations")
    return value


def read_published(path: Path | None) -> Mapping[str, Published]:
    """Read a file of published figures.

    Args:
        path: of the JSON file; None for none.

    Returns:
        Mean and standard deviation by scenario, row and figure; nothing without a file.

    Raises:
        RunFileError: the file is missing or damaged.
    """
    if path is None:
        return {}
    scenarios = read_result(path, "scenarios")["scenarios"]
    rows = scenarios.values() if isinstance(scenarios, dict) else [None]
    if not all(isinstance(each, dict) and all(map(_are_figures, each.values())) for each in rows):
        raise RunFileError(path, "expected means and standard deviations by scenario, row and figure")
    return scenarios


def _are_figures(value: Any) -> bool:
    if not isinstance(value, dict) or not all(isinstance(each, dict) for each in value.values()):
        return False
    numbers = [each.get(name) for each in value.values() for name in ("mean", "std")]
    return all(isinstance(number, int | float) for number in numbers)
