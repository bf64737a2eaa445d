"""Lengths as tags have them."""

import re

_LENGTH = re.compile(r"\s*(\d{1,4}(?:[.,]\d{1,4})?)\s*(m|metres|meters|ft|'|)\s*", re.ASCII)
_FEET = re.compile(r"\s*(\d{1,4})\s*'\s*(\d{1,2}(?:\.\d{1,2})?)\s*\"\s*", re.ASCII)
_FOOT = 0.3048


def read_length(text: str) -> float | None:
    """Read a length: `12`, `12.5 m`, `40 ft`, `10'6"`.

    Args:
        text: a tag's value.

    Returns:
        Metres; None where the text is no length, as an empty one.
    """
    if feet := _FEET.fullmatch(text):
        return (float(feet[1]) + float(feet[2]) / 12) * _FOOT
    match = _LENGTH.fullmatch(text)
    if match is None:
        return None
    value = float(match[1].replace(",", "."))
    return value * _FOOT if match[2] in ("ft", "'") else value
