"""Records of bounded numbers: their limits, values drawn between two bounds, and values read from text."""

from collections.abc import Iterable, Mapping
from math import isfinite

import numpy as np

from dojo_env.errors import ConfigError

Limits = Mapping[str, tuple[float, float]]
Ranges = Mapping[str, float | tuple[float, float]]
"""By name, a value that is fixed, or the least and the greatest one that may be drawn."""


def check_limits(record: object, limits: Limits, what: str) -> None:
    """Refuse values out of range.

    Args:
        record: holds a number under each name of `limits`.
        limits: the least and the greatest value by name.
        what: the record is, for the message.

    Raises:
        ConfigError: a value is not finite or out of its range.
    """
    for name, (low, high) in limits.items():
        value = getattr(record, name)
        if not (isfinite(value) and low <= value <= high):
            raise ConfigError(f"{what}: {name} must be {low:g} to {high:g}; got {value!r}")


def draw_values(
    ranges: Ranges, names: Iterable[str], random: np.random.Generator, what: str
) -> dict[str, float]:
    """Draw a value from each range, uniform and on its own, in order of their names.

    Args:
        ranges: (low, high) by name; what is one number is taken as it is.
        names: those that there are.
        random: where the values come from.
        what: is drawn, for messages.

    Returns:
        A value by name.

    Raises:
        ConfigError: a name is none of `names`, or a range is empty or no range.
    """
    drawn = {}
    for name in sorted(ranges):
        _refuse_unknown(name, names, what)
        given = ranges[name]
        if isinstance(given, int | float | np.number):
            drawn[name] = float(given)
            continue
        try:
            low, high = map(float, () if isinstance(given, str) else given)  # Text has no two bounds.
        except (TypeError, ValueError):
            raise ConfigError(
                f"{what}: {name}={given!r}: expected a number, or a range (low, high)"
            ) from None
        if not low <= high:
            raise ConfigError(f"{what}: the range of {name} is empty: ({low:g}, {high:g})")
        drawn[name] = float(random.uniform(low, high))
    return drawn


def read_values(text: str, names: Iterable[str], presets: Iterable[str], what: str) -> dict[str, float]:
    """Read values such as `hour=20,rain=0.4`.

    Args:
        text: values with commas between.
        names: those that there are.
        presets: what may be named instead, for messages.
        what: is read, for messages.

    Returns:
        A value by name.

    Raises:
        ConfigError: a part has no number, or a name is none of `names`.
    """
    values = {}
    for part in text.split(","):
        name, _, value = part.partition("=")
        try:
            values[name.strip()] = float(value)
        except ValueError:
            some = ",".join(f"{name}=..." for name in list(names)[:2])
            known = ", ".join(presets)
            raise ConfigError(f"{what} {text!r}: expected {known}, or values such as {some}") from None
    for name in values:
        _refuse_unknown(name, names, what)
    return values


def _refuse_unknown(name: str, names: Iterable[str], what: str) -> None:
    if name not in names:
        raise ConfigError(f"{what}: no {name!r}; choose from {', '.join(names)}")
