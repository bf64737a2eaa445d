"""Add connections at single junctions: netconvert builds the network, and only their ways are taken from it.

Roads, outlines, signals and the right of way among the ways that there were stay as they are. A new way has
the right of way, and the signal, of the one beside it, and yields to that.
"""

import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from xml.etree import ElementTree as ET
from xml.sax.saxutils import quoteattr

import numpy as np

from dojo_maps.description import Junction
from dojo_maps.geometry.polylines import Floats, along
from dojo_maps.repair.edits import Connect, Key
from dojo_maps.repair.net_text import NetText, Span, key_of
from dojo_maps.safe_xml import Attributes
from dojo_maps.signals.conflicts import list_foes
from dojo_maps.sources.netconvert import NetconvertError, build_again
from dojo_maps.sources.sumo_net import read_network

_EDGE, _INNER = re.compile(r"\d+|[cw]\d+"), re.compile(r"\d+_\d+")
"""What follows a junction's name in the ids of its inner edges, and of its internal junctions."""
_TAGS = ("edge", "junction", "connection")
_ENDS = ("from", "fromLane", "to", "toLane")
_LETTERS = ("tl", "linkIndex", "linkIndex2")
_FARTHEST = 5.0
"""Metres by which netconvert may have moved a lane's end; its ways are drawn back to the old one."""


@dataclass(frozen=True, slots=True, kw_only=True)
class _Network:
    """A network's text, and its junctions as they are described."""

    text: NetText
    junctions: Mapping[str, Junction]


def connect(data: bytes, wanted: Sequence[Connect], path: Path) -> bytes:
    """Add connections to a network.

    Args:
        data: its bytes, unpacked.
        wanted: the connections; those of one junction are made together.
        path: where it came from, for errors.

    Returns:
        The network's bytes with them.

    Raises:
        NetconvertError: netconvert refuses them or crashes, or they cannot be taken over alone.
        ToolMissingError: netconvert is not installed.
    """
    built, _ = build_again(data, connections="".join(map(plain_connection, wanted)))
    old, new = _read(data, path), _read(built, path)
    pieces: list[tuple[Span, bytes]] = []
    for junction in dict.fromkeys(each.junction for each in wanted):
        like = {each.key: each for each in wanted if each.junction == junction}
        pieces += _splice(old, new, junction, like)
    return old.text.replaced(pieces)


def plain_connection(wanted: Connect) -> str:
    """Write a connection as netconvert reads it.

    Args:
        wanted: the connection; only its key counts.

    Returns:
        An element of a plain file of connections.
    """
    values = zip(_ENDS, wanted.key[1:], strict=True)
    return f"<connection{''.join(f' {name}={quoteattr(value)}' for name, value in values)}/>"


def _read(data: bytes, path: Path) -> _Network:
    road_map, _ = read_network(data, path=path, name="", sha256="")
    return _Network(text=NetText(data, path), junctions={j.id: j for j in road_map.junctions})


def _splice(
    old: _Network, new: _Network, junction: str, like: Mapping[Key, Connect]
) -> Iterator[tuple[Span, bytes]]:
    """Put a junction's ways as they were built in the place of what they were."""
    shapes = _draw_back(old.text, new.text, junction)
    rules = _write_rules(old.junctions[junction], new.junctions[junction], like)
    for tag in _TAGS:
        before, after = (dict.fromkeys(_parts(each.text, junction, tag)) for each in (old, new))
        if not before or not after or _walks(before) != _walks(after):
            raise NetconvertError(
                f"netconvert would change more than the ways across the junction {junction}"
            )
        texts = []
        for key in after:
            element = ET.fromstring(new.text.copies(key)[0])  # noqa: S314 - netconvert's own
            _adapt(element, key, old.text.elements, like, shapes)
            if key == ("junction", junction):
                element[:] = [ET.Element("request", rule) for rule in rules]
            texts.append(ET.tostring(element, encoding="unicode").strip())
        spans = sorted(span for key in before for span in old.text.spans(key))
        yield spans[0], "\n    ".join(texts).encode("ascii", "xmlcharrefreplace")
        yield from ((span, b"") for span in spans[1:])


def _adapt(
    element: ET.Element,
    key: Key,
    known: Mapping[Key, Attributes],
    like: Mapping[Key, Connect],
    shapes: Mapping[str, tuple[str, str]],
) -> None:
    """Let an element that was built keep what the old one said, or what stands beside it."""
    built = dict(element.attrib)
    if key[0] == "edge":
        for lane in element.iter("lane"):
            if lane.get("id", "") in shapes:
                lane.attrib.update(zip(("shape", "length"), shapes[lane.get("id", "")], strict=True))
    elif key in like:
        beside, letter = known.get(like[key].like, {}), like[key].letter
        state = beside.get("state", "m").replace("M", "m")
        for name in _LETTERS:
            element.attrib.pop(name, None)
        element.set("state", state)
        if letter is not None:
            element.attrib.update(tl=beside.get("tl", ""), linkIndex=str(letter))
    elif key in known and not re.fullmatch(r":.*_\d+", key[1]):  # Inner parts are numbered anew.
        element.attrib.clear()
        element.attrib.update(known[key])
        element.attrib.update({name: built[name] for name in ("via", "intLanes") if name in built})


