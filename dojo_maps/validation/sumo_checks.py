"""What SUMO itself says when it loads the network, tied to the elements that it names."""

import re
from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np

from dojo_maps.description import Junction, Points, WalkingArea
from dojo_maps.issue import Element
from dojo_maps.validation.check import ERROR, WARNING, Finding, Need, check
from dojo_maps.validation.facts import Facts
from dojo_maps.validation.profiles import Limits
from dojo_maps.validation.programs import name_ways

_NAME = re.compile(r"([\w-]*)[ (]*'([^']*)'?")
"""A quoted name with the word before it."""
_BARE = re.compile(r"\b(lane|edge|junction|tlLogic) ([^\s',!]+)")
"""A name without quotes; what the network does not have is none."""
_INDEX = re.compile(r"(?:tl-index|linkIndex|link) (\d+(?:,\d+)*)")
_NO_DETECTOR = "no controlling detector"
_KINDS = {
    "tls": "signal",
    "tlLogic": "signal",
    "light": "signal",
    "junction": "junction",
    "logic": "junction",
    "node": "junction",
    "from-node": "junction",
    "to-node": "junction",
    "lane": "lane",
    "edge": "road",
}
"""What SUMO's words name."""


@check(
    id="sumo.refused",
    code="SUM001",
    title="SUMO loads the network",
    severity=ERROR,
    limit="no error",
    source="sumo --net-file",
    hint="mend what SUMO names, or rebuild the network with netconvert",
    needs=Need.SUMO,
)
def check_refused(facts: Facts, _limits: Limits) -> Iterator[Finding]:
    """Find why SUMO refuses the network; an error with which it loads it still is a warning.

    Args:
        facts: of the map, with SUMO's word on it, which is waited for; without it nothing is found.
        _limits: there is none to this check.

    Yields:
        A finding for each of SUMO's errors, at the first thing that it names and the network has.
    """
    verdict = facts.sumo.verdict if facts.sumo else None
    for words, count in verdict.errors.items() if verdict else ():
        yield _quote(facts, words, count, refused=not verdict or not verdict.accepted)


@check(
    id="sumo.warning",
    code="SUM002",
    title="SUMO loads the network without a warning",
    severity=WARNING,
    limit="no warning",
    source="sumo --net-file",
    hint="mend what SUMO names",
    needs=Need.SUMO,
)
def check_warned(facts: Facts, _limits: Limits) -> Iterator[Finding]:
    """Find what SUMO warns of while it loads the network.

    Args:
        facts: of the map, with SUMO's word on it, which is waited for; without it nothing is found.
        _limits: there is none to this check.

    Yields:
        A finding if SUMO has not come to an end, and one for each of its warnings but those of detectors, at
        the first thing that it names and the network has.
    """
    verdict = facts.sumo.verdict if facts.sumo else None
    if verdict and verdict.accepted is None:
        yield Finding(
            elements=(), at=facts.map.origin, message="SUMO has not come to an end with the network in time"
        )
    yield from _quote_warnings(facts, of_detectors=False)


@check(
    id="signals.no_detector",
    code="SIG019",
    title="An actuated green has a detector",
    severity=WARNING,
    limit="a detector for each phase whose length varies",
    source="sumo: has no controlling detector",
    hint="give the phase a fixed duration (minDur = maxDur), or a longer lane of its own before the signal",
    needs=Need.SUMO,
)
def check_no_detector(facts: Facts, _limits: Limits) -> Iterator[Finding]:
    """Find greens of actuated programs that no vehicle can lengthen, in SUMO's words.

    Args:
        facts: of the map, with SUMO's word on it, which is waited for; without it nothing is found.
        _limits: there is none to this check.

    Yields:
        A finding for each of SUMO's warnings of a missing detector.
    """
    yield from _quote_warnings(facts, of_detectors=True)


def _quote_warnings(facts: Facts, *, of_detectors: bool) -> Iterator[Finding]:
    verdict = facts.sumo.verdict if facts.sumo else None
    for words, count in verdict.warnings.items() if verdict else ():
        if (_NO_DETECTOR in words) == of_detectors:
            yield _quote(facts, words, count)


def _quote(facts: Facts, words: str, count: int, *, refused: bool = False) -> Finding:
    elements = tuple(dict.fromkeys(_named_in(facts, words)))
    places = (_place_of(facts, item) for item in elements)
    return Finding(
        elements=elements,
        at=next((place for place in places if place is not None), facts.map.origin),
        message=f"SUMO: {words}" if count == 1 else f"SUMO, {count} times: {words}",
        severity=ERROR if refused else WARNING,
    )


def _named_in(facts: Facts, words: str) -> Iterator[Element]:
    """List what SUMO's words name: what the network has, and what SUMO misses in it."""
    indices = [int(index) for found in _INDEX.findall(words) for index in found.split(",")]
    for word, quoted in _NAME.findall(words):
        found = _find(facts, quoted.partition(", ")[0], _KINDS.get(word))
        if found is not None:
            yield found
            if found.kind == "signal":
                yield from name_ways(way for k in indices for way in facts.controlled.get((found.id, k), ()))
    for word, name in _BARE.findall(words):
        if name in _tables(facts)[_KINDS[word]]:
            yield Element(kind=_KINDS[word], id=name)


def _find(facts: Facts, name: str, kind: str | None) -> Element | None:
    """Find what has a name, best of the kind that SUMO says it is; what lies inside a junction stands for it.

    What SUMO says to be of a kind and the network does not have is named all the same.
    """
    tables = _tables(facts)
    kinds = [kind, *tables] if kind else list(tables)
    for known in kinds:
        if known and name in tables[known]:
            return Element(kind=known, id=name)
    inside = name.removeprefix(":")
    while inside != name and "_" in inside:
        inside = inside.rpartition("_")[0]
        if inside in facts.junctions:
            return Element(kind="junction", id=inside)
    return Element(kind=kind, id=name) if kind else None


def _tables(facts: Facts) -> dict[str, Mapping[str, Any]]:
    return {
        "lane": facts.lanes,
        "road": facts.roads,
        "crossing": facts.crossings,
        "walking_area": facts.walking_areas,
        "connection": facts.connections,
        "junction": facts.junctions,
        "signal": facts.signals_by_id,
    }


def _place_of(facts: Facts, item: Element) -> Points | None:
    """Find where an element lies, (3,); None where the network does not tell."""
    if item.kind == "road" and item.id in facts.roads:
        item = Element(kind="lane", id=facts.roads[item.id].lanes[0])
    if item.kind == "signal":
        ways = (ways[0] for (signal, _), ways in facts.controlled.items() if signal == item.id)
        way = next(ways, None)
        return None if way is None else way.shape[0]
    found = _tables(facts)[item.kind].get(item.id)
    if isinstance(found, Junction):
        return np.array(found.position)
    if isinstance(found, WalkingArea):
        return found.polygon[0]
    return None if found is None else found.shape[0]
