"""Tags that hold at some times only, as they are at one moment of the week.

Read are weekdays, ranges of them, hours, `off`, and several of these: `no @ (Mo-Fr 07:00-09:00,16:00-19:00;
PH off)`. No moment is a holiday. Source: OpenStreetMap wiki, Conditional restrictions, Key:opening_hours.
"""

import re
from collections import defaultdict
from collections.abc import Iterator
from dataclasses import dataclass, replace

from dojo_maps.errors import UsageError
from dojo_maps.sources.osm.read.data import OsmData, Tags

_DAYS = ("Mo", "Tu", "We", "Th", "Fr", "Sa", "Su")
_HOLIDAYS = ("PH", "SH")
_DAY = 24 * 60
"""Minutes."""
_MOMENT = re.compile(r"\s*(Mo|Tu|We|Th|Fr|Sa|Su)\s+(\d{1,2}):(\d{2})\s*", re.ASCII)
_HOURS = re.compile(r"(\d{1,2}):(\d{2})\s*-\s*(\d{1,2}):(\d{2})", re.ASCII)
_RULE = re.compile(
    r"(?P<days>(?:[A-Z][a-z]|PH|SH)(?:[-,]\s*(?:[A-Z][a-z]|PH|SH))*)?:?\s*"
    r"(?P<hours>\d{1,2}:\d{2}\s*-\s*\d{1,2}:\d{2}(?:\s*,\s*\d{1,2}:\d{2}\s*-\s*\d{1,2}:\d{2})*)?\s*"
    r"(?P<off>off|closed)?",
    re.ASCII,
)
_NEXT_RULE = re.compile(r";|,\s*(?=(?:[A-Z][a-z]|PH|SH)[^,;]*\d)")
_PARTS = re.compile(r";(?![^(]*\))")
_LONGEST = 500
"""Characters of a condition."""
_SUFFIX = ":conditional"


@dataclass(frozen=True, slots=True, kw_only=True)
class Moment:
    """A minute of the week: `day` counts from Monday, `minute` from midnight."""

    day: int
    minute: int


@dataclass(frozen=True, slots=True, kw_only=True)
class UnreadCondition:
    """A tag that holds at times that are not understood, and what has it: a kind of element, and ids."""

    key: str
    value: str
    kind: str
    elements: tuple[int, ...]


def read_moment(text: str) -> Moment:
    """Read a moment such as `Mo 08:00`.

    Args:
        text: a weekday in two letters, then hours from 0 to 23 and minutes.

    Returns:
        The moment of the week.

    Raises:
        UsageError: it is none.
    """
    found = _MOMENT.fullmatch(text)
    if found is None or int(found[2]) > 23 or int(found[3]) > 59:
        raise UsageError(f"--at {text!r}: expected a weekday and a time, such as 'Mo 08:00'")
    return Moment(day=_DAYS.index(found[1]), minute=int(found[2]) * 60 + int(found[3]))


def apply_conditions(data: OsmData, moment: Moment) -> tuple[OsmData, list[UnreadCondition]]:
    """Give ways and turn restrictions the tags that they have at a moment.

    Args:
        data: the extract.
        moment: of the week.

    Returns:
        The extract with no conditions left; and those that were left out.
    """
    unread: dict[tuple[str, str, str], list[int]] = defaultdict(list)
    ways, relations = dict(data.ways), dict(data.relations)

    def at_moment(tags: Tags, kind: str, number: int) -> Tags:
        kept, left = _at(tags, moment)
        for key, value in left:
            unread[key, value, kind].append(number)
        return kept

    for number, way in data.ways.items():
        ways[number] = replace(way, tags=at_moment(way.tags, "way", number))
    for number, relation in data.relations.items():
        relations[number] = replace(relation, tags=at_moment(relation.tags, "relation", number))
    found = [
        UnreadCondition(key=key, value=value, kind=kind, elements=tuple(numbers))
        for (key, value, kind), numbers in sorted(unread.items())
    ]
    return replace(data, ways=ways, relations=relations), found


def holds(condition: str, moment: Moment) -> bool | None:
    """Tell whether a condition holds at a moment.

    Args:
        condition: what a tag has behind its `@`, with or without brackets.
        moment: of the week.

    Returns:
        Whether it does; None where it is not understood.
    """
    text = condition.strip().removeprefix("(").removesuffix(")").strip()
    if text == "24/7":
        return True
    state = False
    for part in _NEXT_RULE.split(text):
        rule = _RULE.fullmatch(part.strip())
        days = _days(rule["days"]) if rule is not None else None
        if rule is None or not part.strip() or days is None:
            return None
        here = _covers(days, _hours(rule["hours"]), moment)
        if rule["off"]:
            state = state and not here
        else:
            overridden = moment.day in days and rule["days"] is not None and ";" in text
            state = here or (state and not (overridden and rule["hours"]))
    return state


def _is_timed(key: str, value: str) -> bool:
    return key.endswith(_SUFFIX) or (key.startswith("restriction") and "@" in value)


def _at(tags: Tags, moment: Moment) -> tuple[Tags, list[tuple[str, str]]]:
    """Give tags as they are at a moment; and the conditions that are not understood."""
    kept = {key: value for key, value in tags.items() if not _is_timed(key, value)}
    unread = []
    for key, value in tags.items():
        if not _is_timed(key, value):
            continue
        chosen = None
        for said, condition in _clauses(value):
            now = holds(condition, moment)
            if now is None:
                unread.append((key, value))
                break
            chosen = said if now else chosen
        else:
            kept |= {key.removesuffix(_SUFFIX): chosen} if chosen is not None else {}
    return kept, unread


def _clauses(value: str) -> Iterator[tuple[str, str]]:
    """List the values of a tag, each with its condition; a condition without brackets may go on after `;`."""
    clauses: list[tuple[str, str]] = []
    for part in _PARTS.split(value[:_LONGEST]):
        said, at, condition = part.partition("@")
        if at:
            clauses.append((said.strip(), condition))
        elif clauses and part.strip():
            clauses[-1] = (clauses[-1][0], f"{clauses[-1][1]};{part}")
    yield from clauses or [("", "?")]


def _days(text: str | None) -> set[int] | None:
    """Read weekdays and ranges of them; None where there is another word."""
    if text is None:
        return set(range(7))
    found: set[int] = set()
    for part in text.split(","):
        ends = [end.strip() for end in part.split("-")]
        if len(ends) == 1 and ends[0] in _HOLIDAYS:
            continue
        if len(ends) > 2 or any(end not in _DAYS for end in ends):
            return None
        first, last = _DAYS.index(ends[0]), _DAYS.index(ends[-1])
        found |= {day % 7 for day in range(first, last + 1 + (7 if last < first else 0))}
    return found


def _hours(text: str | None) -> list[tuple[int, int]]:
    """Read hours as minutes from midnight; those that end before they begin go on after midnight."""
    if text is None:
        return [(0, _DAY)]
    found = []
    for match in _HOURS.finditer(text):
        start, end = (int(match[k]) * 60 + int(match[k + 1]) for k in (1, 3))
        found.append((start, end if end > start else end + _DAY))
    return found


def _covers(days: set[int], hours: list[tuple[int, int]], moment: Moment) -> bool:
    """Tell whether hours that begin on some days hold a moment, of that day or of the next."""
    return any(
        (moment.day - late) % 7 in days and start <= moment.minute + late * _DAY < end
        for start, end in hours
        for late in (0, 1)
    )
