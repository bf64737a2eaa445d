"""Repairs of junctions' rules: the row that is missing follows from the others, surplus rows go."""

from collections.abc import Iterator, Sequence

from dojo_maps.issue import Element, Issue
from dojo_maps.repair.edits import Change, Edit, Rebuild, SetRequests, Site, named
from dojo_maps.safe_xml import Attributes


def complete_rules(site: Site, issues: Sequence[Issue]) -> Iterator[Edit]:
    """Give a junction a request per link; where they do not follow from each other, netconvert makes them.

    Args:
        site: the network as it is.
        issues: with the junctions.

    Yields:
        An edit for each junction; what is found at it and at its signals then was only hidden.
    """
    for id_ in named(issues, "junction"):
        attributes = site.text.elements.get(("junction", id_), {})
        rows = _completed(site.text.records.requests[id_], len(attributes.get("intLanes", "").split()))
        change: Change = Rebuild()
        if rows is not None:
            requests = tuple(tuple(row.items()) for row in rows)
            change = SetRequests(key=("junction", id_), requests=requests)
        signals = [signal.id for signal in site.facts.signals if id_ in signal.junctions]
        element = Element(kind="junction", id=id_)
        yield Edit(
            element=element,
            what="rules computed by netconvert" if rows is None else "a rule for each link",
            changes=(change,),
            uncovers=(element, *(Element(kind="signal", id=signal) for signal in signals)),
        )


def _completed(rows: Sequence[Attributes], links: int) -> list[Attributes] | None:
    """Add the one row that is missing and drop those without a link; None if that does not settle it."""
    known = {int(row["index"]): row for row in rows if row.get("index", "").isdecimal()}
    kept = {k: row for k, row in known.items() if k < links}
    missing = sorted(set(range(links)) - kept.keys())
    if not rows or len(missing) > 1 or any(len(row.get("foes", "")) != links for row in kept.values()):
        return None
    for index in missing:
        foes = {k for k, row in kept.items() if _bit(row, "foes", index)}
        first = {k for k in foes if not _bit(kept[k], "response", index)}
        kept[index] = {
            "index": str(index),
            "response": "".join("01"[k in first] for k in reversed(range(links))),
            "foes": "".join("01"[k in foes] for k in reversed(range(links))),
            "cont": "0",
        }
    return [kept[k] for k in sorted(kept)]


def _bit(row: Attributes, key: str, place: int) -> bool:
    """Read a link's bit; SUMO writes link 0 rightmost."""
    bits = row.get(key, "")
    return place < len(bits) and bits[-1 - place] == "1"
