"""Overpass's JSON, with nodes of their own or, after `out geom`, with the places written into the ways."""

from pathlib import Path
from typing import Any

from dojo_maps.errors import SourceError
from dojo_maps.input_files import opened
from dojo_maps.safe_json import parse_json
from dojo_maps.sources.osm.read.data import ELEMENTS, Elements, OsmMember, Tags

_MARKS = (b'"osm3s"', b'"elements"')
_HEAD = 4096
_FULL_CIRCLE = 360.0
"""Degrees; whole numbers may have any number of digits."""


def is_overpass_json(path: Path) -> bool:
    """Tell by the beginning of a file whether Overpass wrote it.

    Args:
        path: of the file, which is not packed.

    Returns:
        Whether it did; False for a file that cannot be read.
    """
    try:
        with opened(path) as file:
            head = file.read(_HEAD)
    except SourceError:
        return False
    return any(mark in head for mark in _MARKS)


def read_overpass_json(data: bytes, path: Path, elements: Elements) -> None:
    """Read elements out of an answer of Overpass.

    Args:
        data: the file's bytes, unpacked.
        path: named in errors.
        elements: what is read is added to them.

    Raises:
        SourceError: it is broken or cut off, or no such answer, or `elements` refuses what it holds.
    """
    answer = parse_json(data, path)
    if not isinstance(answer, dict) or not isinstance(answer.get("elements"), list):
        raise SourceError(path, 'not an answer of Overpass: expected an object with a list "elements"')
    if answer.get("remark"):
        raise SourceError(path, "the server stopped before the end of this answer; download the area again")
    for element in answer["elements"]:
        _Element(element, path).add_to(elements)


class _Element:
    """One element of the answer."""

    def __init__(self, value: Any, path: Path) -> None:
        self._path = path
        self._value = value if isinstance(value, dict) else {}
        self._kind = self._value.get("type")
        if self._kind not in ELEMENTS:
            raise SourceError(path, f"an element of type {str(self._kind)[:40]!r}, expected {ELEMENTS}")
        self._id = self._integer(self._value.get("id"), "id")

    def add_to(self, elements: Elements) -> None:
        if self._kind == "node":
            self._add_node(elements, self._id, self._value, self._tags())
        elif self._kind == "way":
            self._add_way(elements)
        else:
            members = (self._member(each) for each in self._list("members"))
            elements.add_relation(self._id, members, self._tags())

    def _add_way(self, elements: Elements) -> None:
        nodes = [self._integer(node, "nodes") for node in self._list("nodes")]
        places = self._list("geometry")
        if places and len(places) != len(nodes):
            raise self._error(f"{len(places)} places of {len(nodes)} nodes; ask Overpass for `out body geom`")
        for node, place in zip(nodes, places, strict=bool(places)):
            if isinstance(place, dict) and node not in elements.nodes:  # Nodes outside the area have none.
                self._add_node(elements, node, place, {})
        elements.add_way(self._id, nodes, self._tags())

    def _add_node(self, elements: Elements, node: int, place: dict[str, Any], tags: Tags) -> None:
        lon, lat = place.get("lon"), place.get("lat")
        numbers = all(isinstance(each, int | float) and not isinstance(each, bool) for each in (lon, lat))
        if not numbers or max(abs(lon), abs(lat)) > _FULL_CIRCLE:  # type: ignore[arg-type]
            raise self._error(f"node {node} has lon={str(lon)[:40]}, lat={str(lat)[:40]}, expected degrees")
        elements.add_node(node, float(lon), float(lat), tags)  # type: ignore[arg-type]

    def _member(self, value: Any) -> OsmMember:
        if not isinstance(value, dict) or value.get("type") not in ELEMENTS:
            raise self._error(f"a member that is none of {ELEMENTS}")
        ref = self._integer(value.get("ref"), "ref")
        return OsmMember(kind=value["type"], ref=ref, role=str(value.get("role", "")))

    def _tags(self) -> Tags:
        tags = self._value.get("tags", {})
        if not isinstance(tags, dict) or not all(isinstance(value, str) for value in tags.values()):
            raise self._error("its tags are no texts by name")
        return tags

    def _list(self, name: str) -> list[Any]:
        value = self._value.get(name, [])
        if not isinstance(value, list):
            raise self._error(f"{name} is no list")
        return value

    def _integer(self, value: Any, what: str) -> int:
        if isinstance(value, bool) or not isinstance(value, int) or not 0 < abs(value) < 1 << 63:
            raise self._error(f"{what}={str(value)[:40]!r}, expected an id")
        return value

    def _error(self, problem: str) -> SourceError:
        return SourceError(self._path, problem, element=f"{self._kind} {str(self._value.get('id'))[:20]}")
