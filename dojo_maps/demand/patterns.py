"""Demand patterns: traffic that changes in ways which only who looks can know, told in a few numbers.

    name = "surges"
    summary = "..."
    level = [1.0, 1.0]          # of the traffic that junctions take under their own programs
    surge = [2.0, 3.0]          # times as much on the side that has the surge
    surge_seconds = [120, 420]  # then it moves to another side

Each pair is a range from which a seed draws, anew for each episode, surge or incident. A pattern is a TOML
file with fields of `Pattern`; it fits any map.
"""

import math
from dataclasses import dataclass, fields
from pathlib import Path

from dojo_maps.errors import SourceError
from dojo_maps.input_files import is_there
from dojo_maps.safe_toml import read_toml

FOLDER = Path(__file__).parent / "pattern_files"
SUFFIX = ".toml"
_MOST_BYTES = 1 << 16
_MOST = 1e4
Range = tuple[float, float]


@dataclass(frozen=True, slots=True, kw_only=True)
class Pattern:
    """How traffic varies; a range of two equal numbers is that number.

    Attributes:
        name: of the pattern.
        summary: what it is, in a sentence.
        level: vehicles as a share of what `dojo-maps demand` writes; once an episode.
        surge: how many times as many come on the side that has the surge; 1 for no surges.
        rest: how many times as many come on the others meanwhile.
        surge_seconds: how long a surge lasts before another side has the next.
        left_turns: how many times as many of a side turn left, its total unchanged; at each surge anew.
        platoons: the share of cars that come in platoons.
        platoon_size: cars of a platoon, 2 s apart.
        incidents: cars per hour and signal that break down and close their lane, on roads of several lanes.
        incident_seconds: how long such a lane is closed.
        buses: per hour and signal.
        emergencies: emergency vehicles per hour and signal.
        walkers: how many times as many people walk over each crossing.
        needs_crossings: it means nothing on a map without crossings.
    """

    name: str
    summary: str = ""
    level: Range = (1.0, 1.0)
    surge: Range = (1.0, 1.0)
    rest: Range = (1.0, 1.0)
    surge_seconds: Range = (120.0, 420.0)
    left_turns: Range = (1.0, 1.0)
    platoons: Range = (0.0, 0.0)
    platoon_size: Range = (5.0, 12.0)
    incidents: Range = (0.0, 0.0)
    incident_seconds: Range = (180.0, 420.0)
    buses: Range = (0.0, 0.0)
    emergencies: Range = (0.0, 0.0)
    walkers: Range = (1.0, 1.0)
    needs_crossings: bool = False

    def __post_init__(self) -> None:
        """Refuse what cannot be.

        Raises:
            SourceError: a value is no range, or out of its bounds.
        """
        for each in fields(self):
            value = getattr(self, each.name)
            if type(each.default) is not tuple:
                kind = bool if each.default is False else str
                if not isinstance(value, kind):
                    raise self._refuse(each.name, value, kind.__name__)
                continue
            least, most = _BOUNDS.get(each.name, (0.0, _MOST))
            if not _is_range(value) or not least <= value[0] <= value[1] <= most:
                raise self._refuse(each.name, value, f"two numbers from {least:g} to {most:g}, as in [1, 2]")
            object.__setattr__(self, each.name, (float(value[0]), float(value[1])))

    def _refuse(self, name: str, value: object, expected: str) -> SourceError:
        return SourceError(f"pattern {self.name}", f"{name} = {value!r}: expected {expected}")


_BOUNDS: dict[str, Range] = {
    "platoons": (0.0, 1.0),
    "platoon_size": (1.0, 100.0),
    "surge_seconds": (10.0, 86_400.0),
    "incident_seconds": (10.0, 86_400.0),
    **dict.fromkeys(("level", "surge", "rest", "left_turns", "walkers"), (0.0, 100.0)),
}


def read_pattern(path: Path) -> Pattern:
    """Read a pattern's file.

    Args:
        path: of a TOML file; its name without `.toml` is the pattern's where it gives none.

    Returns:
        The pattern; what the file leaves out is as `Pattern` has it.

    Raises:
        SourceError: it cannot be read, or is no pattern.
    """
    known = read_toml(path, most=_MOST_BYTES)
    names = [each.name for each in fields(Pattern)]
    if unknown := sorted(known.keys() - set(names)):
        raise SourceError(path, f"{', '.join(unknown)}: unknown; known are {', '.join(names)}")
    try:
        return Pattern(**{"name": path.stem, **known})
    except SourceError as error:
        raise SourceError(path, error.args[1]) from error


def list_patterns() -> tuple[str, ...]:
    """List the packaged patterns by name."""
    return tuple(sorted(path.stem for path in FOLDER.glob(f"*{SUFFIX}")))


def find_pattern(value: str | Path) -> Pattern:
    """Find a packaged pattern by its name, or read one from a `.toml` file.

    Args:
        value: the name of a packaged pattern, which goes first, or a file's path.

    Returns:
        The pattern.

    Raises:
        SourceError: there is none of that name, or the file is none.
    """
    if str(value) in list_patterns():
        return read_pattern(FOLDER / f"{value}{SUFFIX}")
    if is_there(Path(value)) or str(value).endswith(SUFFIX):
        return read_pattern(Path(value))
    known = ", ".join(list_patterns())
    raise SourceError(f"pattern {str(value)[:80]!r}", f"is not known; give one of {known}, or a .toml file")


def split_pattern(name: str) -> tuple[str, str]:
    """Split `cologne1-surges` into what traffic drives on and a packaged pattern.

    Args:
        name: of a scenario, with or without a pattern after its last hyphen.

    Returns:
        What stands before the hyphen, and the pattern; the whole name and "" where there is no packaged
        pattern.
    """
    base, _, pattern = name.rpartition("-")
    return (base, pattern) if base and pattern in list_patterns() else (name, "")


def _is_range(value: object) -> bool:
    return (
        isinstance(value, list | tuple)
        and len(value) == 2
        and all(isinstance(n, int | float) and not isinstance(n, bool) and math.isfinite(n) for n in value)
    )
