"""Crossings where a signalised junction has none, built by netconvert on request."""

from collections.abc import Iterator, Sequence
from xml.sax.saxutils import quoteattr

from dojo_maps.issue import Element, Issue
from dojo_maps.repair.edits import Edit, Rebuild, Site
from dojo_maps.wording import counted


def add_crossings(site: Site, issues: Sequence[Issue]) -> Iterator[Edit]:
    """Cross each leg that an issue names; a leg is the road in and the road back out.

    Args:
        site: the network as it is.
        issues: each with a junction, and the roads of its legs that have no crossing.

    Yields:
        An edit for each issue: netconvert builds the network anew, with the crossings.
    """
    for issue in issues:
        junction = next(e.id for e in issue.elements if e.kind == "junction")
        roads = [site.facts.roads[e.id] for e in issue.elements if e.kind == "road"]
        legs: dict[str, list[str]] = {}
        for road in roads:
            far = road.from_junction if road.to_junction == junction else road.to_junction
            legs.setdefault(far, []).append(road.id)
        crossings = tuple(
            f'<crossing node={quoteattr(junction)} edges={quoteattr(" ".join(leg))} priority="1"/>'
            for leg in legs.values()
        )
        what = f"{counted(len(crossings), 'crossing')} added"
        element = Element(kind="junction", id=junction)
        yield Edit(element=element, what=what, changes=(Rebuild(connections=crossings),))
