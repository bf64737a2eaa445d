"""In which order a signal shows its stages, so that no short road between its stop lines is filled twice.

Who waits on a short road between two stop lines of a signal fills it. A stage that leads more traffic onto it
before it is cleared finds no room there, and those in front block all behind them.
"""

import itertools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from dojo_maps.sources.osm.signals.stages import SHORT, SignalLink, Stage

_MOST_STAGES = 7
"""Stages of which all orders are looked at: 720 of 7, since the first stays where it is."""


@dataclass(frozen=True, slots=True)
class _Step:
    """A stage, by the short roads that it fills and those that it clears."""

    stage: Stage
    fills: frozenset[str]
    clears: frozenset[str]


def order_stages(links: Mapping[int, SignalLink], stages: Sequence[Stage]) -> tuple[list[Stage], list[Stage]]:
    """Order the stages of a signal, with and without repeats.

    Args:
        links: of the signal, by index.
        stages: each once.

    Returns:
        The order that fills a short road twice as seldom as possible, with stages shown once more where they
        clear such a road in time; and the same without, which is shorter, or equal.
    """
    cars = [link for link in links.values() if not link.walks and not link.cycles]
    short = {link.road for link in cars if link.room < SHORT}
    steps = [_describe(links, stage, short) for stage in stages]
    if _list_filled_twice(steps) and len(steps) <= _MOST_STAGES:
        orders = ([steps[0], *rest] for rest in itertools.permutations(steps[1:]))
        steps = min(orders, key=lambda order: len(_list_filled_twice(order)))
    repeated = list(steps)
    for place, road in reversed(_list_filled_twice(steps)):
        if road not in repeated[(place + 1) % len(repeated)].clears:
            clearing = [step for step in steps if road in step.clears]
            repeated.insert(place + 1, min(clearing, key=lambda step: len(step.fills - step.clears)))
    return [step.stage for step in repeated], [step.stage for step in steps]


def _describe(links: Mapping[int, SignalLink], stage: Stage, short: set[str]) -> _Step:
    roads = frozenset(links[k].road for k in stage.vehicles)
    filled = frozenset(links[k].onto for k in stage.vehicles)
    return _Step(stage, fills=(filled & short) - roads, clears=roads & short)


def _list_filled_twice(steps: Sequence[_Step]) -> list[tuple[int, str]]:
    """List the steps after which a short road that they filled is filled again before it is cleared."""
    found = []
    for place, step in enumerate(steps):
        later = [*steps[place + 1 :], *steps[:place]]
        for road in sorted(step.fills):
            touching = next((each for each in later if road in each.clears | each.fills), None)
            if touching is not None and road not in touching.clears:
                found.append((place, road))
    return found
