"""Which letter of a signal's state belongs to which link, before and after crossings were added.

Every link of the old network gets its old letter again, whatever netconvert numbered it; new crossings get
the letters after the last old one, with the vehicle links that conflict with them.
"""

from collections import defaultdict
from collections.abc import Mapping
from xml.etree.ElementTree import Element

from dojo_maps.errors import DojoError, SourceError
from dojo_maps.sources.net_tree import NetTree, WalkKey, crossing_junction, name, shifted
from dojo_maps.sources.pedestrian_timing import Foe, Walk

_TURNS = ("l", "r", "t")


class TransplantError(DojoError):
    """netconvert changed what a signal controls, so its programs cannot be carried over."""


def restore_link_indices(old: NetTree, new: NetTree, shift: Mapping[str, int]) -> dict[str, list[Walk]]:
    """Give every link of the old network its old letter again, and append letters for new crossings.

    Args:
        old: the network before.
        new: the network with crossings, changed in place.
        shift: by road, how far its lanes' indices moved.

    Returns:
        The new crossings of each signal, in the order of their letters.

    Raises:
        TransplantError: a link went missing, came up or changed its signal.
    """
    expected = {shifted(key, shift): connection for key, connection in old.vehicle_links.items()}
    for key in expected.keys() ^ new.vehicle_links.keys():
        done = "dropped" if key in expected else "added"
        raise TransplantError(
            f"{old.path}: netconvert {done} the connection {key[0]}_{key[1]}->{key[2]}_{key[3]}"
        )
    for key, connection in expected.items():
        _restore_link(old, connection, new.vehicle_links[key])
    appended: dict[str, dict[WalkKey, Element]] = defaultdict(dict)
    for walk_key in old.walk_links.keys() - new.walk_links.keys():
        raise TransplantError(
            f"{old.path}: netconvert dropped a signalled crossing at junction {walk_key[0]}"
        )
    for walk_key, connection in new.walk_links.items():
        if walk_key in old.walk_links:
            _restore_link(old, old.walk_links[walk_key], connection)
        else:
            appended[connection.get("tl", "")][walk_key] = connection
    return {signal: _append_links(old, new, signal, links) for signal, links in appended.items()}


def _restore_link(old: NetTree, before: Element, after: Element) -> None:
    if before.get("tl") != after.get("tl"):
        raise TransplantError(
            f"{old.path}: netconvert moved {name(before)} from signal {before.get('tl')} to {after.get('tl')}"
        )
    if "linkIndex" in before.attrib:
        after.set("linkIndex", before.attrib["linkIndex"])


def _append_links(old: NetTree, new: NetTree, signal: str, links: Mapping[WalkKey, Element]) -> list[Walk]:
    """Number new pedestrian links after the last old letter, in netconvert's order."""
    first = _state_size(old, signal)
    built = sorted({new.number(connection, "linkIndex") for connection in links.values()})
    crossings: dict[int, str] = {}
    for (_, _, onto, _), connection in links.items():
        index = first + built.index(new.number(connection, "linkIndex"))
        connection.set("linkIndex", str(index))
        crossings[index] = connection.get("to" if onto else "from", "")
    return [
        Walk(
            crossing=crossing,
            index=index,
            length=new.crossing_length(crossing),
            foes=_find_foes(new, crossing, signal),
        )
        for index, crossing in sorted(crossings.items())
    ]


def _state_size(old: NetTree, signal: str) -> int:
    """Count the letters of a signal's states; every phase of every program must have as many."""
    links = [*old.vehicle_links.values(), *old.walk_links.values()]
    needed = 1 + max(
        (old.number(link, "linkIndex") for link in links if link.get("tl") == signal), default=-1
    )
    states = [
        phase.get("state", "")
        for logic in old.logics()
        if logic.get("id") == signal
        for phase in logic.iterfind("phase")
    ]
    sizes = {len(state) for state in states}
    if len(sizes) > 1 or min(sizes, default=needed) < needed:
        raise SourceError(
            old.path,
            f"states of {sorted(sizes)} letters for {needed} links; give each phase as many",
            element=signal,
        )
    return max(sizes, default=needed)


def _find_foes(new: NetTree, crossing: str, signal: str) -> tuple[Foe, ...]:
    """Read from the junction's own request matrix which vehicle links conflict with a crossing."""
    junction = new.junctions[crossing_junction(crossing)]
    lanes = junction.get("intLanes", "").split()
    requests = {new.number(request, "index"): request for request in junction.iterfind("request")}
    own = lanes.index(f"{crossing}_0")
    crossed = new.crossings[crossing].get("crossingEdges", "").split()
    foes = []
    for number, lane in enumerate(lanes):
        connection = new.link_of_lane.get(lane)
        if connection is None or not _bit(requests[own], "foes", number):
            continue
        index = new.number(connection, "linkIndex") if connection.get("tl") == signal else -1
        foes.append(
            Foe(
                index=index if index >= 0 else None,
                blocks=connection.get("from") in crossed or connection.get("dir") not in _TURNS,
                yields=_bit(requests[number], "response", own),
            )
        )
    return tuple(foes)


def _bit(request: Element, key: str, link: int) -> bool:
    """Read a link's bit; SUMO writes link 0 rightmost."""
    return request.get(key, "")[::-1][link : link + 1] == "1"
