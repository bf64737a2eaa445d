"""What a repair proposes: edits of single elements, each a few changes to the network's text."""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

from dojo_maps.issue import Element, Issue
from dojo_maps.repair.net_text import NetText
from dojo_maps.validation.facts import Facts
from dojo_maps.validation.profiles import Limits

Key = tuple[str, ...]
"""A tag and what tells its elements apart: (lane, id), (edge, id), (tlLogic, id, programID),
(connection, from, fromLane, to, toLane)."""


@dataclass(frozen=True, slots=True, kw_only=True)
class SetAttributes:
    """Give an element's attributes new values; None takes one away."""

    key: Key
    values: tuple[tuple[str, str | None], ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class Remove:
    """Take an element out; `copy` counts those with the same key, from 0."""

    key: Key
    copy: int = 0


@dataclass(frozen=True, slots=True, kw_only=True)
class SetPhases:
    """Give a signal program new phases, as attributes in order."""

    key: Key
    phases: tuple[tuple[tuple[str, str], ...], ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class Rebuild:
    """Let netconvert build the network anew, with elements of its plain files of connections or nodes."""

    connections: tuple[str, ...] = ()
    nodes: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True, kw_only=True)
class SetRequests:
    """Give a junction the rules of who yields to whom, as attributes in order."""

    key: Key
    requests: tuple[tuple[tuple[str, str], ...], ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class Connect:
    """Add a connection at a junction, with the right of way of another.

    Attributes:
        key: of the new connection.
        junction: where it is.
        like: of the other.
        letter: the place of its letter in the state of the other's signal, if that has one.
    """

    key: Key
    junction: str
    like: Key
    letter: int | None = None


Change = SetAttributes | Remove | SetPhases | SetRequests | Rebuild | Connect


@dataclass(frozen=True, slots=True, kw_only=True)
class Edit:
    """One repair of one element.

    Attributes:
        element: what is mended.
        what: what is done to it, in a few words.
        changes: to the network's text.
        uncovers: elements that could not be checked before; what is found there then was only hidden.
    """

    element: Element
    what: str
    changes: tuple[Change, ...]
    uncovers: tuple[Element, ...] = ()


@dataclass(frozen=True, slots=True, kw_only=True)
class Site:
    """A network as repairs see it: its facts, its text with every attribute, and the limits of its checks."""

    facts: Facts
    text: NetText
    limits: Limits
    path: Path


Repair = Callable[[Site, Sequence[Issue]], Iterable[Edit]]
"""A pure function from a network and the issues of one check to edits, each of another element."""


def named(issues: Iterable[Issue], kind: str) -> list[str]:
    """List the elements of one kind that issues name.

    Args:
        issues: to look through.
        kind: of the elements, such as `lane` or `signal`.

    Returns:
        Their ids, each once, in the order in which they are first named.
    """
    return list(dict.fromkeys(e.id for issue in issues for e in issue.elements if e.kind == kind))
