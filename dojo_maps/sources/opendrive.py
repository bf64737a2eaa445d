"""From an OpenDRIVE file to a SUMO network: checked here, built by netconvert, what is lost counted.

Coordinates stay those of the file. Lanes of every kind are taken. OpenDRIVE knows no signal programs, so
netconvert makes them up for the signals that it finds.
"""

import math
from collections import Counter
from dataclasses import dataclass
from pathlib import Path

from dojo_maps.description import RoadMap
from dojo_maps.errors import SourceError
from dojo_maps.index import MapIndex
from dojo_maps.issue import Element, Issue, Severity
from dojo_maps.safe_xml import Attributes, parse_xml
from dojo_maps.sources.netconvert import NetconvertError, build_from_files, warning_issue
from dojo_maps.wording import counted

SUFFIXES = (".xodr", ".xodr.gz")
_OPTIONS = ("--opendrive.import-all-lanes", "--offset.disable-normalization", "--output.street-names")
_TIMEOUT = 240.0
_LONGEST = 1e6
"""Metres of one piece of a reference line, and km of all together; netconvert draws each metre by metre."""
_CHECK = "sumo.opendrive_lost"


@dataclass(frozen=True, slots=True, kw_only=True)
class OpenDriveNetwork:
    """A network as netconvert built it, and what the file held.

    Attributes:
        path: of the file.
        data: the network's bytes.
        warnings: netconvert's own.
        roads: the ids of the file's roads that lie in no junction.
        objects: how many objects of each type the file has.
        signals: how many signals it has.
        routes: of traffic: OpenDRIVE has none.
    """

    path: Path
    data: bytes
    warnings: tuple[str, ...]
    roads: tuple[str, ...]
    objects: dict[str, int]
    signals: int
    routes: str = ""

    def issues(self, road_map: RoadMap) -> tuple[Issue, ...]:
        """List what netconvert warned of, and what of the file is not in the network.

        Args:
            road_map: the description of `data`.

        Returns:
            Notes of netconvert's warnings, warnings of lost roads, then notes of objects and signals.
        """
        index = MapIndex(road_map)
        hint = "look at the place in netedit; correct the OpenDRIVE file where it is wrong"
        found = [
            warning_issue(warning, index, check="sumo.opendrive_warning", hint=hint)
            for warning in self.warnings
        ]
        # netconvert adds a sign for the direction, and a place where it splits a road.
        built = {road.id.removeprefix("-").partition(".")[0] for road in road_map.roads}
        for road in self.roads:
            if road.removeprefix("-") not in built:
                what = f"road {road} is not in the network; it has no lane that netconvert takes"
                found.append(_not_taken(what, road_map, (Element(kind="road", id=road),), Severity.WARNING))
        for kind, count in sorted(self.objects.items()):
            found.append(
                _not_taken(f"not in the network: {counted(count, 'object')} of type {kind[:80]!r}", road_map)
            )
        if self.signals and road_map.signals:
            what = "OpenDRIVE has no signal programs; those of the network are netconvert's own"
            found.append(
                _not_taken(what, road_map, tuple(Element(kind="signal", id=s.id) for s in road_map.signals))
            )
        return tuple(found)


def is_opendrive(path: Path | str) -> bool:
    """Tell by a file's name whether it is an OpenDRIVE file.

    Args:
        path: of the file, which need not be there.

    Returns:
        Whether it ends in .xodr or .xodr.gz, in capitals or not.
    """
    return str(path).lower().endswith(SUFFIXES)


def build_network(data: bytes, *, path: Path) -> OpenDriveNetwork:
    """Build the network of an OpenDRIVE file.

    Args:
        data: the file's bytes, unpacked.
        path: where they came from, for errors.

    Returns:
        The network, with what the file held.

    Raises:
        SourceError: they are no OpenDRIVE, larger than can be drawn, or netconvert refuses them.
        ToolMissingError: netconvert is not installed.
    """
    reader = _Reader(path)
    parse_xml(data, path, root="OpenDRIVE", kind="OpenDRIVE file", start=reader.start)
    options = [*_OPTIONS, "--lefthand"] if reader.rules["LHT"] > reader.rules["RHT"] else list(_OPTIONS)
    try:
        built, warnings = build_from_files({"--opendrive-files": data}, options, timeout=_TIMEOUT)
    except NetconvertError as error:
        raise SourceError(path, f"netconvert makes no network of it: {error}") from error
    return OpenDriveNetwork(
        path=path,
        data=built,
        warnings=warnings,
        roads=tuple(reader.roads),
        objects=dict(reader.objects),
        signals=reader.signals,
    )


class _Reader:
    """Counts what a file holds, and refuses what netconvert would not come to an end with."""

    def __init__(self, path: Path) -> None:
        self._path, self._whole = path, 0.0
        self.rules: Counter[str] = Counter()
        self.roads: list[str] = []
        self.objects: Counter[str] = Counter()
        self.signals = 0

    def start(self, name: str, attributes: Attributes) -> None:
        """Take one element."""
        if name == "road":
            self.rules[attributes.get("rule", "RHT")] += 1
            if attributes.get("junction", "-1") == "-1":
                self.roads.append(attributes.get("id", ""))
        elif name == "geometry":
            self._whole += self._length(attributes)
            if self._whole > _LONGEST * 1000:
                raise SourceError(self._path, f"its roads are longer than {_LONGEST:.0f} km together")
        elif name == "object":
            self.objects[attributes.get("type", "none")] += 1
        elif name == "signal":
            self.signals += 1

    def _length(self, attributes: Attributes) -> float:
        text = attributes.get("length", "")
        try:
            length = float(text)
        except ValueError:
            length = math.nan
        if not 0 <= length <= _LONGEST:
            raise SourceError(
                self._path,
                f"a <geometry> has the length {text[:40]!r}; expected metres, 0 to {_LONGEST:.0f}",
            )
        return length


def _not_taken(
    message: str,
    road_map: RoadMap,
    elements: tuple[Element, ...] = (),
    severity: Severity = Severity.NOTE,
) -> Issue:
    return Issue(
        check=_CHECK,
        severity=severity,
        elements=elements,
        position=(*road_map.origin, 0.0),
        message=message,
        hint="add what is missing in netedit",
    )
