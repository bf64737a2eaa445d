"""The description as JSON and back: every field under its own name, positions as plain lists.

What is read is checked against the dataclasses' own types, so a map.json made by anyone is safe to load.
The same rules for other tools stand in map.schema.json.
"""

import math
import types
from collections.abc import Mapping
from dataclasses import MISSING, Field, fields, is_dataclass
from enum import StrEnum
from functools import cache
from typing import Any, Union, get_args, get_origin, get_type_hints

import numpy as np
from numpy.typing import NDArray

from dojo_maps.description import FORMAT, VERSION, RoadMap, points
from dojo_maps.errors import DescriptionError


def to_json(road_map: RoadMap) -> dict[str, Any]:
    """Turn a description into JSON values, in the order of its fields.

    Args:
        road_map: the description.

    Returns:
        Objects, lists, texts and numbers.
    """
    encoded: dict[str, Any] = _encode(road_map)
    return {"format": FORMAT, "version": VERSION, **encoded}


def from_json(value: Any, *, path: object = "map.json") -> RoadMap:
    """Build a description from JSON values.

    Args:
        value: what `to_json` gave.
        path: of the file, for errors.

    Returns:
        The description.

    Raises:
        DescriptionError: a field is missing or has another type than the format gives it.
    """
    check_format(value, path)
    try:
        road_map: RoadMap = _decode(RoadMap, value, "map")
    except _FieldError as error:
        raise DescriptionError(path, str(error)) from None
    except RecursionError:
        raise DescriptionError(path, "its values are nested too deep; convert the map again") from None
    return road_map


def check_format(value: Any, path: object) -> None:
    """Refuse JSON values that are no description, or one of another version.

    Args:
        value: any.
        path: of the file, for errors.

    Raises:
        DescriptionError: they are.
    """
    if not isinstance(value, Mapping) or value.get("format") != FORMAT:
        raise DescriptionError(path, f'not a map description: its format is not "{FORMAT}"')
    if value.get("version") != VERSION:
        raise DescriptionError(
            path, f"version {value.get('version')!r:.20}, this program reads {VERSION}; convert the map again"
        )


class _FieldError(Exception):
    """A field that does not hold what its type says."""


_PLAIN = (str, float, int, bool, types.NoneType)


@cache
def _fields(cls: type) -> tuple[tuple[Field[Any], str, Any], ...]:
    hints = get_type_hints(cls)
    return tuple((f, f.metadata.get("json", f.name), hints[f.name]) for f in fields(cls))


def _encode(value: Any) -> Any:
    kind: type = type(value)
    if kind in _PLAIN:
        return value
    if kind is np.ndarray:
        return value.tolist()
    if is_dataclass(value):
        return {key: _encode(getattr(value, f.name)) for f, key, _ in _fields(kind)}
    if isinstance(value, str | float | int):
        return value.value if isinstance(value, StrEnum) else value
    if isinstance(value, tuple):
        return [_encode(item) for item in value]
    raise TypeError(f"{type(value).__name__} has no place in a description")


def _decode(kind: Any, value: Any, where: str) -> Any:
    origin = get_origin(kind)
    if origin in (Union, types.UnionType):
        if value is None:
            return None
        return _decode(next(arm for arm in get_args(kind) if arm is not type(None)), value, where)
    if origin in (np.ndarray, NDArray):  # `NDArray` is a type of its own since numpy 2.5.
        return _decode_points(value, where)
    if origin is tuple:
        return _decode_tuple(get_args(kind), value, where)
    if is_dataclass(kind):
        return _decode_object(kind, value, where)
    return _decode_plain(kind, value, where)


def _decode_plain(kind: Any, value: Any, where: str) -> Any:
    if issubclass(kind, StrEnum):
        try:
            return kind(value)
        except ValueError:
            raise _FieldError(f"{where} is {str(value)[:60]!r}, expected one of {', '.join(kind)}") from None
    if kind is float and type(value) is int:
        value = float(value) if abs(value) < 1e300 else math.inf
    if type(value) is not kind:
        raise _FieldError(f"{where} is {str(value)[:60]!r}, expected {kind.__name__}")
    if kind is float and not math.isfinite(value):
        raise _FieldError(f"{where} is not a finite number")
    return value


def _decode_object(kind: Any, value: Any, where: str) -> Any:
    if not isinstance(value, Mapping):
        raise _FieldError(f"{where} is not an object")
    # A field with a default is an addition to the format: maps made before it do without.
    missing = [key for f, key, _ in _fields(kind) if key not in value and f.default is MISSING]
    if missing:
        raise _FieldError(f"{where} has no {missing[0]}")
    name = f"{where} {str(value['id'])[:60]}" if "id" in value else where
    found = ((f.name, key, hint) for f, key, hint in _fields(kind) if key in value)
    return kind(**{name_: _decode(hint, value[key], f"{name}: {key}") for name_, key, hint in found})


def _decode_tuple(arms: tuple[Any, ...], value: Any, where: str) -> tuple[Any, ...]:
    if not isinstance(value, list):
        raise _FieldError(f"{where} is not a list")
    if len(arms) == 2 and arms[1] is Ellipsis:
        return tuple(_decode(arms[0], item, where) for item in value)
    if len(arms) != len(value):
        raise _FieldError(f"{where} has {len(value)} values, expected {len(arms)}")
    return tuple(_decode(arm, item, where) for arm, item in zip(arms, value, strict=True))


def _decode_points(value: Any, where: str) -> Any:
    try:
        array = points(value)
    except (TypeError, ValueError):
        array = None
    if array is None or not np.isfinite(array).all():
        raise _FieldError(f"{where} is not a list of [x, y, z] positions")
    return array
