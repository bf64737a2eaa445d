"""Control points: pixels of a photograph whose places on the map are known, out of CSV or JSON."""

import csv
import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from difflib import get_close_matches
from pathlib import Path
from typing import Any, NoReturn

import numpy as np
from numpy.typing import NDArray

from dojo_env.calibration.landmarks import Ground, Place, list_landmarks
from dojo_env.errors import CalibrationError
from dojo_maps.description import RoadMap
from dojo_maps.input_files import read_bytes
from dojo_maps.safe_json import parse_json

Floats = NDArray[np.float64]
Row = Mapping[str, Any]

LEAST = 6
_MOST_BYTES, _MOST = 1 << 22, 10_000
_WAYS = ("x", "lon", "element")
_COLUMNS = ("u", "v", "x", "y", "z", "lon", "lat", "element")
_EXPECTED = "u, v and one of: x, y (and z); lon, lat; element"
_NARROWEST, _THINNEST = 0.03, 0.02
"""Shares: of the picture's width that the points span, and of their own length across."""
_FARTHEST = 1e8


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ControlPoints:
    """Pixels and their places.

    Attributes:
        path: where they come from, for messages.
        labels: what each is called.
        pixels: (n, 2) pixels, (0, 0) the upper left corner of the picture.
        places: (n, 3) metres, map frame.
        ground: height of the lowest road below them, metres.
    """

    path: Path
    labels: tuple[str, ...]
    pixels: Floats
    places: Floats
    ground: float

    def __len__(self) -> int:
        """Count them."""
        return len(self.labels)

    def without(self, number: int) -> "ControlPoints":
        """Leave one out.

        Args:
            number: of the point, from 0.

        Returns:
            The others; their `ground` stays that of all.
        """
        return replace(
            self,
            labels=(*self.labels[:number], *self.labels[number + 1 :]),
            pixels=np.delete(self.pixels, number, axis=0),
            places=np.delete(self.places, number, axis=0),
        )

    def check(self, width: int, height: int) -> None:
        """See that a camera can be found from them.

        Args:
            width: of the picture, pixels.
            height: the same.

        Raises:
            CalibrationError: they are too few, outside the picture, all near one place, or on one line.
        """
        outside = ((self.pixels < 0) | (self.pixels > [width, height])).any(axis=1)
        if outside.any():
            at = int(np.argmax(outside))
            u, v = self.pixels[at]
            raise CalibrationError(
                self.path,
                f"pixel {u:g}, {v:g} lies outside the picture of {width} x {height}",
                self.labels[at],
            )
        for values, what, unit in ((self.pixels, "pixels", "px"), (self.places, "places", "m")):
            distinct = np.unique(np.round(values, 2), axis=0)
            if len(distinct) < LEAST:
                raise CalibrationError(
                    self.path, f"{len(distinct)} different {what}; at least {LEAST} points are needed"
                )
            spread = np.linalg.svd(values - values.mean(axis=0))[1] / math.sqrt(len(values))
            if spread[1] < _THINNEST * spread[0]:
                raise CalibrationError(
                    self.path, f"all {what} lie on one line; add points to its left and right"
                )
            if what == "pixels" and spread[0] < _NARROWEST * width:
                raise CalibrationError(
                    self.path,
                    f"all points lie near one place, within {2 * spread[0]:.0f} {unit}; spread them out",
                )


def read_points(path: Path, road_map: RoadMap) -> ControlPoints:
    """Read control points.

    Args:
        path: a CSV file with a head, or JSON: a list of objects, or an object that has it as `points`.
            Columns or names are u, v (pixels) and x, y and perhaps z (metres, map frame), or lon, lat
            (degrees), or element (of `list_landmarks`).
        road_map: the map.

    Returns:
        The points, in the file's order; where no z is told, they lie as high as the nearest lane.

    Raises:
        CalibrationError: the file cannot be read, or a point is not what it must be; names its line.
    """
    data = read_bytes(path, most=_MOST_BYTES, error=CalibrationError)
    is_json = path.suffix.lower() == ".json" or data.lstrip()[:1] in (b"[", b"{")
    rows = list(_read_json(data, path) if is_json else _read_csv(data, path))
    if len(rows) > _MOST:
        raise CalibrationError(path, f"{len(rows)} points; at most {_MOST} are read")
    finder = _Finder(path, road_map)
    labels, pixels, places = [], [], []
    for where, row in rows:
        label, place = finder.find(where, row)
        labels.append(label)
        pixels.append(tuple(finder.number(where, row, name) for name in ("u", "v")))
        places.append(place)
    return ControlPoints(
        path=path,
        labels=tuple(labels),
        pixels=np.array(pixels, np.float64).reshape(-1, 2),
        places=np.array(places, np.float64).reshape(-1, 3),
        ground=min((finder.ground.height(x, y) for x, y, _ in places), default=0.0),
    )


