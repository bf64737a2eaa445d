"""Edits as text: made in a network, and as files of SUMO's plain XML, for a look or for netconvert.

The files say what the network holds in the end: `netconvert -s NET -n repair.nod.xml -e repair.edg.xml
-x repair.con.xml -i repair.tll.xml` makes the same repairs, though it builds everything else anew as well.
"""

from collections import defaultdict
from collections.abc import Iterable, Sequence
from pathlib import Path
from xml.sax.saxutils import quoteattr

from dojo_maps.repair.edits import (
    Change,
    Connect,
    Edit,
    Key,
    Rebuild,
    Remove,
    SetAttributes,
    SetPhases,
    SetRequests,
)
from dojo_maps.repair.net_text import NetText, Span
from dojo_maps.repair.rebuilding import rebuild
from dojo_maps.repair.splicing import connect, plain_connection

Values = dict[str, str | None]
_ROOTS = {"nod": "nodes", "edg": "edges", "con": "connections", "tll": "tlLogics"}


def apply_changes(text: NetText, changes: Iterable[Change], path: Path) -> bytes:
    """Make changes; those of one element's attributes are made together, and netconvert comes last.

    Args:
        text: the network, which stays as it is.
        changes: to elements that it has, and what is to be added.
        path: where the network came from, for errors.

    Returns:
        The changed network's bytes.

    Raises:
        NetconvertError: the network has to be built anew, and that failed.
        TransplantError: netconvert changed something for vehicles that cannot be put back.
        SourceError: the network has to be built anew, and one of its signals is broken.
        ToolMissingError: the network has to be built anew, and netconvert is not installed.
    """
    values: dict[Key, dict[str, str | None]] = {}
    pieces: list[tuple[Span, bytes]] = []
    rebuilds: list[Rebuild] = []
    connects: list[Connect] = []
    for change in changes:
        if isinstance(change, SetAttributes):
            values.setdefault(change.key, {}).update(change.values)
        elif isinstance(change, Remove):
            pieces.append(text.remove(change.key, change.copy))
        elif isinstance(change, SetPhases):
            pieces.append(text.set_rows(change.key, change.phases))
        elif isinstance(change, SetRequests):
            pieces.append(text.set_rows(change.key, change.requests))
        elif isinstance(change, Connect):
            connects.append(change)
        else:
            rebuilds.append(change)
    pieces += [text.set_attributes(key, wanted) for key, wanted in values.items()]
    data = text.replaced(pieces) if pieces else text.data
    if connects:
        data = connect(data, connects, path)
    return rebuild(data, rebuilds, path) if rebuilds else data


def plain_files(after: NetText, edits: Iterable[tuple[str, Edit]], note: str = "") -> dict[str, str]:
    """Write edits as plain XML.

    Args:
        after: the network with all of them.
        edits: each with its check.
        note: a line that each file begins with.

    Returns:
        The text of each file by its name; no file where there is nothing to say.
    """
    lines: dict[str, dict[str, None]] = defaultdict(dict)
    for check, edit in edits:
        said: set[str] = set()
        for change in edit.changes:
            for kind, element in _plain(after, change):
                if kind not in said:
                    lines[kind][_comment(f"{check}, {edit.element.kind} {edit.element.id}: {edit.what}")] = (
                        None
                    )
                    said.add(kind)
                lines[kind][element] = None
    return {
        f"repair.{kind}.xml": _document(root, [*([_comment(note)] if note else ()), *lines[kind]])
        for kind, root in _ROOTS.items()
        if kind in lines
    }


def _document(root: str, elements: Sequence[str]) -> str:
    inner = "".join(f"    {element}\n" for element in elements)
    return f'<?xml version="1.0" encoding="UTF-8"?>\n<{root}>\n{inner}</{root}>\n'


def _plain(after: NetText, change: Change) -> list[tuple[str, str]]:
    """Write a change as elements, each with the file that it belongs in."""
    if isinstance(change, Rebuild):
        built = _comment("netconvert builds all ways across junctions anew")
        added = [("con", element) for element in change.connections]
        return [*added, *(("nod", element) for element in change.nodes)] or [("con", built)]
    if isinstance(change, Connect):
        return [("con", plain_connection(change))]
    if isinstance(change, SetPhases):
        return [("tll", element) for element in after.copies(change.key)[:1]]
    if isinstance(change, SetRequests):
        return [("con", _comment(f"junction {change.key[1]}: netconvert computes its rules anew"))]
    return _plain_attributes(after, change)


