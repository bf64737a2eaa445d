"""A network's text, changed element by element: every byte that no change names stays as it is."""

import itertools
import re
from collections import defaultdict
from collections.abc import Mapping, Sequence
from pathlib import Path
from xml.parsers import expat
from xml.sax.saxutils import quoteattr

from dojo_maps.errors import SourceError
from dojo_maps.safe_xml import Attributes
from dojo_maps.sources.sumo_xml import LogicRecord, read_records

Span = tuple[int, int]
_VALUE = rb"\"[^\"]*\"|'[^']*'"
_TAG = re.compile(rb"<[^\s/>]+(?:\s+[^\s=/>]+\s*=\s*(?:" + _VALUE + rb"))*\s*/?>")
_ATTRIBUTE = re.compile(rb"\s+([^\s=/>]+)\s*=\s*(" + _VALUE + rb")")
_ENCODING = re.compile(rb"\s*<\?xml[^>]*encoding\s*=\s*[\"']([A-Za-z0-9._-]+)")
_IDENTITY = {
    "edge": ("id",),
    "lane": ("id",),
    "junction": ("id",),
    "connection": ("from", "fromLane", "to", "toLane"),
    "tlLogic": ("id", "programID"),
}
_ROWS = {"tlLogic": "phase", "junction": "request"}


