"""How records tell themselves: in a line, with what is not as usual and no more than people read."""

from dataclasses import MISSING, Field, fields
from reprlib import Repr
from typing import Any

LONGEST = 200
"""Characters."""
_values = Repr()
_values.maxstring = _values.maxother = 60


def short_repr(record: Any) -> str:
    """Write a record as it would be made, without what is as usual; what is long loses its middle or its end.

    Args:
        record: a dataclass; it takes this function as its `__repr__`.

    Returns:
        A line of at most 200 characters.
    """
    told = ", ".join(
        f"{field.name}={_values.repr(getattr(record, field.name))}"
        for field in fields(record)
        if field.init and not _is_usual(field, getattr(record, field.name))
    )
    return shortened(f"{type(record).__name__}({told})")


def shortened(text: str) -> str:
    """Cut a line's end off where it is too long.

    Args:
        text: with a bracket at its end.

    Returns:
        A line of at most 200 characters, with a bracket at its end.
    """
    line = " ".join(text.split())
    return line if len(line) <= LONGEST else f"{line[: LONGEST - 4]}...)"


def _is_usual(field: Field[Any], value: Any) -> bool:
    default = field.default if field.default_factory is MISSING else field.default_factory()
    return type(value) is type(default) and not hasattr(value, "shape") and bool(value == default)
