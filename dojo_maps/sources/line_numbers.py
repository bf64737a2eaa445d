"""Where elements stand in a network's text, for tools that show findings beside it."""

from xml.parsers import expat

_KINDS = {"edge": "road", "lane": "lane", "junction": "junction", "tlLogic": "signal"}


def find_lines(data: bytes) -> dict[tuple[str, str], int]:
    """Find the first line of each element, by its kind and id as reports name it.

    Args:
        data: a network that `sumo_xml.read_records` has accepted.

    Returns:
        Lines from 1 by (kind, id); connections as `from_lane->to_lane`.
    """
    found: dict[tuple[str, str], int] = {}

    def start(name: str, attributes: dict[str, str]) -> None:
        line, id_ = parser.CurrentLineNumber, attributes.get("id", "")
        if name == "connection":
            ends = [f"{attributes.get(end)}_{attributes.get(f'{end}Lane')}" for end in ("from", "to")]
            found.setdefault((name, "->".join(ends)), line)
        elif name == "edge" and attributes.get("function") in ("crossing", "walkingarea"):
            kind = "crossing" if attributes["function"] == "crossing" else "walking_area"
            found.setdefault((kind, id_), line)
        elif name in _KINDS:
            found.setdefault((_KINDS[name], id_), line)

    parser = expat.ParserCreate()
    parser.StartElementHandler = start
    parser.Parse(data, True)
    return found
