"""Parse XML that anyone may have written: no document type, no entities, bounded in every direction."""

from collections.abc import Callable, Iterable, Iterator
from pathlib import Path
from xml.parsers import expat

from dojo_maps.errors import SourceError

Attributes = dict[str, str]

MAX_TAG = 4 << 20
"""Bytes of one tag with all its attributes, or of one comment: ten times the longest in public networks."""
MAX_ATTRIBUTE = 1 << 20
"""Letters of one attribute: the shape of a lane with 50,000 positions."""
MAX_ID = 10_000
"""Letters of an `id`; netconvert makes long ones of all that it joins."""
MAX_ATTRIBUTES = 256
"""Attributes of one element; SUMO and OpenStreetMap use up to 20."""
MAX_ELEMENTS = 20_000_000
"""Elements of one file: OpenStreetMap data of a city of several million people."""
_DEEPEST = 16
_PIECE = 1 << 20


def parse_xml(
    data: bytes | Iterable[bytes],
    path: Path | str,
    *,
    root: str | None,
    kind: str,
    start: Callable[[str, Attributes], None],
    end: Callable[[str], None] = lambda _name: None,
    error: type[SourceError] = SourceError,
) -> None:
    """Tell `start` and `end` of each element, in file order.

    Args:
        data: the file's bytes, unpacked, whole or in pieces.
        path: named in errors.
        root: the root element's name; None for any.
        kind: what the file should be, for errors: `SUMO network`.
        start: called with an element's name and attributes; an IndexError from it means a misplaced element.
        end: called with an element's name at its end.
        error: raised for whatever is wrong.

    Raises:
        SourceError: of the class `error`: not well-formed, another root, larger than the limits in a tag, an
            attribute or their numbers, or XML with a document type or entities.
    """
    checks = _Checks(path, root=root, kind=kind, start=start, end=end, error=error)
    try:
        checks.parse(_in_pieces(data) if isinstance(data, bytes) else data)
    except SourceError:
        raise
    except expat.ExpatError as problem:
        said = expat.ErrorString(problem.code) or "unknown problem"
        told = f"not well-formed XML ({said}); it is damaged, or no {kind}"
        raise error(path, told, element=f"line {problem.lineno}") from problem
    except (LookupError, ValueError) as problem:
        if checks.begun:
            raise
        raise error(path, f"its text encoding cannot be read: {problem}; save it as UTF-8") from problem


class _Checks:
    """Stands between the parser and those who are told."""

    def __init__(
        self,
        path: Path | str,
        *,
        root: str | None,
        kind: str,
        start: Callable[[str, Attributes], None],
        end: Callable[[str], None],
        error: type[SourceError],
    ) -> None:
        self._path, self._root, self._kind, self._error = path, root, kind, error
        self._start, self._end = start, end
        self._depth, self._count = 0, 0
        self._parser = expat.ParserCreate()
        self._parser.StartElementHandler = self._begin
        self._parser.EndElementHandler = self._finish
        self._parser.StartDoctypeDeclHandler = self._refuse_declaration
        self._parser.EntityDeclHandler = self._refuse_declaration

    @property
    def begun(self) -> bool:
        """Whether an element was seen; the parser looks for the text's encoding before."""
        return self._count > 0

    def parse(self, pieces: Iterable[bytes]) -> None:
        """Parse in pieces, so that a tag or comment without an end is noticed before it fills the memory."""
        fed = 0
        for piece in pieces:
            self._parser.Parse(piece, False)
            fed += len(piece)
            if fed - max(self._parser.CurrentByteIndex, 0) > MAX_TAG:
                raise self._refusal(f"a tag or comment is longer than {MAX_TAG} bytes")
        self._parser.Parse(b"", True)

    def _begin(self, name: str, attributes: Attributes) -> None:
        self._count += 1
        if self._count == 1 and self._root not in (None, name):
            raise self._error(
                self._path,
                f"not a {self._kind}: the root element is <{name[:80]}>, expected <{self._root}>",
            )
        if self._depth > _DEEPEST:
            raise self._error(
                self._path, f"<{name[:80]}> is nested more than {_DEEPEST} deep; not a {self._kind}"
            )
        if self._count > MAX_ELEMENTS:
            raise self._refusal(f"more than {MAX_ELEMENTS} elements")
        # The longest value first: most elements have none that needs a closer look.
        if attributes and (len(attributes) > MAX_ATTRIBUTES or max(map(len, attributes.values())) > MAX_ID):
            self._check_attributes(name, attributes)
        self._depth += 1
        try:
            self._start(name, attributes)
        except IndexError:
            raise self._refusal(f"<{name[:80]}> stands where a {self._kind} allows none") from None

    def _check_attributes(self, name: str, attributes: Attributes) -> None:
        if len(attributes) > MAX_ATTRIBUTES:
            raise self._refusal(f"<{name[:80]}> has more than {MAX_ATTRIBUTES} attributes")
        for key, value in attributes.items():
            most = MAX_ID if key == "id" else MAX_ATTRIBUTE
            if len(value) > most:
                raise self._refusal(
                    f"<{name[:80]}> has {key[:80]} of {len(value)} letters; at most {most} are read"
                )

    def _finish(self, name: str) -> None:
        self._depth -= 1
        self._end(name)

    def _refusal(self, problem: str) -> SourceError:
        return self._error(self._path, problem, element=f"line {self._parser.CurrentLineNumber}")

    def _refuse_declaration(self, *_: object) -> None:
        raise self._error(
            self._path, f"has a document type or entities, which no {self._kind} has; refused as unsafe"
        )


def _in_pieces(data: bytes) -> Iterator[bytes]:
    return (data[at : at + _PIECE] for at in range(0, len(data), _PIECE))
