"""A signal for people to read: which movements each phase lets go, as text, and what is odd about it."""

from collections.abc import Iterator

from dojo_env.signals.plan import SignalPlan
from dojo_maps.index import MapIndex
from dojo_maps.signals.programs import GREEN, green_links

_TURNS = {"s": "straight", "l": "left", "r": "right", "L": "half left", "R": "half right", "t": "turn round"}
_WALK = "walk"
_MOST_NAMED = 8


def draw_phases(plan: SignalPlan, index: MapIndex) -> Iterator[str]:
    """Draw a table of movements by phases: G has priority, g yields, a point stands for red.

    Args:
        plan: of the signal.
        index: of its map.

    Yields:
        Lines of equal columns: the phases' numbers, then a line for each movement and for each crossing.
    """
    rows: dict[tuple[str, str], set[int]] = {}
    for connection in index.map.connections:
        if connection.signal == plan.signal and connection.link_index is not None:
            road, turn = index.lanes[connection.from_lane].road, connection.direction
            rows.setdefault((road, _TURNS.get(turn, turn)), set()).add(connection.link_index)
    for link, crossing in plan.walks:
        rows.setdefault((crossing, _WALK), set()).add(link)
    width = max(len(f"{place} {turn}") for place, turn in rows)
    yield f"  {'phase':{width}}" + "".join(f"{number:>4}" for number in range(len(plan.phases)))
    for (place, turn), links in rows.items():
        name = f"{place} {turn}"
        yield f"  {name:{width}}" + "".join(f"{_sum_up(state, links):>4}" for state in plan.phases)


def _sum_up(state: str, links: set[int]) -> str:
    """Write what a movement's links show: one letter, or two where its lanes differ."""
    letters = {state[link] if state[link] in GREEN else "." for link in links if link < len(state)}
    return "".join(sorted(letters, key="Gg.".find))


def list_oddities(plan: SignalPlan) -> Iterator[str]:
    """Tell what of a signal cannot be controlled, or is not as one may think, a sentence each.

    Args:
        plan: of the signal.

    Yields:
        What follows the signal's name in a sentence, such as "has one green phase"; mostly nothing.
    """
    if len(plan.phases) == 1:
        yield "has one green phase, so there is nothing to choose"
    if not plan.is_of_program:
        yield "has no green phase of its own; its phases are computed from its links"
    yield from list_unserved(plan)
    yield from plan.changes


def list_unserved(plan: SignalPlan) -> Iterator[str]:
    """Tell which links no phase serves, whoever controls the signal.

    Args:
        plan: of the signal.

    Yields:
        What follows the signal's name in a sentence; nothing where every link has a green.
    """
    served = frozenset[int]().union(*map(green_links, plan.phases))
    dark = sorted({link for link, _, _ in plan.links} - served)
    if dark:
        more = f" and {len(dark) - _MOST_NAMED} more" if len(dark) > _MOST_NAMED else ""
        yield f"has no phase for the links {', '.join(map(str, dark[:_MOST_NAMED]))}{more}"
