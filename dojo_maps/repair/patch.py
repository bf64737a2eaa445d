"""Edits as text: applied to a network, and as plain-XML files that netconvert reads."""

from collections.abc import Iterable, Sequence
from pathlib import Path

from dojo_maps.repair.edits import Change, Rebuild, Remove, SetAttributes, SetPhases
from dojo_maps.repair.net_text import NetText, Span


def apply_changes(text: NetText, changes: Iterable[Change], path: Path) -> bytes:
    """Make changes; those of one element's attributes are made together."""
    values: dict[tuple[str, ...], dict[str, str | None]] = {}
    pieces: list[tuple[Span, bytes]] = []
    rebuilds: list[Rebuild] = []
    for change in changes:
        if isinstance(change, SetAttributes):
            values.setdefault(change.key, {}).update(change.values)
        elif isinstance(change, Remove):
            pieces.append(text.remove(change.key, change.copy))
        elif isinstance(change, SetPhases):
            pieces.append(text.set_phases(change.key, change.phases))
        else:
            rebuilds.append(change)
    pieces += [text.set_attributes(key, wanted) for key, wanted in values.items()]
    return text.replaced(pieces)
