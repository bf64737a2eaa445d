"""Random damage to good inputs: to bytes, to values of XML and JSON, to arrays, to scenes."""

import io
import json
import random
import re
from collections.abc import Callable
from typing import Any

import numpy as np

_WEIRD = (
    "", "nan", "-1", "0", "1e308", "inf", "x", "99999999999", "a b c", "&#10;", "../x", ":c_0", "1,2", "-0.0",
    "1e-320", "é", "%s%n", "/dev/zero", "0x10", "true", "1" * 400,
)  # fmt: skip
_WEIRD_JSON = (
    None, True, -1, 0, 1e308, 10**30, "", "x", [], {}, [[]], "../x", 0.5, [1, 2], {"id": "x"}, "nan", -0.0,
)  # fmt: skip

Mutate = Callable[[bytes, random.Random], bytes]


def damage(data: bytes, chance: random.Random) -> bytes:
    """Change XML here and there; the text mostly stays XML.

    Args:
        data: a file's bytes.
        chance: decides where and how.
    """
    changed = bytearray(data)
    # Most damage to single bytes ends in the XML parser; damage to values reaches further in.
    chance.choice([_damage_bytes, _damage_attributes, _damage_attributes, _damage_lines])(changed, chance)
    return bytes(changed)


def _damage_bytes(data: bytearray, chance: random.Random) -> None:
    for _ in range(chance.randint(1, 6)):
        at = chance.randrange(len(data) or 1)
        kind = chance.randrange(4)
        if kind == 0 and data:
            data[min(at, len(data) - 1)] = chance.randrange(256)
        elif kind == 1:
            del data[at : at + chance.randint(1, 400)]
        elif kind == 2:
            data[at:at] = data[at : at + chance.randint(1, 400)]
        else:
            data[at:at] = chance.randbytes(chance.randint(1, 20))


def _damage_attributes(data: bytearray, chance: random.Random) -> None:
    places = list(re.finditer(rb' ([\w.-]+)="([^"]*)"', bytes(data)))
    chosen = chance.sample(places, min(len(places), chance.randint(1, 4)))
    for place in sorted(chosen, key=re.Match.start, reverse=True):
        kind = chance.randrange(3)
        other = chance.choice(places)
        new = {
            0: b"",
            1: b' %s="%s"' % (place[1], chance.choice(_WEIRD).encode()),
            2: b' %s="%s"' % (place[1], other[2]),
        }[kind]
        data[place.start() : place.end()] = new


def _damage_lines(data: bytearray, chance: random.Random) -> None:
    lines = bytes(data).split(b"\n")
    for _ in range(chance.randint(1, 5)):
        at, other = chance.randrange(len(lines)), chance.randrange(len(lines))
        kind = chance.randrange(3)
        if kind == 0 and len(lines) > 1:
            del lines[at]
        elif kind == 1:
            lines.insert(at, lines[other])
        else:
            lines[at], lines[min(other, len(lines) - 1)] = lines[min(other, len(lines) - 1)], lines[at]
    data[:] = b"\n".join(lines)


def damage_bytes(data: bytes, chance: random.Random) -> bytes:
    """Change, cut out, repeat or insert a few bytes, or cut the end off."""
    if chance.randrange(6) == 0:
        return data[: chance.randrange(len(data))]
    changed = bytearray(data)
    _damage_bytes(changed, chance)
    return bytes(changed)


def damage_json(data: bytes, chance: random.Random) -> bytes:
    """Change a few values of a JSON file for others of any type, or of another place; now and then bytes."""
    if chance.randrange(8) == 0:
        return damage_bytes(data, chance)
    value = json.loads(data)
    for _ in range(chance.randint(1, 3)):
        _damage_value(value, chance)
    return json.dumps(value).encode()


def _damage_value(value: Any, chance: random.Random) -> None:
    """Walk down at random and change what is met there."""
    while True:
        keys = list(value) if isinstance(value, dict) else range(len(value))
        if not keys:
            return
        key = chance.choice(keys)
        inner = value[key]
        if isinstance(inner, dict | list) and inner and chance.randrange(6):
            value = inner
            continue
        kind = chance.randrange(4)
        if kind == 0:
            del value[key]
        elif kind == 1:
            value[key] = value[chance.choice(keys)]
        elif kind == 2 and isinstance(inner, int | float):
            value[key] = inner + chance.choice([-1, 1, 1000, 0.5, -1e9])
        else:
            value[key] = chance.choice(_WEIRD_JSON)
        return


def damage_archive(data: bytes, chance: random.Random) -> bytes:
    """Change an archive of arrays: its bytes, or single numbers, types, shapes and names inside of it."""
    if chance.randrange(3) == 0:
        return damage_bytes(data, chance)
    with np.load(io.BytesIO(data)) as archive:
        arrays = {name: archive[name] for name in archive.files}
    for _ in range(chance.randint(1, 2)):
        name = chance.choice(list(arrays))
        arrays[name] = _damage_array(arrays[name], chance)
    if chance.randrange(8) == 0:
        arrays.pop(chance.choice(list(arrays)))
    out = io.BytesIO()
    np.savez_compressed(out, **arrays)
    return out.getvalue()


def _damage_array(array: Any, chance: random.Random) -> Any:
    kind = chance.randrange(5)
    if kind == 0 or not array.size:
        return np.array(chance.choice([0, -1, 3.5, "x", 10**18]))
    if kind == 1:
        return array.reshape(-1)[: chance.randrange(array.size)]
    if kind == 2:
        return array.astype(chance.choice(["f4", "i8", "u1", "U3"]) if array.dtype.kind != "U" else "U1")
    changed = array.copy().reshape(-1)
    at = chance.randrange(changed.size)
    if changed.dtype.kind == "U":
        changed[at] = chance.choice(["", "x", "\ud800", "\0", "../x"])
    elif changed.dtype.kind == "f":
        changed[at] = chance.choice([np.nan, np.inf, -1e300, 0.0, 1e9])
    else:
        limits = np.iinfo(changed.dtype)
        changed[at] = chance.choice([limits.max, limits.min, 0])
    return changed.reshape(array.shape)


def damage_binary_gltf(data: bytes, chance: random.Random) -> bytes:
    """Change a scene: its bytes, or values of the JSON inside of it."""
    if chance.randrange(2):
        return damage_bytes(data, chance)
    length = int.from_bytes(data[12:16], "little")
    text = damage_json(data[20 : 20 + length], chance)
    text += b" " * (-len(text) % 4)
    rest = data[20 + length :]
    total = 20 + len(text) + len(rest)
    return (
        data[:8] + total.to_bytes(4, "little") + len(text).to_bytes(4, "little") + data[16:20] + text + rest
    )