class NetText:
    """A network's bytes with the places of its elements.

    Attributes:
        data: the bytes.
        elements: the attributes of each element, by its tag and identity; of several, the first.
        edge_of: the edge of each lane.
    """

    def __init__(self, data: bytes, path: Path) -> None:
        """Find every element.

        Raises:
            SourceError: not a SUMO network, unsafe, or in an encoding whose letters are not those of ASCII.
        """
        if b"\0" in data[:8]:
            raise SourceError(path, "is not in an encoding that can be repaired; save it as UTF-8")
        self.data = data
        self.records = read_records(data, path)
        self.elements: dict[tuple[str, ...], Attributes] = {}
        self.edge_of: dict[str, str] = {}
        self._spans: dict[tuple[str, ...], list[Span]] = defaultdict(list)
        self._rows: dict[tuple[str, ...], list[tuple[Span, Attributes]]] = defaultdict(list)
        self._find()

    def logics(self, signal: str) -> list[LogicRecord]:
        """List the programs of a signal.

        Args:
            signal: its id.

        Returns:
            Their records, in file order; empty where the signal has none.
        """
        return [logic for logic in self.records.logics if logic.attributes.get("id") == signal]

    def copies(self, key: tuple[str, ...]) -> list[str]:
        """Give the text of every element with one identity.

        Args:
            key: as `key_of` makes it.

        Returns:
            Each one's text from its start tag to its end, in file order; empty where there is none.
        """
        declared = _ENCODING.match(self.data[:200])
        encoding = declared.group(1).decode() if declared else "utf-8"
        return [self.data[start:end].decode(encoding, "replace") for start, end in self._spans.get(key, ())]

    def spans(self, key: tuple[str, ...]) -> list[Span]:
        """Give the places of every element with one identity.

        Args:
            key: as `key_of` makes it.

        Returns:
            Each one's first byte and the byte after its last, in file order; empty where there is none.
        """
        return self._spans.get(key, [])

    def set_attributes(self, key: tuple[str, ...], values: Mapping[str, str | None]) -> tuple[Span, bytes]:
        """Write an element's start tag with other values; the network's bytes stay.

        Args:
            key: of an element that the network has, as `key_of` makes it; of several, the first is meant.
            values: by attribute; None takes one away, those without a value here stay.

        Returns:
            The place of the start tag, and what belongs there, for `replaced`.
        """
        start, _ = self._spans[key][0]
        found = _TAG.match(self.data, start)
        tag = found.group() if found else b""
        parts, at, rest = [], 0, dict(values)
        for attribute in _ATTRIBUTE.finditer(tag):
            name = attribute.group(1).decode("utf-8", "replace")
            if name in rest:
                value = rest.pop(name)
                parts.append(tag[at : attribute.start(2) if value is not None else attribute.start()])
                parts.append(b"" if value is None else _quoted(value))
                at = attribute.end()
        close = len(tag) - (2 if tag.endswith(b"/>") else 1)
        parts.append(tag[at:close].rstrip() if rest else tag[at:close])
        parts += [f" {name}=".encode() + _quoted(value) for name, value in rest.items() if value is not None]
        return (start, start + len(tag)), b"".join(parts) + tag[close:]

    def remove(self, key: tuple[str, ...], copy: int) -> tuple[Span, bytes]:
        """Write nothing for an element and the line that it leaves empty; the network's bytes stay.

        Args:
            key: of an element that the network has, as `key_of` makes it.
            copy: which of those with this key, from 0, in file order.

        Returns:
            The place to empty, and no bytes, for `replaced`.
        """
        start, end = self._spans[key][copy]
        line = len(self.data[:start].rstrip(b" \t"))
        if self.data[line - 1 : line] == b"\n" and self.data[end : end + 2].lstrip(b"\r")[:1] == b"\n":
            start = line - (2 if self.data[line - 2 : line] == b"\r\n" else 1)
        return (start, end), b""

    def set_rows(self, key: tuple[str, ...], rows: Sequence[Sequence[tuple[str, str]]]) -> tuple[Span, bytes]:
        """Write a program's phases, or a junction's requests, anew.

        Rows that are as they were keep their text; what stands between rows comes after the last.

        Args:
            key: of a `tlLogic` or a `junction` with at least one row, as `key_of` makes it.
            rows: the attributes of each, in order.

        Returns:
            The place from the first row to the last, and what belongs there, for `replaced`.
        """
        spans, tag = [span for span, _ in self._rows[key]], _ROWS[key[0]]
        same = {tuple(a.items()): self.data[start:end] for (start, end), a in self._rows[key]}
        written = [same.get(tuple(row)) or _row(tag, row) for row in rows]
        gaps = (self.data[a[1] : b[0]].strip() for a, b in itertools.pairwise(spans))
        start = spans[0][0]
        indent = self.data[len(self.data[:start].rstrip(b" \t")) : start]
        return (start, spans[-1][1]), (b"\n" + indent).join([*written, *filter(None, gaps)])

    def replaced(self, pieces: Sequence[tuple[Span, bytes]]) -> bytes:
        """Put pieces in the place of what they stand for; the text itself stays.

        Args:
            pieces: places, of which none overlap, and what belongs there; in any order.

        Returns:
            The new network's bytes.
        """
        parts, at = [], 0
        for (start, end), piece in sorted(pieces):
            parts += [self.data[at:start], piece]
            at = end
        return b"".join([*parts, self.data[at:]])

    def _find(self) -> None:
        opened: list[tuple[str, tuple[str, ...], int]] = []
        rows: list[Attributes] = []

        def start(name: str, attributes: Attributes) -> None:
            at = parser.CurrentByteIndex
            inside = opened[-1][1] if opened else ()
            if inside and name == _ROWS.get(inside[0]):
                opened.append((name, inside if len(self._spans[inside]) < 1 else (), at))
                rows.append(attributes)
                return
            key = key_of(name, attributes)
            opened.append((name, key, at))
            self.elements.setdefault(key, attributes)
            if name == "lane" and inside:
                self.edge_of.setdefault(attributes.get("id", ""), inside[1] if len(inside) > 1 else "")

        def end(_name: str) -> None:
            name, key, at = opened.pop()
            if name in _ROWS.values() and rows:
                span = (at, _end(self.data, at, parser.CurrentByteIndex))
                self._rows[key].append((span, rows.pop()))
            elif name in _IDENTITY:
                self._spans[key].append((at, _end(self.data, at, parser.CurrentByteIndex)))

        parser = expat.ParserCreate()
        parser.StartElementHandler, parser.EndElementHandler = start, end
        parser.Parse(self.data, True)


def _end(data: bytes, start: int, close: int) -> int:
    """Find where an element ends that starts and is closed at two places."""
    found = _TAG.match(data, start)
    if found and found.group().endswith(b"/>"):
        return found.end()
    return data.index(b">", close) + 1


def key_of(name: str, attributes: Attributes) -> tuple[str, ...]:
    """Name an element by its tag and what tells it apart from others.

    Args:
        name: its tag.
        attributes: its own; one that it lacks counts as empty.

    Returns:
        The tag and the identity, such as (lane, id); the tag alone for elements that are not told apart.
    """
    return (name, *(attributes.get(part, "") for part in _IDENTITY.get(name, ())))


def _row(tag: str, attributes: Sequence[tuple[str, str]]) -> bytes:
    return f"<{tag}".encode() + b"".join(f" {k}=".encode() + _quoted(v) for k, v in attributes) + b"/>"


def _quoted(value: str) -> bytes:
    return quoteattr(value).encode("ascii", "xmlcharrefreplace")
