"""In which light and weather an episode is seen: drawn by its seed from what the user allows."""

from collections.abc import Sequence
from dataclasses import replace
from types import MappingProxyType

import numpy as np

from dojo_env.conditions import PRESETS, Conditions, read_conditions, sample_conditions
from dojo_env.errors import ConfigError
from dojo_env.ranges import Limits

RANDOM = "random"
_MIX: Sequence[tuple[float, Limits]] = (
    (0.35, {"hour": (7.0, 18.5), "overcast": (0.0, 0.4)}),
    (0.15, {"hour": (7.0, 18.5), "overcast": (0.6, 1.0)}),
    (0.1, {"hour": (5.0, 7.0), "overcast": (0.0, 0.7)}),
    (0.1, {"hour": (18.5, 20.5), "overcast": (0.0, 0.7)}),
    (0.1, {"hour": (21.0, 24.0), "overcast": (0.0, 1.0)}),
    (0.15, {"hour": (6.0, 20.0), "overcast": (0.8, 1.0), "rain": (0.1, 0.9)}),
    (0.05, {"hour": (6.0, 19.0), "overcast": (0.6, 1.0), "fog": (0.005, 0.025)}),
)
"""Weathers of a temperate year as traffic meets them: share, and what each is drawn from."""
_CAMERAS: Limits = MappingProxyType(
    {"exposure": (-0.5, 0.5), "blur": (0.3, 0.8), "shake_m": (0.1, 0.1), "shake_deg": (1.0, 1.0)}
)
"""What `random` draws of every camera beside the weather."""


def read_ranges(text: str) -> Limits | None:
    """Read what conditions are drawn from: a preset's name, or values and ranges as `hour=6..22,rain=0.4`.

    Args:
        text: what the user gives.

    Returns:
        (low, high) by the name of a field of `Conditions`; None for `random`, the mix of weathers.

    Raises:
        ConfigError: it is none of these, or a value is out of range.
    """
    if text == RANDOM:
        return None
    if text in PRESETS:
        return {name: (value, value) for name, value in _values(PRESETS[text]).items()}
    ends = [_read_end(text, last) for last in (False, True)]
    low, high = (_values(read_conditions(end)) for end in ends)
    ranges = {name: (low[name], high[name]) for name in low}
    sample_conditions(ranges, seed=0)
    if ranges["dropped"][1] > 0:
        raise ConfigError(
            f"conditions {text!r}: a picture that is delivered again has other labels; no dropped"
        )
    return ranges


def draw_conditions(texts: Sequence[str], seed: int) -> Conditions:
    """Draw an episode's conditions.

    Args:
        texts: one is chosen, each as likely as the others; see `read_ranges`.
        seed: the same seed and texts give the same conditions.

    Returns:
        The conditions; their hour is from 0 to below 24.

    Raises:
        ConfigError: see `read_ranges`.
    """
    random = np.random.default_rng(seed)
    ranges = read_ranges(texts[int(random.integers(len(texts)))])
    if ranges is None:
        shares = [share for share, _ in _MIX]
        ranges = {**_MIX[int(random.choice(len(_MIX), p=shares))][1], **_CAMERAS}
    drawn = sample_conditions(ranges, int(random.integers(2**31)))
    return replace(drawn, hour=drawn.hour % 24.0)


def _read_end(text: str, last: bool) -> str:
    """Write `hour=6..22` as `hour=6`, or as `hour=22`."""
    parts = []
    for part in text.split(","):
        name, sign, value = part.partition("=")
        low, dots, high = value.partition("..")
        parts.append(f"{name}{sign}{high if dots and last else low}")
    return ",".join(parts)


def _values(conditions: Conditions) -> dict[str, float]:
    return {name: getattr(conditions, name) for name in Conditions.__slots__ if name != "seed"}