def _parts(text: NetText, junction: str, tag: str) -> Iterator[Key]:
    """List what belongs to a junction, in the order of the file."""
    for key in text.elements:
        if key[0] != tag:
            continue
        if tag == "connection":
            inner = any(_is_inner(end, junction, _EDGE) for end in (key[1], key[3]))
            if inner or text.elements.get(("edge", key[1]), {}).get("to") == junction:
                yield key
        elif key == ("junction", junction) or _is_inner(key[1], junction, _EDGE if tag == "edge" else _INNER):
            yield key


def _is_inner(id_: str, junction: str, rest: re.Pattern[str]) -> bool:
    start = f":{junction}_"
    return id_.startswith(start) and rest.fullmatch(id_[len(start) :]) is not None


def _walks(keys: Iterable[Key]) -> set[str]:
    return {key[1] for key in keys if key[1].rpartition("_")[2][:1] in ("c", "w") and key[1][:1] == ":"}


def _write_rules(old: Junction, new: Junction, like: Mapping[Key, Connect]) -> list[Attributes]:
    """Write who yields to whom: as before, and new ways as the one beside them, to which they yield."""
    beside = {_link(key): _link(wanted.like) for key, wanted in like.items()}
    links = [way.link for way in new.right_of_way]
    kept = {way.link for way in old.right_of_way if way.link}  # Rules without a way are left over.
    if not all(links) or kept | beside.keys() != set(links):
        raise NetconvertError(f"the junction {old.id} has no rules for all of its ways")
    known, built = _waits(old), _waits(new)
    inside = {way.link: way.cont for way in old.right_of_way}
    if any(inside.get(way.link, way.cont) != way.cont for way in new.right_of_way):
        raise NetconvertError(f"netconvert would let vehicles wait elsewhere inside the junction {old.id}")

    def waits(one: str, other: str) -> bool:
        before = known.get((beside.get(one, one), beside.get(other, other)))
        if before is not None:
            return before
        if (one in beside) == (other in beside):
            return built.get((one, other), one > other)
        return one in beside

    def are_foes(one: str, other: str) -> bool:
        if not {one, other} & beside.keys():
            return (one, other) in known
        return one != other and ((one, other) in built or _target(one) == _target(other))

    rules = []
    for index, (link, way) in enumerate(zip(links, new.right_of_way, strict=True)):
        pairs = [are_foes(link, other) for other in links]
        response = [foe and waits(link, other) for foe, other in zip(pairs, links, strict=True)]
        rules.append(
            {
                "index": str(index),
                "response": "".join("01"[bit] for bit in reversed(response)),
                "foes": "".join("01"[bit] for bit in reversed(pairs)),
                "cont": str(int(way.cont)),
            }
        )
    return rules


def _target(link: str) -> str:
    return link.rpartition("->")[2]


def _waits(junction: Junction) -> dict[tuple[str, str], bool]:
    """Tell of each pair of ways that cross or join whether the first waits for the second."""
    found: dict[tuple[str, str], bool] = {}
    for pair in list_foes(junction):
        found[pair.one, pair.other], found[pair.other, pair.one] = pair.one_waits, pair.other_waits
    return found


def _link(key: Key) -> str:
    return f"{key[1]}_{key[2]}->{key[3]}_{key[4]}"


def _draw_back(old: NetText, new: NetText, junction: str) -> dict[str, tuple[str, str]]:
    """Move built ways to where the roads' lanes end; the shape and the length of each inner lane."""
    records = [r for r in new.records.connections if key_of("connection", r) in new.elements]
    onward = {f"{r['from']}_{r['fromLane']}": r.get("via") for r in records if r["from"].startswith(":")}
    shapes: dict[str, tuple[str, str]] = {}
    for record in records:
        via = record.get("via")
        if via is None or new.elements.get(("edge", record["from"]), {}).get("to") != junction:
            continue
        chain = [via]
        while (following := onward.get(chain[-1])) is not None and following not in chain:
            chain.append(following)
        start, end = (f"{record[end]}_{record[f'{end}Lane']}" for end in ("from", "to"))
        moved = np.array(
            [_shape(old, start)[-1] - _shape(new, start)[-1], _shape(old, end)[0] - _shape(new, end)[0]]
        )
        if np.hypot(*moved[:, :2].T).max() > _FARTHEST:
            raise NetconvertError(f"netconvert would draw the roads at the junction {junction} anew")
        places = [_shape(new, lane) for lane in chain]
        steps = np.linspace(0, 1, sum(map(len, places)))[:, None]
        row = np.concatenate(places) + (1 - steps) * moved[0] + steps * moved[1]
        for lane, part in zip(chain, np.split(row, np.cumsum([*map(len, places)])[:-1]), strict=True):
            shapes[lane] = (_written(part), f"{max(float(along(part)[-1]), 0.1):.2f}")
    return shapes


def _shape(text: NetText, lane: str) -> Floats:
    """Read a lane's shape, (n, 3); heights are 0 where there are none."""
    tokens = text.elements.get(("lane", lane), {}).get("shape", "").split()
    if not tokens:
        raise NetconvertError(f"the lane {lane} has another name, or no shape")
    return np.array([[*map(float, token.split(",")), 0.0][:3] for token in tokens])


def _written(shape: Floats) -> str:
    width = 3 if shape[:, 2].any() else 2
    return " ".join(",".join(f"{value:.2f}" for value in place[:width]) for place in shape)