def _read_csv(data: bytes, path: Path) -> Iterator[tuple[str, Row]]:
    try:
        text = data.decode("utf-8-sig")
        reader = csv.reader(text.splitlines())
        head: list[str] = []
        for cells in reader:
            row = [cell.strip() for cell in cells]
            if not any(row) or row[0].startswith("#"):
                continue
            where = f"line {reader.line_num}"
            if not head:
                head = [name.lower() for name in row]
                if not {"u", "v"} <= set(head) or not set(_WAYS) & set(head):
                    raise CalibrationError(
                        path, f"the head is {','.join(row)!r}; expected {_EXPECTED}", where
                    )
                continue
            if len(row) != len(head):
                raise CalibrationError(path, f"{len(row)} values for {len(head)} columns", where)
            yield where, {name: value for name, value in zip(head, row, strict=True) if value}
    except (UnicodeDecodeError, csv.Error) as problem:
        raise CalibrationError(path, f"not a table of comma-separated values ({problem})") from problem


def _read_json(data: bytes, path: Path) -> Iterator[tuple[str, Row]]:
    value = parse_json(data, path, error=CalibrationError)
    if isinstance(value, dict):
        value = value.get("points")
    if not isinstance(value, list):
        raise CalibrationError(path, 'expected a list of points, or {"points": [...]}')
    for number, row in enumerate(value, 1):
        if not isinstance(row, dict):
            raise CalibrationError(path, f"expected an object with {_EXPECTED}", f"point {number}")
        yield f"point {number}", {name: each for name, each in row.items() if each is not None}


class _Finder:
    """Finds the places that rows tell."""

    def __init__(self, path: Path, road_map: RoadMap) -> None:
        self._path, self._map = path, road_map
        self._landmarks = list_landmarks(road_map)
        self.ground = Ground(road_map)

    def find(self, where: str, row: Row) -> tuple[str, Place]:
        """Find a row's label and place."""
        if unknown := [name for name in row if name not in _COLUMNS]:
            self._refuse(where, f"{unknown[0]!r} is not known; expected {_EXPECTED}")
        ways = [way for way in _WAYS if way in row]
        if len(ways) != 1:
            told = " and ".join(ways) or "no place"
            self._refuse(where, f"has {told}; expected {_EXPECTED}")
        if ways == ["element"]:
            return f"{where} ({row['element']})", self._find_element(where, str(row["element"]))
        x, y = self._find_level(where, row, ways[0])
        return where, (x, y, self.number(where, row, "z") if "z" in row else self.ground.height(x, y))

    def _find_element(self, where: str, name: str) -> Place:
        if name not in self._landmarks:
            near = get_close_matches(name, self._landmarks, n=3, cutoff=0.5)
            hint = f"did you mean {' or '.join(near)}? " if near else ""
            self._refuse(where, f"the map has no element {name!r}; {hint}calibrate --elements lists all")
        return self._landmarks[name]

    def _find_level(self, where: str, row: Row, way: str) -> tuple[float, float]:
        if way == "x":
            return self.number(where, row, "x"), self.number(where, row, "y")
        projection = self._map.projection
        if projection.proj is None:
            self._refuse(where, f"map {self._map.name} has no place on the earth; give x and y instead")
        from dojo_maps.exports.earth import Earth  # noqa: PLC0415 - PROJ is slow to load

        longitude, latitude = (np.array([self.number(where, row, name)]) for name in ("lon", "lat"))
        earth = Earth(projection.proj, projection.net_offset)
        ((x, y),) = earth.positions(longitude, latitude).tolist()
        return x, y

    def number(self, where: str, row: Row, name: str) -> float:
        """Read a number of a row."""
        try:
            value = float(row[name])
        except KeyError:
            self._refuse(where, f"has no {name}; expected {_EXPECTED}")
        except (TypeError, ValueError):
            self._refuse(where, f"{name} is {str(row[name])[:40]!r}; expected a number")
        if not abs(value) <= _FARTHEST:
            self._refuse(where, f"{name} is {value:g}; expected a number up to {_FARTHEST:g}")
        return value

    def _refuse(self, where: str, problem: str) -> NoReturn:
        raise CalibrationError(self._path, problem, where)
