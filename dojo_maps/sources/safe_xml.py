"""Parse XML that anyone may have written: no document type, no entities, bounded depth, one kind of error."""

from collections.abc import Callable
from pathlib import Path
from xml.parsers import expat

from dojo_maps.errors import SourceError

Attributes = dict[str, str]

_DEEPEST = 16


def parse_xml(
    data: bytes,
    path: Path | str,
    *,
    root: str,
    kind: str,
    start: Callable[[str, Attributes], None],
    end: Callable[[str], None] = lambda _name: None,
) -> None:
    """Tell `start` and `end` of each element, in file order.

    Args:
        data: the file's bytes, unpacked.
        path: named in errors.
        root: the root element's name.
        kind: what the file should be, for errors: `SUMO network`.
        start: called with an element's name and attributes; an IndexError from it means a misplaced element.
        end: called with an element's name at its end.

    Raises:
        SourceError: not well-formed, another root, or XML with a document type or entities.
    """
    open_elements: list[str] = []
    parser = expat.ParserCreate()

    def begin(name: str, attributes: Attributes) -> None:
        if not open_elements and name != root:
            raise SourceError(path, f"not a {kind}: the root element is <{name[:80]}>, expected <{root}>")
        if len(open_elements) > _DEEPEST:
            raise SourceError(path, f"<{name[:80]}> is nested more than {_DEEPEST} deep; not a {kind}")
        open_elements.append(name)
        try:
            start(name, attributes)
        except IndexError:
            where = f"line {parser.CurrentLineNumber}"
            raise SourceError(
                path, f"<{name[:80]}> stands where a {kind} allows none", element=where
            ) from None

    def finish(name: str) -> None:
        open_elements.pop()
        end(name)

    def refuse(*_: object) -> None:
        raise SourceError(path, f"has a document type or entities, which no {kind} has; refused as unsafe")

    parser.buffer_text = True
    parser.StartElementHandler = begin
    parser.EndElementHandler = finish
    parser.StartDoctypeDeclHandler = refuse
    parser.EntityDeclHandler = refuse
    try:
        parser.Parse(data, True)
    except expat.ExpatError as error:
        problem = expat.ErrorString(error.code) or "unknown problem"
        raise SourceError(path, f"not well-formed XML ({problem})", element=f"line {error.lineno}") from error
    except (LookupError, ValueError) as error:
        raise SourceError(path, f"its text encoding cannot be read: {error}; save it as UTF-8") from error