def _plain_attributes(after: NetText, change: SetAttributes | Remove) -> list[tuple[str, str]]:
    tag = change.key[0]
    if tag == "connection":
        return _plain_connection(after, change)
    if tag == "lane":
        return _plain_lane(after, change.key)
    return [_plain_other(tag, change)]


def _plain_other(tag: str, change: SetAttributes | Remove) -> tuple[str, str]:
    kind = {"edge": "edg", "junction": "nod"}.get(tag, "con")
    if isinstance(change, SetAttributes) and kind != "con":
        plain = "edge" if tag == "edge" else "node"
        return kind, f"<{plain}{_attributes({'id': change.key[1], **dict(change.values)})}/>"
    return kind, _comment(f"{tag} {change.key[1]}: one of its copies removed")


def _plain_connection(after: NetText, change: SetAttributes | Remove) -> list[tuple[str, str]]:
    ends: Values = dict(zip(("from", "fromLane", "to", "toLane"), change.key[1:], strict=True))
    if change.key[1].startswith(":") or change.key[3].startswith(":"):
        return [("con", _plain_step(after, change))]
    if isinstance(change, Remove) and change.copy:
        return [("con", _comment(f"copy {change.copy + 1} of the connection {_attributes(ends)} removed"))]
    if isinstance(change, Remove):
        return [("con", f"<delete{_attributes(ends)}/>")]
    values = dict(change.values)
    if ends.keys() & values.keys():
        fresh = _attributes({**ends, **values})
        return [("con", f"<delete{_attributes(ends)}/>"), ("con", f"<connection{fresh}/>")]
    kind = "tll" if values.keys() & {"tl", "linkIndex"} else "con"
    return [(kind, f"<connection{_attributes({**ends, **values})}/>")]


def _plain_step(after: NetText, change: SetAttributes | Remove) -> str:
    """Write a step on foot: the crossing with its signal's letter; netconvert makes other steps itself."""
    start, target = change.key[1], change.key[3]
    crossed = after.elements.get(("edge", target), {}).get("crossingEdges")
    values = dict(change.values) if isinstance(change, SetAttributes) else {}
    if crossed is None or "linkIndex" not in values:
        return _comment(f"connection {start}->{target}: {_attributes(values) or 'removed'}")
    crossing: Values = {"node": target[1:].rpartition("_c")[0], "edges": crossed}
    return f"<crossing{_attributes({**crossing, 'linkIndex': values['linkIndex']})}/>"


def _plain_lane(after: NetText, key: Key) -> list[tuple[str, str]]:
    """Write a lane's shape: of a road, of a way across a junction, or of a walking area."""
    lane = after.elements[key]
    edge = after.elements.get(("edge", after.edge_of.get(key[1], "")), {})
    id_, function = edge.get("id", ""), edge.get("function", "normal")
    shape: Values = {name: lane[name] for name in ("shape", "width") if name in lane}
    if function == "walkingarea":
        area: Values = {"node": id_[1:].rpartition("_w")[0], "edges": _edges_at(after, id_), **shape}
        return [("con", f"<walkingArea{_attributes(area)}/>")]
    if function != "internal":
        inner = f"<lane{_attributes({'index': lane.get('index', '0'), **shape})}/>"
        return [("edg", f"<edge{_attributes({'id': id_})}>{inner}</edge>")]
    for record in after.records.connections:
        if record.get("via") == key[1] and not record.get("from", "").startswith(":"):
            ends: Values = {name: record.get(name) for name in ("from", "fromLane", "to", "toLane")}
            return [("con", f"<connection{_attributes({**ends, **shape})}/>")]
    return [("con", _comment(f"lane {key[1]}: {_attributes(shape)}"))]


def _edges_at(text: NetText, area: str) -> str:
    """Name the roads whose sidewalks meet in a walking area."""
    ends = [(r.get("from", ""), r.get("to", "")) for r in text.records.connections]
    roads = [other for a, b in ends for other in ((b,) if a == area else (a,) if b == area else ())]
    return " ".join(dict.fromkeys(road for road in roads if not road.startswith(":")))


def _attributes(values: Values) -> str:
    return "".join(f" {key}={quoteattr(value)}" for key, value in values.items() if value is not None)


def _comment(text: str) -> str:
    return f"<!-- {text.replace('--', '- -').rstrip('-')} -->"
