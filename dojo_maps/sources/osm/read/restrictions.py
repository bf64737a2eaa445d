"""Turn restrictions: which way may not, or must, be taken after which."""

from dataclasses import dataclass

from dojo_maps.sources.osm.read.data import OsmData

_EXEMPT = {"motorcar", "motor_vehicle"}
"""Vehicles that make a restriction none for cars, by the tag `except`."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Restriction:
    """A turn restriction: the ways from, through and to, and the node between where there is one."""

    relation: int
    only: bool
    source: int
    via: tuple[int, ...]
    via_ways: tuple[int, ...]
    target: int


def read_restrictions(data: OsmData) -> tuple[list[Restriction], list[int]]:
    """Read the turn restrictions for cars, except those that hold at some times only.

    Args:
        data: the extract.

    Returns:
        The restrictions, one for each pair of ways from and to; and the ids of the relations that cannot be
        used, for they lack a member or name one of the wrong type.
    """
    found, broken = [], []
    for relation, record in data.relations.items():
        tags = record.tags
        kind = tags.get("restriction", tags.get("restriction:motorcar", ""))
        if tags.get("type") != "restriction" or _EXEMPT & set(tags.get("except", "").split(";")):
            continue
        if not kind.startswith(("no_", "only_")) or "@" in kind:
            continue
        roles: dict[str, list[tuple[str, int]]] = {"from": [], "via": [], "to": []}
        for member in record.members:
            roles.setdefault(member.role, []).append((member.kind, member.ref))
        usable = all(e[0] == "way" for e in roles["from"] + roles["to"]) and roles["via"]
        if not (usable and roles["from"] and roles["to"]):
            broken.append(relation)
            continue
        found += [
            Restriction(
                relation=relation,
                only=kind.startswith("only_"),
                source=source,
                via=tuple(ref for role, ref in roles["via"] if role == "node"),
                via_ways=tuple(ref for role, ref in roles["via"] if role == "way"),
                target=target,
            )
            for _, source in roles["from"]
            for _, target in roles["to"]
        ]
    return found, broken


def find_conditional(data: OsmData) -> dict[int, int]:
    """Find the turn restrictions that hold at some times only, with the node that they are at.

    Args:
        data: the extract.

    Returns:
        The node between the ways, by the relation's id; without relations that have no such node.
    """
    found = {}
    for relation, record in data.relations.items():
        said = {key: value for key, value in record.tags.items() if key.startswith("restriction")}
        timed = any(":conditional" in key or "@" in value for key, value in said.items())
        places = [member.ref for member in record.members if (member.kind, member.role) == ("node", "via")]
        if timed and places:
            found[relation] = places[0]
    return found
